//! The last command to every open line where the process ends without the guard: zero torque.
//!
//! Each open line has a place in a fixed table, with the message that commands zero. [`let_go`] writes these messages.
//! It allocates nothing and locks nothing, so that it may be called in a signal handler.

use super::LONGEST;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU8, AtomicUsize, Ordering};

/// Most lines that are open at once.
const MOST_LINES: usize = 64;

/// In the place of a file descriptor: nobody has the line's place; somebody fills it in.
const FREE: i32 = -1;
const TAKEN: i32 = -2;

/// Time for a message that was cut off to leave (ms).
const PAUSE: libc::c_int = 5;

struct Line {
    descriptor: AtomicI32,
    length: AtomicUsize,
    zero: [AtomicU8; LONGEST],
}

static LINES: [Line; MOST_LINES] = [const {
    Line { descriptor: AtomicI32::new(FREE), length: AtomicUsize::new(0), zero: [const { AtomicU8::new(0) }; LONGEST] }
}; MOST_LINES];

/// Whether the last command has been given: none may follow it.
static GIVEN: AtomicBool = AtomicBool::new(false);

/// A line's place in the table.
#[derive(Debug)]
pub struct LastCommand(usize);

impl LastCommand {
    /// Remembers that `zero` commands zero torque on the line `descriptor`. None if too many lines are open.
    pub fn take(descriptor: i32, zero: &[u8]) -> Option<Self> {
        let is_free =
            |line: &Line| line.descriptor.compare_exchange(FREE, TAKEN, Ordering::Acquire, Ordering::Relaxed).is_ok();
        let place = LINES.iter().position(is_free)?;
        let line = &LINES[place];
        for (to, from) in line.zero.iter().zip(zero) {
            to.store(*from, Ordering::Relaxed);
        }
        line.length.store(zero.len().min(LONGEST), Ordering::Relaxed);
        line.descriptor.store(descriptor, Ordering::Release);
        Some(Self(place))
    }
}

impl Drop for LastCommand {
    fn drop(&mut self) {
        LINES[self.0].descriptor.store(FREE, Ordering::Release);
    }
}

/// Whether [`let_go`] was called.
pub fn is_given() -> bool {
    GIVEN.load(Ordering::Acquire)
}

/// Commands zero torque on every open line. No other command follows: the process is about to end.
pub fn let_go() {
    GIVEN.store(true, Ordering::Release);
    // Twice, with a pause: the first may complete a message that was cut off.
    for is_last in [false, true] {
        let mut any = false;
        for line in &LINES {
            let descriptor = line.descriptor.load(Ordering::Acquire);
            if descriptor < 0 {
                continue;
            }
            any = true;
            let mut zero = [0; LONGEST];
            for (to, from) in zero.iter_mut().zip(&line.zero) {
                *to = from.load(Ordering::Relaxed);
            }
            // SAFETY: as many bytes are valid, and the call may be made in a signal handler.
            unsafe { libc::write(descriptor, zero.as_ptr().cast(), line.length.load(Ordering::Relaxed)) };
        }
        if any && !is_last {
            // SAFETY: waits for nothing but the time, and may do so in a signal handler.
            unsafe { libc::poll(std::ptr::null_mut(), 0, PAUSE) };
        }
    }
}
