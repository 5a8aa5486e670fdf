//! A serial line of Unix: opened raw and for this program alone, read and written without waiting.

use super::last_command::{self, LastCommand};
use crate::device::Halt;
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    fs::OFlags,
    termios::{OptionalActions, QueueSelector, Termios, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush, tcgetattr, tcsetattr},
};
use std::{
    fs::{self, File, OpenOptions},
    io::{ErrorKind, Read, Write},
    os::{fd::AsRawFd, unix::fs::OpenOptionsExt},
};

/// An open line. It gets back the settings that it had.
#[derive(Debug)]
pub struct Port {
    file: File,
    found: Termios,
    /// Given up before the file is closed.
    place: Option<LastCommand>,
}

impl Port {
    /// Opens the line at `path`.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn open(path: &str) -> Result<Self, String> {
        let opened = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags((OFlags::NOCTTY | OFlags::NONBLOCK).bits().cast_signed())
            .open(path);
        let file = opened.map_err(|error| match error.kind() {
            ErrorKind::PermissionDenied => {
                format!(
                    "{path} may not be opened: join its group (usermod -aG dialout $USER, \
                     on some systems uucp) and log in again"
                )
            }
            ErrorKind::NotFound => format!("{path} is not there: plug the device in"),
            _ => format!("{path}: {error}; end other programs that use it"),
        })?;
        let raw = tcgetattr(&file).and_then(|found| {
            let mut settings = found.clone();
            settings.make_raw();
            tcsetattr(&file, OptionalActions::Flush, &settings)?;
            ioctl_tiocexcl(&file)?;
            Ok(found)
        });
        let found = raw.map_err(|error| format!("{path} is no serial line: {error}"))?;
        Ok(Self { file, found, place: None })
    }

    /// Has `zero` sent if the process ends without another command.
    ///
    /// # Errors
    /// In words, if too many lines are open.
    pub fn end_with(&mut self, zero: &[u8]) -> Result<(), String> {
        let place = LastCommand::take(self.file.as_raw_fd(), zero);
        self.place = Some(place.ok_or("too many serial devices are open: close some")?);
        Ok(())
    }

    /// Reads what has come into `buffer`, which must not be empty; returns how much. Never waits.
    ///
    /// # Errors
    /// [`Halt::Unplugged`] if the line is gone.
    pub fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Halt> {
        match self.file.read(buffer) {
            Ok(0) => Err(Halt::Unplugged),
            Ok(count) => Ok(count),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            Err(_) => Err(Halt::Unplugged),
        }
    }

    /// Writes as much of `bytes` as the line takes at once; returns how much. Never waits.
    ///
    /// # Errors
    /// [`Halt::Unplugged`] if the line is gone, [`Halt::Over`] after the last command.
    pub fn send(&mut self, bytes: &[u8]) -> Result<usize, Halt> {
        if last_command::is_given() {
            return Err(Halt::Over);
        }
        match self.file.write(bytes) {
            Ok(count) => Ok(count),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            Err(_) => Err(Halt::Unplugged),
        }
    }

    /// Waits until something has come, for `seconds` at most.
    pub fn wait(&self, seconds: f64) {
        let time = Timespec { tv_sec: seconds as i64, tv_nsec: (seconds.fract() * 1e9) as _ };
        // It is read after this, whatever the answer.
        let _ = poll(&mut [PollFd::new(&self.file, PollFlags::IN)], Some(&time));
    }

    /// Drops all that has come and has not been read.
    pub fn clear(&mut self) {
        // A line that is gone shows at the next call.
        let _ = tcflush(&self.file, QueueSelector::IFlush);
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.place = None;
        self.clear();
        // A line that is gone has no settings.
        let _ = tcsetattr(&self.file, OptionalActions::Now, &self.found);
        let _ = ioctl_tiocnxcl(&self.file);
    }
}

/// Returns the serial lines of this machine that USB devices make, in the order of their names.
#[must_use]
pub fn ports() -> Vec<String> {
    let names =
        fs::read_dir("/dev").into_iter().flatten().flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let serial = |name: &String| ["ttyACM", "ttyUSB", "cu.usbmodem"].iter().any(|kind| name.starts_with(kind));
    let mut ports: Vec<String> = names.filter(serial).map(|name| format!("/dev/{name}")).collect();
    ports.sort();
    ports
}
