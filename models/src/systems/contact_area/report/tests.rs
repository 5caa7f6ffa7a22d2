use proptest::prelude::*;

use super::{ContactMeter, ContactReport, ContactSettings, RunningMedian, force_mae, iou};
use crate::systems::contact_area::{Centroid, ContactError, ImageSize, PixelSize};

fn settings(width: usize, height: usize) -> ContactSettings {
    ContactSettings::new(ImageSize { width, height }, PixelSize::new(0.5, 0.25).unwrap())
}

fn meter(width: usize, height: usize) -> ContactMeter {
    ContactMeter::new(settings(width, height)).unwrap()
}

#[test]
fn a_contact_is_counted_weighed_and_placed() {
    let mut meter = meter(3, 2);
    let report = meter.measure(&[0.0, 1.0, 0.0, -5.0, 1.0, 2.0]).unwrap();
    let expected = ContactReport {
        pixels: 3,
        area_mm2: 0.375,
        force_n: 4.0,
        median_force_n: 4.0,
        // (1 * 1 + 1 * 1 + 2 * 2) / 4 and (1 * 0 + 1 * 1 + 2 * 1) / 4.
        centroid: Some(Centroid { x_px: 1.5, y_px: 0.75, x_mm: 0.75, y_mm: 0.1875 }),
    };
    assert_eq!(report, expected);
    assert_eq!(meter.mask(), [false, true, false, false, true, true]);
}

#[test]
fn a_force_at_the_threshold_is_no_contact() {
    let above = f32::from_bits(1e-4_f32.to_bits() + 1);
    let report = meter(2, 1).measure(&[1e-4, above]).unwrap();
    assert_eq!((report.pixels, report.force_n), (1, f64::from(above)));
}

#[test]
fn without_a_contact_there_is_no_force_and_no_centroid() {
    let report = meter(2, 1).measure(&[1e-5, -1.0]).unwrap();
    assert_eq!((report.pixels, report.area_mm2, report.force_n, report.centroid), (0, 0.0, 0.0, None));
}

#[test]
fn the_median_of_five_passes_over_an_outlier() {
    let mut meter = meter(1, 1);
    let medians = [1.0, 1.0, 50.0, 2.0, 2.0, 3.0].map(|f| meter.measure(&[f]).unwrap().median_force_n);
    assert_eq!(medians, [1.0, 1.0, 1.0, 1.5, 2.0, 2.0]);
    meter.reset();
    assert_eq!(meter.mask(), [false]);
    assert_eq!(meter.measure(&[9.0]).unwrap().median_force_n, 9.0);
}

#[test]
fn a_map_that_is_refused_leaves_no_trace() {
    let mut meter = meter(2, 2);
    meter.measure(&[1.0, 0.0, 0.0, 0.0]).unwrap();
    let before = meter.clone();
    let error = meter.measure(&[2.0, 2.0, f32::NEG_INFINITY, 2.0]).unwrap_err().to_string();
    assert_eq!(error, "map of forces: expected finite values, found -inf at column 0, row 1");
    let error = meter.measure(&[2.0; 3]).unwrap_err();
    assert_eq!(error, ContactError::Length { what: "map of forces", expected: 4, found: 3 });
    assert_eq!(meter, before);
}

