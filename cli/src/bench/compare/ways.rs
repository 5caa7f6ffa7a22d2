//! One pass of each way over the same moments, its compute timed.
//!
//! The clock is read between the parts of a moment, two or three times however many events it has. Making an engine is
//! not counted; what its first frame or event costs is.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::frames::Skip;
use meissner_engine::{Engine, Sensor};

use super::super::frames::{FrameLatencies, FramePasses, Passed, Taken, WARMUP_FRAMES};
use super::report::{WayReport, WaysReport};
use crate::error::CliError;
use meissner_pipeline::latency::Latency;
use meissner_pipeline::model::Model;

/// What all passes have in common.
pub(super) struct Ways<'a> {
    pub(super) model: &'a Model,
    pub(super) sensor: Sensor,
    pub(super) frames: FramePasses<'a>,
    /// Most events of the warm-up.
    pub(super) warmup: u64,
}

/// A pass of one way.
#[derive(Debug)]
pub(super) struct Way {
    /// Events entering the window, or the frame.
    events: Duration,
    /// Taking frames.
    push: Option<Duration>,
    predict: Duration,
    /// All of a moment.
    moments: Latency,
    /// The number of frames, of a frame network.
    frames: Option<u64>,
    predictions: u64,
    multiply_adds: u64,
    state_bytes: u64,
}

/// A pass of all ways.
#[derive(Debug)]
pub(super) struct Pass {
    events: Way,
    frames_everything: Way,
    frames_skipping: Way,
    /// Accepted events that no frame shows.
    pub(super) outside: u64,
    /// Events that left a sliding frame before their time.
    pub(super) evicted: u64,
}

/// The bits of predictions, one after the other.
#[derive(Debug, Default)]
pub(super) struct Predictions {
    values: usize,
    bits: Vec<u32>,
}

impl Predictions {
    fn note(&mut self, values: &[f32]) {
        self.values = values.len();
        self.bits.extend(values.iter().map(|value| value.to_bits()));
    }

    /// How many predictions differ in any bit of any value; those that `other` has not, or has more of, differ.
    pub(super) fn that_differ(&self, other: &Self) -> u64 {
        let each = |of: &Self| of.values.max(1);
        let [a, b] = [self, other].map(|of| of.bits.chunks(each(of)));
        let more = a.len().abs_diff(b.len());
        (a.zip(b).filter(|(a, b)| a != b).count() + more) as u64
    }
}

impl Ways<'_> {
    /// Passes over the first events and frames, not counted.
    pub(super) fn warm_up(&self) -> Result<(), CliError> {
        if self.warmup == 0 {
            return Ok(());
        }
        self.over_events(usize::try_from(self.warmup).unwrap_or(usize::MAX))?;
        for skip in [Skip::Nothing, Skip::Exact] {
            self.frames.pass(skip, WARMUP_FRAMES, &mut FrameLatencies::new(), |_| Ok(()))?;
        }
        Ok(())
    }

    /// One pass of each way; notes the predictions of both ways over frames, the whole one first.
    pub(super) fn all(&self, [whole, skipping]: [&mut Predictions; 2]) -> Result<Pass, CliError> {
        let events = self.over_events(usize::MAX)?;
        let (frames_everything, _) = self.over_frames(Skip::Nothing, whole)?;
        let (frames_skipping, passed) = self.over_frames(Skip::Exact, skipping)?;
        let Passed { outside, evicted, .. } = passed;
        Ok(Pass { events, frames_everything, frames_skipping, outside, evicted })
    }

    /// A new engine over the first events, up to the moment at which as many as `most` are in.
    fn over_events(&self, most: usize) -> Result<Way, CliError> {
        let moments = self.frames.moments;
        let mut engine = Engine::new(Arc::new(self.model.network.clone()), self.sensor)?;
        let mut way = Way::new();
        for moment in moments.iter() {
            if moment.events.start >= most {
                break;
            }
            let begin = Instant::now();
            engine.push_slice(&moments.events[moment.events]);
            let entered = Instant::now();
            engine.advance(moment.t_us);
            let prediction = engine.predict().map(drop);
            let end = Instant::now();
            prediction?;
            way.events += entered - begin;
            way.predict += end - entered;
            way.moments.record(end - begin);
        }
        let counters = engine.counters();
        let work = counters.layers.iter().zip(&self.model.multiply_adds);
        way.multiply_adds = work.map(|(layer, of_row)| layer.recomputed * of_row).sum();
        way.predictions = counters.predictions.read;
        way.state_bytes = u64::try_from(engine.state_bytes()).unwrap_or(u64::MAX);
        Ok(way)
    }

    fn over_frames(&self, skip: Skip, predictions: &mut Predictions) -> Result<(Way, Passed), CliError> {
        let mut latencies = FrameLatencies::new();
        let mut way = Way::new();
        let passed = self.frames.pass(skip, u64::MAX, &mut latencies, |Taken { values, work, .. }| {
            predictions.note(values);
            way.moments.record(work);
            Ok(())
        })?;
        let counters = passed.engine.counters();
        way.events = latencies.frame.total();
        way.push = Some(latencies.push.total());
        way.predict = latencies.predict.total();
        way.frames = Some(counters.frames);
        way.predictions = counters.predictions;
        way.multiply_adds = self.frames.model.multiply_adds(&counters.layers);
        way.state_bytes = passed.engine.state_bytes() as u64;
        Ok((way, passed))
    }
}

