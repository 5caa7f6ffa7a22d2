//! Pictures of balls: arrays in a `NumPy` archive.

use std::error::Error;

use meissner_io::datasets::BallPictures;

use crate::packed::zip;
use crate::shared_files::shared;

/// A file of version 1 with this type and shape.
fn npy(descr: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values);
    bytes
}

/// Two pictures of 2 x 1 pixels.
fn arrays() -> [(&'static str, Vec<u8>); 4] {
    let difference: [i16; 12] = [5, -5, 0, 250, -250, 1, 0, 0, 0, 0, 0, 7];
    let circle = [1.0_f64, 0.5, 2.0, 0.0, 0.25, 3.0];
    let bytes = |values: &[i16]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>();
    let circle: Vec<u8> = circle.iter().flat_map(|value| value.to_le_bytes()).collect();
    [
        ("background.npy", npy("|u1", "(1, 2, 3)", &[10, 20, 30, 40, 50, 60])),
        ("difference.npy", npy("<i2", "(2, 1, 2, 3)", &bytes(&difference))),
        ("circle.npy", npy("<f8", "(2, 3)", &circle)),
        ("notes.txt", b"not an array".to_vec()),
    ]
}

fn read(arrays: &[(&str, Vec<u8>)]) -> Result<BallPictures, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("balls.npz");
    std::fs::write(&path, zip(arrays.iter().map(|(name, content)| (*name, content.clone())))).unwrap();
    BallPictures::read(&path).map_err(|error| {
        let mut message = error.to_string();
        let mut source = error.source();
        while let Some(inner) = source {
            message = format!("{message}: {inner}");
            source = inner.source();
        }
        message
    })
}

#[test]
fn a_picture_is_the_background_and_the_difference_between_black_and_white() {
    let read = read(&arrays()).unwrap();
    assert_eq!((read.width, read.height), (2, 1));
    assert_eq!(read.background, [10, 20, 30, 40, 50, 60]);
    let pictures: Vec<_> = read.balls.iter().map(|ball| ball.picture.clone()).collect();
    assert_eq!(pictures, [[15, 15, 30, 255, 0, 61], [10, 20, 30, 40, 50, 67]]);
    assert_eq!(read.balls[1].circle, [0.0, 0.25, 3.0]);
}

#[test]
fn arrays_that_are_missing_or_do_not_fit_are_refused() {
    for missing in 0..3 {
        let left: Vec<_> =
            arrays().into_iter().enumerate().filter(|(i, _)| *i != missing).map(|(_, array)| array).collect();
        let name = arrays()[missing].0.trim_end_matches(".npy");
        let message = read(&left).unwrap_err();
        assert!(message.contains(&format!("expected an array {name}, found none")), "{message}");
    }
    let with = |index: usize, content: Vec<u8>| {
        let mut arrays = arrays();
        arrays[index].1 = content;
        read(&arrays).unwrap_err()
    };
    let message = with(0, npy("|u1", "(2, 1, 3)", &[0; 6]));
    assert!(message.contains("[2, 1, 3], [2, 1, 2, 3], [2, 3]"), "{message}");
    assert!(with(0, npy("|u1", "(1, 2, 3)", &[0; 5])).contains("6 bytes of the shape [1, 2, 3]"));
    let message = with(1, npy("<f4", "(2, 1, 2, 3)", &[0; 48]));
    assert!(message.contains("the type <i2 before this") && message.contains("<f4"), "{message}");
    let infinite = [f64::INFINITY; 6].iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>();
    assert!(with(2, npy("<f8", "(2, 3)", &infinite)).contains("expected finite circles, found inf"));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_published_pictures_have_their_circles_inside() {
    let balls = BallPictures::read(shared("data/gelsight/balls.npz")).unwrap();
    assert_eq!((balls.width, balls.height, balls.balls.len()), (120, 160, 30));
    for ball in &balls.balls {
        let [column, row, radius] = ball.circle;
        assert!((radius..120.0 - radius).contains(&column) && (radius..160.0 - radius).contains(&row));
        assert_ne!(ball.picture, balls.background);
    }
}
