//! Labels of streams along time: what a network over events should have said, at any time.
//!
//! Enters: tensors of a safetensors file, of tracks or of events. Leaves: values at any time,
//! linear between the times of the labels and constant outside them. Every stream has a time, times
//! ascend in each, and values are finite.

use std::collections::BTreeMap;
use std::ops::Range;

use meissner_models::TensorFile;
use safetensors::tensor::{Dtype, SafeTensors};

use crate::error::StreamsError;
use crate::tensors::{bounds, integers, value};

/// Beginning of the names of labels in a file of events.
const PREFIX: &str = "truth.";
const START: &str = "truth.start";
const TIMES: &str = "truth.t_us";

/// Labels of streams along time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Truth {
    /// Index of the first time of each stream, and the number of times.
    start: Vec<usize>,
    t_us: Vec<i64>,
    /// The values of each label at all times.
    labels: BTreeMap<String, Vec<f32>>,
}

impl Truth {
    /// The labels of tracks whose times are `t_us` and `start`: every F32 tensor of shape (times).
    /// `None` without any.
    pub(crate) fn of_tracks(
        file: &SafeTensors<'_>,
        start: Vec<usize>,
        t_us: Vec<i64>,
    ) -> Result<Option<Self>, StreamsError> {
        Self::new(file, "", start, t_us)
    }

    /// The labels of `streams` streams in a file of events; `None` without any.
    pub(crate) fn of_events(file: &SafeTensors<'_>, streams: usize) -> Result<Option<Self>, StreamsError> {
        if !file.names().iter().any(|name| name.starts_with(PREFIX)) {
            return Ok(None);
        }
        let t_us = integers(file, TIMES, None)?;
        let start = integers(file, START, Some(streams + 1))?;
        let start = bounds(&start, t_us.len()).map_err(|error| match error {
            StreamsError::Value { index, expected, found, .. } => value(START, index, expected, found),
            error => error,
        })?;
        Self::new(file, PREFIX, start, t_us)
    }

    fn new(
        file: &SafeTensors<'_>,
        prefix: &str,
        start: Vec<usize>,
        t_us: Vec<i64>,
    ) -> Result<Option<Self>, StreamsError> {
        let (start_name, times_name) = (format!("{prefix}start"), format!("{prefix}t_us"));
        let mut labels = BTreeMap::new();
        for (tensor, view) in file.iter() {
            let Some(name) = tensor.strip_prefix(prefix) else { continue };
            if view.dtype() != Dtype::F32 || view.shape() != [t_us.len()] {
                continue;
            }
            let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            let values: Vec<f32> = view.data().chunks_exact(4).map(number).collect();
            if let Some(i) = values.iter().position(|value| !value.is_finite()) {
                return Err(value(tensor, i, "a finite number".to_owned(), values[i].to_string()));
            }
            labels.insert(name.to_owned(), values);
        }
        for range in start.windows(2) {
            if range[0] == range[1] {
                return Err(value(
                    &start_name,
                    range[0],
                    "a time for each stream".to_owned(),
                    "none".to_owned(),
                ));
            }
            let times = range[0] + 1..range[1];
            if let Some(i) = times.clone().find(|&i| t_us[i] <= t_us[i - 1]) {
                let expected = format!("a time above {}", t_us[i - 1]);
                return Err(value(&times_name, i, expected, t_us[i].to_string()));
            }
        }
        Ok((!labels.is_empty()).then_some(Self { start, t_us, labels }))
    }

    /// Labels of streams one after the other: for each, its times and the values of the labels
    /// `names` at each of them.
    ///
    /// # Panics
    /// Where a stream has no time.
    pub(crate) fn of_streams<const N: usize>(names: [&str; N], streams: &[Vec<(i64, [f32; N])>]) -> Self {
        assert!(streams.iter().all(|stream| !stream.is_empty()), "a time for each stream");
        let mut start = vec![0];
        start.extend(streams.iter().scan(0, |end, stream| {
            *end += stream.len();
            Some(*end)
        }));
        let values = |i: usize| streams.iter().flatten().map(|(_, values)| values[i]).collect();
        Self {
            start,
            t_us: streams.iter().flatten().map(|(t_us, _)| *t_us).collect(),
            labels: names.iter().enumerate().map(|(i, name)| ((*name).to_owned(), values(i))).collect(),
        }
    }

    /// Adds the labels to a file of events.
    pub(crate) fn write(&self, file: &mut TensorFile) {
        let start: Vec<i64> = self.start.iter().map(|&start| start as i64).collect();
        file.i64(START, &[start.len()], &start);
        file.i64(TIMES, &[self.t_us.len()], &self.t_us);
        for (name, values) in &self.labels {
            file.f32(&format!("{PREFIX}{name}"), &[values.len()], values);
        }
    }

