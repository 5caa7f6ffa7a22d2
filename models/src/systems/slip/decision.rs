//! A decision that stands until several windows in a row agree on another class.
//!
//! Enters: for one window after the other, its most probable class and that class's probability. Leaves: the decision
//! that stands behind each window. A window votes for its class where the probability is at least `least_probability`;
//! the decision is the class of the newest `hold` windows in a row that all voted for one class. There is none before
//! the first such run, so that no decision ever rests on fewer windows.
//!
//! Invariant: `run` counts the newest windows in a row that voted for `candidate`, up to `hold`.

use thiserror::Error;

/// Why a filter cannot be made.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum DecisionError {
    /// No window would have to agree.
    #[error("windows that have to agree: expected at least 1, found {found}")]
    Hold {
        /// What was asked for.
        found: u32,
    },
    /// No probability.
    #[error("least probability of a window that votes: expected 0 to 1, found {found}")]
    LeastProbability {
        /// What was asked for.
        found: f32,
    },
}

/// What has been decided, and for how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// Index of the class.
    pub class: usize,
    /// Windows for which it has stood, the one that made it included: at least 1.
    pub held: u64,
}

/// Holds a decision until `hold` windows in a row vote for another class.
///
/// The first decision, too, needs `hold` windows in a row that agree. A window whose largest probability is below the
/// least one, or NaN, does not vote: the decision stands, and a run of windows that agree ends, because a run is to say
/// that each of the last `hold` windows was sure of one class. A window takes O(1), and nothing is allocated.
///
/// ```
/// use meissner_models::systems::slip::DecisionFilter;
///
/// let mut filter = DecisionFilter::new(2, 0.5)?;
/// let windows = [(3, 0.9), (3, 0.8), (5, 0.9), (3, 0.7), (5, 0.9), (5, 0.6)];
/// let classes = windows.map(|(class, probability)| filter.push(class, probability).map(|d| d.class));
/// assert_eq!(classes, [None, Some(3), Some(3), Some(3), Some(3), Some(5)]);
/// # Ok::<(), meissner_models::systems::slip::DecisionError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionFilter {
    hold: u32,
    least_probability: f32,
    standing: Option<Decision>,
    candidate: usize,
    run: u32,
}

impl DecisionFilter {
    /// A filter without a decision. With a `hold` of 1 and a `least_probability` of 0 each window decides.
    ///
    /// # Errors
    /// A `hold` of 0; a `least_probability` that is not from 0 to 1.
    pub fn new(hold: u32, least_probability: f32) -> Result<Self, DecisionError> {
        if hold == 0 {
            return Err(DecisionError::Hold { found: hold });
        }
        if !(0.0..=1.0).contains(&least_probability) {
            return Err(DecisionError::LeastProbability { found: least_probability });
        }
        Ok(Self { hold, least_probability, standing: None, candidate: 0, run: 0 })
    }

    /// Takes the most probable class of the next window and its probability; the decision behind it, where there is
    /// one.
    pub fn push(&mut self, class: usize, probability: f32) -> Option<Decision> {
        if probability >= self.least_probability {
            let agrees = self.run > 0 && self.candidate == class;
            self.run = if agrees { self.hold.min(self.run.saturating_add(1)) } else { 1 };
            self.candidate = class;
        } else {
            self.run = 0;
        }
        if let Some(standing) = &mut self.standing {
            standing.held = standing.held.saturating_add(1);
        }
        if self.run == self.hold && self.standing.is_none_or(|standing| standing.class != self.candidate) {
            self.standing = Some(Decision { class: self.candidate, held: 1 });
        }
        self.standing
    }

