//! A column of plain numbers: owned, or a checked window into a mapped file.

use bytemuck::Pod;
use memmap2::Mmap;
use std::{ops::Deref, ops::Range, sync::Arc};

/// A read-only slice of `T` that owns its memory or shares a mapped file.
#[derive(Clone)]
pub struct Column<T: Pod>(Storage<T>);

#[derive(Clone)]
enum Storage<T> {
    Owned(Vec<T>),
    Mapped { map: Arc<Mmap>, bytes: Range<usize> },
}

impl<T: Pod> Column<T> {
    /// A window of a mapped file; `None` when it is out of bounds, misaligned, or not a whole number of `T`.
    #[must_use]
    pub fn mapped(map: Arc<Mmap>, bytes: Range<usize>) -> Option<Self> {
        bytemuck::try_cast_slice::<u8, T>(map.get(bytes.clone())?).ok()?;
        Some(Self(Storage::Mapped { map, bytes }))
    }

    /// The numbers as bytes.
    pub(super) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self)
    }

    /// Gives the memory of the whole mapped file back to the system, where that takes such advice: pages are read again
    /// from the file, or its cache, once they are looked at. The columns must lie in a file, not in a copy of one,
    /// which would be lost.
    pub(super) fn release(&self) {
        #[cfg(unix)]
        if let Storage::Mapped { map, .. } = &self.0 {
            // SAFETY: the map is a read-only one of a file, so that its pages come again with the same bytes. Advice
            // that is not taken changes nothing.
            let _ = unsafe { map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
        }
    }
}

impl<T: Pod> From<Vec<T>> for Column<T> {
    fn from(values: Vec<T>) -> Self {
        Self(Storage::Owned(values))
    }
}

impl<T: Pod> Deref for Column<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        match &self.0 {
            Storage::Owned(values) => values,
            Storage::Mapped { map, bytes } => bytemuck::cast_slice(&map[bytes.clone()]),
        }
    }
}
