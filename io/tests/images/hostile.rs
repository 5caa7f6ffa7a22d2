//! Truncations, flipped bits and absurd sizes: an error or an image, never a panic, never much memory.

use std::fs::File;

use meissner_io::limits::{IMAGE_BYTES, IMAGE_PIXELS};
use meissner_io::{IoError, decode_image, read_image};
use proptest::prelude::*;

use crate::support::{Ihdr, chunk, jpeg, png, png_with, samples};

#[test]
fn a_file_cut_at_any_length_gives_an_error() {
    for (name, file) in samples() {
        assert!(decode_image(&file).is_ok(), "{name}");
        for length in 0..file.len() {
            match decode_image(&file[..length]) {
                Err(IoError::Truncated { .. }) => {}
                Err(IoError::UnknownFormat { .. }) if length < 3 => {}
                other => panic!("{name} cut at {length}: {other:?}"),
            }
        }
    }
}

#[test]
fn any_flipped_bit_gives_an_error_or_an_image() {
    for (_, mut file) in samples() {
        for bit in 0..file.len() * 8 {
            file[bit / 8] ^= 1 << (bit % 8);
            if let Ok(image) = decode_image(&file) {
                assert_eq!(image.data.len(), image.width * image.height * 3);
            }
            file[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

#[test]
fn an_absurd_length_anywhere_gives_an_error_or_an_image() {
    for (name, file) in samples() {
        for at in 0..file.len() - 4 {
            for length in [u32::MAX, 1 << 31, 0x7fff_ffff, 0x8000_8000, 0] {
                for width in [2, 4] {
                    let mut changed = file.clone();
                    changed[at..at + width].copy_from_slice(&length.to_be_bytes()[4 - width..]);
                    if let Ok(image) = decode_image(&changed) {
                        assert!(image.width as u64 * image.height as u64 <= IMAGE_PIXELS, "{name} at {at}");
                        assert_eq!(image.data.len(), image.width * image.height * 3, "{name} at {at}");
                    }
                }
            }
        }
    }
}

#[test]
fn messages_quote_what_a_file_says_in_part() {
    let long = "9".repeat(50_000);
    let files = [
        format!("P6 {long} 1 255\n"),
        format!("P6 x{long} 1 255\n"),
        format!("P6 1 1 255\nabc{long}"),
        format!("GIF{long}"),
        format!("\u{7f}PNG{long}"),
    ];
    let name = vec![0x80; 40_000];
    let mut file = png(1, 1, 8, 2, &[0, 1, 2, 3]);
    file.splice(33..33, chunk(*b"ABCD", &name));
    for file in files.map(String::into_bytes).into_iter().chain([file]) {
        let error = decode_image(&file).unwrap_err().to_string();
        assert!(error.len() < 500, "{} bytes: {error:.600}", error.len());
    }
}

#[test]
fn sizes_beyond_the_limit_are_refused_by_the_header() {
    let side = u32::try_from(IMAGE_PIXELS).unwrap() / 256 + 1;
    let files = [
        png(side, 256, 8, 2, &[0]),
        png(i32::MAX as u32, i32::MAX as u32, 16, 6, &[0]),
        b"P6 4294967295 4294967295 65535\n\0".to_vec(),
        b"P5 16777217 1 255\n\0".to_vec(),
    ];
    for file in files {
        let error = decode_image(&file).unwrap_err();
        assert!(matches!(error, IoError::TooLarge { limit: IMAGE_PIXELS, .. }), "{error}");
    }
    let mut file = jpeg(8, 8, &[[10, 128, 128]]);
    let sof = file.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    file[sof + 5..sof + 9].fill(0xff);
    let error = decode_image(&file).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { actual: 4_294_836_225, .. }), "{error}");
}

#[test]
fn a_png_whose_bytes_cannot_fill_its_pixels_is_refused_before_it_is_decoded() {
    // 4096 x 4096 x 3 bytes in 12 compressed ones.
    let error = decode_image(&png(4096, 4096, 8, 2, &[0])).unwrap_err().to_string();
    assert_eq!(
        error,
        "PNG: compressed pixels at byte 8: expected at least 48771 bytes for 4096x4096 pixels, found 12"
    );
}

/// Found by fuzzing: the decoder would go through 16 million pixels of a few bytes.
#[test]
fn a_jpeg_whose_bytes_cannot_code_its_blocks_is_refused_before_it_is_decoded() {
    let mut file = jpeg(8, 8, &[[10, 128, 128]]);
    let sof = file.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    file[sof + 5..sof + 9].copy_from_slice(&[0x10, 0x00, 0x10, 0x00]);
    let error = decode_image(&file).unwrap_err().to_string();
    let expected = "at least 16384 bytes for 4096x4096 pixels";
    assert_eq!(error, format!("JPEG: header at byte 0: expected {expected}, found {}", file.len()));
}

/// Found by fuzzing: such a segment would end before its content starts.
#[test]
fn a_jpeg_segment_that_does_not_count_its_own_length_is_refused() {
    let mut file = jpeg(8, 8, &[[10, 128, 128]]);
    let sof = file.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    file[sof + 3] = 0;
    let error = decode_image(&file).unwrap_err().to_string();
    let at = sof + 2;
    let expected = "its own 2 bytes at least";
    assert_eq!(error, format!("JPEG: length of a segment at byte {at}: expected {expected}, found 0"));
}

/// Found by fuzzing: the decoder would read beyond the rows that it made for the first component.
#[test]
fn a_jpeg_whose_chroma_has_more_columns_than_its_luma_is_refused() {
    let mut file = jpeg(8, 8, &[[10, 128, 128]]);
    let sof = file.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    file[sof + 14] = 0x41;
    let error = decode_image(&file).unwrap_err().to_string();
    let expected = "1x1, 1x2, 1x4, 2x1, 2x2 or 4x1 of the first component, 1x1 of others";
    assert_eq!(
        error,
        format!("JPEG: sampling factors at byte {sof}: expected {expected}, found 1x1, 4x1, 1x1")
    );
}

/// Found by fuzzing: the decoder would read a byte after the palette.
#[test]
fn a_palette_that_ends_within_an_entry_is_refused() {
    let ihdr = Ihdr { width: 15, height: 1, depth: 2, colour: 3, interlaced: false };
    let error = decode_image(&png_with(&ihdr, &[(b"PLTE", &[7; 11])], &[0; 5])).unwrap_err().to_string();
    assert_eq!(error, "PNG: palette at byte 33: expected entries of 3 bytes, found 11 bytes");
}

#[test]
fn a_file_that_is_too_long_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.png");
    File::create(&path).unwrap().set_len(IMAGE_BYTES + 1).unwrap();
    match read_image(&path).unwrap_err() {
        IoError::Content { source, .. } => assert!(matches!(*source, IoError::TooLarge { .. })),
        error => panic!("{error}"),
    }
}

#[test]
fn what_is_no_image_is_shown() {
    let error = decode_image(b"GIF89a\x01\x00\x01").unwrap_err().to_string();
    let expected = "expected PNG, JPEG, binary PPM or PGM, found 9 bytes starting with `GIF89a\\x01\\x00`";
    assert_eq!(error, format!("unknown image format: {expected}"));
}

proptest! {
    #[test]
    fn any_bytes_in_place_of_some_give_an_error_or_an_image(
        sample in 0_usize..6,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let (_, mut file) = samples().swap_remove(sample);
        for (at, byte) in changes {
            *at.get_mut(&mut file) = byte;
        }
        if let Ok(image) = decode_image(&file) {
            prop_assert_eq!(image.data.len(), image.width * image.height * 3);
        }
    }
}
