//! The memory that readers hold at once, for any content of a file.
#![allow(unsafe_code, reason = "a global allocator cannot be written without; this one only counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use meissner_io::{CsvEvents, Format, decode_image, decode_with};
use meissner_models::{AnyDescription, Weights};

/// The system's allocator, counted.
struct Counting;

thread_local! {
    /// Bytes that this thread allocated and did not free, and their maximum.
    static HELD: Cell<(usize, usize)> = const { Cell::new((0, 0)) };
}

/// Counts allocated and freed bytes; after the thread's end the count is not needed.
fn count(grown: usize, freed: usize) {
    let _ = HELD.try_with(|held| {
        let now = (held.get().0 + grown).saturating_sub(freed);
        held.set((now, held.get().1.max(now)));
    });
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller's promise about `layout` is the one that the allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: as above, for `pointer` too.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Asserts that `read` refuses its input; returns the maximum bytes that this thread held
/// meanwhile.
fn held<T, E>(read: impl FnOnce() -> Result<T, E>) -> usize {
    let before = HELD.get().0;
    HELD.set((before, before));
    assert!(read().is_err(), "it is refused");
    HELD.get().1 - before
}

/// Maximum bytes that a reader may hold for a stated length of 2^63: it must not allocate that
/// size.
const LITTLE: usize = 64 << 10;

#[test]
fn lengths_that_no_file_has_make_no_reader_hold_more() {
    let npy = |shape: &str| {
        let fields = "[('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')]";
        let header = format!("{{'descr': {fields}, 'fortran_order': False, 'shape': ({shape},)}}");
        [&b"\x93NUMPY\x01\0"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), &[0; 13]].concat()
    };
    for shape in ["9223372036854775808", "18446744073709551615", "4294967295"] {
        let bytes = npy(shape);
        assert!(held(|| decode_with(&bytes, Format::Npy)) < LITTLE, "{shape}");
    }
    for (shape, end) in
        [("9223372036854775808", "16"), ("4294967296,4294967296", "16"), ("4", "9223372036854775808")]
    {
        let header = format!(r#"{{"a":{{"dtype":"F32","shape":[{shape}],"data_offsets":[0,{end}]}}}}"#);
        let bytes = [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &[0; 16]].concat();
        assert!(held(|| Weights::from_bytes(&bytes)) < LITTLE, "{shape} {end}");
    }
    for header in ["P6 65535 65535 255\n", "P6 4294967295 4294967295 65535\n", "P5 16777216 1 255\n"] {
        assert!(held(|| decode_image(header.as_bytes())) < LITTLE, "{header}");
    }
}

#[test]
fn a_line_without_end_is_held_up_to_its_bound() {
    let endless = std::io::BufReader::with_capacity(512, std::io::repeat(b'1'));
    let mut events = CsvEvents::new(endless);
    assert!(held(|| events.next().expect("an error")) < LITTLE);
}

#[test]
fn headers_and_descriptions_of_nothing_but_nesting_are_held_a_few_times() {
    let header = "[".repeat(1 << 24);
    let bytes = [&(header.len() as u64).to_le_bytes()[..], header.as_bytes()].concat();
    assert!(held(|| Weights::from_bytes(&bytes)) < 4 * bytes.len());
    for line in ["[[layer]]\n", "=\n", "a = [\n", "a.b.c = 1\n"] {
        let text = line.repeat((1 << 18) / line.len());
        let held = held(|| AnyDescription::parse(&text));
        assert!(held < 256 << 20, "{line:?}: {held} bytes");
    }
}
