//! The directory as it is, over the checker's atomics.

mod sync {
    pub(super) use loom::sync::atomic::{AtomicPtr, Ordering};

    pub(super) const PUBLISH: Ordering = Ordering::Release;
    pub(super) const OBSERVE: Ordering = Ordering::Acquire;
}

#[path = "../../../src/dataset/store/directory.rs"]
pub mod directory;
