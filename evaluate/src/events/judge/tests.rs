//! Figures of made-up answers.

use proptest::prelude::*;

use super::{Outcome, OverTime, correct_from, lower_median};
use crate::judged::Figures;

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
