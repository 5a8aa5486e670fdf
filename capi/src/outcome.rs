//! How a call ended: a code, and where there is more to say a message in the caller's buffer.

use haptize::{Error, ErrorKind, threads};
use std::{
    ffi::{CStr, c_char},
    io::{Cursor, Write},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

/// How a call ended. Below zero it failed, and nothing but zeros was written to its results.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum hz_code {
    /// Everything is as it should be.
    HZ_OK = 0,
    /// The configuration is outside the grid, or beside a grid point that was not computed.
    HZ_OUTSIDE = 1,
    /// Beside a grid point that did not converge: the torque is not to be trusted.
    HZ_UNCONVERGED = 2,
    /// The loop has let go: the torque is being brought to zero, or has been. hz_loop_fault tells why.
    HZ_LET_GO = 3,
    /// An argument is NULL, not a finite number, of a wrong size, or out of its range.
    HZ_ARGUMENT = -1,
    /// A file cannot be read.
    HZ_FILE = -2,
    /// A file is not a dataset, of another version, or damaged.
    HZ_FORMAT = -3,
    /// A scene or its object is not valid; the message names file and line.
    HZ_SCENE = -4,
    /// A defect of the library; please report it.
    HZ_DEFECT = -99,
}

/// Why a call failed.
pub struct Failure {
    pub code: hz_code,
    pub message: String,
}

/// An argument that cannot be taken.
pub fn argument(message: impl Into<String>) -> Failure {
    Failure { code: hz_code::HZ_ARGUMENT, message: message.into() }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let code = match error.kind() {
            ErrorKind::File => hz_code::HZ_FILE,
            ErrorKind::Dataset | ErrorKind::Foreign => hz_code::HZ_FORMAT,
            _ => hz_code::HZ_SCENE,
        };
        Self { code, message: error.to_string() }
    }
}

/// Runs `work`; a panic becomes a code. Allocates nothing where `work` does not.
pub fn guarded(work: impl FnOnce() -> hz_code) -> hz_code {
    // What a panic has left half done is not looked at again: the caller is told of a defect.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(hz_code::HZ_DEFECT)
}

/// Runs `work` and writes its message, remarks or the reason of its failure, into the `size` bytes at `text`.
///
/// # Safety
/// `text` is NULL or points to `size` bytes that may be written.
pub unsafe fn told(text: *mut c_char, size: usize, work: impl FnOnce() -> Result<String, Failure>) -> hz_code {
    let mut code = hz_code::HZ_DEFECT;
    let work = || threads::begin_shared().map_err(Failure::from).and_then(|()| work());
    let message = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(remarks)) => {
            code = hz_code::HZ_OK;
            remarks
        }
        Ok(Err(failure)) => {
            code = failure.code;
            failure.message
        }
        Err(_) => "the library panicked: please report this as a defect".into(),
    };
    // SAFETY: as the caller promises.
    unsafe { write_text(text, size, &message) };
    code
}

/// Puts what `make` makes, with its remarks, behind a new handle at `handle`, NULL where it fails, and writes the
/// message as [`told`] does.
///
/// # Safety
/// `handle` is NULL or a place for a pointer; `text` as for [`told`].
pub unsafe fn open<T>(
    handle: *mut *mut T,
    text: *mut c_char,
    size: usize,
    make: impl FnOnce() -> Result<(T, String), Failure>,
) -> hz_code {
    let work = || {
        // SAFETY: as the caller promises.
        let out = unsafe { handle.as_mut() }.ok_or_else(|| argument("the pointer to the handle is NULL"))?;
        *out = std::ptr::null_mut();
        let (made, remarks) = make()?;
        *out = Box::into_raw(Box::new(made));
        Ok(remarks)
    };
    // SAFETY: as the caller promises.
    unsafe { told(text, size, work) }
}

/// Ends what [`open`] began; NULL is left alone.
///
/// # Safety
/// `handle` is NULL or was opened and not yet closed.
pub unsafe fn close<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: as the caller promises.
        let opened = unsafe { Box::from_raw(handle) };
        guarded(|| {
            drop(opened);
            hz_code::HZ_OK
        });
    }
}

/// Writes `message` into the `size` bytes at `text`, cut where it does not fit, and ended by a zero. Allocates nothing.
///
/// # Safety
/// As for [`told`].
pub unsafe fn write_text(text: *mut c_char, size: usize, message: &dyn std::fmt::Display) {
    if text.is_null() || size == 0 {
        return;
    }
    // SAFETY: as the caller promises.
    let buffer = unsafe { std::slice::from_raw_parts_mut(text.cast::<u8>(), size) };
    let mut cursor = Cursor::new(&mut buffer[..size - 1]);
    // A message that does not fit is cut.
    let _ = write!(cursor, "{message}");
    let mut end = cursor.position() as usize;
    // Not within a character: bytes 10xxxxxx go on with one.
    if end == size - 1 {
        let text = &buffer[..end];
        end = text.utf8_chunks().next().map_or(0, |chunk| chunk.valid().len());
    }
    buffer[end] = 0;
}

