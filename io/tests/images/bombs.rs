//! Small files that ask for much: streams that unpack to gigabytes, scans without number.

use std::time::{Duration, Instant};

use meissner_io::limits::{IMAGE_PIXELS, JPEG_SCANS};
use meissner_io::{IoError, Place, decode_image};

use crate::support::{Ihdr, chunk, png_with};

/// Longest time that an input may take; far more than any input here needs.
const CEILING: Duration = Duration::from_secs(10);

/// Bits, the first in the lowest place of a byte (deflate) or in the highest (JPEG).
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

/// A zlib stream of `bytes` zeros or a few more: one literal, and copies of 258 bytes of 13 bits each.
fn zlib_bomb(bytes: usize) -> Vec<u8> {
    let mut bits = Bits::default();
    // The last block, of fixed codes (the two bits of its type come lowest first).
    bits.code(0b110, 3);
    bits.code(0x30, 8);
    (0..16).for_each(|_| bits.code(0b1100_0101 << 5, 13));
    let start = bits.deflate();
    // Eight copies are 13 bytes, wherever they are taken from.
    let repeated = start[2..15].repeat(bytes / (8 * 258) + 1);
    // The rest of a copy, the end of the block, and room for a checksum.
    [&[0x78, 0x9c][..], &start[..2], &repeated, &start[2..3], &[0; 8]].concat()
}

#[test]
fn compressed_text_and_profiles_of_a_png_are_not_unpacked() {
    // Unpacked, each would be beyond what the decoder holds of all chunks together.
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

/// The start of a JPEG of `sides` (height, width) and `components` without subsampling: frame marker `code`, quantisers
/// of 1, a code of 1 bit for a mean like the one before, and one of 1 bit for AC symbol `symbol`.
fn jpeg_start(code: u8, [height, width]: [u16; 2], components: u8, symbol: u8) -> Vec<u8> {
    let [[h1, h0], [w1, w0]] = [height.to_be_bytes(), width.to_be_bytes()];
    let mut frame = vec![8, h1, h0, w1, w0, components];
    (1..=components).for_each(|component| frame.extend([component, 0x11, 0]));
    let one_code = |class: u8, symbol: u8| segment(0xc4, &[&[class, 1][..], &[0; 15], &[symbol]].concat());
    let quantisers = segment(0xdb, &[&[0][..], &[1; 64]].concat());
    [vec![0xff, 0xd8], quantisers, segment(code, &frame), one_code(0, 0), one_code(0x10, symbol)].concat()
}

/// A scan of component 1: coefficients `first` to `last`, `bits` as higher and lower place, then `data`.
fn scan(first: u8, last: u8, bits: u8, data: &[u8]) -> Vec<u8> {
    [&segment(0xda, &[1, 1, 0, first, last, bits])[..], data].concat()
}

/// A progressive grey JPEG of `side` x `side` pixels: the means, and `scans` - 1 scans that refine nothing.
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
