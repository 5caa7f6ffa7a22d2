//! What a hostile file may make the decoders hold, at most.
//!
//! A recording is held in memory as its bytes and its events. All formats but AEDAT4 have a fixed largest
//! number of events per byte (EVT3's vectors: 12 events in 2 bytes), so a file bounds its own events. AEDAT4
//! is compressed: there, one packet and the whole file have the bounds below, and a decompressor's window the
//! packet's. No other buffer is sized by a length field that the bytes at hand do not cover.

/// Longest packet of AEDAT4 after decompression, in bytes: 64 MiB, which is 4 million events.
///
/// A decompressor's window has the same bound, and growing buffers may take twice what they hold: one hostile
/// packet holds some 200 MiB at most.
pub const PACKET_BYTES: u64 = 64 << 20;

/// Bytes that a file of AEDAT4 may decompress to, for each of its own bytes, above [`PACKET_BYTES`].
///
/// An event takes 16 bytes decompressed, so this allows events that were packed into a quarter of a byte.
/// Frames are not counted in this: they are not decompressed at all.
pub const EXPANSION: u64 = 64;

/// Longest header of AEDAT4, in bytes (64 KiB; one to four kilobytes are usual).
///
/// Its XML's parser compares each attribute of an element with all before it: 1 MiB of them takes a minute.
pub const HEADER_BYTES: u64 = 1 << 16;

/// Longest header of `.npy`, in bytes (64 KiB, as in version 1 of the format).
pub const NPY_HEADER_BYTES: u64 = 1 << 16;

/// Longest line of CSV, in bytes.
pub const LINE_BYTES: u64 = 4096;

/// Longest file of an image, and longest list of images, in bytes: 64 MiB.
pub const IMAGE_BYTES: u64 = 64 << 20;

/// Pixels of an image, at most: 16 Mi, such as 4096 x 4096.
///
/// A decoder holds up to 8 bytes of samples and 3 of the image for each, a progressive JPEG some 16: a hostile file
/// takes about 256 MiB beside its own bytes.
pub const IMAGE_PIXELS: u64 = 16 << 20;

/// Scans of a JPEG, at most: a baseline image has one to four, a progressive one about ten.
///
/// A scan of a few bytes may pass over every pixel again: without a bound, a file of 1 MiB takes minutes.
pub const JPEG_SCANS: usize = 100;
