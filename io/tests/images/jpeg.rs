//! JPEG: blocks of one colour, of which every pixel is known.

use meissner_io::{Image, IoError, decode_image};

use crate::support::jpeg;

fn pixel(image: &Image, x: usize, y: usize) -> &[u8] {
    &image.data[(y * image.width + x) * Image::CHANNELS..][..Image::CHANNELS]
}

#[test]
fn flat_blocks_have_the_colours_that_they_code() {
    // Y 76, Cb 85, Cr 255: 76 + 1.402 * 127 = 254.1, 76 + 0.344 * 43 - 0.714 * 127 = 0.1, 76 - 1.772 * 43 = -0.2.
    let image = decode_image(&jpeg(16, 8, &[[200, 128, 128], [76, 85, 255]])).unwrap();
    assert_eq!(image.size(), (16, 8));
    for y in 0..8 {
        for x in 0..8 {
            assert_eq!(pixel(&image, x, y), [200; 3]);
            let [r, g, b] = *pixel(&image, x + 8, y) else { panic!("three channels") };
            assert!(r.abs_diff(254) <= 1 && g <= 1 && b == 0, "{r} {g} {b}");
        }
    }
}

#[test]
fn sides_need_not_be_whole_blocks() {
    let image = decode_image(&jpeg(9, 3, &[[10, 128, 128], [20, 128, 128]])).unwrap();
    assert_eq!((image.size(), image.data.len()), ((9, 3), 81));
    assert_eq!((pixel(&image, 7, 2), pixel(&image, 8, 2)), (&[10; 3][..], &[20; 3][..]));
}

#[test]
fn bytes_behind_the_end_are_passed_over() {
    let mut file = jpeg(8, 8, &[[10, 128, 128]]);
    file.extend([0xff, 0, 1]);
    assert_eq!(decode_image(&file).unwrap().data, [10; 192]);
}

#[test]
fn a_scan_without_an_end_is_cut_short() {
    let file = jpeg(8, 8, &[[10, 128, 128]]);
    match decode_image(&file[..file.len() - 1]).unwrap_err() {
        IoError::Truncated { what: "scan", at_least: true, .. } => {}
        error => panic!("{error}"),
    }
    match decode_image(&file[..20]).unwrap_err() {
        IoError::Truncated { what: "segment", expected: 69, actual: 18, .. } => {}
        error => panic!("{error}"),
    }
}
