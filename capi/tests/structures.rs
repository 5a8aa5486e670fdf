//! Structures that have grown since the caller's header: what that did not have is neither read nor written.

#![allow(dead_code, non_camel_case_types, missing_docs)] // The module is that of the library.

#[path = "../src/outcome.rs"]
mod outcome;

use outcome::{Extensible, Told, given};
use std::mem::offset_of;

/// `new` was not there in the first header.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grown {
    size: usize,
    old: f64,
    new: f64,
}

impl Default for Grown {
    fn default() -> Self {
        Self { size: 0, old: 0.0, new: 7.0 }
    }
}

// SAFETY: it begins with its size.
unsafe impl Extensible for Grown {
    const FIRST_SIZE: usize = offset_of!(Self, old) + size_of::<f64>();
}

const OLD: usize = Grown::FIRST_SIZE;
const NEW: usize = size_of::<Grown>();

#[test]
fn entries_that_an_earlier_header_lacks_take_their_defaults() {
    for (size, new) in [(OLD, 7.0), (NEW, 2.0), (NEW + 8, 2.0)] {
        let memory = [Grown { size, old: 1.0, new: 2.0 }, Grown::default()];
        let taken = unsafe { given(memory.as_ptr()) };
        assert_eq!(taken, Some(Grown { size, old: 1.0, new }));
    }
}

#[test]
fn what_lies_behind_a_shorter_structure_is_not_written() {
    for (size, new) in [(OLD, 9.0), (NEW, 2.0), (NEW + 8, 2.0)] {
        let mut memory = [Grown { size, old: 9.0, new: 9.0 }; 2];
        unsafe {
            let told = Told::new(memory.as_mut_ptr()).unwrap();
            told.write(&Grown { size: 0, old: 1.0, new: 2.0 });
        }
        assert_eq!(memory, [Grown { size, old: 1.0, new }, Grown { size, old: 9.0, new: 9.0 }]);
    }
}

#[test]
fn structures_shorter_than_the_first_are_none() {
    for size in [0, 1, 8, OLD - 1] {
        let mut memory = Grown { size, old: 1.0, new: 2.0 };
        unsafe {
            assert_eq!(given(&raw const memory), None);
            assert!(Told::new(&raw mut memory).is_none());
        }
    }
    unsafe {
        assert_eq!(given(std::ptr::null::<Grown>()), None);
        assert!(Told::new(std::ptr::null_mut::<Grown>()).is_none());
    }
}
