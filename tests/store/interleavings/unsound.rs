//! The directory with orders that do not carry a value from writer to reader.

mod sync {
    pub(super) use loom::sync::atomic::{AtomicPtr, Ordering};

    pub(super) const PUBLISH: Ordering = Ordering::Relaxed;
    pub(super) const OBSERVE: Ordering = Ordering::Relaxed;
}

#[path = "../../../src/dataset/store/directory.rs"]
pub mod directory;
