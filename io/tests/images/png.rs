//! PNG: every colour type against pixels that are known, and what is written against what is read.

use meissner_io::{Image, IoError, decode_image, encode_png, read_image, write_png};
use proptest::prelude::*;

use crate::support::{Ihdr, png, png_with, samples};

fn rgb(bytes: &[u8]) -> Vec<u8> {
    decode_image(bytes).unwrap().data
}

#[test]
fn rgb_is_taken_as_it_is() {
    let file = png(2, 2, 8, 2, &[0, 1, 2, 3, 4, 5, 6, 0, 7, 8, 9, 10, 11, 12]);
    let expected = Image { width: 2, height: 2, data: (1..=12).collect() };
    assert_eq!(decode_image(&file).unwrap(), expected);
}

#[test]
fn an_interlaced_image_is_that_image() {
    let interlaced = Ihdr { width: 2, height: 2, depth: 8, colour: 2, interlaced: true };
    // The passes of a 2 x 2 image: (0, 0), then (1, 0), then the second row.
    let raw = [0, 1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 10, 11, 12];
    assert_eq!(rgb(&png_with(&interlaced, &[], &raw)), (1..=12).collect::<Vec<u8>>());
}

#[test]
fn alpha_is_dropped_and_not_blended() {
    assert_eq!(rgb(&png(2, 1, 8, 6, &[0, 1, 2, 3, 0, 4, 5, 6, 99])), [1, 2, 3, 4, 5, 6]);
    assert_eq!(rgb(&png(2, 1, 8, 4, &[0, 9, 0, 8, 255])), [9, 9, 9, 8, 8, 8]);
}

#[test]
fn grey_of_any_depth_is_repeated_and_stretched_to_8_bits() {
    assert_eq!(rgb(&png(2, 1, 8, 0, &[0, 7, 250])), [7, 7, 7, 250, 250, 250]);
    assert_eq!(rgb(&png(2, 1, 1, 0, &[0, 0b0100_0000])), [0, 0, 0, 255, 255, 255]);
    assert_eq!(rgb(&png(2, 1, 2, 0, &[0, 0b0110_0000])), [85, 85, 85, 170, 170, 170]);
    assert_eq!(rgb(&png(2, 1, 4, 0, &[0, 0x1f])), [17, 17, 17, 255, 255, 255]);
}

#[test]
fn a_palette_is_looked_up_and_its_transparency_dropped() {
    let palette = Ihdr { width: 3, height: 1, depth: 2, colour: 3, interlaced: false };
    let chunks: [(&[u8; 4], &[u8]); 2] = [(b"PLTE", &[1, 2, 3, 4, 5, 6, 7, 8, 9]), (b"tRNS", &[0, 255])];
    assert_eq!(rgb(&png_with(&palette, &chunks, &[0, 0b10_00_01_00])), [7, 8, 9, 1, 2, 3, 4, 5, 6]);
}

#[test]
fn sixteen_bits_are_rounded_to_eight() {
    // 128 / 257 is below a half, 129 / 257 above; 0xabab is 0xab in 8 bits.
    let raw = [0, 0, 128, 0, 129, 0xab, 0xab, 0xff, 0xff, 0xff, 0x7f, 0xff, 0x7e];
    assert_eq!(rgb(&png(2, 1, 16, 2, &raw)), [0, 1, 0xab, 255, 255, 254]);
    assert_eq!(rgb(&png(1, 1, 16, 4, &[0, 0xab, 0xab, 1, 2])), [0xab; 3]);
}

#[test]
fn text_and_bytes_behind_the_end_are_passed_over() {
    let ihdr = Ihdr { width: 1, height: 1, depth: 8, colour: 2, interlaced: false };
    let mut file = png_with(&ihdr, &[(b"tEXt", b"Comment\0by hand")], &[0, 1, 2, 3]);
    file.extend(b"more");
    assert_eq!(rgb(&file), [1, 2, 3]);
}

#[test]
fn a_missing_chunk_is_named_by_its_place() {
    let (_, file) = samples().swap_remove(0);
    let error = decode_image(&file[..file.len() - 1]).unwrap_err().to_string();
    assert_eq!(error, "PNG: chunk at byte 70 is cut short: expected 12 bytes, found 11");
    let error = decode_image(&file[..20]).unwrap_err().to_string();
    assert_eq!(error, "PNG: chunk at byte 8 is cut short: expected 25 bytes, found 12");
}

#[test]
fn pixels_that_do_not_fill_the_image_are_not_written() {
    for (width, height, bytes) in [(2, 2, 11), (2, 2, 13), (0, 2, 0), (2, 0, 0), (1 << 31, 0, 0)] {
        let error = encode_png(width, height, &vec![0; bytes]).unwrap_err();
        assert!(matches!(error, IoError::Buffer { .. }), "{error}");
    }
    let error = encode_png(usize::MAX, usize::MAX, &[]).unwrap_err();
    assert!(matches!(error, IoError::Buffer { .. }), "{error}");
}

#[test]
fn a_written_file_is_read_back_and_a_folder_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (path, data) = (folder.path().join("a.png"), vec![1, 2, 3, 4, 5, 6]);
    write_png(&path, 1, 2, &data).unwrap();
    assert_eq!(read_image(&path).unwrap(), Image { width: 1, height: 2, data: data.clone() });
    let error = write_png(&folder.path().join("none/a.png"), 1, 2, &data).unwrap_err();
    assert!(matches!(error, IoError::File { action: "create", .. }), "{error}");
    let error = read_image(&folder.path().join("b.png")).unwrap_err();
    assert!(matches!(error, IoError::File { action: "open", .. }), "{error}");
}

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(
        (width, height, data) in (1_usize..40, 1_usize..40)
            .prop_flat_map(|(w, h)| (Just(w), Just(h), prop::collection::vec(any::<u8>(), w * h * 3)))
    ) {
        let file = encode_png(width, height, &data).unwrap();
        prop_assert_eq!(decode_image(&file).unwrap(), Image { width, height, data });
    }
}
