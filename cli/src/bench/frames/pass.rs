//! One frame engine over all events, every call timed.
//!
//! Enters: events and their moments. Leaves: histograms, and the engine with its counters. A frame costs what its events
//! took to enter, reading it, its push, and its prediction.

use std::time::{Duration, Instant};

use meissner_engine::frames::{FrameEngine, FrameOptions, Skip};

use super::super::moments::Moments;
use super::model::{Field, FrameModel};
use crate::error::CliError;
use meissner_pipeline::frame_feed::FeedOutput;
use meissner_pipeline::latency::Latency;

/// What all passes have in common.
pub(in super::super) struct FramePasses<'a> {
    pub(in super::super) model: &'a FrameModel,
    pub(in super::super) field: Field,
    pub(in super::super) moments: &'a Moments,
}

/// Latencies of frames, over any number of passes.
#[derive(Debug)]
pub(in super::super) struct FrameLatencies {
    /// Events entering the frame, and reading it.
    pub(in super::super) frame: Latency,
    pub(in super::super) push: Latency,
    pub(in super::super) predict: Latency,
    pub(in super::super) push_predict: Latency,
}

/// A prediction, and what it took.
pub(in super::super) struct Taken<'a> {
    pub(in super::super) t_us: i64,
    pub(in super::super) values: &'a [f32],
    /// From its first event on.
    pub(in super::super) work: Duration,
}

/// What a pass leaves.
pub(in super::super) struct Passed {
    pub(in super::super) engine: FrameEngine,
    /// Accepted events that no frame shows.
    pub(in super::super) outside: u64,
    /// Events that left a sliding window before their time because it was full.
    pub(in super::super) evicted: u64,
}

impl FrameLatencies {
    pub(in super::super) fn new() -> Self {
        let new = Latency::new;
        Self { frame: new(), push: new(), predict: new(), push_predict: new() }
    }

    /// All that was measured.
    pub(in super::super) fn total(&self) -> Duration {
        self.frame.total() + self.push_predict.total()
    }
}

/// An engine, what it has measured, and since when its next frame is under way.
struct At<'a, L> {
    engine: FrameEngine,
    zeros: Vec<f32>,
    into: &'a mut FrameLatencies,
    look: L,
    /// Frames that may still come.
    left: u64,
    since: Instant,
}

impl FramePasses<'_> {
    /// A new engine over the first `frames` frames; measures `into`, and hands every prediction to `look`.
    pub(in super::super) fn pass<L>(
        &self,
        skip: Skip,
        frames: u64,
        into: &mut FrameLatencies,
        look: L,
    ) -> Result<Passed, CliError>
    where
        L: FnMut(Taken<'_>) -> Result<(), CliError>,
    {
        let options = FrameOptions::new().with_skip(skip).with_sparse(true).with_two_threads(false);
        let engine = FrameEngine::with_options(self.model.network.clone(), options)?;
        let zeros = vec![0.0; self.model.network.input().values()];
        let mut feed = self.model.feed(self.field, self.moments.period_us)?;
        let mut at = At { engine, zeros, into, look, left: frames, since: Instant::now() };
        for &event in &self.moments.events {
            feed.push(event, |fed| at.fed(fed))?;
            if at.left == 0 {
                break;
            }
        }
        feed.finish(|fed| at.fed(fed))?;
        let (outside, evicted) = (feed.outside_crop(), feed.evicted());
        Ok(Passed { engine: at.engine, outside, evicted })
    }
}

impl<L> At<'_, L>
where
    L: FnMut(Taken<'_>) -> Result<(), CliError>,
{
    /// Takes the frames that are complete.
    fn fed(&mut self, fed: FeedOutput<'_>) -> Result<(), CliError> {
        match fed {
            FeedOutput::Frame { values, t_us, .. } => self.frame(Some(values), t_us)?,
            FeedOutput::Empty { count, t_us, period_us } => {
                for (_, number) in (0..count.min(self.left)).zip(0..) {
                    self.frame(None, t_us + number * period_us)?;
                }
            }
        }
        Ok(())
    }

    /// Takes a frame; `None` is one of zeros.
    fn frame(&mut self, values: Option<&[f32]>, t_us: i64) -> Result<(), CliError> {
        if self.left == 0 {
            return Ok(());
        }
        self.left -= 1;
        let begin = Instant::now();
        self.engine.push(values.unwrap_or(&self.zeros))?;
        let pushed = Instant::now();
        let prediction = self.engine.predict()?;
        let end = Instant::now();
        let frame = begin - self.since;
        self.into.frame.record(frame);
        self.into.push.record(pushed - begin);
        self.into.predict.record(end - pushed);
        self.into.push_predict.record(end - begin);
        (self.look)(Taken { t_us, values: prediction.values, work: end - self.since })?;
        self.since = Instant::now();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use meissner_engine::{Event, LatePolicy, Sensor};

    use super::{FeedOutput, FrameModel, Moments};
    use crate::error::CliError;

    /// Times of the frames that the feed delivers for `moments`.
    fn times(model: &FrameModel, moments: &Moments, sensor: Sensor) -> Vec<i64> {
        let mut feed = model.feed(model.field(sensor), moments.period_us).expect("the field fits");
        let mut times = Vec::new();
        let mut note = |fed: FeedOutput<'_>| {
            match fed {
                FeedOutput::Frame { t_us, .. } => times.push(t_us),
                FeedOutput::Empty { count, t_us, period_us } => {
                    times.extend((0..count as i64).map(|number| t_us + number * period_us));
                }
            }
            Ok::<_, CliError>(())
        };
        for &event in &moments.events {
            feed.push(event, &mut note).expect("nothing refuses a frame");
        }
        feed.finish(&mut note).expect("nothing refuses a frame");
        times
    }

    #[test]
    fn frames_come_at_the_moments_whatever_the_gaps_between_events() {
        let sensor = Sensor::new(200, 100);
        for name in ["force-tdnn", "event-frame-cnn"] {
            let model = FrameModel::load(name, None, false).expect("it is shipped");
            let period_us = model.period_us(None).expect("it has one");
            for seed in 1..50_u64 {
                // Gaps of 0, of less than a frame, of whole frames, and longer than the window.
                let gaps = [0, 1, 3333, 9999, 10_000, 10_001, 70_000, 150_000, 200_000];
                let gap = |i: u64| gaps[(seed * (i + 1) * (i + 7) / 3 % gaps.len() as u64) as usize];
                let at = |i: u64| -5 + (0..=i).map(gap).sum::<i64>();
                let events: Vec<Event> =
                    (0..30).map(|i| Event::new(at(i), (i * 6) as u16, (i * 3) as u16, i % 2 == 0)).collect();
                let moments = Moments::new(&events, (sensor, LatePolicy::Drop), period_us, model.end());
                let moments = moments.expect("there are few");
                let expected: Vec<i64> = moments.iter().map(|moment| moment.t_us).collect();
                assert_eq!(times(&model, &moments, sensor), expected, "{name}, seed {seed}");
            }
        }
    }
}
