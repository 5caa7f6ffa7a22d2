//! Arguments from C: pointers, arrays, strings, and structs that begin with their size.

use std::ffi::{CStr, c_char};
use std::mem::size_of;
use std::slice;

use crate::status::Failure;

/// The caller's memory for a value, checked before the call does anything else.
pub(crate) struct Place<T>(*mut T);

/// The caller's memory for `length` values, checked in the same way.
pub(crate) struct Room<T> {
    start: *mut T,
    length: usize,
    what: &'static str,
}

/// The caller's memory for the part of a struct that the caller knows, checked in the same way.
pub(crate) struct Report<T> {
    pointer: *mut T,
    size: usize,
}

/// The memory for a value at `pointer`.
///
/// # Safety
/// If the pointer is aligned and not NULL, it points at memory for a value, and only this thread
/// uses the memory until the call returns.
pub(crate) unsafe fn place<T>(pointer: *mut T, what: &str) -> Result<Place<T>, Failure> {
    check(pointer, what)?;
    Ok(Place(pointer))
}

/// As [`place`], or `None` if the pointer is NULL: the caller does not want the value.
///
/// # Safety
/// As [`place`].
pub(crate) unsafe fn place_if_wanted<T>(pointer: *mut T, what: &str) -> Result<Option<Place<T>>, Failure> {
    // SAFETY: the caller promises it.
    if pointer.is_null() { Ok(None) } else { unsafe { place(pointer, what) }.map(Some) }
}

/// The memory for `length` values at `pointer`, which may be NULL if `length` is 0.
///
/// # Safety
/// As [`place`], for `length` values.
pub(crate) unsafe fn room<T>(pointer: *mut T, length: usize, what: &'static str) -> Result<Room<T>, Failure> {
    if length > 0 || !pointer.is_null() {
        check(pointer, what)?;
        within_memory(pointer, length, what)?;
    }
    Ok(Room { start: pointer, length, what })
}

/// The struct at `pointer`. Its first field says how much of the struct the caller knows.
///
/// # Safety
/// As [`place`], for a struct as long as its first field says.
pub(crate) unsafe fn report<T: Versioned>(pointer: *mut T, what: &str) -> Result<Report<T>, Failure> {
    // SAFETY: the caller promises it.
    let size = unsafe { size(pointer, what) }?.min(size_of::<T>());
    Ok(Report { pointer, size })
}

/// As [`report`], or `None` if the pointer is NULL: the caller does not want the struct.
///
/// # Safety
/// As [`report`].
pub(crate) unsafe fn report_if_wanted<T: Versioned>(
    pointer: *mut T,
    what: &str,
) -> Result<Option<Report<T>>, Failure> {
    // SAFETY: the caller promises it.
    if pointer.is_null() { Ok(None) } else { unsafe { report(pointer, what) }.map(Some) }
}

impl<T> Place<T> {
    pub(crate) fn write(self, value: T) {
        // SAFETY: the caller of `place` promised it. The old value is overwritten, not dropped.
        unsafe { self.0.write(value) };
    }
}

impl<T: Copy> Room<T> {
    /// Refuses memory that is too small for `needed` values.
    pub(crate) fn fits(&self, needed: usize) -> Result<(), Failure> {
        let Self { length, what, .. } = *self;
        if length < needed {
            let text = format!("{what}: expected room for {needed}, found room for {length}");
            return Err(Failure::new(crate::status::Status::MEISSNER_BUFFER_TOO_SMALL, text));
        }
        Ok(())
    }

    /// Copies `values`, if they fit.
    pub(crate) fn copy(self, values: &[T]) -> Result<(), Failure> {
        self.fits(values.len())?;
        if !values.is_empty() {
            // SAFETY: the caller of `room` promised memory for them. `values` is ours: no overlap.
            unsafe { self.start.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
        }
        Ok(())
    }
}

impl<T: Versioned> Report<T> {
    /// Writes the part of `value` that the caller knows. The caller's size stays.
    pub(crate) fn write(self, value: T) {
        let (from, first) = ((&raw const value).cast::<u8>(), size_of::<usize>());
        let length = self.size - first;
        // SAFETY: `size` bytes can be written there, and `value` has at least as many. The first
        // field is skipped.
        unsafe { self.pointer.cast::<u8>().add(first).copy_from_nonoverlapping(from.add(first), length) };
    }
}

/// Writes the result of `bytes` to `pointer`, which has room for `capacity` bytes, and its length
/// to `length`. If there is too little room, only the length is written.
///
/// # Safety
/// As [`room`] and [`place`].
pub(crate) unsafe fn write_bytes(
    pointer: *mut u8,
    capacity: usize,
    what: &'static str,
    length: *mut usize,
    bytes: impl FnOnce() -> Result<Vec<u8>, Failure>,
) -> Result<(), Failure> {
    // SAFETY: the caller promises it.
    let (room, length) = unsafe { (room(pointer, capacity, what)?, place(length, "length")?) };
    let bytes = bytes()?;
    length.write(bytes.len());
    room.copy(&bytes)
}

/// The `length` values at `pointer`, which may be NULL if there are none.
///
/// # Safety
/// If the pointer is aligned and not NULL, it points at `length` values that nothing changes
/// meanwhile.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, length: usize, what: &str) -> Result<&'a [T], Failure> {
    if length == 0 {
        return Ok(&[]);
    }
    check(pointer, what)?;
    within_memory(pointer, length, what)?;
    // SAFETY: the pointer is neither NULL nor misaligned, and the array fits in the address space.
    // The caller promises the rest.
    Ok(unsafe { slice::from_raw_parts(pointer, length) })
}

/// The string at `pointer`.
///
/// # Safety
/// If the pointer is not NULL, it points at a string that ends in NUL and that nothing changes
/// meanwhile.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Failure> {
    check(pointer, what)?;
    // SAFETY: the pointer is not NULL. The caller promises the rest.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::argument(what, "UTF-8", "other bytes"))
}

/// A struct of the interface whose first field is its size in bytes, as the caller knows it.
///
/// # Safety
/// The struct is `repr(C)`, its first field is a `usize`, and zeros are a valid value of it, as are
/// any bytes that a caller can pass.
pub(crate) unsafe trait Versioned: Copy {}

/// The options at `pointer`. Fields that the caller does not know are zero, and all are if
/// `pointer` is NULL.
///
/// # Safety
/// If the pointer is aligned and not NULL, it points at a struct as long as its first field says.
pub(crate) unsafe fn options<T: Versioned>(pointer: *const T, what: &str) -> Result<T, Failure> {
    // SAFETY: `Versioned` promises that zeros are a value.
    let mut found: T = unsafe { std::mem::zeroed() };
    if pointer.is_null() {
        return Ok(found);
    }
    // SAFETY: the caller promises it.
    let size = unsafe { size(pointer, what) }?;
    if size > size_of::<T>() {
        // This version cannot follow options that it does not know.
        return Err(Failure::argument(what, format!("a size of at most {}", size_of::<T>()), size));
    }
    // SAFETY: `size` bytes can be read there, and `found` is at least as long.
    unsafe { (&raw mut found).cast::<u8>().copy_from_nonoverlapping(pointer.cast(), size) };
    Ok(found)
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

fn within_memory<T>(pointer: *const T, length: usize, what: &str) -> Result<(), Failure> {
    let room = (isize::MAX as usize).min(usize::MAX - pointer.addr());
    let most = room / size_of::<T>().max(1);
    if length > most {
        return Err(Failure::argument(what, format!("at most {most} values"), length));
    }
    Ok(())
}
