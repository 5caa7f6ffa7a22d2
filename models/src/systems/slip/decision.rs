//! A decision that stands until several windows in a row agree on another class.
//!
//! Enters: each window's most probable class and its probability. Leaves: the decision after it:
//! the class of the newest `hold` windows in a row that all voted for one class; none before the
//! first such run. A window votes if its probability is at least `least_probability`.
//!
//! Invariant: `run` counts the newest windows in a row that voted for `candidate`, up to `hold`.

use thiserror::Error;

/// A filter cannot have these settings.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[expect(missing_docs, reason = "the messages explain the fields")]
#[non_exhaustive]
pub enum DecisionError {
    /// No window would have to agree.
    #[error("windows that have to agree: expected at least 1, found {found}")]
    Hold { found: u32 },
    /// The least probability is not a probability.
    #[error("least probability of a window that votes: expected 0 to 1, found {found}")]
    LeastProbability { found: f32 },
}

/// A decision and its age.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// Index of the class.
    pub class: usize,
    /// Number of windows for which it has stood, including the window that made it; at least 1.
    pub held: u64,
}

/// Holds a decision until `hold` windows in a row vote for another class.
///
/// A window that does not vote (NaN or below the least) leaves the decision standing and ends the
/// run of agreeing windows: each of the last `hold` must be sure. O(1) a window, without
/// allocation.
///
/// ```
/// use meissner_models::systems::slip::DecisionFilter;
///
/// let mut filter = DecisionFilter::new(2, 0.5)?;
/// let windows = [(3, 0.9), (3, 0.8), (5, 0.9), (3, 0.7), (5, 0.9), (5, 0.6)];
/// let classes = windows.map(|(class, p)| filter.push(class, p).map(|d| d.class));
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
    /// Without a decision. `hold` of 1 and `least_probability` of 0: every window decides.
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

    /// Takes the next window's most probable class and its probability; returns the decision after
    /// it, if any.
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

    /// Forgets the decision and all windows, as after [`Self::new`].
    pub fn reset(&mut self) {
        self.standing = None;
        self.candidate = 0;
        self.run = 0;
    }
}

#[cfg(test)]
mod tests;