    /// The names of the labels.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.labels.keys().map(String::as_str)
    }

    /// The times of `stream`, and the name and the values at these times of each label.
    pub(crate) fn of(&self, stream: usize) -> (&[i64], impl Iterator<Item = (&str, &[f32])>) {
        let times = self.times(stream);
        let t_us = &self.t_us[times.clone()];
        (t_us, self.labels.iter().map(move |(name, values)| (name.as_str(), &values[times.clone()])))
    }

    /// The first and the last time of `stream`.
    pub(crate) fn span_us(&self, stream: usize) -> [i64; 2] {
        let times = self.times(stream);
        [self.t_us[times.start], self.t_us[times.end - 1]]
    }

    /// When the label `name` of `stream` leaves 0: the last time at which it has not been above 0
    /// yet. `None` where there is no such label or it never rises.
    pub(crate) fn rises_us(&self, name: &str, stream: usize) -> Option<i64> {
        let (values, times) = (self.labels.get(name)?, self.times(stream));
        let first = times.clone().find(|&i| values[i] > 0.0)?;
        Some(self.t_us[first.saturating_sub(1).max(times.start)])
    }

    /// The value of the label `name` of `stream` at `t_us`; `None` without such a label. O(log
    /// times).
    pub(crate) fn at(&self, name: &str, stream: usize, t_us: i64) -> Option<f64> {
        let (values, times) = (self.labels.get(name)?, self.times(stream));
        let after = times.start + self.t_us[times.clone()].partition_point(|&time| time <= t_us);
        let value = |i: usize| f64::from(values[i]);
        if after == times.start {
            return Some(value(after));
        }
        if after == times.end {
            return Some(value(after - 1));
        }
        let (from, to) = (self.t_us[after - 1], self.t_us[after]);
        let share = t_us.abs_diff(from) as f64 / to.abs_diff(from) as f64;
        Some(value(after - 1) + share * (value(after) - value(after - 1)))
    }

    fn times(&self, stream: usize) -> Range<usize> {
        self.start[stream]..self.start[stream + 1]
    }
}

#[cfg(test)]
mod tests {
    use meissner_models::TensorFile;
    use safetensors::SafeTensors;

    use super::Truth;
    use crate::error::StreamsError;

    fn read(
        t_us: &[i64],
        start: &[i64],
        depth: &[f32],
        streams: usize,
    ) -> Result<Option<Truth>, StreamsError> {
        let mut file = TensorFile::new([].into());
        file.i64("truth.t_us", &[t_us.len()], t_us);
        file.i64("truth.start", &[start.len()], start);
        file.f32("truth.depth", &[depth.len()], depth);
        let bytes = file.into_bytes();
        Truth::of_events(&SafeTensors::deserialize(&bytes).expect("a valid file"), streams)
    }

    #[test]
    fn a_label_is_linear_between_its_times_and_constant_outside_them_within_its_stream() {
        let truth = read(&[-10, 0, 20, 5, 6], &[0, 3, 5], &[0.0, 0.0, 4.0, 9.0, 7.0], 2);
        let truth = truth.expect("it fits").expect("there are labels");
        let depth = |stream, t_us| truth.at("depth", stream, t_us).expect("there is such a label");
        assert_eq!(
            [-99, -10, 0, 5, 19, 20, 99].map(|t_us| depth(0, t_us)),
            [0.0, 0.0, 0.0, 1.0, 3.8, 4.0, 4.0]
        );
        assert_eq!([i64::MIN, 5, 6, i64::MAX].map(|t_us| depth(1, t_us)), [9.0, 9.0, 7.0, 7.0]);
        assert_eq!((truth.span_us(0), truth.span_us(1)), ([-10, 20], [5, 6]));
        assert_eq!([0, 1].map(|stream| truth.rises_us("depth", stream)), [Some(0), Some(5)]);
        assert_eq!((truth.at("force", 0, 0), truth.rises_us("force", 0)), (None, None));
    }

    #[test]
    fn labels_that_do_not_fit_are_refused_by_name() {
        let refused = |t_us: &[i64], start: &[i64], depth: &[f32], expected: &str| {
            let error = read(t_us, start, depth, start.len() - 1).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        };
        refused(&[0, 0], &[0, 2], &[1.0, 2.0], "truth.t_us 1: expected a time above 0, found 0");
        refused(
            &[0, 1],
            &[0, 0, 2],
            &[1.0, 2.0],
            "truth.start 0: expected a time for each stream, found none",
        );
        refused(&[0, 1], &[0, 3], &[1.0, 2.0], "truth.start 1: expected 2 to 2, found 3");
        refused(
            &[0, 1],
            &[0, 2],
            &[1.0, f32::INFINITY],
            "truth.depth 1: expected a finite number, found inf",
        );
        let other = read(&[0], &[0, 1], &[1.0], 2).expect_err("another number of streams").to_string();
        assert!(other.contains("truth.start: expected I64 (3), found I64 [2]"), "{other}");
        assert!(read(&[0, 1], &[0, 2], &[1.0], 1).expect("no tensor has the shape of the times").is_none());
    }
}
