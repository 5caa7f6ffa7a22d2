//! Arguments from C: pointers that may be NULL, arrays, strings, and structs that begin with their size.

use std::ffi::{CStr, c_char};
use std::mem::size_of;
use std::slice;

use crate::status::Failure;

/// What `pointer` points at.
///
/// # Safety
/// A pointer that is aligned and not NULL points at a value that nothing changes meanwhile.
pub(crate) unsafe fn shared<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Failure> {
    check(pointer, what)?;
    // SAFETY: neither NULL nor misaligned; the rest is promised.
    Ok(unsafe { &*pointer })
}

/// Writes `value` to where `pointer` points.
///
/// # Safety
/// A pointer that is aligned and not NULL points at memory for a value, which this thread alone uses.
pub(crate) unsafe fn write<T>(pointer: *mut T, value: T, what: &str) -> Result<(), Failure> {
    check(pointer, what)?;
    // SAFETY: neither NULL nor misaligned; the rest is promised. What is there is overwritten, not dropped.
    unsafe { pointer.write(value) };
    Ok(())
}

/// Makes a handle of `value` and writes it to where `result` points.
///
/// # Safety
/// As [`write`].
pub(crate) unsafe fn give<T>(value: T, result: *mut *mut T, what: &str) -> Result<(), Failure> {
    // Before there is a handle that nobody would release.
    check(result, what)?;
    // SAFETY: the same is promised.
    unsafe { write(result, Box::into_raw(Box::new(value)), what) }
}

/// Writes `value` to where `pointer` points, unless it is NULL.
///
/// # Safety
/// As [`write`].
pub(crate) unsafe fn write_if_wanted<T>(pointer: *mut T, value: T, what: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Ok(());
    }
    // SAFETY: the same is promised.
    unsafe { write(pointer, value, what) }
}

/// The `length` values at `pointer`, which may be NULL if there are none.
///
/// # Safety
/// A pointer that is aligned and not NULL points at `length` values that nothing changes meanwhile.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, length: usize, what: &str) -> Result<&'a [T], Failure> {
    if length == 0 {
        return Ok(&[]);
    }
    check(pointer, what)?;
    within_memory::<T>(length, what)?;
    // SAFETY: neither NULL nor misaligned, and no longer than any memory; the rest is promised.
    Ok(unsafe { slice::from_raw_parts(pointer, length) })
}

/// Copies `values` to the memory for `length` values at `pointer`.
///
/// # Safety
/// A pointer that is aligned and not NULL points at memory for `length` values, which this thread alone uses.
pub(crate) unsafe fn copy<T: Copy>(
    values: &[T],
    pointer: *mut T,
    length: usize,
    what: &str,
) -> Result<(), Failure> {
    fits(values.len(), length, what)?;
    if values.is_empty() {
        return Ok(());
    }
    check(pointer, what)?;
    // SAFETY: there is room for `length` values, of which there are no more; `values` is ours, so that they do not overlap.
    unsafe { pointer.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
    Ok(())
}

/// Refuses memory for `length` values where `needed` are to be written.
pub(crate) fn fits(needed: usize, length: usize, what: &str) -> Result<(), Failure> {
    if length < needed {
        let text = format!("{what}: expected room for {needed}, found room for {length}");
        return Err(Failure::new(crate::status::Status::MEISSNER_BUFFER_TOO_SMALL, text));
    }
    Ok(())
}

/// The string at `pointer`.
///
/// # Safety
/// A pointer that is not NULL points at a string that ends in NUL, which nothing changes meanwhile.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Failure> {
    check(pointer, what)?;
    // SAFETY: not NULL; the rest is promised.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::argument(what, "UTF-8", "other bytes"))
}

/// A struct of the interface whose first field is its size in bytes, as the caller knows it.
///
/// # Safety
/// The struct is `repr(C)`, its first field is a `usize`, and bytes of zeros are a value of it, as are any bytes of its other fields
/// that a caller can pass.
pub(crate) unsafe trait Versioned: Copy {}

/// The options at `pointer`, or those of zeros where it is NULL. Fields that the caller does not know are 0.
///
/// # Safety
/// A pointer that is aligned and not NULL points at a struct as long as its first field says.
pub(crate) unsafe fn options<T: Versioned>(pointer: *const T, what: &str) -> Result<T, Failure> {
    // SAFETY: `Versioned` promises that zeros are a value.
    let mut found: T = unsafe { std::mem::zeroed() };
    if pointer.is_null() {
        return Ok(found);
    }
    // SAFETY: the caller's.
    let size = unsafe { size(pointer, what) }?;
    if size > size_of::<T>() {
        // Options that this version does not know cannot be followed.
        return Err(Failure::argument(what, format!("a size of at most {}", size_of::<T>()), size));
    }
    // SAFETY: `size` bytes can be read there, and `found` is at least as long.
    unsafe { (&raw mut found).cast::<u8>().copy_from_nonoverlapping(pointer.cast(), size) };
    Ok(found)
}

/// Writes the part of `value` that the caller knows to `pointer`, unless it is NULL. The caller's size stays.
///
/// # Safety
/// A pointer that is aligned and not NULL points at a struct as long as its first field says, which this thread alone uses.
pub(crate) unsafe fn report<T: Versioned>(pointer: *mut T, value: T, what: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Ok(());
    }
    // SAFETY: the caller's.
    let size = unsafe { size(pointer, what) }?.min(size_of::<T>());
    let (from, first) = ((&raw const value).cast::<u8>(), size_of::<usize>());
    // SAFETY: `size` bytes can be written there, and `value` has as many; the first field is left out of both.
    unsafe { pointer.cast::<u8>().add(first).copy_from_nonoverlapping(from.add(first), size - first) };
    Ok(())
}

/// Refuses a struct that cannot be reported to, before anything is computed for it.
///
/// # Safety
/// As [`report`].
pub(crate) unsafe fn reportable<T: Versioned>(pointer: *const T, what: &str) -> Result<(), Failure> {
    // SAFETY: the caller's.
    if pointer.is_null() { Ok(()) } else { unsafe { size(pointer, what) }.map(drop) }
}

/// The size that the struct at `pointer` states.
///
/// # Safety
/// As [`options`].
unsafe fn size<T: Versioned>(pointer: *const T, what: &str) -> Result<usize, Failure> {
    check(pointer, what)?;
    // SAFETY: the first field is a `usize`.
    let size = unsafe { pointer.cast::<usize>().read() };
    if size < size_of::<usize>() {
        return Err(Failure::argument(what, "its size in its first field", size));
    }
    Ok(size)
}

fn check<T>(pointer: *const T, what: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::argument(what, "a pointer", "NULL"));
    }
    if !pointer.is_aligned() {
        return Err(Failure::argument(
            what,
            format!("an address that {} divides", align_of::<T>()),
            format!("{pointer:p}"),
        ));
    }
    Ok(())
}

fn within_memory<T>(length: usize, what: &str) -> Result<(), Failure> {
    let most = isize::MAX as usize / size_of::<T>().max(1);
    if length > most {
        return Err(Failure::argument(what, format!("at most {most} values"), length));
    }
    Ok(())
}
