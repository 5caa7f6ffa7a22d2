use proptest::prelude::*;

use super::{DifferenceBaseline, DifferenceSettings};
use crate::systems::contact_area::{Centroid, ImageSize, PixelSize};

fn settings(width: usize, height: usize, threshold: f32, blur_radius: usize) -> DifferenceSettings {
    let pixel = PixelSize::new(0.5, 0.25).unwrap();
    DifferenceSettings { size: ImageSize { width, height }, pixel, threshold, blur_radius }
}

#[test]
fn without_a_blur_each_pixel_stands_for_itself() {
    let mut baseline = DifferenceBaseline::new(&[10; 12], settings(2, 2, 10.0, 0)).unwrap();
    // Differences of 10 (which does not exceed the threshold), 11, 0 and 40 levels.
    let report = baseline.measure(&[20, 0, 20, 43, 10, 10, 10, 10, 10, 50, 50, 50]).unwrap();
    assert_eq!(baseline.difference(), [10.0, 11.0, 0.0, 40.0]);
    assert_eq!(baseline.mask(), [false, true, false, true]);
    let centroid = Some(Centroid { x_px: 1.0, y_px: 0.5, x_mm: 0.5, y_mm: 0.125 });
    assert_eq!((report.pixels, report.area_mm2, report.centroid), (2, 0.25, centroid));
}

#[test]
fn a_blur_spreads_a_difference_over_its_box() {
    let mut image = [0; 15];
    image[6..9].fill(90);
    let mut baseline = DifferenceBaseline::new(&[0; 15], settings(5, 1, 29.0, 1)).unwrap();
    let report = baseline.measure(&image).unwrap();
    assert_eq!(baseline.difference(), [0.0, 30.0, 30.0, 30.0, 0.0]);
    assert_eq!((report.pixels, report.centroid.map(|c| c.x_px)), (3, Some(2.0)));
}

#[test]
fn at_the_border_the_box_is_cut() {
    let mut baseline = DifferenceBaseline::new(&[0; 12], settings(2, 2, 255.0, 1)).unwrap();
    baseline.measure(&[40, 40, 40, 0, 0, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(baseline.difference(), [10.0; 4]);
}

#[test]
fn the_reference_itself_is_no_contact() {
    let mut baseline = DifferenceBaseline::new(&[7; 12], settings(2, 2, 0.0, 9)).unwrap();
    let report = baseline.measure(&[7; 12]).unwrap();
    assert_eq!((report.pixels, report.area_mm2, report.centroid), (0, 0.0, None));
}

#[test]
fn what_does_not_fit_is_refused() {
    assert!(DifferenceBaseline::new(&[0; 11], settings(2, 2, 1.0, 0)).is_err());
    assert!(DifferenceBaseline::new(&[], settings(0, 2, 1.0, 0)).is_err());
    assert!(DifferenceBaseline::new(&[], settings(usize::MAX, 2, 1.0, 0)).is_err());
    for threshold in [-1.0, 256.0, f32::NAN] {
        assert!(DifferenceBaseline::new(&[0; 12], settings(2, 2, threshold, 0)).is_err());
    }
    let mut baseline = DifferenceBaseline::new(&[0; 12], settings(2, 2, 1.0, 0)).unwrap();
    let error = baseline.measure(&[0; 13]).unwrap_err().to_string();
    assert_eq!(error, "image (3 bytes a pixel): expected 12 values, found 13");
}

proptest! {
    #[test]
    fn running_sums_have_the_bits_of_summing_every_box(
        (width, height, images) in (1_usize..8, 1_usize..8).prop_flat_map(|(w, h)| {
            (Just(w), Just(h), prop::collection::vec(any::<[u8; 2]>(), w * h * 3))
        }),
        radius in 0_usize..10,
    ) {
        let (image, reference): (Vec<u8>, Vec<u8>) = images.into_iter().map(<(u8, u8)>::from).unzip();
        let mut baseline =
            DifferenceBaseline::new(&reference, settings(width, height, 80.0, radius)).unwrap();
        // Nothing of an image before stays.
        baseline.measure(&reference).unwrap();
        let report = baseline.measure(&image).unwrap();
        let mut pixels = 0;
        for y in 0..height {
            for x in 0..width {
                let mut values = Vec::new();
                for v in (0..height).filter(|v| v.abs_diff(y) <= radius) {
                    for u in (0..width).filter(|u| u.abs_diff(x) <= radius) {
                        let at = (v * width + u) * 3;
                        values.extend((at..at + 3).map(|i| u32::from(image[i].abs_diff(reference[i]))));
                    }
                }
                let mean = (f64::from(values.iter().sum::<u32>()) / values.len() as f64) as f32;
                prop_assert_eq!(baseline.difference()[y * width + x].to_bits(), mean.to_bits());
                prop_assert_eq!(baseline.mask()[y * width + x], mean > 80.0);
                pixels += usize::from(mean > 80.0);
            }
        }
        prop_assert_eq!(report.pixels, pixels);
    }
}
