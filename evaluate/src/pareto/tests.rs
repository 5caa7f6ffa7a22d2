//! Times, errors and states of made-up measurements.

mod report {
    //! The Pareto front against a twin that compares all pairs; the fastest settings.

    use proptest::prelude::*;

    use crate::pareto::measurement::Measurement;
    use crate::pareto::report::{Compared, NetworkReport, SettingReport, fastest, pareto_front, summary};
    use crate::pareto::task_error::{ErrorKind, TaskError};

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
        assert!(
            summary.starts_with("own has a mean squared error of 0.1000 N^2 when it is exact:"),
            "{summary}"
        );
        assert!(
            summary.contains("within 5 % more nothing is faster; within 10 % more the fastest"),
            "{summary}"
        );
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
}

mod measurement {
    //! Times and errors.

    use std::time::Duration;

    use crate::pareto::measurement::{Differences, Lap, Timing, median};

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
}

mod state {
    //! Lines of a state of older programs.

    use meissner_run::journal::Line;

    use crate::pareto::{ErrorKind, Key, Measurement};

    /// A line from a program of the time before errors had a kind.
    const OLD: &str = r#"{"key":{"system":"digits","network":"digits-past","weights":"1","setting":"exact","data":"2","options":"3","version":"0.1.0"},"measurement":{"timed":10,"entered":1.0,"push_us":{"mean":1.0,"p50":1.0,"p99":2.0},"push_predict_us":{"mean":3.0,"p50":3.0,"p99":4.0},"exact_us":3.0,"ratio":1.0,"rows":4.5,"multiply_adds":1000.0,"numerical":{"max":0.0,"rms":0.0,"relative_rms":0.0,"max_by_tenth":[0.0],"rms_by_tenth":[0.0]},"task":[{"of":"split test","error":0.03,"interval_95":[0.02,0.05],"trials":1100,"trainings":1}]}}"#;

    #[test]
    fn a_line_of_an_older_program_has_errors_of_wrong_answers() {
        let line: Line<Key, Measurement> = serde_json::from_str(OLD).expect("it is whole");
        let task = &line.measurement.task[0];
        assert_eq!((task.kind, task.interval_95), (ErrorKind::WrongAnswers, Some((0.02, 0.05))));
        let again = serde_json::to_string(&line).expect("a line");
        assert_eq!(serde_json::from_str::<Line<Key, Measurement>>(&again).expect("it is whole"), line);
    }
}

mod task_error {
    use crate::pareto::task_error::{ErrorKind, TaskError};

    #[test]
    fn several_trainings_count_alike() {
        let task = TaskError::new("test", &[(1, 10), (3, 10)]).expect("asked");
        assert!((task.error - 0.2).abs() < 1e-12);
        assert_eq!((task.kind, task.trials, task.trainings), (ErrorKind::WrongAnswers, 10, 2));
        assert!(task.interval_95.is_some_and(|(low, high)| low < 0.2 && 0.2 < high));
        assert_eq!(TaskError::new("test", &[]), None);
        assert_eq!(TaskError::new("test", &[(0, 0)]), None);
    }

    #[test]
    fn the_interval_of_a_mean_is_that_of_its_presses_and_stays_where_errors_can_be() {
        // Means 1, 2 and 3 of presses: the deviation is 1, and t of 2 degrees of freedom 4.3027.
        let presses = vec![(2.0, 2), (4.0, 2), (6.0, 2)];
        let task =
            TaskError::mean("all", ErrorKind::SquaredForce, [(2.0, presses.clone())]).expect("figures");
        let (low, high) = task.interval_95.expect("three presses");
        assert!(low == 0.0 && (high - (2.0 + 4.302_652_73 / 3.0_f64.sqrt())).abs() < 1e-7, "{low} {high}");
        assert_eq!((task.error, task.trials, task.trainings), (2.0, 6, 1));
        let share = TaskError::mean("all", ErrorKind::OneMinusIou, [(0.9, vec![(0.8, 1), (1.0, 1)])]);
        assert_eq!(share.and_then(|share| share.interval_95).map(|(_, high)| high), Some(1.0));
        // The second training is exactly right: bounds are means, too.
        let both = [(2.0, presses), (0.0, vec![(0.0, 3), (0.0, 3)])];
        let task = TaskError::mean("all", ErrorKind::SquaredForce, both).expect("figures");
        assert!(
            task.error == 1.0 && task.interval_95.is_some_and(|both| (both.1 - high / 2.0).abs() < 1e-12)
        );
    }

    #[test]
    fn a_single_press_has_no_interval_and_no_picture_no_error() {
        let one = TaskError::mean("all", ErrorKind::AbsoluteForce, [(0.5, vec![(1.0, 2), (0.0, 0)])]);
        assert_eq!(one.map(|one| (one.error, one.interval_95)), Some((0.5, None)));
        assert_eq!(TaskError::mean("all", ErrorKind::AbsoluteForce, [(f64::NAN, vec![(0.0, 0)])]), None);
        assert_eq!(TaskError::mean("all", ErrorKind::AbsoluteForce, []), None);
    }

    #[test]
    fn an_error_that_states_no_kind_is_one_of_wrong_answers() {
        let old = r#"{"of":"test","error":0.25,"interval_95":[0.1,0.4],"trials":20,"trainings":1}"#;
        let task: TaskError = serde_json::from_str(old).expect("a line of an older program");
        assert_eq!((task.kind, task.interval_95), (ErrorKind::WrongAnswers, Some((0.1, 0.4))));
    }

    #[test]
    fn shares_are_shown_in_percent_and_forces_in_newtons() {
        assert_eq!(ErrorKind::OneMinusIou.text(0.1234), "12.34");
        assert_eq!(ErrorKind::SquaredForce.interval_text((0.01, 0.123_45)), "0.0100 to 0.1235");
        for kind in [ErrorKind::WrongAnswers, ErrorKind::SquaredForce, ErrorKind::AbsoluteForce] {
            assert!(kind.name().contains(&format!("({})", kind.unit())), "{kind:?}");
        }
    }
}

mod studies {
    use crate::pareto::measurement::spread;

    #[test]
    fn timed_recordings_are_far_apart_and_at_least_one() {
        let chosen = |chosen: &[usize], count: usize| spread(chosen, |_| 4, count);
        let all: Vec<usize> = (0..10).collect();
        assert_eq!(chosen(&all, 1), [5]);
        assert_eq!(chosen(&all, 8), [2, 7]);
        assert_eq!(chosen(&all, 1000), all);
        assert_eq!(chosen(&[3, 9], 5), [3, 9]);
    }
}
