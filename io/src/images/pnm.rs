//! Binary PPM and PGM (netpbm, `man 5 ppm`): `P6` or `P5`, width, height, largest sample, then the samples.

use super::image::{Image, ImageError, pixels, to_8_bits};
use crate::error::shown;
use crate::format::ImageFormat;

/// A reader of the header's numbers.
///
/// Invariant: `at` is at most the length of `bytes`.
struct Header<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Header<'_> {
    /// A number of at least 1 and at most `most`, after white space and comments.
    fn number(&mut self, what: &'static str, most: u32) -> Result<u32, ImageError> {
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b'#' => {
                    let rest = &self.bytes[self.at..];
                    self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                }
                b if b.is_ascii_whitespace() => self.at += 1,
                _ => break,
            }
        }
        let start = self.at;
        let mut value = 0_u32;
        while let Some(digit) = self.bytes.get(self.at).filter(|b| b.is_ascii_digit()) {
            value = value.saturating_mul(10).saturating_add(u32::from(digit - b'0'));
            self.at += 1;
        }
        if self.at == self.bytes.len() {
            let expected = self.at as u64 + 1;
            return Err(ImageError::truncated(ImageFormat::Pnm, "header", 0, expected, self.at, true));
        }
        if value == 0 || value > most {
            let found = &self.bytes[start..(start + 12).min(self.bytes.len())];
            return Err(malformed(what, start, format!("a number from 1 to {most}"), found));
        }
        Ok(value)
    }
}

fn malformed(what: &'static str, at: usize, expected: impl Into<String>, found: &[u8]) -> ImageError {
    ImageError::malformed(ImageFormat::Pnm, what, at, expected, shown(found))
}

/// Decodes `bytes`, which start with `P5` or `P6`. Bytes after the image are refused: they are a second image, or the header
/// is wrong.
pub(super) fn decode(bytes: &[u8]) -> Result<Image, ImageError> {
    let channels = if bytes[1] == b'6' { 3 } else { 1 };
    let mut header = Header { bytes, at: 2 };
    let width = header.number("width", u32::MAX)?;
    let height = header.number("height", u32::MAX)?;
    let largest = header.number("largest sample", 65_535)?;
    let count = pixels(width.into(), height.into())?;
    let (separator, start) = (header.at, header.at + 1);
    if !bytes[separator].is_ascii_whitespace() {
        let found = &bytes[separator..start];
        return Err(malformed("header", separator, "white space before the pixels", found));
    }
    let wide = if largest > 255 { 2 } else { 1 };
    let (samples, length) = (&bytes[start..], count * channels * wide);
    if samples.len() < length {
        let format = ImageFormat::Pnm;
        return Err(ImageError::truncated(format, "pixels", start, length as u64, bytes.len(), false));
    }
    if samples.len() > length {
        let (end, excess) = (start + length, &samples[length..]);
        return Err(malformed("pixels", end, "the end of the file", &excess[..excess.len().min(8)]));
    }
    let (width, height) = (width as usize, height as usize);
    // Samples of 8-bit RGB need no conversion.
    if (largest, channels) == (255, Image::CHANNELS) {
        return Ok(Image { width, height, data: samples.to_owned() });
    }
    let sample = |at: usize| {
        let value = match samples[at * wide..(at + 1) * wide] {
            [high, low] => u32::from(u16::from_be_bytes([high, low])),
            ref one => u32::from(one[0]),
        };
        if value > largest {
            let found = &samples[at * wide..(at + 1) * wide];
            return Err(malformed("sample", start + at * wide, format!("at most {largest}"), found));
        }
        Ok(to_8_bits(value, largest))
    };
    let mut data = Vec::with_capacity(count * Image::CHANNELS);
    for at in 0..count * channels {
        let value = sample(at)?;
        data.extend_from_slice(&[value; Image::CHANNELS][..Image::CHANNELS / channels]);
    }
    Ok(Image { width, height, data })
}
