//! The threads that share work out. The engine takes rayon's, of which there are one set for a process. A process that
//! was forked has none of them, but would wait for them for ever, and they are begun but once: where they are missing, a
//! pool of its own takes their place.

use haptize::{Error, threads};
use pyo3::{exceptions::PyOSError, prelude::*, types::PyDict};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::{
    ptr::null_mut,
    sync::atomic::{AtomicBool, AtomicPtr, Ordering},
};

/// Whether this process was forked from one that had loaded the package.
static FORKED: AtomicBool = AtomicBool::new(false);

/// The pool of a process without these threads, once it is needed; it lives as long as the process. No lock: one that another
/// thread held at the fork would never be released.
static POOL: AtomicPtr<ThreadPool> = AtomicPtr::new(null_mut());

/// Does `work` while other threads of Python run, sharing it out among threads of this process.
pub fn detach<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| run(work))
}

/// Does `work`, sharing it out among threads of this process.
pub fn run<T: Send>(work: impl FnOnce() -> T + Send) -> PyResult<T> {
    if FORKED.load(Ordering::Acquire) || threads::begin_shared().is_err() {
        return Ok(pool()?.install(work));
    }
    Ok(work())
}

/// The exception of threads that the system does not give.
pub fn refused(why: Error) -> PyErr {
    PyOSError::new_err(why.to_string())
}

fn pool() -> PyResult<&'static ThreadPool> {
    let mut there = POOL.load(Ordering::Acquire);
    if there.is_null() {
        let made = ThreadPoolBuilder::new().build().map_err(|why| refused(threads::refused(why)))?;
        let made = Box::into_raw(Box::new(made));
        there = match POOL.compare_exchange(null_mut(), made, Ordering::AcqRel, Ordering::Acquire) {
            Ok(_) => made,
            Err(first) => {
                // SAFETY: it is this thread's own: another one has put its pool there first.
                drop(unsafe { Box::from_raw(made) });
                first
            }
        };
    }
    // SAFETY: what is there was boxed above and is never dropped.
    Ok(unsafe { &*there })
}

/// To be called in the child after a fork.
#[pyfunction]
fn after_fork() {
    // A pool that the parent had is left: its threads are not here.
    POOL.store(null_mut(), Ordering::Release);
    FORKED.store(true, Ordering::Release);
}

/// Has the interpreter tell of forks, where there are such.
pub fn watch_forks(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let Some(register) = py.import("os")?.getattr_opt("register_at_fork")? else { return Ok(()) };
    let options = PyDict::new(py);
    options.set_item("after_in_child", wrap_pyfunction!(after_fork, module)?)?;
    register.call((), Some(&options)).map(drop)
}
