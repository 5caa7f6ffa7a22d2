//! The Pareto front against a twin that compares all pairs; the fastest settings.

use proptest::prelude::*;

use super::{Compared, ErrorKind, Measurement, NetworkReport, SettingReport, fastest, pareto_front, summary};
use crate::pareto::task_error::TaskError;

/// Every point against every other.
fn slow(points: &[(f64, f64)]) -> Vec<usize> {
    let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    (0..points.len()).filter(|&i| !points.iter().any(|&other| beats(other, points[i]))).collect()
}

#[test]
fn a_slower_point_with_the_same_error_is_beaten() {
    assert_eq!(pareto_front(&[(2.0, 0.1), (1.0, 0.1), (0.5, 0.2), (0.5, 0.3)]), [2, 1]);
}

#[test]
fn equal_points_are_all_on_the_front() {
    assert_eq!(pareto_front(&[(1.0, 0.1), (1.0, 0.1), (2.0, 0.2)]), [0, 1]);
}

#[test]
fn what_is_no_number_is_left_out() {
    assert_eq!(pareto_front(&[(f64::NAN, 0.0), (1.0, f64::INFINITY), (3.0, 3.0)]), [2]);
    assert_eq!(pareto_front(&[]), [0_usize; 0]);
}

proptest! {
    #[test]
    fn it_is_what_no_other_point_beats(
        // Few values, so that many are equal.
        points in proptest::collection::vec((0..8_u8, 0..8_u8), 0..40)
    ) {
        let points: Vec<(f64, f64)> =
            points.into_iter().map(|(time, error)| (f64::from(time) - 3.0, f64::from(error) / 3.0)).collect();
        let mut fast = pareto_front(&points);
        prop_assert!(fast.windows(2).all(|pair| points[pair[0]].0 <= points[pair[1]].0));
        fast.sort_unstable();
        prop_assert_eq!(fast, slow(&points));
    }
}

fn setting(name: &str, speed_up: f64, error: f64) -> SettingReport {
    let measurement = Measurement::default();
    let (setting, us) = (name.to_owned(), 10.0 / speed_up);
    SettingReport { setting, us, speed_up, error, interval_95: None, on_front: false, measurement }
}

fn network() -> NetworkReport {
    let settings = vec![
        setting("exact", 1.0, 0.1),
        setting("as fast", 1.01, 0.1),
        setting("at the bound", 2.0, 0.11),
        setting("beyond", 3.0, 0.1301),
    ];
    let text = |text: &str| text.to_owned();
    NetworkReport { network: text("own"), weights: text("drawn"), fingerprint: text("0"), settings }
}

#[test]
fn the_fastest_setting_is_one_whose_error_is_within_the_bound() {
    let networks = [network()];
    let fastest = fastest(&networks, Compared::Task(ErrorKind::WrongAnswers));
    let names: Vec<&str> = fastest.iter().map(|fastest| fastest.setting.as_str()).collect();
    assert_eq!(names, ["exact", "at the bound", "at the bound"]);
    let summary = summary(&networks, &fastest, Compared::Task(ErrorKind::WrongAnswers));
    assert!(summary.starts_with("own is wrong in 10.00 % of its answers when it is exact:"), "{summary}");
    assert!(summary.contains("within 0.5 points nothing is faster; within 1 points"), "{summary}");
    assert!(summary.contains("the fastest is at the bound, 2.00 times as fast (11.00 %)"), "{summary}");
}

#[test]
fn bounds_of_an_error_in_a_unit_of_its_own_are_shares_of_it() {
    let networks = [network()];
    let compared = Compared::Task(ErrorKind::SquaredForce);
    let fastest = fastest(&networks, compared);
    // 0.11 is 10 % above 0.1, 0.1301 is 30.1 % above it.
    let names: Vec<&str> = fastest.iter().map(|fastest| fastest.setting.as_str()).collect();
    assert_eq!(names, ["exact", "at the bound", "at the bound"]);
    assert!((fastest[2].within - 0.025).abs() < 1e-12);
    let summary = summary(&networks, &fastest, compared);
    assert!(summary.starts_with("own has a mean squared error of 0.1000 N^2 when it is exact:"), "{summary}");
    assert!(summary.contains("within 5 % more nothing is faster; within 10 % more the fastest"), "{summary}");
    assert!(summary.contains("2.00 times as fast (0.1100 N^2)"), "{summary}");
}

#[test]
fn settings_are_compared_by_the_first_error_that_all_of_them_have() {
    let task = |kind| TaskError::mean("all", kind, [(0.5, vec![(1.0, 2)])]).expect("figures");
    let networks = |kinds: &[&[ErrorKind]]| {
        let mut network = network();
        for (setting, kinds) in network.settings.iter_mut().zip(kinds) {
            setting.measurement.task = kinds.iter().map(|&kind| task(kind)).collect();
        }
        network.settings.truncate(kinds.len());
        Compared::of(&[network])
    };
    let (iou, force) = (ErrorKind::OneMinusIou, ErrorKind::AbsoluteForce);
    assert_eq!(networks(&[&[iou, force], &[iou, force]]), Compared::Task(iou));
    assert_eq!(networks(&[&[iou, force], &[force]]), Compared::RelativeRms);
    assert_eq!(networks(&[&[iou], &[]]), Compared::RelativeRms);
    let word = |compared| serde_json::to_string(&compared).expect("a word");
    assert_eq!(word(Compared::Task(force)), "\"task_error\"");
    assert_eq!(word(Compared::RelativeRms), "\"relative_rms\"");
}
