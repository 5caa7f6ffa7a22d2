//! Bytes as images: a typed error, or as many pixels as the header says, within the limit.

use meissner_io::limits::IMAGE_PIXELS;
use meissner_io::{Image, decode_image, encode_png};

use crate::target::Verdict;

/// Pixels of images that are written and read again.
const REWRITTEN: usize = 1 << 16;

/// PNG, JPEG and PNM.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn image(bytes: &[u8]) -> Verdict {
    let image = match decode_image(bytes) {
        Ok(image) => image,
        Err(error) => {
            let message = error.to_string();
            assert!(message.contains("expected"), "{message}");
            return Verdict::Refused;
        }
    };
    let pixels = image.width * image.height;
    assert!((1..=IMAGE_PIXELS as usize).contains(&pixels), "{pixels} pixels");
    assert_eq!(image.data.len(), pixels * Image::CHANNELS);
    if pixels <= REWRITTEN {
        let png = encode_png(image.width, image.height, &image.data).expect("an image can be written");
        assert_eq!(decode_image(&png).expect("what was written can be read"), image);
    }
    Verdict::Accepted
}
