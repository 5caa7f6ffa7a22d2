//! What predictions say about their input, beside how good they are.

use serde::Serialize;

/// An error of so many times the mean is bad.
pub(crate) const BAD: f64 = 3.0;

/// Predictions of all trainings, of networks that know their training.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Doubts {
    pub predictions: u64,
    /// Those of input unlike the training's.
    pub unlike: u64,
    /// Those that are bad: of another class, or with an error of more than three times the mean.
    pub bad: u64,
    /// Those that are both.
    pub bad_unlike: u64,
}

impl Doubts {
    /// Those of predictions with how unlike their input is, and whether they are bad; `None` for
    /// none, and if the network does not know its training.
    pub(crate) fn of(predictions: impl IntoIterator<Item = (Option<f32>, bool)>) -> Option<Self> {
        let mut doubts = Self::default();
        for (unlike, bad) in predictions {
            let (unlike, bad) = (u64::from(unlike? > 1.0), u64::from(bad));
            doubts.add(&Self { predictions: 1, unlike, bad, bad_unlike: unlike * bad });
        }
        (doubts.predictions > 0).then_some(doubts)
    }

    /// Those of all of `each`; `None` if one of them is.
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
