//! Malicious pictures: sizes beyond memory, damaged and random bytes.

use std::fs::File;
use std::time::{Duration, Instant};

use meissner_io::limits::{IMAGE_BYTES, IMAGE_PIXELS, JPEG_SCANS};
use meissner_io::{IoError, Place, decode_image, read_image};
use proptest::prelude::*;

use meissner_io_tests::images::{Ihdr, chunk, jpeg, png, png_with, samples};

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

/// Longest time that an input may take; far more than any input here needs.
const CEILING: Duration = Duration::from_secs(10);

/// Bits; the first is the lowest bit of a byte (deflate) or the highest (JPEG).
#[derive(Default)]
struct Bits(Vec<bool>);

impl Bits {
    /// The `count` lowest bits of `code`, the highest of them first.
    fn code(&mut self, code: u32, count: u32) {
        self.0.extend((0..count).rev().map(|bit| code >> bit & 1 == 1));
    }

    fn deflate(&self) -> Vec<u8> {
        let byte = |bits: &[bool]| bits.iter().rev().fold(0, |byte, &bit| byte << 1 | u8::from(bit));
        self.0.chunks(8).map(byte).collect()
    }

    /// Filled up with ones, and 0xff stuffed.
    fn jpeg(&self) -> Vec<u8> {
        let byte = |bits: &[bool]| (0..8).fold(0, |b, at| b << 1 | u8::from(*bits.get(at).unwrap_or(&true)));
        let stuffed = |byte| if byte == 0xff { vec![0xff, 0] } else { vec![byte] };
        self.0.chunks(8).map(byte).flat_map(stuffed).collect()
    }
}

/// A zlib stream of `bytes` zeros or a few more: one literal, and copies of 258 bytes of 13 bits
/// each.
fn zlib_bomb(bytes: usize) -> Vec<u8> {
    let mut bits = Bits::default();
    // The last block, of fixed codes (the two bits of its type come lowest first).
    bits.code(0b110, 3);
    bits.code(0x30, 8);
    (0..16).for_each(|_| bits.code(0b1100_0101 << 5, 13));
    let start = bits.deflate();
    // Eight copies take 13 bytes, whatever their start.
    let repeated = start[2..15].repeat(bytes / (8 * 258) + 1);
    // The end of a copy, the end of the block, and room for a checksum.
    [&[0x78, 0x9c][..], &start[..2], &repeated, &start[2..3], &[0; 8]].concat()
}

#[test]
fn compressed_text_and_profiles_of_a_png_are_not_unpacked() {
    // Unpacked, each would exceed the decoder's limit for all chunks together.
    let bomb = zlib_bomb(256 << 20);
    assert!(bomb.len() < 2 << 20, "{}", bomb.len());
    let with = |start: &[u8]| [start, &bomb].concat();
    let (text, international, profile) = (with(b"a\0\0"), with(b"a\0\x01\0\0\0"), with(b"a\0\0"));
    let between: [(&[u8; 4], &[u8]); 3] = [(b"iCCP", &profile), (b"zTXt", &text), (b"iTXt", &international)];
    let ihdr = Ihdr { width: 1, height: 1, depth: 8, colour: 2, interlaced: false };
    let start = Instant::now();
    assert_eq!(decode_image(&png_with(&ihdr, &between, &[0, 1, 2, 3])).unwrap().data, [1, 2, 3]);
    assert!(start.elapsed() < CEILING, "{:?}", start.elapsed());
}

#[test]
fn pixels_beyond_those_of_a_png_are_not_kept() {
    // A gibibyte for one pixel, and again for an animation's second frame.
    let bomb = zlib_bomb(1 << 30);
    let header = [&1_u32.to_be_bytes()[..], &1_u32.to_be_bytes(), &[8, 2, 0, 0, 0]].concat();
    let control = |number: u32| {
        let words = [number, 1, 1, 0, 0].map(u32::to_be_bytes).concat();
        chunk(*b"fcTL", &[&words[..], &[0, 1, 0, 1, 0, 0]].concat())
    };
    let file = [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(*b"IHDR", &header),
        chunk(*b"acTL", &[0, 0, 0, 2, 0, 0, 0, 0]),
        control(0),
        chunk(*b"IDAT", &bomb),
        control(1),
        chunk(*b"fdAT", &[&2_u32.to_be_bytes()[..], &bomb].concat()),
        chunk(*b"IEND", b""),
    ];
    let start = Instant::now();
    assert_eq!(decode_image(&file.concat()).unwrap().data, [0; 3]);
    assert!(start.elapsed() < CEILING, "{:?}", start.elapsed());
}

fn segment(code: u8, content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len() + 2).unwrap().to_be_bytes();
    [&[0xff, code], &length[..], content].concat()
}

