//! Zero torque for lines whose program ends without dropping its devices: after a failed allocation, in `abort`.
//!
//! Each open line leaves here the message of zero torque, made beforehand. Who ends the process calls [`stop_all`], also
//! in a signal handler.

use super::LONGEST;
use rustix::{fd::BorrowedFd, thread::nanosleep};
use std::sync::atomic::{AtomicI32, AtomicU8, AtomicUsize, Ordering};

/// Most lines at a time; further ones are not stopped.
const LINES: usize = 8;

/// Marks a place without a line.
const NONE: i32 = -1;

/// Marks a place whose message is being written.
const TAKEN: i32 = -2;

/// An open line.
struct Line {
    descriptor: AtomicI32,
    length: AtomicUsize,
    message: [AtomicU8; LONGEST],
}

static OPEN: [Line; LINES] = [const {
    Line {
        descriptor: AtomicI32::new(NONE),
        length: AtomicUsize::new(0),
        message: [const { AtomicU8::new(0) }; LONGEST],
    }
}; LINES];

/// A line that [`stop_all`] stops as long as this lives, which must not be longer than its descriptor is open.
#[derive(Debug)]
pub(super) struct StopOnAbort(usize);

impl StopOnAbort {
    /// Lets [`stop_all`] write `message` to the line of `descriptor`; `None` where there are too many lines.
    pub fn new(descriptor: i32, message: &[u8]) -> Option<Self> {
        let free =
            |line: &Line| line.descriptor.compare_exchange(NONE, TAKEN, Ordering::Acquire, Ordering::Relaxed).is_ok();
        let place = OPEN.iter().position(free)?;
        let line = &OPEN[place];
        line.message.iter().zip(message).for_each(|(to, from)| to.store(*from, Ordering::Relaxed));
        line.length.store(message.len().min(LONGEST), Ordering::Relaxed);
        line.descriptor.store(descriptor, Ordering::Release);
        Some(Self(place))
    }
}

impl Drop for StopOnAbort {
    fn drop(&mut self) {
        OPEN[self.0].descriptor.store(NONE, Ordering::Release);
    }
}

/// Commands zero torque on all open lines, and takes some milliseconds for it. May be called in a signal handler.
pub fn stop_all() {
    // Twice, with a pause: the first may complete a message that was cut off.
    for _ in 0..2 {
        let mut any = false;
        for line in &OPEN {
            let descriptor = line.descriptor.load(Ordering::Acquire);
            if descriptor < 0 {
                continue;
            }
            any = true;
            let message: [u8; LONGEST] = std::array::from_fn(|k| line.message[k].load(Ordering::Relaxed));
            // SAFETY: the descriptor was open when its line was registered, and the line is taken out before it closes.
            let line_end = unsafe { BorrowedFd::borrow_raw(descriptor) };
            let _ = rustix::io::write(line_end, &message[..line.length.load(Ordering::Relaxed)]);
        }
        if any {
            let _ = nanosleep(&rustix::time::Timespec { tv_sec: 0, tv_nsec: 5_000_000 });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Port;
    use super::*;
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use std::{fs::File, io::Read};

    #[test]
    fn each_open_line_is_told_and_no_other() {
        let line = || {
            let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
            grantpt(&master).and_then(|()| unlockpt(&master)).unwrap();
            let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
            (File::from(master), Port::open(&path).unwrap())
        };
        let mut lines: Vec<(File, Port)> = (0..3).map(|_| line()).collect();
        let mut stops: Vec<Option<StopOnAbort>> =
            lines.iter().zip([b'a', b'b', b'c']).map(|((_, port), what)| port.stop_on_abort(&[what, b'0'])).collect();
        stops[1] = None;
        stop_all();
        // One that is open is not told any more once it is taken out.
        lines[1].1.send(b"x").unwrap();
        for ((master, _), expected) in lines.iter_mut().zip([&b"a0a0"[..], b"x", b"c0c0"]) {
            let mut told = [0; 16];
            let count = master.read(&mut told).unwrap();
            assert_eq!(&told[..count], expected);
        }
    }
}
