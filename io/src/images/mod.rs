//! Images: bytes in, interleaved 8-bit RGB out, and PNG back.
//!
//! | format | reads | writes |
//! |---|---|---|
//! | PNG, any colour type and depth, interlaced or not | yes | 8-bit RGB |
//! | PPM and PGM, binary (`P6`, `P5`), 8 and 16 bits | yes | |
//! | JPEG, baseline and progressive | yes | |
//!
//! The format is found from the content. Grey is repeated in the three channels, alpha is dropped (not blended), and
//! a sample v of the range 0..=m becomes round(255 v / m), so that 16 bits that repeat 8 bits give these 8 bits.
//! Nothing is done about gamma, colour profiles or the orientation that a camera notes beside the pixels.
//!
//! Invariant: a file that is cut short or corrupt gives an [`ImageError`] that names the place; an image of more than
//! [`crate::limits::IMAGE_PIXELS`] pixels is refused before anything of its size is allocated.

mod error;
mod format;
mod image;
mod jpeg;
mod png;
mod pnm;
mod sequence;

pub use error::ImageError;
pub use format::ImageFormat;
pub use image::{Image, decode_image, read_image};
pub use png::{encode_png, write_png};
pub use sequence::ImageSequence;