/// The path that a C string names, in UTF-8.
///
/// # Safety
/// `path` is NULL or points to a text that ends in a zero and outlives the result.
pub unsafe fn path<'a>(path: *const c_char) -> Result<&'a Path, Failure> {
    if path.is_null() {
        return Err(argument("the path is NULL"));
    }
    // SAFETY: as the caller promises.
    let text = unsafe { CStr::from_ptr(path) };
    text.to_str().map(Path::new).map_err(|_| argument("the path is not UTF-8"))
}

/// The `count` numbers at `numbers`; `None` where it is NULL or they cannot be in memory.
///
/// # Safety
/// `numbers` is NULL or points to `count` numbers that nobody writes while the result lives.
pub unsafe fn slice<'a, T>(numbers: *const T, count: usize) -> Option<&'a [T]> {
    if !is_buffer(numbers, count) {
        return None;
    }
    // SAFETY: as the caller promises; the length was checked.
    Some(unsafe { std::slice::from_raw_parts(numbers, count) })
}

/// As [`slice`], to be written.
///
/// # Safety
/// `numbers` is NULL or points to `count` numbers that nobody else reads or writes while the result lives.
pub unsafe fn slice_mut<'a, T>(numbers: *mut T, count: usize) -> Option<&'a mut [T]> {
    if !is_buffer(numbers, count) {
        return None;
    }
    // SAFETY: as the caller promises; the length was checked.
    Some(unsafe { std::slice::from_raw_parts_mut(numbers, count) })
}

fn is_buffer<T>(numbers: *const T, count: usize) -> bool {
    !numbers.is_null() && numbers.is_aligned() && count <= isize::MAX as usize / size_of::<T>()
}

/// A structure whose first entry is its own size. Later versions of the library only make it longer, so that its size
/// tells with which header a program was compiled.
///
/// # Safety
/// The structure begins with a `usize`, and consists of numbers.
pub unsafe trait Extensible: Copy + Default {
    /// Size in the first header of this `HZ_ABI` (bytes): the end of the entry that was its last one.
    const FIRST_SIZE: usize;
}

/// The size that the structure at `structure` tells; `None` where it is NULL or that is no size of such a structure.
///
/// # Safety
/// `structure` is NULL or points to a structure of the size that it tells.
unsafe fn told_size<T: Extensible>(structure: *const T) -> Option<usize> {
    if structure.is_null() || !structure.is_aligned() {
        return None;
    }
    // SAFETY: the structure begins with its size.
    let size = unsafe { structure.cast::<usize>().read() };
    (size >= T::FIRST_SIZE).then_some(size)
}

/// A copy of the structure at `structure`, with the defaults of entries that an earlier header did not have; `None`
/// where it is NULL or its size is not told or too small.
///
/// # Safety
/// As for [`Told::new`]; nobody writes the structure meanwhile.
pub unsafe fn given<T: Extensible>(structure: *const T) -> Option<T> {
    // SAFETY: as the caller promises.
    let size = unsafe { told_size(structure)? }.min(size_of::<T>());
    let mut copy = T::default();
    // SAFETY: so many bytes are there, and it consists of numbers.
    unsafe { structure.cast::<u8>().copy_to_nonoverlapping((&raw mut copy).cast(), size) };
    Some(copy)
}

/// A structure of the caller's that is to be told something. Nothing borrows it: it may lie where the arguments do.
pub struct Told<T> {
    place: *mut T,
    size: usize,
}

impl<T: Extensible> Told<T> {
    /// The structure at `structure`; `None` where it is NULL or its size is not told or too small.
    ///
    /// # Safety
    /// `structure` is NULL or points to a structure of the size that it tells, which lives as long as the result.
    pub unsafe fn new(structure: *mut T) -> Option<Self> {
        // SAFETY: as the caller promises.
        let size = unsafe { told_size(structure.cast_const())? };
        Some(Self { place: structure, size })
    }

    /// Writes the entries of `value` that the caller's header has, but for the size, which stays.
    ///
    /// # Safety
    /// Nobody else reads or writes the structure meanwhile.
    pub unsafe fn write(&self, value: &T) {
        let (first, end) = (size_of::<usize>(), self.size.min(size_of::<T>()));
        // SAFETY: as the caller of `new` and of this promises; both begin with a size, which is left out.
        unsafe {
            let from = std::ptr::from_ref(value).cast::<u8>().add(first);
            from.copy_to_nonoverlapping(self.place.cast::<u8>().add(first), end - first);
        }
    }
}
