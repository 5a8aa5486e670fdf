//! A serial line of Unix: opened raw and for this program alone, read and written without waiting.

pub(super) use super::abort::StopOnAbort;
use crate::device::Halt;
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    fs::OFlags,
    termios::{OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr},
};
use std::{
    fs::{self, File, OpenOptions},
    io::{ErrorKind, Read, Write},
    os::{fd::AsRawFd, unix::fs::OpenOptionsExt},
};

/// An open line.
#[derive(Debug)]
pub struct Port(File);

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
        let raw = tcgetattr(&file).and_then(|mut settings| {
            settings.make_raw();
            tcsetattr(&file, OptionalActions::Flush, &settings)?;
            ioctl_tiocexcl(&file)
        });
        raw.map_err(|error| format!("{path} is no serial line: {error}"))?;
        Ok(Self(file))
    }

    /// Reads what has come into `buffer`, which must not be empty; returns how much. Never waits.
    ///
    /// # Errors
    /// [`Halt::Unplugged`] if the line is gone.
    pub fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Halt> {
        match self.0.read(buffer) {
            Ok(0) => Err(Halt::Unplugged),
            Ok(count) => Ok(count),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            Err(_) => Err(Halt::Unplugged),
        }
    }

    /// Writes as much of `bytes` as the line takes at once; returns how much. Never waits.
    ///
    /// # Errors
    /// [`Halt::Unplugged`] if the line is gone.
    pub fn send(&mut self, bytes: &[u8]) -> Result<usize, Halt> {
        match self.0.write(bytes) {
            Ok(count) => Ok(count),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            Err(_) => Err(Halt::Unplugged),
        }
    }

    /// Lets [`super::stop_all`] write `message`. The result is to be dropped before the port.
    pub(super) fn stop_on_abort(&self, message: &[u8]) -> Option<StopOnAbort> {
        StopOnAbort::new(self.0.as_raw_fd(), message)
    }

    /// Waits until something has come, for `seconds` at most.
    pub fn wait(&self, seconds: f64) {
        let time = Timespec { tv_sec: seconds as i64, tv_nsec: (seconds.fract() * 1e9) as _ };
        // It is read after this, whatever the answer.
        let _ = poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&time));
    }

    /// Drops all that has come and has not been read.
    pub fn clear(&mut self) {
        // A line that is gone shows at the next call.
        let _ = tcflush(&self.0, QueueSelector::IFlush);
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
