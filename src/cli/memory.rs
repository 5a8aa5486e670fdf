//! Memory that runs out: an error with the number of bytes and the remedy.
//!
//! Rust lets a program answer a failed allocation where it asks first. Any other one ends the process by `abort`, after
//! a line with the number of bytes. Here the size is remembered, and the signal of `abort` is answered with what to do
//! and exit code 1. So is a panic of the standard library where the system refuses memory that is not allocated, as for
//! the signal stack of a thread that begins, and an `abort` of the C library, which allocates for itself.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::atomic::{AtomicUsize, Ordering},
};

/// The system's allocator, which remembers the size of an allocation that failed.
pub struct Remembering;

/// Size of the last allocation that failed (bytes); 0 before any did.
static FAILED: AtomicUsize = AtomicUsize::new(0);

impl Remembering {
    fn checked(pointer: *mut u8, bytes: usize) -> *mut u8 {
        if pointer.is_null() {
            FAILED.store(bytes, Ordering::Relaxed);
        }
        pointer
    }
}

// SAFETY: hands every call on to the system's allocator.
unsafe impl GlobalAlloc for Remembering {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::checked(unsafe { System.alloc(layout) }, layout.size())
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        Self::checked(unsafe { System.realloc(pointer, layout, size) }, size)
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[cfg(unix)]
mod answer {
    use super::{FAILED, Ordering};
    use crate::device::serial;
    use rustix::stdio::{stderr, stdout};
    use std::{os::fd::BorrowedFd, sync::atomic::AtomicBool};

    /// Whether a thread has begun to answer: of several that find no memory at once only one speaks.
    static ANSWERED: AtomicBool = AtomicBool::new(false);

    /// Whether the standard library has panicked for want of memory.
    static PANICKED: AtomicBool = AtomicBool::new(false);

    /// What is said, with the number of bytes in the middle where it is known.
    const SAID: [&str; 4] = [
        "out of memory",
        ": ",
        " bytes were asked for in vain",
        "; close other programs, raise the limit (ulimit -v), or take a coarser grid or surface; what was written is \
         kept: an unfinished haptize bake or haptize scan goes on with --resume",
    ];

    /// What glibc asks the system for where its heap cannot grow in place (bytes) (`MMAP_AS_MORECORE_SIZE`).
    const HEAP_STEP: usize = 1 << 20;

    /// Whether the system refuses what the C library would ask for.
    fn is_exhausted() -> bool {
        let access = libc::PROT_READ | libc::PROT_WRITE;
        let kind = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS;
        // SAFETY: two system calls; the pages between them are known to nobody.
        unsafe {
            let pages = libc::mmap(std::ptr::null_mut(), HEAP_STEP, access, kind, -1, 0);
            if pages != libc::MAP_FAILED {
                libc::munmap(pages, HEAP_STEP);
            }
            pages == libc::MAP_FAILED
        }
    }

    /// Answers `abort` for want of memory. Any other one takes its course. Zero torque goes out before.
    extern "C" fn answer<const JSON: bool>(signal: libc::c_int) {
        serial::let_go();
        let failed = FAILED.load(Ordering::Relaxed);
        if failed == 0 && !PANICKED.load(Ordering::Relaxed) && !is_exhausted() {
            // SAFETY: no memory is involved; the signal ends the process as this returns, whoever raised it.
            unsafe {
                libc::signal(signal, libc::SIG_DFL);
                libc::raise(signal);
            }
            return;
        }
        while ANSWERED.swap(true, Ordering::Relaxed) {
            // SAFETY: waits for a signal, and may do so in a signal handler; the other thread ends the process.
            unsafe { libc::pause() };
        }
        say(stderr(), ["haptize: ", "\n"], failed);
        if JSON {
            say(stdout(), ["{\n  \"error\": \"", "\"\n}\n"], failed);
        }
        // SAFETY: ends the process, and may do so in a signal handler.
        unsafe { libc::_exit(1) }
    }

    /// Writes what is to be said between `around` to `file`, without allocating.
    fn say(file: BorrowedFd<'_>, around: [&str; 2], failed: usize) {
        let (mut digits, mut first, mut rest) = ([0; 20], 20, failed);
        while rest > 0 {
            first -= 1;
            digits[first] = b'0' + (rest % 10) as u8;
            rest /= 10;
        }
        let [begin, before, after, end] = SAID.map(str::as_bytes);
        let count = if failed > 0 { [before, &digits[first..], after] } else { [&[][..]; 3] };
        for part in [&[around[0].as_bytes(), begin], &count[..], &[end, around[1].as_bytes()]].into_iter().flatten() {
            // Where nobody listens there is nobody to tell.
            let _ = rustix::io::write(file, part);
        }
    }

    pub fn tell_shortage(json: bool) {
        let answer = if json { answer::<true> } else { answer::<false> } as extern "C" fn(libc::c_int);
        // SAFETY: the handler calls nothing that may not be called in one.
        unsafe { libc::signal(libc::SIGABRT, answer as libc::sighandler_t) };
        let refused = std::io::Error::from_raw_os_error(libc::ENOMEM).to_string();
        let others = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if panic.payload_as_str().is_some_and(|said| said.contains(&refused)) {
                PANICKED.store(true, Ordering::Relaxed);
                std::process::abort();
            }
            others(panic);
        }));
    }
}

#[cfg(not(unix))]
mod answer {
    pub fn tell_shortage(_: bool) {}
}

/// Reports a failed allocation with the remedy from now on; with `json` on standard output, too.
pub use answer::tell_shortage;