    /// Forgets the decision and every window: as after [`Self::new`].
    pub fn reset(&mut self) {
        self.standing = None;
        self.candidate = 0;
        self.run = 0;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{Decision, DecisionError, DecisionFilter};

    /// Class and windows held behind each window.
    fn decisions(hold: u32, least: f32, windows: &[(usize, f32)]) -> Vec<Option<(usize, u64)>> {
        let mut filter = DecisionFilter::new(hold, least).unwrap();
        let decision = |&(class, probability): &(usize, f32)| filter.push(class, probability);
        windows.iter().map(decision).map(|d| d.map(|Decision { class, held }| (class, held))).collect()
    }

    #[test]
    fn with_a_hold_of_1_every_window_decides() {
        let windows = [(4, 0.2), (4, 0.9), (1, 0.3), (4, 0.3)];
        assert_eq!(decisions(1, 0.0, &windows), [(4, 1), (4, 2), (1, 1), (4, 1)].map(Some));
    }

    #[test]
    fn the_first_decision_too_needs_windows_that_agree() {
        let windows = [(2, 1.0), (0, 1.0), (0, 1.0), (0, 1.0)];
        assert_eq!(decisions(3, 0.0, &windows), [None, None, None, Some((0, 1))]);
    }

    #[test]
    fn windows_of_another_class_that_do_not_follow_each_other_change_nothing() {
        let windows = [0, 0, 1, 0, 1, 2, 1, 2, 0].map(|class| (class, 1.0));
        let last = decisions(2, 0.0, &windows).pop().flatten();
        assert_eq!(last, Some((0, 8)));
    }

    #[test]
    fn a_window_that_does_not_vote_keeps_the_decision_and_ends_a_run() {
        let windows = [(0, 0.9), (0, 0.5), (1, 0.9), (1, 0.4), (1, 0.9), (1, f32::NAN), (1, 0.9), (1, 0.9)];
        let expected = [None, Some(0), Some(0), Some(0), Some(0), Some(0), Some(0), Some(1)];
        let classes: Vec<Option<usize>> =
            decisions(2, 0.5, &windows).into_iter().map(|d| d.map(|d| d.0)).collect();
        assert_eq!(classes, expected);
    }

    #[test]
    fn after_a_reset_nothing_is_remembered() {
        let mut filter = DecisionFilter::new(2, 0.0).unwrap();
        let fresh = filter.clone();
        filter.push(2, 1.0);
        filter.reset();
        assert_eq!((filter.push(0, 1.0), filter.push(0, 1.0)), (None, Some(Decision { class: 0, held: 1 })));
        filter.push(2, 1.0);
        filter.reset();
        assert_eq!(filter, fresh);
    }

    #[test]
    fn settings_that_make_no_sense_are_refused() {
        assert_eq!(DecisionFilter::new(0, 0.5), Err(DecisionError::Hold { found: 0 }));
        for least in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
            let error = DecisionFilter::new(1, least).unwrap_err().to_string();
            let expected = "least probability of a window that votes: expected 0 to 1, found ";
            assert_eq!(error, format!("{expected}{least}"));
        }
        assert!(DecisionFilter::new(u32::MAX, 1.0).is_ok());
    }

    /// The decision behind the last of `votes`: the class of the newest `hold` votes in a row that are equal.
    fn decided(hold: usize, votes: &[Option<usize>]) -> Option<usize> {
        let agree =
            |run: &[Option<usize>]| run.iter().all(|vote| *vote == run[0]).then_some(run[0]).flatten();
        votes.windows(hold).rev().find_map(agree)
    }

    proptest! {
        #[test]
        fn the_decision_is_that_of_the_newest_run_in_the_whole_history(
            hold in 1_u32..5,
            least in prop_oneof![Just(0.0_f32), Just(0.5), Just(1.0)],
            windows in prop::collection::vec(
                (0_usize..3, prop_oneof![6 => Just(1.0_f32), 1 => 0.0_f32..=1.0, 1 => Just(f32::NAN)]),
                0..60,
            ),
        ) {
            let votes: Vec<Option<usize>> =
                windows.iter().map(|&(class, probability)| (probability >= least).then_some(class)).collect();
            let behind: Vec<Option<usize>> =
                (1..=votes.len()).map(|end| decided(hold as usize, &votes[..end])).collect();
            let expected: Vec<Option<(usize, u64)>> = (0..behind.len())
                .map(|window| {
                    let held = behind[..=window].iter().rev().take_while(|d| **d == behind[window]).count();
                    behind[window].map(|class| (class, held as u64))
                })
                .collect();
            prop_assert_eq!(decisions(hold, least, &windows), expected);
        }
    }
}
