//! Work in threads of their own, so that the window never waits for it.

use crate::threads;
use std::{
    sync::mpsc::{self, TryRecvError},
    thread::JoinHandle,
};

/// Something that is being made, and is taken once it is there. Whoever drops it before lets it come to nothing.
pub struct Pending<T> {
    made: mpsc::Receiver<T>,
}

/// Message for a thread that ended without its result.
const ENDED: &str = "the work ended unexpectedly; please report this";

impl<T: Send + 'static> Pending<T> {
    /// Begins to `make` it in a thread called `name`; `wake` is called once it is there.
    ///
    /// # Errors
    /// In words, when the system gives no thread.
    pub fn begin(
        name: &str,
        make: impl FnOnce() -> T + Send + 'static,
        wake: impl FnOnce() + Send + 'static,
    ) -> Result<Self, String> {
        let (sender, made) = mpsc::channel();
        spawn(name, move || {
            // A window that is gone needs nothing.
            let _ = sender.send(make());
            wake();
        })?;
        Ok(Self { made })
    }

    /// It, if it is there; an error in words when it will never be.
    pub fn poll(&self) -> Option<Result<T, String>> {
        match self.made.try_recv() {
            Ok(made) => Some(Ok(made)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(ENDED.into())),
        }
    }

    /// It, once it is there.
    ///
    /// # Errors
    /// In words, when it will never be.
    pub fn wait(self) -> Result<T, String> {
        self.made.recv().map_err(|_| ENDED.into())
    }
}

/// Something that is made again in the background whenever something else is wanted of it; what there is stays in use
/// until then.
pub struct Following<W, T> {
    /// The result, or why there is none; absent before the first.
    last: Option<W>,
    coming: Option<(W, Pending<T>)>,
}

impl<W: Clone + PartialEq + Send + 'static, T: Send + 'static> Following<W, T> {
    /// There is one as `last`, or none yet.
    pub fn new(last: Option<W>) -> Self {
        Self { last, coming: None }
    }

    /// Whether another one is being made.
    pub fn is_busy(&self) -> bool {
        self.coming.is_some()
    }

    /// Begins to make another one where another is `wanted`, in a thread called `name`, one at a time; answers with one
    /// that is there. `wake` is called once it is.
    ///
    /// # Errors
    /// In words, once, when there is no thread or it ended without its result.
    pub fn follow(
        &mut self,
        wanted: &W,
        name: &str,
        make: impl FnOnce(&W) -> T + Send + 'static,
        wake: impl FnOnce() + Send + 'static,
    ) -> Result<Option<T>, String> {
        let made = self.coming.as_ref().and_then(|(_, coming)| coming.poll());
        if made.is_some() {
            self.last = self.coming.take().map(|(wanted, _)| wanted);
        }
        if self.coming.is_none() && self.last.as_ref() != Some(wanted) {
            let asked = wanted.clone();
            match Pending::begin(name, move || make(&asked), wake) {
                Ok(coming) => self.coming = Some((wanted.clone(), coming)),
                Err(error) => {
                    self.last = Some(wanted.clone());
                    return Err(error);
                }
            }
        }
        made.transpose()
    }
}

/// Begins `work` in a thread called `name`.
///
/// # Errors
/// In words, when the system gives none.
pub fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, String> {
    threads::spawn(name, work).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wanted_is_made_one_at_a_time_and_the_latest_wish_counts() {
        let (open, gate) = mpsc::channel::<()>();
        let mut following = Following::new(Some(0));
        // Nothing is made where nothing else is wanted.
        assert_eq!(following.follow(&0, "test", |wanted| *wanted, || ()), Ok(None));
        assert!(!following.is_busy());
        let slow = move |wanted: &i32| {
            gate.recv().unwrap();
            *wanted
        };
        assert_eq!(following.follow(&1, "test", slow, || ()), Ok(None));
        for wanted in [2, 3] {
            assert_eq!(following.follow(&wanted, "test", |_| panic!("two are made at a time"), || ()), Ok(None));
            assert!(following.is_busy());
        }
        open.send(()).unwrap();
        let mut next = || loop {
            if let Some(made) = following.follow(&3, "test", |wanted| *wanted, || ()).unwrap() {
                return (made, following.is_busy());
            }
            std::thread::yield_now();
        };
        assert_eq!([next(), next()], [(1, true), (3, false)]);
    }

    #[test]
    fn a_result_is_there_once_it_is_made() {
        let (awake, woken) = mpsc::channel();
        let coming = Pending::begin("test", || 7, move || awake.send(()).unwrap()).unwrap();
        woken.recv().unwrap();
        assert_eq!(coming.poll(), Some(Ok(7)));
    }

    #[test]
    fn work_that_ends_without_a_result_is_told_once() {
        let (sender, made) = mpsc::channel::<i32>();
        drop(sender);
        let mut following = Following { last: Some(0), coming: Some((1, Pending { made })) };
        assert_eq!(following.follow(&1, "test", |wanted| *wanted, || ()), Err(ENDED.to_owned()));
        assert_eq!(following.follow(&1, "test", |wanted| *wanted, || ()), Ok(None));
    }
}
