//! Crashes: zero torque goes out on every serial line before the process ends.

#[cfg(unix)]
mod handler {
    use crate::device::serial;
    use std::{ptr, sync::OnceLock};

    /// What a crash raises; memory that runs out ends in an `abort`.
    const SIGNALS: [libc::c_int; 5] = [libc::SIGSEGV, libc::SIGBUS, libc::SIGILL, libc::SIGFPE, libc::SIGABRT];

    /// What answered each signal before: the standard library tells of a stack that overflows.
    static BEFORE: [OnceLock<libc::sigaction>; SIGNALS.len()] = [const { OnceLock::new() }; SIGNALS.len()];

    extern "C" fn answer(signal: libc::c_int, info: *mut libc::siginfo_t, _: *mut libc::c_void) {
        serial::let_go();
        let before = SIGNALS.iter().position(|known| *known == signal).and_then(|place| BEFORE[place].get());
        // SAFETY: the system passes valid information, and the calls may be made in a signal handler.
        unsafe {
            let is_sent = (*info).si_code <= 0;
            match before {
                // What crashed does so again on return.
                Some(before) if !is_sent => {
                    libc::sigaction(signal, before, ptr::null_mut());
                }
                // What another process sent does not come again.
                _ => {
                    libc::signal(signal, libc::SIG_DFL);
                    libc::raise(signal);
                }
            }
        }
    }

    pub fn let_go_first() {
        let answer = answer as extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void);
        for (signal, before) in SIGNALS.into_iter().zip(&BEFORE) {
            // SAFETY: zero is valid for each number of an action, and the handler calls nothing that may not be called
            // in one. It runs on the thread's signal stack, as it must where the other one has overflowed.
            unsafe {
                let mut action: libc::sigaction = std::mem::zeroed();
                if libc::sigaction(signal, ptr::null(), &raw mut action) == 0 {
                    let _ = before.set(action);
                }
                let mut action: libc::sigaction = std::mem::zeroed();
                action.sa_sigaction = answer as libc::sighandler_t;
                action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
                libc::sigaction(signal, &raw const action, ptr::null_mut());
            }
        }
    }
}

#[cfg(not(unix))]
mod handler {
    pub fn let_go_first() {}
}

/// Has zero torque go out first from now on, whatever crashes.
pub use handler::let_go_first;
