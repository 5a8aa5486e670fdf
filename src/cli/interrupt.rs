//! Ctrl-C, SIGTERM and SIGHUP: honoured within a second, however long what is under way takes.
//!
//! Work that can stop at a good place takes [`stop_flag`] and looks at it. What has not stopped after [`GRACE`] is
//! left: files that are half written are removed, and the program ends. A bake's part and a scan's log are on the disk
//! by then. What follows such work, and may be left out, is left once it [is late](is_late). All other work ends
//! at once, and so does everything at a second signal. A signal that the program was started to ignore (`nohup`) stays
//! ignored.

use super::{Failure, last_words};
use crate::{dataset::discard_unfinished, device::serial, threads};
use std::{
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

/// Exit code of a program that Ctrl-C ended, as shells have it: 128 and the signal's number.
const INTERRUPTED: i32 = 130;

/// How long work may take to stop: with all that follows, less than a second.
const GRACE: Duration = Duration::from_millis(700);

/// How long after a signal work goes on that may be left out, such as figures. Longer: more of them are there, and on a
/// busy machine what remains to be said comes after more than a second.
const LATE: Duration = Duration::from_millis(600);

/// How long saying so may take where nobody reads.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// Raised when work is to stop.
static STOP: AtomicBool = AtomicBool::new(false);

/// When the first signal came.
static SINCE: Mutex<Option<Instant>> = Mutex::new(None);

/// Whether there is work that looks at [`STOP`].
static IS_STOPPABLE: AtomicBool = AtomicBool::new(false);

/// Whether what is done lies on the disk, so that it can be continued.
static IS_KEPT: AtomicBool = AtomicBool::new(false);

/// Listens for signals from now on. With `json` the end by a signal is reported on standard output, too; with `resumes`
/// that `--resume` continues the work, once it [is kept](kept).
pub fn listen(json: bool, resumes: bool) -> Result<(), Failure> {
    let ignored = ignored();
    ctrlc::set_handler(move || {
        SINCE.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(Instant::now);
        let is_first = !STOP.swap(true, Ordering::Relaxed);
        let leave = move || {
            thread::sleep(GRACE);
            if IS_STOPPABLE.load(Ordering::Relaxed) {
                end(json, resumes);
            }
        };
        // In a thread of its own, so that this one hears the next signal. Where there is none work ends at once.
        let is_given_time = is_first
            && IS_STOPPABLE.load(Ordering::Relaxed)
            && thread::Builder::new().name("grace".into()).spawn(leave).is_ok();
        if !is_given_time {
            end(json, resumes);
        }
    })
    .map_err(|why| threads::refused(why).within("cannot listen for signals"))?;
    ignore(&ignored);
    Ok(())
}

/// Returns the flag that a signal raises, lowered. Whoever takes it looks at it, and calls [`over`] afterwards.
pub fn stop_flag() -> &'static AtomicBool {
    STOP.store(false, Ordering::Relaxed);
    IS_STOPPABLE.store(true, Ordering::Relaxed);
    &STOP
}

/// Returns [`stop_flag`] for work that drives a device. From now on every signal raises it that would end or stop the
/// program and can be answered, Ctrl-\\ and Ctrl-Z among them: zero torque goes out first.
pub fn stop_flag_of_device() -> &'static AtomicBool {
    hear_all();
    stop_flag()
}

/// From now on what is done lies on the disk.
pub fn kept() {
    IS_KEPT.store(true, Ordering::Relaxed);
}

/// Whether a signal came so long ago that what may be left out is left.
pub fn is_late() -> bool {
    let since = *SINCE.lock().unwrap_or_else(PoisonError::into_inner);
    since.is_some_and(|since| since.elapsed() >= LATE)
}

/// Ends the work that looked at the flag: what follows is ended by a signal at once.
pub fn over() {
    IS_STOPPABLE.store(false, Ordering::Relaxed);
}

/// Ends the program. Whoever holds standard output may be waiting for its reader: that must not hold this up.
fn end(json: bool, resumes: bool) {
    // The loop may not have had a tick since the signal, as where two come together.
    serial::let_go();
    discard_unfinished();
    let (told, done) = mpsc::channel();
    let speak = move || {
        let resumes = resumes && IS_KEPT.load(Ordering::Relaxed);
        let kept = if resumes { "; what is done is kept: --resume continues it" } else { "" };
        last_words(&format!("interrupted{kept}"), json);
        let _ = told.send(());
    };
    // Without a thread for it the end comes in silence.
    if thread::Builder::new().spawn(speak).is_ok() {
        let _ = done.recv_timeout(LAST_WORDS);
    }
    std::process::exit(INTERRUPTED);
}

/// Signals that the program was started to ignore, of those that are listened for.
#[cfg(unix)]
fn ignored() -> Vec<libc::c_int> {
    [libc::SIGINT, libc::SIGTERM, libc::SIGHUP].into_iter().filter(|signal| is_ignored(*signal)).collect()
}

#[cfg(unix)]
fn is_ignored(signal: libc::c_int) -> bool {
    // SAFETY: zero is valid for each of its numbers.
    let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
    // SAFETY: `action` is valid for writing, and no action is given to be set.
    let known = unsafe { libc::sigaction(signal, std::ptr::null(), &raw mut action) } == 0;
    known && action.sa_sigaction == libc::SIG_IGN
}

/// Takes the other signals that end or stop a program for SIGTERM.
#[cfg(unix)]
fn hear_all() {
    const OTHERS: [libc::c_int; 13] = [
        libc::SIGQUIT,
        libc::SIGTSTP,
        libc::SIGTTIN,
        libc::SIGTTOU,
        libc::SIGUSR1,
        libc::SIGUSR2,
        libc::SIGALRM,
        libc::SIGVTALRM,
        libc::SIGPROF,
        libc::SIGXCPU,
        libc::SIGXFSZ,
        libc::SIGSYS,
        libc::SIGTRAP,
    ];
    extern "C" fn terminate(_: libc::c_int) {
        // SAFETY: the call may be made in a signal handler.
        unsafe { libc::kill(libc::getpid(), libc::SIGTERM) };
    }
    for signal in OTHERS.into_iter().chain(further_signals()).filter(|signal| !is_ignored(*signal)) {
        // SAFETY: the handler calls nothing that may not be called in one.
        unsafe { libc::signal(signal, terminate as extern "C" fn(libc::c_int) as libc::sighandler_t) };
    }
}

/// Signals of Linux alone that end a program: those for its own use, and of its real time.
#[cfg(any(target_os = "linux", target_os = "android"))]
fn further_signals() -> impl Iterator<Item = libc::c_int> {
    [libc::SIGIO, libc::SIGPWR, libc::SIGSTKFLT].into_iter().chain(libc::SIGRTMIN()..=libc::SIGRTMAX())
}

#[cfg(all(unix, not(any(target_os = "linux", target_os = "android"))))]
fn further_signals() -> impl Iterator<Item = libc::c_int> {
    std::iter::empty()
}

/// Ignores `signals`.
#[cfg(unix)]
fn ignore(signals: &[libc::c_int]) {
    for &signal in signals {
        // SAFETY: no handler of this program is involved.
        unsafe { libc::signal(signal, libc::SIG_IGN) };
    }
}

/// Elsewhere than on Unix no signal is ignored.
#[cfg(not(unix))]
fn ignored() {}

#[cfg(not(unix))]
fn ignore(_: &()) {}

/// Elsewhere than on Unix there are no other signals.
#[cfg(not(unix))]
fn hear_all() {}
