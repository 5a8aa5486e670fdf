//! Remarks of the library, printed when they are made: before the work that they are about.

use super::tell;
use log::{LevelFilter, Log, Metadata, Record};
use std::{
    collections::BTreeSet,
    sync::{Mutex, PoisonError},
};

/// What was printed: a command may build one body several times.
static PRINTED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Prints `remark`, unless that was done already.
pub fn once(remark: &str) {
    if PRINTED.lock().unwrap_or_else(PoisonError::into_inner).insert(remark.to_owned()) {
        tell(format_args!("haptize: {remark}"));
    }
}

struct Printer;

impl Log for Printer {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().split("::").next() == Some(env!("CARGO_CRATE_NAME"))
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            once(&record.args().to_string());
        }
    }

    fn flush(&self) {}
}

/// Begins to print what the library remarks; what it is made of, such as the graphics, stays silent.
pub fn listen() {
    if log::set_logger(&Printer).is_ok() {
        log::set_max_level(LevelFilter::Info);
    }
}
