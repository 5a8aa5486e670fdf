//! The directory under a checker of interleavings and of memory orders (loom): a reader finds a whole value or none.

#![allow(dead_code)] // The whole file is included, and a part of it tested.

mod sound;
mod unsound;

use loom::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
};
use std::panic::catch_unwind;

/// A value of two parts, written one after the other before it is published.
struct Parts([AtomicU64; 2]);

impl Parts {
    fn of(number: u64) -> Self {
        let parts = Self([AtomicU64::new(0), AtomicU64::new(0)]);
        parts.0.iter().for_each(|part| part.store(number, Ordering::Relaxed));
        parts
    }

    fn read(&self) -> [u64; 2] {
        [0, 1].map(|k| self.0[k].load(Ordering::Relaxed))
    }
}

/// Two writers, of which both publish one key and each one of its own, and a reader that reads all of them.
macro_rules! race {
    ($directory:ident) => {
        loom::model(|| {
            let directory = Arc::new($directory::directory::Directory::<Parts>::new(3));
            let writers: Vec<_> = [1, 2]
                .map(|writer| {
                    let directory = directory.clone();
                    thread::spawn(move || {
                        let own = directory.publish(writer, Parts::of(writer)).is_ok();
                        assert!(own);
                        directory.publish(3, Parts::of(10 + writer)).is_ok()
                    })
                })
                .into();
            for key in [3, 1, 2] {
                if let Some(parts) = directory.get(key) {
                    let [a, b] = parts.read();
                    assert_eq!(a, b);
                    assert!(if key == 3 { a == 11 || a == 12 } else { a == key }, "{key}: {a}");
                }
            }
            // Exactly one of both published the key that they share.
            let first = writers.into_iter().map(|writer| writer.join().unwrap()).filter(|first| *first);
            assert_eq!(first.count(), 1);
            assert_eq!(directory.iter().count(), 3);
        })
    };
}

#[test]
fn a_reader_finds_whole_values_in_every_interleaving() {
    race!(sound);
}

#[test]
fn the_checker_sees_orders_that_let_half_a_value_through() {
    assert!(catch_unwind(|| race!(unsound)).is_err());
}
