//! Coverage of the code under test, where it was compiled with counters: one byte for each block, counted up when the
//! block runs.
//!
//! `tests/fuzz.sh` compiles it so, with a stable compiler. Otherwise there are no counters, and nothing here does
//! anything.

use std::{
    slice,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicPtr, AtomicUsize, Ordering},
    },
};

/// Counters of all blocks: where they begin, and how many there are.
static FIRST: AtomicPtr<u8> = AtomicPtr::new(std::ptr::null_mut());
static COUNT: AtomicUsize = AtomicUsize::new(0);

/// The counters count for one target at a time.
static TURN: Mutex<()> = Mutex::new(());

/// Called before `main` by every part of the program that was compiled with counters; all of them name the same ones.
// SAFETY: nothing else has this name, which is the compiler's.
#[unsafe(no_mangle)]
extern "C" fn __sanitizer_cov_8bit_counters_init(first: *mut u8, end: *mut u8) {
    FIRST.store(first, Ordering::Relaxed);
    COUNT.store(end as usize - first as usize, Ordering::Relaxed);
}

/// The counters, for as long as the caller runs nothing else.
fn counters<'a>() -> &'a mut [u8] {
    let (first, count) = (FIRST.load(Ordering::Relaxed), COUNT.load(Ordering::Relaxed));
    if count == 0 {
        return &mut [];
    }
    // SAFETY: the compiler reserved these bytes for as long as the program runs, and whoever holds [`TURN`] alone looks
    // at them. Threads that still count meanwhile count as code does that was compiled so, without a lock: that may
    // lose a count, no more.
    unsafe { slice::from_raw_parts_mut(first, count) }
}

/// Blocks that a target has run, and how often at once.
pub struct Coverage {
    /// A bit for each magnitude of a block's count.
    seen: Vec<u8>,
    _turn: Option<MutexGuard<'static, ()>>,
}

impl Coverage {
    /// Begins with nothing covered, once no other target counts.
    pub fn begin() -> Self {
        let count = COUNT.load(Ordering::Relaxed);
        let turn = (count > 0).then(|| TURN.lock().unwrap_or_else(PoisonError::into_inner));
        counters().fill(0);
        Self { seen: vec![0; count], _turn: turn }
    }

    /// Takes what has run since the last call, and returns whether any of it is new: a block, or a magnitude of its
    /// count.
    pub fn take(&mut self) -> bool {
        let mut is_new = false;
        for (counters, seen) in counters().chunks_mut(CHUNK).zip(self.seen.chunks_mut(CHUNK)) {
            // Most blocks have not run; the compiler makes one comparison of a whole chunk.
            if counters.iter().fold(0, |any, counter| any | *counter) == 0 {
                continue;
            }
            for (counter, seen) in counters.iter_mut().zip(seen) {
                let bit = magnitude(std::mem::take(counter));
                is_new |= *seen | bit != *seen;
                *seen |= bit;
            }
        }
        is_new
    }

    /// Blocks that have run, and all there are.
    pub fn blocks(&self) -> (usize, usize) {
        (self.seen.iter().filter(|seen| **seen > 0).count(), self.seen.len())
    }
}

/// Counters that are looked at together.
const CHUNK: usize = 64;

/// A bit for the magnitude of `count`, none for 0: the classes of AFL (Zalewski 2014).
fn magnitude(count: u8) -> u8 {
    match count {
        0 => 0,
        1 => 1,
        2 => 1 << 1,
        3 => 1 << 2,
        4..8 => 1 << 3,
        8..16 => 1 << 4,
        16..32 => 1 << 5,
        32..128 => 1 << 6,
        128.. => 1 << 7,
    }
}
