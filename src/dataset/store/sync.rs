//! The atomics of [`super::directory`], and the orders in which its readers and writers use them. A checker of
//! interleavings includes that file with atomics of its own (`tests/store/interleavings/`).

pub(super) use std::sync::atomic::{AtomicPtr, Ordering};

/// Makes all that a writer did to a block visible before the block itself.
pub(super) const PUBLISH: Ordering = Ordering::Release;
/// The reader's half of [`PUBLISH`].
pub(super) const OBSERVE: Ordering = Ordering::Acquire;
