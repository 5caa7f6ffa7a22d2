//! Figures of made-up answers, and folds against their definition.

mod judge {
    //! Figures of made-up answers.

    use proptest::prelude::*;

    use crate::events::judge::{Outcome, OverTime, correct_from, lower_median};
    use crate::judge::Figures;

    fn outcome(answers: &[usize], end_us: i64) -> Outcome {
        Outcome { answers: answers.to_vec(), logits: Vec::new(), end_us }
    }

    fn one(outcomes: &[(usize, Outcome)], times: usize) -> OverTime {
        let outcomes: Vec<_> = outcomes.iter().map(|(truth, outcome)| (*truth, outcome)).collect();
        OverTime::new(10, &outcomes, 10, times).unwrap()
    }

    #[test]
    fn after_its_end_a_recordings_last_answer_stands() {
        let one = one(&[(3, outcome(&[3, 1, 3], 25)), (4, outcome(&[4], 8))], 4);
        assert_eq!(one.accuracy_at, [1.0, 0.5, 1.0, 1.0]);
        assert_eq!((one.accuracy, one.confusion.hits()), (1.0, 2));
    }

    #[test]
    fn an_answer_settles_when_it_is_read_first_and_at_the_end_at_the_last_event() {
        let outcomes = [
            (3, outcome(&[3, 1, 3], 25)),
            (3, outcome(&[1, 3, 3], 25)),
            (3, outcome(&[3, 3, 3], 25)),
            (3, outcome(&[3, 3, 0], 25)),
        ];
        let one = one(&outcomes, 3);
        assert_eq!(one.settled, [Some(25), Some(20), Some(10), None]);
        assert_eq!(one.settled_us, Some(20));
    }

    #[test]
    fn half_are_over_at_the_lower_median() {
        assert_eq!(lower_median(vec![Some(4), None, Some(2)]), Some(4));
        assert_eq!(lower_median(vec![Some(4), None, Some(2), None]), Some(4));
        assert_eq!(lower_median(vec![None, None, Some(2)]), None);
        assert_eq!(lower_median(vec![]), None);
    }

    #[test]
    fn several_trainings_give_mean_and_deviation_and_the_mean_of_their_bounds() {
        let each = [&[1, 3][..], &[3, 3]].map(|answers| one(&[(3, outcome(answers, 15))], 2));
        let bounds = each[0].interval_95_at[0].0.midpoint(each[1].interval_95_at[0].0);
        let judged = OverTime::mean(&each.each_ref()).unwrap();
        assert_eq!((judged.accuracy_at[0].mean, judged.accuracy_at[0].std), (0.5, Some(0.5_f64.sqrt())));
        assert_eq!((judged.accuracy.mean, judged.recordings), (1.0, 1));
        assert!((judged.interval_95_at[0].0 - bounds).abs() < 1e-15);
        assert_eq!((judged.settled_us, judged.confusion.count(3, 3)), (Some(10), 2));
    }

    #[test]
    fn an_answer_that_is_right_for_a_while_has_not_settled_then() {
        assert_eq!(correct_from(&[3, 1, 3, 3], 3), Some(2));
        assert_eq!(correct_from(&[3, 3], 3), Some(0));
        assert_eq!(correct_from(&[3, 3, 1], 3), None);
        assert_eq!(correct_from(&[], 3), None);
    }

    proptest! {
        #[test]
        fn it_is_the_first_place_behind_which_nothing_is_wrong(
            answers in proptest::collection::vec(0..3_usize, 0..12)
        ) {
            let slow = (0..answers.len()).find(|&i| answers[i..].iter().all(|&answer| answer == 1));
            prop_assert_eq!(correct_from(&answers, 1), slow);
        }
    }
}

mod folds {
    //! Folds against their definition.

    use proptest::prelude::*;

    use crate::events::{folds, is_a_fold};

    #[test]
    fn recordings_are_dealt_class_after_class() {
        assert_eq!(folds(&[1, 0, 1, 0, 0, 1, 2], 2).unwrap(), [1, 0, 0, 1, 0, 1, 0]);
    }

    #[test]
    fn too_few_and_too_many_folds_are_refused() {
        for count in [0, 1, 4] {
            let error = folds(&[0, 0, 1], count).unwrap_err().to_string();
            assert!(error.contains("2 to 3") && error.ends_with(&format!("found {count}")), "{error}");
        }
    }

    #[test]
    fn a_fold_is_all_of_its_recordings_and_no_other() {
        let folds = [0, 1, 0, 1, 2];
        for chosen in [&[0, 2][..], &[1, 3], &[4]] {
            assert!(is_a_fold(chosen, 3, &folds).is_ok(), "{chosen:?}");
        }
        for (chosen, found) in [
            (
                &[0][..],
                "the 2 recordings of one fold of 3, as `meissner prepare` writes them with --folds 3, found 1",
            ),
            (&[0, 1], "found 2 recordings of 2 folds"),
            (&[], "found 0 recordings of 0 folds"),
        ] {
            let error = is_a_fold(chosen, 3, &folds).unwrap_err().to_string();
            assert!(error.contains(found), "{error}");
        }
    }

    /// Number of recordings of each fold, among those that `counts` accepts.
    fn sizes(folds: &[usize], count: usize, counts: impl Fn(usize) -> bool) -> Vec<usize> {
        let of_fold = |fold| (0..folds.len()).filter(|&i| folds[i] == fold && counts(i)).count();
        (0..count).map(of_fold).collect()
    }

    proptest! {
        #[test]
        fn no_two_folds_differ_by_more_than_one_recording_of_a_class_or_of_all(
            classes in proptest::collection::vec(0..4_usize, 2..60),
            part in 0.0..=1.0_f64,
        ) {
            let count = 2 + (part * (classes.len() - 2) as f64) as usize;
            let folds = folds(&classes, count).unwrap();
            let mut groups: Vec<Vec<usize>> =
                (0..4).map(|class| sizes(&folds, count, |i| classes[i] == class)).collect();
            groups.push(sizes(&folds, count, |_| true));
            for sizes in groups {
                let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
                prop_assert!(most - least <= 1, "{:?}", sizes);
            }
        }

        #[test]
        fn a_recordings_fold_is_its_place_in_the_order_of_class_and_index(
            classes in proptest::collection::vec(0..4_usize, 2..60),
        ) {
            let folds = folds(&classes, 2).unwrap();
            for (i, fold) in folds.into_iter().enumerate() {
                let before = (0..classes.len()).filter(|&j| (classes[j], j) < (classes[i], i)).count();
                prop_assert_eq!(fold, before % 2);
            }
        }
    }
}

mod events {
    use crate::events::late;
    use meissner_engine::Event;

    #[test]
    fn an_event_is_late_after_any_newer_one() {
        let events = [5, 3, 4, 5, 9].map(|t_us| Event::new(t_us, 0, 0, true));
        assert_eq!(late(&events), 2);
    }
}
