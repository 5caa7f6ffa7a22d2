//! PPM and PGM: headers as people write them, samples of any range.

use meissner_io::{Image, IoError, Place, decode_image};
use proptest::prelude::*;

fn rgb(bytes: &[u8]) -> Vec<u8> {
    decode_image(bytes).unwrap().data
}

#[test]
fn a_pixmap_is_taken_as_it_is_and_a_greymap_repeated() {
    let pixmap = decode_image(b"P6\n2 1\n255\n\x01\x02\x03\x04\x05\x06").unwrap();
    assert_eq!(pixmap, Image { width: 2, height: 1, data: vec![1, 2, 3, 4, 5, 6] });
    assert_eq!(rgb(b"P5 1 2 255 \x07\x08"), [7, 7, 7, 8, 8, 8]);
}

#[test]
fn comments_in_the_header_are_passed_over() {
    assert_eq!(rgb(b"P5# by hand\n# 3 3\n1 #width\n 1\t255\n\x07"), [7; 3]);
}

#[test]
fn the_first_white_space_behind_the_header_ends_it() {
    // The second line feed is a sample.
    assert_eq!(rgb(b"P5 2 1 255\n\n\x07"), [10, 10, 10, 7, 7, 7]);
}

#[test]
fn samples_are_stretched_to_8_bits() {
    assert_eq!(rgb(b"P5 3 1 1\n\x00\x01\x00"), [0, 0, 0, 255, 255, 255, 0, 0, 0]);
    // 255 * 500 / 1000 is 127.5, which rounds upwards.
    assert_eq!(rgb(b"P5 2 1 1000\n\x01\xf4\x03\xe8"), [128, 128, 128, 255, 255, 255]);
    assert_eq!(rgb(b"P5 2 1 65535\n\xab\xab\x00\x81"), [0xab, 0xab, 0xab, 1, 1, 1]);
}

#[test]
fn a_header_that_is_wrong_is_refused_at_its_byte() {
    let cases: [(&[u8], &str, u64); 7] = [
        (b"P5 0 1 255\n", "width", 3),
        (b"P5 1 -1 255\n", "height", 5),
        (b"P5 1 x 255\n", "height", 5),
        (b"P5 1 1 65536\n\0", "largest sample", 7),
        (b"P5 1 1 0\n\0", "largest sample", 7),
        (b"P5 1 1 255x\0", "header", 10),
        (b"P5 1 1 99999999999999999999\n\0", "largest sample", 7),
    ];
    for (file, expected, at) in cases {
        match decode_image(file).unwrap_err() {
            IoError::Malformed { what, place, .. } => {
                assert_eq!((what, place), (expected, Place::Byte(at)));
            }
            error => panic!("{error}"),
        }
    }
}

#[test]
fn a_sample_above_the_largest_and_bytes_behind_the_last_are_refused() {
    let error = decode_image(b"P5 2 1 100\n\x64\x65").unwrap_err().to_string();
    assert_eq!(error, "PNM: sample at byte 12: expected at most 100, found `e`");
    let error = decode_image(b"P5 1 1 255\n\x01\x02").unwrap_err().to_string();
    assert_eq!(error, "PNM: pixels at byte 12: expected the end of the file, found `\\x02`");
}

#[test]
fn missing_pixels_are_counted() {
    let error = decode_image(b"P6 2 2 255\n\x01\x02").unwrap_err().to_string();
    assert_eq!(error, "PNM: pixels at byte 11 is cut short: expected 12 bytes, found 2");
}

proptest! {
    #[test]
    fn what_is_written_by_hand_is_read(
        (width, height, data) in (1_usize..20, 1_usize..20)
            .prop_flat_map(|(w, h)| (Just(w), Just(h), prop::collection::vec(any::<u8>(), w * h * 3)))
    ) {
        let file = [format!("P6 {width} {height} 255\n").as_bytes(), &data].concat();
        prop_assert_eq!(decode_image(&file).unwrap(), Image { width, height, data });
    }
}