impl Pass {
    /// The faster pass of each way.
    pub(super) fn faster(self, other: Self) -> Self {
        let faster = |a: Way, b: Way| if b.compute() < a.compute() { b } else { a };
        Self {
            events: faster(self.events, other.events),
            frames_everything: faster(self.frames_everything, other.frames_everything),
            frames_skipping: faster(self.frames_skipping, other.frames_skipping),
            ..self
        }
    }

    /// In figures, for `stream_s` seconds of stream.
    pub(super) fn report(&self, stream_s: f64) -> WaysReport {
        WaysReport {
            events: self.events.report(stream_s),
            frames_everything: self.frames_everything.report(stream_s),
            frames_skipping: self.frames_skipping.report(stream_s),
        }
    }
}

impl Way {
    fn new() -> Self {
        Self {
            events: Duration::ZERO,
            push: None,
            predict: Duration::ZERO,
            moments: Latency::new(),
            frames: None,
            predictions: 0,
            multiply_adds: 0,
            state_bytes: 0,
        }
    }

    fn compute(&self) -> Duration {
        self.events + self.push.unwrap_or_default() + self.predict
    }

    fn report(&self, stream_s: f64) -> WayReport {
        let compute_s = self.compute().as_secs_f64();
        WayReport {
            compute_s,
            compute_s_per_s: (stream_s > 0.0).then(|| compute_s / stream_s),
            events_s: self.events.as_secs_f64(),
            push_s: self.push.map(|push| push.as_secs_f64()),
            predict_s: self.predict.as_secs_f64(),
            frames: self.frames,
            predictions: self.predictions,
            multiply_adds: self.multiply_adds,
            state_bytes: self.state_bytes,
            moment_us: super::super::report::Distribution::of(&self.moments),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Predictions;

    fn predictions(all: &[[f32; 2]]) -> Predictions {
        let mut predictions = Predictions::default();
        all.iter().for_each(|values| predictions.note(values));
        predictions
    }

    #[test]
    fn predictions_differ_in_bits_and_where_one_is_missing() {
        let a = predictions(&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]);
        assert_eq!(a.that_differ(&predictions(&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])), 0);
        assert_eq!(a.that_differ(&predictions(&[[-0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])), 1);
        assert_eq!(a.that_differ(&predictions(&[[9.0, 9.0], [2.0, 3.0]])), 2);
        assert_eq!(predictions(&[]).that_differ(&a), 3);
    }
}
