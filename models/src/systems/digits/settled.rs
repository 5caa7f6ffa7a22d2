//! How early an answer is right.

/// The first of `answers`, in order of time, from which on all are `truth`; `None` where the last is not, or there is
/// none. O(n).
pub fn settled(answers: &[usize], truth: usize) -> Option<usize> {
    let wrong = answers.iter().rposition(|&answer| answer != truth);
    let first = wrong.map_or(0, |last_wrong| last_wrong + 1);
    (first < answers.len()).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::settled;
    use proptest::prelude::*;

    #[test]
    fn an_answer_that_is_right_for_a_while_has_not_settled_then() {
        assert_eq!(settled(&[3, 1, 3, 3], 3), Some(2));
        assert_eq!(settled(&[3, 3], 3), Some(0));
        assert_eq!(settled(&[3, 3, 1], 3), None);
        assert_eq!(settled(&[], 3), None);
    }

    proptest! {
        #[test]
        fn it_is_the_first_place_behind_which_nothing_is_wrong(
            answers in proptest::collection::vec(0..3_usize, 0..12)
        ) {
            let slow = (0..answers.len()).find(|&i| answers[i..].iter().all(|&answer| answer == 1));
            prop_assert_eq!(settled(&answers, 1), slow);
        }
    }
}
