//! PNG (W3C recommendation, third edition): bytes to and from an image, with the `png` crate.
//!
//! The chunks are checked before decoding, so that a missing byte is an error with the position of
//! its chunk, and no allocated image is larger than the compressed bytes can give.

use std::io::{Cursor, Write};
use std::path::Path;

use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Transformations};

use super::{Image, pixels, sample, to_8_bits};
use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::files::write_file;

/// Bytes before the first chunk.
const SIGNATURE: usize = 8;

/// Bytes of a chunk in addition to its content: length, type, checksum.
const AROUND: usize = 12;

/// Maximum number of bytes that deflate makes from one byte: 258 from two bits, and a little less
/// for the block's header.
const DEFLATE_MAX: u64 = 1032;

/// Longest side that the format allows.
const MAX_SIDE: u32 = (1 << 31) - 1;

/// Checks the chunks up to IEND; returns the number of bytes of all IDAT chunks.
fn compressed_bytes(file: Bytes<'_>) -> Result<u64, IoError> {
    file.get("signature", 0, SIGNATURE)?;
    let (mut at, mut compressed) = (SIGNATURE, 0);
    loop {
        let start = file.get("chunk", at, AROUND)?;
        let length = u32::from_be_bytes(array(start)) as usize;
        let chunk = file.get("chunk", at, length.saturating_add(AROUND))?;
        match &chunk[4..8] {
            b"IDAT" => compressed += length as u64,
            // The decoder relies on complete entries.
            b"PLTE" if !length.is_multiple_of(3) => {
                return Err(file.malformed("palette", at, "entries of 3 bytes", format!("{length} bytes")));
            }
            b"IEND" => return Ok(compressed),
            _ => {}
        }
        at += chunk.len();
    }
}

/// Decodes a file that starts with the signature.
pub(super) fn decode(file: Bytes<'_>) -> Result<Image, IoError> {
    let compressed = compressed_bytes(file)?;
    let mut cursor = Cursor::new(file.data);
    let mut decoder = Decoder::new(&mut cursor);
    // Palettes and fewer than 8 bits become 8 bits per channel; 16 bits are rounded in `to_rgb`.
    decoder.set_transformations(Transformations::EXPAND);
    // Texts and profiles are not decompressed.
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(|e| file.malformed("header", 0, "a valid IHDR", e))?;
    let (width, height) = (info.width, info.height);
    let count = pixels(file, width.into(), height.into())?;
    let least = (count as u64 * info.bits_per_pixel() as u64).div_ceil(8).div_ceil(DEFLATE_MAX);
    if compressed < least {
        let expected = format!("at least {least} bytes for {width}x{height} pixels");
        return Err(file.malformed("compressed pixels", SIGNATURE, expected, compressed));
    }
    let samples = samples(decoder);
    let (samples, colour, depth) = samples
        .map_err(|e| file.malformed("content", cursor.position() as usize, "valid chunks and pixels", e))?;
    let data = to_rgb(&samples, colour, depth);
    debug_assert_eq!(data.len(), count * Image::CHANNELS);
    Ok(Image { width: width as usize, height: height as usize, data })
}

/// The decoded samples of the first image, their colour type and depth; reads up to IEND.
fn samples(
    decoder: Decoder<&mut Cursor<&[u8]>>,
) -> Result<(Vec<u8>, ColorType, BitDepth), png::DecodingError> {
    let mut reader = decoder.read_info()?;
    let length = reader.output_buffer_size().ok_or(png::DecodingError::LimitsExceeded)?;
    let mut samples = vec![0; length];
    let output = reader.next_frame(&mut samples)?;
    reader.finish()?;
    samples.truncate(output.buffer_size());
    Ok((samples, output.color_type, output.bit_depth))
}

/// Samples of any colour type with 8 or 16 bits, big-endian, as 8-bit RGB.
fn to_rgb(samples: &[u8], colour: ColorType, depth: BitDepth) -> Vec<u8> {
    let channels = colour.samples();
    let (wide, largest) = if depth == BitDepth::Sixteen { (2, 0xffff) } else { (1, 0xff) };
    // Without colour, grey is the first channel; alpha, if any, comes last.
    let [r, g, b] = if channels < 3 { [0, 0, 0] } else { [0, 1, 2] };
    let pixels = samples.chunks_exact(channels * wide);
    let value = |pixel: &[u8], at: usize| to_8_bits(sample(&pixel[at * wide..(at + 1) * wide]), largest);
    pixels.flat_map(|pixel| [r, g, b].map(|channel| value(pixel, channel))).collect()
}

/// Encodes interleaved RGB as an 8-bit PNG; O(pixels).
///
/// # Errors
/// [`IoError::Buffer`] if `rgb` is not `height` x `width` x 3 bytes, or a side is not 1..2^31.
///
/// # Panics
/// Never: an image of this size can be encoded, and writing to memory does not fail.
pub fn encode_png(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>, IoError> {
    let side = |length: usize| u32::try_from(length).ok().filter(|&l| l > 0 && l <= MAX_SIDE);
    let expected = (width as u64).saturating_mul(height as u64).saturating_mul(Image::CHANNELS as u64);
    let actual = rgb.len() as u64;
    let (Some(columns), Some(rows), true) = (side(width), side(height), expected == actual) else {
        return Err(IoError::Buffer { width, height, expected, actual });
    };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, columns, rows);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    let mut writer = encoder.write_header().expect("sides of at least 1");
    writer.write_image_data(rgb).expect("as many bytes as the image has");
    writer.finish().expect("an image that is complete");
    Ok(bytes)
}

/// Encodes `pixels`, a byte each, as a PNG of two bits a pixel: 0 to 3 are colours of `palette`,
/// and larger values are the last colour. O(pixels).
///
/// # Errors
/// [`IoError::Buffer`] if there are not `height` x `width` pixels, or a side is not 1..2^31.
///
/// # Panics
/// Never, as [`encode_png`].
pub fn encode_palette_png(
    width: usize,
    height: usize,
    palette: [[u8; 3]; 4],
    pixels: &[u8],
) -> Result<Vec<u8>, IoError> {
    let side = |length: usize| u32::try_from(length).ok().filter(|&l| l > 0 && l <= MAX_SIDE);
    let expected = (width as u64).saturating_mul(height as u64);
    let actual = pixels.len() as u64;
    let (Some(columns), Some(rows), true) = (side(width), side(height), expected == actual) else {
        return Err(IoError::Buffer { width, height, expected, actual });
    };
    let packed = |four: &[u8]| (0..4).fold(0, |byte, i| byte << 2 | four.get(i).map_or(0, |&p| p.min(3)));
    let packed: Vec<u8> = pixels.chunks(width).flat_map(|row| row.chunks(4).map(packed)).collect();
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, columns, rows);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Two);
    encoder.set_palette(palette.concat());
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header().expect("sides of at least 1");
    writer.write_image_data(&packed).expect("as many bytes as the image has");
    writer.finish().expect("an image that is complete");
    Ok(bytes)
}

/// Writes interleaved RGB to the file at `path` as an 8-bit PNG; O(pixels).
///
/// # Errors
/// As [`encode_png`] and [`write_file`].
pub fn write_png(path: &Path, width: usize, height: usize, rgb: &[u8]) -> Result<(), IoError> {
    let bytes = encode_png(width, height, rgb)?;
    write_file(path, |out| out.write_all(&bytes))
}
