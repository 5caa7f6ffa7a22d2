//! JPEG, PNG and PNM, and sequences of them.

use std::fs;
use std::path::{Path, PathBuf};

use meissner_io::{Image, ImageSequence, IoError, Place, decode_image, encode_png, read_image, write_png};
use proptest::prelude::*;

use meissner_io_tests::images::{Ihdr, jpeg, png, png_with, samples};

fn pixel(image: &Image, x: usize, y: usize) -> &[u8] {
    &image.data[(y * image.width + x) * Image::CHANNELS..][..Image::CHANNELS]
}

#[test]
fn flat_blocks_have_the_colours_that_they_code() {
    // Y 76, Cb 85, Cr 255: 76 + 1.402 * 127 = 254.1, 76 + 0.344 * 43 - 0.714 * 127 = 0.1, 76 -
    // 1.772 * 43 = -0.2.
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

fn image(path: &Path, width: usize, height: usize, value: u8) {
    write_png(path, width, height, &vec![value; width * height * 3]).unwrap();
}

fn names(sequence: &ImageSequence) -> Vec<&str> {
    sequence.paths().iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect()
}

#[test]
fn a_folder_is_read_in_natural_order_and_other_files_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    for (value, name) in ["img1.png", "img2.PNG", "img10.png"].into_iter().enumerate() {
        image(&folder.path().join(name), 2, 1, value as u8);
    }
    fs::write(folder.path().join("img3.txt"), "no image").unwrap();
    fs::create_dir(folder.path().join("img4.png")).unwrap();
    let sequence = ImageSequence::open(folder.path()).unwrap();
    assert_eq!((sequence.len(), names(&sequence)), (3, vec!["img1.png", "img2.PNG", "img10.png"]));
    for (value, item) in sequence.enumerate() {
        assert_eq!(item.unwrap().1, Image { width: 2, height: 1, data: vec![value as u8; 6] });
    }
}

#[test]
fn a_list_gives_its_paths_in_its_order_relative_to_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("run 1")).unwrap();
    let absolute = folder.path().join("c.png");
    image(&folder.path().join("run 1/b.png"), 1, 1, 1);
    image(&folder.path().join("a.png"), 1, 1, 2);
    image(&absolute, 1, 1, 3);
    let list = folder.path().join("images.txt");
    let text =
        format!("\u{feff}# by hand\r\n  run 1/b.png \r\n\n# a.png\na.png\n{}\na.png", absolute.display());
    fs::write(&list, text).unwrap();
    let values: Vec<u8> = ImageSequence::open(&list).unwrap().map(|item| item.unwrap().1.data[0]).collect();
    assert_eq!(values, [1, 2, 3, 2]);
}

#[test]
fn one_image_is_a_sequence_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("touch");
    image(&path, 1, 1, 7);
    let items: Vec<(PathBuf, Image)> = ImageSequence::open(&path).unwrap().map(Result::unwrap).collect();
    assert_eq!(items, [(path, Image { width: 1, height: 1, data: vec![7; 3] })]);
}

#[test]
fn an_image_of_another_size_or_at_fault_is_an_error_and_the_next_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    fs::write(path("1.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    image(&path("2.png"), 2, 1, 1);
    image(&path("3.png"), 1, 2, 2);
    image(&path("4.png"), 2, 1, 3);
    let mut sequence = ImageSequence::open(folder.path()).unwrap();
    let error = sequence.next().unwrap().unwrap_err();
    assert!(matches!(&error, IoError::Content { path: at, .. } if *at == path("1.png")), "{error}");
    assert_eq!(sequence.next().unwrap().unwrap().1.data, [1; 6]);
    let error = sequence.next().unwrap().unwrap_err().to_string();
    let expected =
        format!("{}: expected 2x1 pixels as in the first image, found 1x2", path("3.png").display());
    assert_eq!(error, expected);
    assert_eq!(sequence.next().unwrap().unwrap().1.data, [3; 6]);
    assert!(sequence.next().is_none());
}

#[test]
fn what_names_no_image_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let error = ImageSequence::open(folder.path()).unwrap_err();
    assert!(matches!(error, IoError::Unfit { .. }), "{error}");
    let list = folder.path().join("list.txt");
    fs::write(&list, "# nothing\n").unwrap();
    assert!(matches!(ImageSequence::open(&list), Err(IoError::Unfit { .. })));
    fs::write(&list, b"a.png\n\x00\x01\n").unwrap();
    match ImageSequence::open(&list).unwrap_err() {
        IoError::Content { source, .. } => {
            let IoError::Malformed { place, actual, .. } = *source else { panic!("{source}") };
            assert_eq!((place, actual.as_str()), (Place::Line(2), "`\\x00\\x01`"));
        }
        error => panic!("{error}"),
    }
    let missing = ImageSequence::open(&folder.path().join("none"));
    assert!(matches!(missing, Err(IoError::File { action: "open", .. })));
}
