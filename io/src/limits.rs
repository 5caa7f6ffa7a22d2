//! Upper bounds on the memory that a hostile file can make the decoders use.
//!
//! A recording is held in memory as its bytes, unpacked from gzip or zip, and its events. Every
//! format except AEDAT4 has a fixed largest number of events per byte (12 events in 2 bytes for
//! EVT3's vectors), so the length of a file bounds its events. AEDAT4 and MCAP are compressed: the
//! bounds below limit one packet or chunk, the whole file and a decompressor's window. MCAP has at
//! most as many events as fit into a packet of AEDAT4, and 6 more for each byte of the file. A
//! length field determines the size of another buffer only if the file has at least as many bytes.

/// Longest recording that is read from a device or a pipe, which have no length, in bytes: 2 GiB.
pub const STREAM_BYTES: u64 = 2 << 30;

/// Longest packet of AEDAT4, and longest entry of a zip archive with several, after decompression,
/// in bytes: 64 MiB, which is 4 million events of AEDAT4.
///
/// A decompressor's window has the same bound, and a growing buffer may take twice its content: one
/// hostile packet takes about 200 MiB at most.
pub const PACKET_BYTES: u64 = 64 << 20;

/// Bytes to which each byte of a file may expand, in addition to [`PACKET_BYTES`].
///
/// An event of AEDAT4 takes 16 bytes after decompression, so it may be compressed to a quarter of a
/// byte. The sparse arrays of `NeuTouch` expand 50 times.
pub const EXPANSION: u64 = 64;

/// Longest header of AEDAT3 and AEDAT4, in bytes (64 KiB; one to four kilobytes are usual).
///
/// The XML parser compares all attributes of an element: 1 MiB would take a minute.
pub const HEADER_BYTES: u64 = 1 << 16;

/// Longest header of AEDAT 2, in bytes: 16 MiB. The settings of a chip as XML take about 100 KiB.
pub const JAER_HEADER_BYTES: u64 = 16 << 20;

/// Longest header of `.npy`, in bytes (64 KiB, as in version 1 of the format).
pub const NPY_HEADER_BYTES: u64 = 1 << 16;

/// Longest line of a text, in bytes.
pub const LINE_BYTES: u64 = 4096;

/// Longest image file, and longest list of images, in bytes: 64 MiB.
pub const IMAGE_BYTES: u64 = 64 << 20;

/// Maximum number of pixels of an image: 16 Mi, such as 4096 x 4096.
///
/// For each pixel a decoder holds up to 8 bytes of samples and 3 of the image, a progressive JPEG
/// about 16: a hostile file takes about 256 MiB in addition to its own bytes.
pub const IMAGE_PIXELS: u64 = 16 << 20;

/// Maximum number of scans of a JPEG: a baseline image has one to four, a progressive one about
/// ten.
///
/// A scan of a few bytes can pass over every pixel: without a bound, 1 MiB takes minutes.
pub const JPEG_SCANS: usize = 100;

/// Upper bound of the times of presses by a robot, in microseconds: 2^53, which is 285 years.
pub const STAMP_US: i64 = 1 << 53;

/// Longest time between consecutive instants of a press by a robot, and from them to its first and
/// last event, in microseconds: ten minutes.
///
/// Predictions are read along a whole press.
pub const PRESS_US: i64 = 600_000_000;

/// Maximum number of presses by a robot in a file, and of readings of one press: 1 Mi.
///
/// A press without readings takes a few bytes in a file, and a hundred times as much in memory.
pub const PRESSES: u64 = 1 << 20;

/// Maximum number of bytes to which `packed` bytes may expand.
pub(crate) fn most(packed: u64) -> u64 {
    packed.saturating_mul(EXPANSION).saturating_add(PACKET_BYTES)
}