/// The start of a JPEG of `sides` (height, width) and `components` without subsampling: frame
/// marker `code`, quantisers of 1, a code of 1 bit for a mean like the one before, and one of 1 bit
/// for AC symbol `symbol`.
fn jpeg_start(code: u8, [height, width]: [u16; 2], components: u8, symbol: u8) -> Vec<u8> {
    let [[h1, h0], [w1, w0]] = [height.to_be_bytes(), width.to_be_bytes()];
    let mut frame = vec![8, h1, h0, w1, w0, components];
    (1..=components).for_each(|component| frame.extend([component, 0x11, 0]));
    let one_code = |class: u8, symbol: u8| segment(0xc4, &[&[class, 1][..], &[0; 15], &[symbol]].concat());
    let quantisers = segment(0xdb, &[&[0][..], &[1; 64]].concat());
    [vec![0xff, 0xd8], quantisers, segment(code, &frame), one_code(0, 0), one_code(0x10, symbol)].concat()
}

/// A scan of component 1: coefficients `first` to `last`, `bits` as higher and lower place, then
/// `data`.
fn scan(first: u8, last: u8, bits: u8, data: &[u8]) -> Vec<u8> {
    [&segment(0xda, &[1, 1, 0, first, last, bits])[..], data].concat()
}

/// A progressive grey JPEG of `side` x `side` pixels: the means, and `scans` - 1 scans that refine
/// nothing.
fn progressive(side: u16, scans: usize) -> Vec<u8> {
    let blocks = u32::from(side / 8).pow(2);
    let mut means = Bits::default();
    (0..blocks).for_each(|_| means.code(0, 1));
    // Runs of blocks without a coefficient: 2^14, and a number of 14 bits more.
    let mut runs = Bits::default();
    (0..blocks.div_ceil(1 << 14)).for_each(|_| runs.code(0, 1 + 14));
    let mut file = jpeg_start(0xc2, [side, side], 1, 0xe0);
    file.extend(scan(0, 0, 0x01, &means.jpeg()));
    let refined = scan(1, 63, 0x10, &runs.jpeg());
    (1..scans).for_each(|_| file.extend(&refined));
    file.extend([0xff, 0xd9]);
    file
}

#[test]
fn a_jpeg_of_the_most_scans_over_the_most_pixels_is_read_in_seconds() {
    let file = progressive(4096, JPEG_SCANS);
    assert!(file.len() < 40 << 10, "{}", file.len());
    let start = Instant::now();
    let image = decode_image(&file).unwrap();
    assert_eq!(image.data.len() as u64, IMAGE_PIXELS * 3);
    assert!(start.elapsed() < CEILING, "{:?}", start.elapsed());
}

#[test]
fn a_jpeg_of_more_scans_than_anyone_writes_is_refused_at_the_first_too_many() {
    let refused = |file: &[u8], at: usize| match decode_image(file).unwrap_err() {
        IoError::Malformed { what: "scan", place, expected, .. } => {
            assert_eq!((place, expected.as_str()), (Place::Byte(at as u64), "at most 100 scans"));
        }
        error => panic!("{error}"),
    };
    let end = |scans| progressive(4096, scans).len() - 2;
    refused(&progressive(4096, JPEG_SCANS + 1), end(JPEG_SCANS));
    refused(&progressive(4096, 100_000), end(JPEG_SCANS));
    // Baseline, one component of three in each scan: each may be a row of blocks once more.
    let mut baseline = jpeg_start(0xc0, [256, 65_528], 3, 0);
    let (first, empty) = (baseline.len(), scan(0, 63, 0, &[0]));
    (0..100_000).for_each(|_| baseline.extend(&empty));
    baseline.extend([0xff, 0xd9]);
    refused(&baseline, first + JPEG_SCANS * empty.len());
}

#[test]
fn a_baseline_jpeg_of_the_most_scans_over_the_most_pixels_ends_in_seconds() {
    let mut file = jpeg_start(0xc0, [256, 65_528], 3, 0);
    (0..JPEG_SCANS).for_each(|_| file.extend(scan(0, 63, 0, &[0])));
    file.extend([0xff, 0xd9]);
    let start = Instant::now();
    if let Ok(image) = decode_image(&file) {
        assert_eq!(image.size(), (65_528, 256));
    }
    assert!(start.elapsed() < CEILING, "{:?}", start.elapsed());
}

#[test]
fn a_progressive_jpeg_that_was_cut_or_flipped_anywhere_gives_an_error_or_an_image() {
    let file = progressive(16, 3);
    assert_eq!(decode_image(&file).unwrap().size(), (16, 16));
    for length in 0..file.len() {
        let error = decode_image(&file[..length]).unwrap_err();
        assert!(length < 3 || matches!(error, IoError::Truncated { .. }), "{length}: {error}");
    }
    for bit in 0..8 * file.len() {
        let mut flipped = file.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Ok(image) = decode_image(&flipped) {
            assert_eq!(image.data.len(), image.width * image.height * 3);
        }
    }
}
