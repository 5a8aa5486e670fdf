//! Work on a thread of its own, so that Ctrl-C ends a call at once, however long what is under way takes.

use crate::threads;
use haptize::threads::spawn;
use pyo3::{panic::PanicException, prelude::*};
use std::{
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError, Sender},
    },
    time::{Duration, Instant},
};

/// How often signals are looked at: well below what a person notices.
const TURN: Duration = Duration::from_millis(50);

/// How long work that is to stop may take to: with all that follows, less than a second, as for the command.
const GRACE: Duration = Duration::from_millis(700);

/// A message of the work: news, or its result.
enum News<N, T> {
    Told(N),
    Done(T),
}

/// Does `work` while other threads of Python run, and hands what it tells to `hear`. What `hear` raises, and Ctrl-C,
/// raise `stop` and end the call: work that does not stop within [`GRACE`] is left to end by itself, unheard.
pub fn run<N: Send + 'static, T: Send + 'static>(
    py: Python<'_>,
    stop: &AtomicBool,
    work: impl FnOnce(&dyn Fn(N)) -> T + Send + 'static,
    mut hear: impl FnMut(N) -> PyResult<()>,
) -> PyResult<T> {
    let (sender, mut news) = mpsc::channel();
    spawn("haptize", move || tell(work, &sender)).map_err(threads::refused)?;
    loop {
        let heard = &mut news;
        let happened = match py.detach(move || heard.recv_timeout(TURN)) {
            Ok(News::Done(result)) => return result,
            Ok(News::Told(told)) => hear(told),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => Err(PanicException::new_err("the work ended by a panic")),
        };
        if let Err(error) = happened.and_then(|()| py.check_signals()) {
            stop.store(true, Ordering::Relaxed);
            let (left, deadline) = (&mut news, Instant::now() + GRACE);
            py.detach(
                move || while let Ok(News::Told(_)) = left.recv_timeout(deadline.duration_since(Instant::now())) {},
            );
            return Err(error);
        }
    }
}

fn tell<N: Send, T: Send>(work: impl FnOnce(&dyn Fn(N)) -> T + Send, sender: &Sender<News<N, PyResult<T>>>) {
    // Nobody listens where the call has ended.
    let result = threads::run(|| work(&|told| drop(sender.send(News::Told(told)))));
    let _ = sender.send(News::Done(result));
}
