//! JPEG (ITU-T T.81): bytes to an image, with the `zune-jpeg` crate.
//!
//! The segments are checked before decoding: the decoder fills missing data with grey, and
//! processes all pixels once per scan. It is built without processor-specific paths: a file gives
//! the same pixels on every machine.

use std::io::Cursor;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::{Image, pixels};
use crate::bytes::Bytes;
use crate::error::IoError;
use crate::limits::JPEG_SCANS;

/// Maximum number of pixels that a byte codes. Every block of 8 x 8 values takes at least one bit,
/// and subsampled components have at least half as many blocks as one component of all pixels.
const MAX_PIXELS_OF_A_BYTE: usize = 2 * 8 * 64;

/// Refuses sampling factors for which the decoder reads beyond its rows: a component with more
/// columns or rows than the first. `content` is the content of the frame header at `at`.
fn check_sampling(file: Bytes<'_>, content: &[u8], at: usize) -> Result<(), IoError> {
    const FIRST: [u8; 6] = [0x11, 0x12, 0x14, 0x21, 0x22, 0x41];
    // After precision, height, width and number of components: identifier, factors and table of
    // each.
    let factors: Vec<u8> = content.iter().skip(7).step_by(3).copied().collect();
    let [first, others @ ..] = &factors[..] else { return Ok(()) };
    if !FIRST.contains(first) || others.iter().any(|&other| other != 0x11) {
        let expected = "1x1, 1x2, 1x4, 2x1, 2x2 or 4x1 of the first component, 1x1 of others";
        let shown: Vec<String> = factors.iter().map(|f| format!("{}x{}", f >> 4, f & 15)).take(4).collect();
        return Err(file.malformed("sampling factors", at, expected, shown.join(", ")));
    }
    Ok(())
}

/// Checks the segments up to the end-of-image marker, with at most [`JPEG_SCANS`] scans; returns
/// the start of the first scan's data.
fn first_scan(file: Bytes<'_>) -> Result<usize, IoError> {
    let (mut at, mut scan, mut scans) = (2, None, 0);
    loop {
        let [mark, code] = file.array("marker", at)?;
        if mark != 0xff {
            return Err(file.malformed("marker", at, "0xff", format!("{mark:#04x}")));
        }
        match code {
            // Markers may be padded with further bytes 0xff.
            0xff => {
                at += 1;
                continue;
            }
            // Restart and start markers have no length.
            0x01 | 0xd0..=0xd8 => {
                at += 2;
                continue;
            }
            0xd9 => {
                let no_scan = || file.malformed("end of the image", at, "a scan before it", "none");
                return scan.ok_or_else(no_scan);
            }
            _ => {}
        }
        let [_, _, high, low] = file.array("segment", at)?;
        let length = usize::from(u16::from_be_bytes([high, low]));
        if length < 2 {
            return Err(file.malformed("length of a segment", at + 2, "its own 2 bytes at least", length));
        }
        let segment = file.get("segment", at, 2 + length)?;
        let end = at + segment.len();
        if matches!(code, 0xc0..=0xc2) {
            check_sampling(file, &segment[4..], at)?;
        }
        at = end;
        if code == 0xda {
            scans += 1;
            if scans > JPEG_SCANS {
                let start = end - segment.len();
                return Err(file.malformed("scan", start, format!("at most {JPEG_SCANS} scans"), "one more"));
            }
            scan.get_or_insert(end);
            // Entropy-coded data end at the first 0xff before neither 0x00 nor a restart.
            let is_end = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xd0..=0xd7);
            let rest = &file.data[end..];
            let endless = || file.truncated("scan", end, rest.len() as u64 + 1, true);
            at += rest.windows(2).position(is_end).ok_or_else(endless)?;
        }
    }
}

/// Decodes a file that starts with a start-of-image marker.
pub(super) fn decode(file: Bytes<'_>) -> Result<Image, IoError> {
    let scan = first_scan(file)?;
    // Only the number of pixels is limited below: a thin image may be as long as the format allows.
    let options = DecoderOptions::new_safe()
        .set_strict_mode(true)
        .set_max_width(u16::MAX.into())
        .set_max_height(u16::MAX.into())
        .jpeg_set_max_scans(JPEG_SCANS)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(file.data), options);
    let valid = "valid segments of a supported kind";
    decoder.decode_headers().map_err(|e| file.malformed("header", 0, valid, format!("{e:?}")))?;
    let Some((width, height)) = decoder.dimensions() else {
        return Err(file.malformed("header", 0, "the size of the image", "none"));
    };
    let count = pixels(file, width as u64, height as u64)?;
    let least = count.div_ceil(MAX_PIXELS_OF_A_BYTE);
    if file.len() < least {
        let expected = format!("at least {least} bytes for {width}x{height} pixels");
        return Err(file.malformed("header", 0, expected, file.len()));
    }
    let data = decoder
        .decode()
        .map_err(|e| file.malformed("scan", scan, "valid entropy-coded data", format!("{e:?}")))?;
    let colour = decoder.output_colorspace();
    if colour != Some(ColorSpace::RGB) || data.len() != count * Image::CHANNELS {
        let actual = format!("{colour:?} in {} bytes", data.len());
        return Err(file.malformed("colours", 0, "what can be had as RGB", actual));
    }
    Ok(Image { width, height, data })
}
