//! Predictions over time: one for each part of the shown time.
//!
//! Invariant: a part keeps the prediction that was read last in it. Predictions depend on the
//! events alone, so a replay writes the same values.

use std::collections::BTreeMap;

use crate::frame::Bytes;

/// Number of parts of the shown time.
const PARTS: i64 = 512;
/// Shown time of a live input, in microseconds.
const LIVE_US: i64 = 20_000_000;

/// Predictions over time.
#[derive(Clone, Debug)]
pub struct Series {
    part_us: i64,
    live: bool,
    /// Time of the part, time of its prediction from the first event, values.
    points: BTreeMap<i64, (i64, Vec<f32>)>,
}

impl Series {
    /// An empty series for an input of this length; a live input has no known length.
    pub fn new(length_us: Option<i64>) -> Self {
        let shown = length_us.unwrap_or(LIVE_US);
        Self { part_us: (shown / PARTS).max(1), live: length_us.is_none(), points: BTreeMap::new() }
    }

    /// The part of time to which `t_us` belongs.
    pub fn part(&self, t_us: i64) -> i64 {
        t_us.div_euclid(self.part_us)
    }

    /// Adds a prediction at `t_us` from the first event.
    pub fn add(&mut self, t_us: i64, values: &[f32]) {
        let point = self.points.entry(self.part(t_us)).or_default();
        point.0 = t_us;
        point.1.clear();
        point.1.extend_from_slice(values);
        while self.live && self.points.len() > PARTS as usize {
            self.points.pop_first();
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// The section SERS of points with `outputs` values.
    pub(crate) fn write(&self, outputs: usize, to: &mut Bytes<'_>) {
        to.count(outputs);
        to.count(self.points.len());
        for (t_us, values) in self.points.values() {
            to.f32((*t_us as f64 / 1e3) as f32);
            to.f32s(values);
        }
    }
}
