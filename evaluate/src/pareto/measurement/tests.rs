//! Times and errors.

use std::time::Duration;

use super::{Differences, Lap, Timing, median};

#[test]
fn equal_values_have_no_error() {
    let mut differences = Differences::default();
    (0..7).for_each(|place| differences.add((place, 7), &[1.5, -2.0], &[1.5, -2.0]));
    let numerical = differences.finish();
    assert_eq!((numerical.max, numerical.rms, numerical.relative_rms), (0.0, 0.0, Some(0.0)));
}

#[test]
fn an_error_shows_in_its_tenth_of_the_stream() {
    let mut differences = Differences::default();
    (0..20).for_each(|place| {
        let found = if place == 19 { 5.0 } else { 2.0 };
        differences.add((place, 20), &[2.0], &[found]);
    });
    let numerical = differences.finish();
    assert_eq!(numerical.max, 3.0);
    assert!((numerical.rms - (9.0_f64 / 20.0).sqrt()).abs() < 1e-12);
    assert!((numerical.compared() - (9.0_f64 / 80.0).sqrt()).abs() < 1e-12);
    assert_eq!(numerical.max_by_tenth[..9], [Some(0.0); 9]);
    assert!(numerical.rms_by_tenth[9].is_some_and(|rms| (rms - 4.5_f64.sqrt()).abs() < 1e-12));
}

#[test]
fn a_share_of_nothing_is_none_and_a_tenth_without_values_too() {
    let mut differences = Differences::default();
    differences.add((0, 1), &[0.0], &[0.5]);
    let numerical = differences.finish();
    assert_eq!((numerical.relative_rms, numerical.compared()), (None, 0.5));
    assert_eq!(numerical.rms_by_tenth[1..], [None; 9]);
}
fn lap(times_us: &[u64]) -> Lap {
    times_us.iter().map(|&us| Duration::from_micros(us)).map(|us| (us / 2, us)).collect()
}

#[test]
fn an_interruption_of_one_repeat_changes_no_figure() {
    let laps = [
        (lap(&[10, 20]), lap(&[20, 9000])),
        (lap(&[7000, 20]), lap(&[20, 40])),
        (lap(&[10, 8000]), lap(&[9000, 40])),
    ];
    let timing = Timing::of(&laps);
    assert!((timing.ratio - 0.5).abs() < 1e-9, "{timing:?}");
    assert!((timing.push_predict_us.mean - 15.0).abs() < 1e-9 && (timing.exact_us - 30.0).abs() < 1e-9);
    assert!((timing.push_us.mean - 7.5).abs() < 1e-9);
}

#[test]
fn the_median_of_two_is_between_them() {
    let of = |times: &[u64]| median(times.iter().map(|&us| Duration::from_micros(us)).collect());
    assert_eq!([of(&[3, 1, 2]), of(&[4, 2]), of(&[])], [2, 3, 0].map(Duration::from_micros));
}