#[test]
fn settings_that_mean_nothing_are_refused() {
    for threshold_n in [-1e-4, f32::NAN, f32::INFINITY] {
        assert!(ContactMeter::new(ContactSettings { threshold_n, ..settings(1, 1) }).is_err());
    }
    assert!(ContactMeter::new(ContactSettings { median_window: 4, ..settings(1, 1) }).is_err());
    for (width, height) in [(0, 4), (4, 0), (usize::MAX, 2), (1 << 11, (1 << 11) + 1)] {
        assert!(ContactMeter::new(settings(width, height)).is_err(), "{width} {height}");
    }
    for (x_mm, y_mm) in [(0.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
        assert!(PixelSize::new(x_mm, y_mm).is_err(), "{x_mm} {y_mm}");
    }
}

proptest! {
    #[test]
    fn the_report_has_the_bits_of_the_plain_sums(
        width in 1_usize..6,
        forces in prop::collection::vec(-1e-3_f32..1e-3, 6..30),
    ) {
        let height = forces.len() / width;
        let forces = &forces[..width * height];
        let report = meter(width, height).measure(forces).unwrap();
        let contact: Vec<usize> = (0..forces.len()).filter(|&at| forces[at] > 1e-4).collect();
        let sum = |weight: &dyn Fn(usize) -> usize| {
            contact.iter().map(|&at| f64::from(forces[at]) * weight(at) as f64).fold(0.0, |a, b| a + b)
        };
        let total = sum(&|_| 1);
        prop_assert_eq!((report.pixels, report.force_n.to_bits()), (contact.len(), total.to_bits()));
        let place = report.centroid.map(|c| (c.x_px, c.y_px));
        let expected = (sum(&|at| at % width) / total, sum(&|at| at / width) / total);
        prop_assert_eq!(place, (!contact.is_empty()).then_some(expected));
    }
}

#[test]
fn an_outlier_does_not_pass() {
    let mut median = RunningMedian::new(5).unwrap();
    let found = [1.0, 2.0, 90.0, 3.0, 4.0, 5.0, 6.0].map(|value| median.push(value));
    assert_eq!(found, [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0]);
}

#[test]
fn a_window_of_one_gives_the_value_itself() {
    let mut median = RunningMedian::new(1).unwrap();
    assert_eq!([3.0, -1.0, 2.0].map(|value| median.push(value)), [3.0, -1.0, 2.0]);
}

#[test]
fn after_a_reset_nothing_is_remembered() {
    let mut median = RunningMedian::new(3).unwrap();
    for value in [7.0, 8.0, 9.0, 10.0] {
        median.push(value);
    }
    median.reset();
    assert_eq!([1.0, 2.0].map(|value| median.push(value)), [1.0, 1.5]);
}

#[test]
fn an_even_window_is_refused() {
    assert!(RunningMedian::new(0).is_err());
    assert!(RunningMedian::new(usize::MAX).is_err());
    let error = RunningMedian::new(4).unwrap_err().to_string();
    assert_eq!(error, "window of the running median: expected an odd number up to 65535, found 4");
}

proptest! {
    #[test]
    fn the_median_is_that_of_the_sorted_window(
        half in 0_usize..5,
        values in prop::collection::vec(prop_oneof![any::<f64>(), (-3_i8..3).prop_map(f64::from)], 0..40),
    ) {
        let window = 2 * half + 1;
        let mut median = RunningMedian::new(window).unwrap();
        for end in 1..=values.len() {
            let mut last = values[end.saturating_sub(window)..end].to_vec();
            last.sort_by(f64::total_cmp);
            let middle = last.len() / 2;
            let expected = if last.len() % 2 == 1 {
                last[middle]
            } else {
                last[middle - 1] / 2.0 + last[middle] / 2.0
            };
            prop_assert_eq!(median.push(values[end - 1]).to_bits(), expected.to_bits());
        }
    }
}

#[test]
fn the_iou_counts_common_pixels_over_all() {
    assert_eq!(iou(&[true, true, false, false], &[true, false, true, false]).unwrap(), 1.0 / 3.0);
    assert_eq!(iou(&[true, false], &[true, false]).unwrap(), 1.0);
    assert_eq!(iou(&[true, false], &[false, true]).unwrap(), 0.0);
}

#[test]
fn masks_without_a_contact_agree() {
    assert_eq!(iou(&[false; 3], &[false; 3]).unwrap(), 1.0);
    assert_eq!(iou(&[], &[]).unwrap(), 1.0);
}

#[test]
fn the_mae_is_the_mean_of_the_differences() {
    assert_eq!(force_mae(&[1.0, 2.0, -3.0, 0.0], &[1.5, 1.0, -3.0, 0.5]).unwrap(), 0.5);
}

#[test]
fn maps_of_different_lengths_and_empty_ones_are_refused() {
    let error = iou(&[true], &[true, true]).unwrap_err().to_string();
    assert_eq!(error, "mask: expected 2 values, found 1");
    assert!(force_mae(&[1.0], &[1.0, 2.0]).is_err());
    assert!(force_mae(&[], &[]).is_err());
}
