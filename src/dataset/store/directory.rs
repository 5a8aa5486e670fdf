//! A table from keys to values that many threads read while many write: append-only, without locks.
//!
//! Open addressing with linear probing over a fixed number of slots, at most half of them full (Knuth, The Art of
//! Computer Programming 3, section 6.4). A slot is one pointer, null or to an entry that never changes: one
//! compare-and-swap publishes a whole entry, one load finds a whole entry or none. Entries are freed with the table,
//! never before, so that a reference lives as long as its borrow of it.
//!
//! [`Directory::get`] does not allocate, lock or wait: it loads a pointer for each probe, 1.5 on average where the
//! table is half full.

use super::sync::{AtomicPtr, OBSERVE, Ordering, PUBLISH};
use std::{marker::PhantomData, ptr};

/// Most slots that are tried. Runs of taken slots fall off like 0.82^n where half are taken: none is as long as this.
const MOST_PROBES: usize = 256;

/// Target of a slot.
struct Entry<T> {
    key: u64,
    value: T,
}

/// A table of values that are published once.
pub(crate) struct Directory<T> {
    slots: Box<[AtomicPtr<Entry<T>>]>,
    /// 64 less the logarithm of the number of slots.
    shift: u32,
    /// It owns values: threads may share it that may share them.
    values: PhantomData<T>,
}

/// Why a value was not published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// Its key has a value.
    Taken,
    /// Every slot that it may have is taken.
    Full,
}

impl<T> Directory<T> {
    /// A table for `most` values.
    pub fn new(most: usize) -> Self {
        let count = most.saturating_mul(2).next_power_of_two().max(2);
        let slots = (0..count).map(|_| AtomicPtr::new(ptr::null_mut())).collect();
        Self { slots, shift: u64::BITS - count.ilog2(), values: PhantomData }
    }

    /// Number of values for which the table was made.
    pub fn capacity(&self) -> usize {
        self.slots.len() / 2
    }

    /// The slots in the order in which `key` takes or seeks one.
    fn probes(&self, key: u64) -> impl Iterator<Item = &AtomicPtr<Entry<T>>> {
        // Fibonacci hashing: 2^64 over the golden ratio scatters neighbouring keys (Knuth, as above).
        let first = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> self.shift) as usize;
        let (count, last) = (self.slots.len(), self.slots.len() - 1);
        (0..MOST_PROBES.min(count)).map(move |probe| &self.slots[(first + probe) & last])
    }

    /// The value of `key`.
    pub fn get(&self, key: u64) -> Option<&T> {
        for slot in self.probes(key) {
            let entry = slot.load(OBSERVE);
            // SAFETY: a pointer that is not null came from `publish`, which let go of it, and is freed by `drop` alone.
            let entry = unsafe { entry.as_ref() }?;
            if entry.key == key {
                return Some(&entry.value);
            }
        }
        None
    }

    /// Publishes `value` for `key`.
    ///
    /// # Errors
    /// Nothing is changed then.
    pub fn publish(&self, key: u64, value: T) -> Result<&T, Refusal> {
        let new = Box::into_raw(Box::new(Entry { key, value }));
        let mut refusal = Refusal::Full;
        for slot in self.probes(key) {
            match slot.compare_exchange(ptr::null_mut(), new, PUBLISH, OBSERVE) {
                // SAFETY: as in `get`: from now on `new` is shared and never written.
                Ok(_) => return Ok(unsafe { &(*new).value }),
                // SAFETY: as in `get`; compare_exchange fails for a pointer that is not null.
                Err(other) if unsafe { (*other).key } == key => {
                    refusal = Refusal::Taken;
                    break;
                }
                Err(_) => {}
            }
        }
        // SAFETY: no slot has taken it.
        drop(unsafe { Box::from_raw(new) });
        Err(refusal)
    }

    /// Moves all values into a table for `most` of them; nobody reads meanwhile.
    pub fn resize(&mut self, most: usize) {
        let larger = Self::new(most.max(self.capacity()));
        for slot in &self.slots {
            let entry = slot.swap(ptr::null_mut(), Ordering::AcqRel);
            // SAFETY: as in `get`. Of both tables one points to the entry.
            if let Some(key) = unsafe { entry.as_ref() }.map(|entry| entry.key) {
                let free = |slot: &&AtomicPtr<Entry<T>>| slot.load(Ordering::Relaxed).is_null();
                if let Some(free) = larger.probes(key).find(free) {
                    free.store(entry, PUBLISH);
                }
            }
        }
        *self = larger;
    }

    /// Keys and values published so far, in no order.
    pub fn iter(&self) -> impl Iterator<Item = (u64, &T)> {
        // SAFETY: as in `get`.
        let entries = self.slots.iter().filter_map(|slot| unsafe { slot.load(OBSERVE).as_ref() });
        entries.map(|entry| (entry.key, &entry.value))
    }
}

impl<T> Drop for Directory<T> {
    fn drop(&mut self) {
        for slot in &self.slots {
            let entry = slot.swap(ptr::null_mut(), Ordering::AcqRel);
            if !entry.is_null() {
                // SAFETY: as in `get`; no borrow of the table is left.
                drop(unsafe { Box::from_raw(entry) });
            }
        }
    }
}
