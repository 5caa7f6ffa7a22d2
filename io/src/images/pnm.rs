//! Binary PPM and PGM (netpbm, `man 5 ppm`): `P6` or `P5`, width, height, largest sample, samples.

use super::{Image, pixels, sample, to_8_bits};
use crate::bytes::Bytes;
use crate::error::{IoError, shown};

/// A number of the header, from 1 to `most`, after white space and comments; moves `at` past it.
fn number(file: Bytes<'_>, at: &mut usize, what: &'static str, most: u32) -> Result<u32, IoError> {
    let bytes = file.data;
    while let Some(&byte) = bytes.get(*at) {
        match byte {
            b'#' => *at += bytes[*at..].iter().take_while(|&&b| b != b'\n').count(),
            b if b.is_ascii_whitespace() => *at += 1,
            _ => break,
        }
    }
    let start = *at;
    let mut value = 0_u32;
    while let Some(digit) = bytes.get(*at).filter(|b| b.is_ascii_digit()) {
        value = value.saturating_mul(10).saturating_add(u32::from(digit - b'0'));
        *at += 1;
    }
    if *at == bytes.len() {
        return Err(file.truncated("header", 0, *at as u64 + 1, true));
    }
    if value == 0 || value > most {
        let found = &bytes[start..(start + 12).min(bytes.len())];
        return Err(file.malformed(what, start, format!("a number from 1 to {most}"), shown(found)));
    }
    Ok(value)
}

/// Decodes a file that starts with `P5` or `P6`. Bytes after the image are refused: they are a
/// second image, or the header is wrong.
pub(super) fn decode(file: Bytes<'_>) -> Result<Image, IoError> {
    let channels = if file.data[1] == b'6' { 3 } else { 1 };
    let mut at = 2;
    let width = number(file, &mut at, "width", u32::MAX)?;
    let height = number(file, &mut at, "height", u32::MAX)?;
    let largest = number(file, &mut at, "largest sample", 65_535)?;
    let count = pixels(file, width.into(), height.into())?;
    let separator = &file.data[at..=at];
    if !separator[0].is_ascii_whitespace() {
        return Err(file.malformed("header", at, "white space before the pixels", shown(separator)));
    }
    let start = at + 1;
    let wide = if largest > 255 { 2 } else { 1 };
    let length = count * channels * wide;
    let samples = file.get("pixels", start, length)?;
    let excess = &file.data[start + length..];
    if !excess.is_empty() {
        let found = shown(&excess[..excess.len().min(8)]);
        return Err(file.malformed("pixels", start + length, "the end of the file", found));
    }
    let (width, height) = (width as usize, height as usize);
    // Samples of 8-bit RGB need no conversion.
    if (largest, channels) == (255, Image::CHANNELS) {
        return Ok(Image { width, height, data: samples.to_owned() });
    }
    let mut data = Vec::with_capacity(count * Image::CHANNELS);
    for (index, bytes) in samples.chunks_exact(wide).enumerate() {
        let value = sample(bytes);
        if value > largest {
            let expected = format!("at most {largest}");
            return Err(file.malformed("sample", start + index * wide, expected, shown(bytes)));
        }
        data.extend_from_slice(&[to_8_bits(value, largest); Image::CHANNELS][..Image::CHANNELS / channels]);
    }
    Ok(Image { width, height, data })
}
