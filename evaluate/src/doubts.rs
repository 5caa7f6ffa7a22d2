//! Counts of predictions by quality, and by the likeness of their input to the training's.

use serde::Serialize;

/// An error of so many times the mean is bad.
pub(crate) const BAD: f64 = 3.0;

/// Predictions of all trainings, of networks with statistics of their training.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Doubts {
    pub predictions: u64,
    /// Predictions whose input is unlike the training's.
    pub unlike: u64,
    /// Bad predictions: of another class, or with an error of more than three times the mean.
    pub bad: u64,
    /// Predictions that are both.
    pub bad_unlike: u64,
}

impl Doubts {
    /// Counts over predictions: how unlike the input of each is, and whether it is bad. `None`
    /// without predictions, and if the network has no statistics of its training.
    pub(crate) fn of(predictions: impl IntoIterator<Item = (Option<f32>, bool)>) -> Option<Self> {
        let mut doubts = Self::default();
        for (unlike, bad) in predictions {
            let (unlike, bad) = (u64::from(unlike? > 1.0), u64::from(bad));
            doubts.add(&Self { predictions: 1, unlike, bad, bad_unlike: unlike * bad });
        }
        (doubts.predictions > 0).then_some(doubts)
    }

    /// The sum of `each`; `None` if one of them is `None`.
    pub(crate) fn sum(each: impl IntoIterator<Item = Option<Self>>) -> Option<Self> {
        let mut sum = Self::default();
        for doubts in each {
            sum.add(&doubts?);
        }
        Some(sum)
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.predictions += other.predictions;
        self.unlike += other.unlike;
        self.bad += other.bad;
        self.bad_unlike += other.bad_unlike;
    }
}
