//! Raw video: pictures without headers.

use std::io::{self, Read};

use meissner_io::limits::IMAGE_PIXELS;
use meissner_io::{Image, IoError, PixelFormat, Place, RawVideo, VideoFormat};
use proptest::prelude::*;

/// A reader that gives at most `most` bytes at once, is interrupted between them, and may fail at
/// the end.
struct Pieces<'a> {
    bytes: &'a [u8],
    most: usize,
    interrupted: bool,
    fails: bool,
}

impl Read for Pieces<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.interrupted = !self.interrupted;
        if self.interrupted {
            return Err(io::ErrorKind::Interrupted.into());
        }
        if self.bytes.is_empty() && self.fails {
            return Err(io::Error::other("unplugged"));
        }
        let most = self.most.min(into.len());
        self.bytes.read(&mut into[..most])
    }
}

fn format(width: u64, height: u64, pixels: PixelFormat) -> VideoFormat {
    VideoFormat::new(width, height, pixels).expect("a size that can be read")
}

fn pictures(bytes: &[u8], format: VideoFormat) -> Vec<Result<Image, IoError>> {
    RawVideo::new(bytes, format).collect()
}

#[test]
fn red_green_and_blue_stand_where_the_pixel_format_says() {
    for (name, bytes, expected) in [
        ("rgb24", &[1, 2, 3, 4, 5, 6][..], [1, 2, 3, 4, 5, 6]),
        ("bgr24", &[1, 2, 3, 4, 5, 6], [3, 2, 1, 6, 5, 4]),
        ("gray8", &[7, 9], [7, 7, 7, 9, 9, 9]),
        ("gray", &[7, 9], [7, 7, 7, 9, 9, 9]),
    ] {
        let format = format(1, 2, name.parse().expect("a pixel format"));
        assert_eq!(format.bytes(), bytes.len(), "{name}");
        let read = pictures(bytes, format);
        let [Ok(image)] = &read[..] else { panic!("{name}: {read:?}") };
        assert_eq!((image.size(), &image.data[..]), ((1, 2), &expected[..]), "{name}");
    }
    let refused = "yuv420p".parse::<PixelFormat>().expect_err("it has no bytes of a pixel").to_string();
    assert!(refused.contains("rgb24, bgr24 or gray8") && refused.contains("yuv420p"), "{refused}");
}

#[test]
fn a_size_without_pixels_or_beyond_the_limit_is_refused_before_anything_is_allocated() {
    for (width, height) in [(0, 0), (0, 240), (320, 0)] {
        let error = VideoFormat::new(width, height, PixelFormat::Rgb24).expect_err("no pixels");
        assert!(matches!(error, IoError::Unsupported { .. }), "{error}");
        assert!(error.to_string().contains(&format!("{width}x{height}")), "{error}");
    }
    for (width, height) in [(IMAGE_PIXELS + 1, 1), (u64::MAX, u64::MAX), (1 << 32, 1 << 32), (4097, 4096)] {
        let error = VideoFormat::new(width, height, PixelFormat::Gray8).expect_err("too many pixels");
        assert!(matches!(error, IoError::TooLarge { limit: IMAGE_PIXELS, .. }), "{error}");
    }
    assert_eq!(format(4096, 4096, PixelFormat::Rgb24).bytes(), 3 << 24);
}

#[test]
fn an_input_without_a_whole_picture_is_an_error() {
    let format = format(2, 2, PixelFormat::Rgb24);
    for bytes in [&[][..], &[1; 11]] {
        let read = pictures(bytes, format);
        let [Err(IoError::Truncated { place: Place::Byte(0), expected: 12, actual, .. })] = read[..] else {
            panic!("{read:?}")
        };
        assert_eq!(actual, bytes.len() as u64);
    }
}

#[test]
fn a_reader_that_fails_is_an_error_with_its_place_after_the_pictures_before_it() {
    let input = Pieces { bytes: &[5; 29], most: 7, interrupted: false, fails: true };
    let read: Vec<_> = RawVideo::new(input, format(2, 2, PixelFormat::Rgb24)).collect();
    let [Ok(_), Ok(_), Err(IoError::Stream { place: Place::Byte(29), .. })] = &read[..] else {
        panic!("{read:?}")
    };
}

proptest! {
    #[test]
    fn any_bytes_in_any_pieces_are_their_whole_pictures_and_then_a_rest(
        bytes in prop::collection::vec(any::<u8>(), 0..400),
        (width, height) in (1..7_u64, 1..7_u64),
        most in 1..60_usize,
        grey in any::<bool>(),
    ) {
        let format = format(width, height, if grey { PixelFormat::Gray8 } else { PixelFormat::Rgb24 });
        let input = Pieces { bytes: &bytes, most, interrupted: false, fails: false };
        let mut read: Vec<_> = RawVideo::new(input, format).collect();
        let (whole, rest) = (bytes.len() / format.bytes(), bytes.len() % format.bytes());
        if rest > 0 || whole == 0 {
            let refused = read.pop().expect("an item about the rest");
            let Err(IoError::Truncated { place: Place::Byte(place), actual, .. }) = refused else {
                panic!("{refused:?}")
            };
            prop_assert_eq!((place as usize, actual as usize), (bytes.len() - rest, rest));
        }
        prop_assert_eq!(read.len(), whole);
        for (image, bytes) in read.into_iter().zip(bytes.chunks(format.bytes())) {
            let channels = if grey { 3 } else { 1 };
            let expected: Vec<u8> = bytes.iter().flat_map(|&byte| vec![byte; channels]).collect();
            prop_assert_eq!(image.expect("it is whole").data, expected);
        }
    }
}
