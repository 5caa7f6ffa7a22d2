//! How often each class was predicted for each.

use serde::ser::{Serialize, Serializer};

/// Counts of predictions: rows are true classes, columns predicted ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Confusion {
    classes: usize,
    /// Row-major.
    counts: Vec<u64>,
}

impl Confusion {
    /// No predictions of `classes` classes. 8 `classes`^2 bytes.
    ///
    /// # Panics
    /// Where no memory holds them.
    pub fn new(classes: usize) -> Self {
        Self { classes, counts: vec![0; classes * classes] }
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// Counts a prediction.
    ///
    /// # Panics
    /// Where one of the two is no class.
    pub fn add(&mut self, truth: usize, predicted: usize) {
        self.check(truth, predicted);
        self.counts[truth * self.classes + predicted] += 1;
    }

    fn check(&self, truth: usize, predicted: usize) {
        assert!(
            truth < self.classes && predicted < self.classes,
            "{truth}, {predicted}: of {}",
            self.classes
        );
    }

    /// Counts all that `other` counts.
    ///
    /// # Panics
    /// Where it has another number of classes.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.classes, other.classes, "classes of both");
        self.counts.iter_mut().zip(&other.counts).for_each(|(count, more)| *count += more);
    }

    /// How often `predicted` was predicted for `truth`.
    ///
    /// # Panics
    /// Where one of the two is no class.
    pub fn count(&self, truth: usize, predicted: usize) -> u64 {
        self.check(truth, predicted);
        self.counts[truth * self.classes + predicted]
    }

    /// The counts of each true class.
    pub fn rows(&self) -> impl Iterator<Item = &[u64]> {
        // Without classes there are no rows, and chunks of nothing may not be asked for.
        self.counts.chunks_exact(self.classes.max(1))
    }

    /// How often `class` was true.
    ///
    /// # Panics
    /// Where it is no class.
    pub fn truths(&self, class: usize) -> u64 {
        (0..self.classes).map(|predicted| self.count(class, predicted)).sum()
    }

    /// How often `class` was predicted.
    ///
    /// # Panics
    /// Where it is no class.
    pub fn predictions(&self, class: usize) -> u64 {
        (0..self.classes).map(|truth| self.count(truth, class)).sum()
    }

    /// How often the prediction was true.
    pub fn hits(&self) -> u64 {
        (0..self.classes).map(|class| self.count(class, class)).sum()
    }

    /// Number of predictions.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }
}

impl Serialize for Confusion {
    /// A list of rows.
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_seq(self.rows())
    }
}

#[cfg(test)]
mod tests {
    use super::Confusion;

    #[test]
    fn rows_are_true_and_columns_predicted() {
        let mut confusion = Confusion::new(3);
        [(0, 0), (0, 1), (0, 1), (2, 0)]
            .iter()
            .for_each(|&(truth, predicted)| confusion.add(truth, predicted));
        let rows: Vec<&[u64]> = confusion.rows().collect();
        assert_eq!(rows, [[1, 2, 0], [0, 0, 0], [1, 0, 0]]);
        assert_eq!((confusion.truths(0), confusion.predictions(0)), (3, 2));
        assert_eq!((confusion.hits(), confusion.total()), (1, 4));
        assert_eq!(serde_json::to_string(&confusion).expect("numbers"), "[[1,2,0],[0,0,0],[1,0,0]]");
    }

    #[test]
    fn merged_counts_are_those_of_both() {
        let (mut a, mut b, mut both) = (Confusion::new(2), Confusion::new(2), Confusion::new(2));
        [(0, 1), (1, 1)].iter().for_each(|&(t, p)| {
            a.add(t, p);
            both.add(t, p);
        });
        b.add(1, 0);
        both.add(1, 0);
        a.merge(&b);
        assert_eq!(a, both);
    }

    #[test]
    fn no_classes_have_no_rows() {
        assert_eq!(Confusion::new(0).rows().count(), 0);
        assert_eq!(Confusion::new(0).total(), 0);
    }

    #[test]
    #[should_panic(expected = "of 2")]
    fn a_prediction_of_no_class_is_a_mistake_of_the_caller() {
        Confusion::new(2).add(0, 2);
    }
}
