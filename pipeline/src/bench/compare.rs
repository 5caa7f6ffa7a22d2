//! Compares a network over events with a frame network over the same stream.
//!
//! At each moment, the network over events takes the events of the moment and predicts. The frame network makes a frame
//! of the same events, takes it, and predicts. It runs twice: with everything computed, and with exact skipping. Both
//! runs give the same bits. Everything runs on one thread.
//!
//! The clock is read two or three times per moment, between its parts, independently of the number of events. The time
//! to make an engine is not counted. The cost of its first frame or event is counted.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::Engine;
use meissner_engine::frames::Skip;
use serde::Serialize;

use super::frame_passes::{EventFrameModel, FramePasses, FrameTimes, Pass, Predicted, WARMUP_FRAMES};
use super::input::{BenchInput, BenchOptions, FrameInputReport, InputReport};
use super::moments::Moments;
use crate::error::PipelineError;
use crate::latency::{Distribution, Latency};
use crate::memory::peak_resident_bytes;
use crate::model::Model;
use crate::provenance::ModelCard;

/// A comparison of a network over events with a frame network.
pub struct Comparison<'a> {
    model: &'a Model,
    against: &'a EventFrameModel,
    input: BenchInput,
    options: BenchOptions,
}

/// The report of a comparison.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct CompareReport {
    /// The input.
    #[serde(flatten)]
    pub input: InputReport,
    /// The frames.
    #[serde(flatten)]
    pub made: FrameInputReport,
    /// The frame network.
    pub against: ModelCard,
    /// Whether frames have pixels that the sensor lacks.
    pub padded: bool,
    /// Events that left a sliding frame early because it was full.
    pub evicted_from_frames: u64,
    /// Number of moments at which all networks predict.
    pub moments: u64,
    /// The compared passes, the fastest of each.
    pub ways: SidesReport,
    /// Compute of the network over events.
    pub ratio_percent: Ratios,
    /// Multiply-adds of the network over events.
    pub multiply_adds_ratio_percent: Ratios,
    /// Predictions over frames that differ in any bit between the pass without skipping and the pass with skipping.
    pub predictions_that_differ: u64,
    /// Peak resident memory of the process; `None` if the platform does not report it.
    pub peak_resident_bytes: Option<u64>,
}

/// The three compared passes, with predictions at the same moments.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct SidesReport {
    /// The network over events, incrementally.
    pub events: SideReport,
    /// The frame network, with everything computed for every frame.
    pub frames_everything: SideReport,
    /// The frame network, without computing pixels whose inputs do not change.
    pub frames_skipping: SideReport,
}

/// One of the compared passes.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct SideReport {
    /// Seconds of compute.
    pub compute_s: f64,
    /// Seconds of compute per second of stream.
    pub compute_s_per_s: Option<f64>,
    /// The share of entering events into the window or the frame.
    pub events_s: f64,
    /// Taking frames.
    pub push_s: Option<f64>,
    /// Advancing the clock, and predictions.
    pub predict_s: f64,
    /// Frames, for a frame network.
    pub frames: Option<u64>,
    /// Predictions.
    pub predictions: u64,
    /// Multiply-adds. For the network over events they are counted at full neighbourhoods, without readout and dense
    /// layers.
    pub multiply_adds: u64,
    /// Activations, graph and state.
    pub state_bytes: u64,
    /// Compute of a moment: its events, its frame, its prediction.
    pub moment_us: Option<Distribution>,
}

/// The network over events in percent of the frame network.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct Ratios {
    /// Everything computed.
    pub frames_everything: Option<f64>,
    /// With skipping.
    pub frames_skipping: Option<f64>,
}

impl Ratios {
    fn of(ways: &SidesReport, of: impl Fn(&SideReport) -> f64) -> Self {
        let percent = |to: f64| (to > 0.0).then(|| of(&ways.events) / to * 100.0);
        Self {
            frames_everything: percent(of(&ways.frames_everything)),
            frames_skipping: percent(of(&ways.frames_skipping)),
        }
    }
}

impl<'a> Comparison<'a> {
    /// A comparison of `model` with the frame network `against` over `input`.
    pub fn new(
        model: &'a Model,
        against: &'a EventFrameModel,
        input: BenchInput,
        options: BenchOptions,
    ) -> Self {
        Self { model, against, input, options }
    }

    /// Runs all passes, and returns the report.
    ///
    /// # Errors
    /// The period differs from that of the frame network, there are too many frames, or an engine refuses an option.
    pub fn run(self) -> Result<CompareReport, PipelineError> {
        let Self { against, input, options, .. } = &self;
        let period_us = against.period_us(options.every)?;
        let moments = Moments::new(&input.events, (input.sensor, options.late), period_us, against.end())?;
        let field = against.field(input.sensor);
        let frames = FramePasses { model: against, field, moments: &moments };

        let [mut whole, mut skipping] = [Predictions::default(), Predictions::default()];
        self.warm_up(&frames)?;
        let mut fastest = self.round(&frames, [&mut whole, &mut skipping])?;
        for _ in 1..options.repeat {
            let [mut whole, mut skipping] = [Predictions::default(), Predictions::default()];
            fastest = fastest.faster(self.round(&frames, [&mut whole, &mut skipping])?);
        }
        let ways = fastest.report(moments.stream_s());
        let losses = input.losses(moments.counters).with_outside_crop(fastest.outside);
        Ok(CompareReport {
            made: FrameInputReport::new(input, against, field, &moments, fastest.outside),
            input: input.report(&moments.counters, &losses, options.repeat.max(1)),
            against: against.model.card.clone(),
            padded: field.is_padded(),
            evicted_from_frames: fastest.evicted,
            moments: moments.count() as u64,
            ratio_percent: Ratios::of(&ways, |way| way.compute_s),
            multiply_adds_ratio_percent: Ratios::of(&ways, |way| way.multiply_adds as f64),
            ways,
            predictions_that_differ: whole.that_differ(&skipping),
            peak_resident_bytes: peak_resident_bytes(),
        })
    }
}

/// One pass.
#[derive(Debug, Default)]
struct Side {
    /// Events entering the window, or the frame.
    events: Duration,
    /// Taking frames.
    push: Option<Duration>,
    predict: Duration,
    /// All work of a moment.
    moments: Latency,
    /// The number of frames, for a frame network.
    frames: Option<u64>,
    predictions: u64,
    multiply_adds: u64,
    state_bytes: u64,
}

/// One pass of each of the three.
#[derive(Debug)]
struct Round {
    events: Side,
    frames_everything: Side,
    frames_skipping: Side,
    /// Accepted events that no frame covers.
    outside: u64,
    /// Events that left a sliding frame early because it was full.
    evicted: u64,
}

/// The bits of consecutive predictions.
#[derive(Debug, Default)]
struct Predictions {
    values: usize,
    bits: Vec<u32>,
}

impl Predictions {
    fn note(&mut self, values: &[f32]) {
        self.values = values.len();
        self.bits.extend(values.iter().map(|value| value.to_bits()));
    }

    /// The number of predictions that differ in any bit of any value. Predictions that only one side has count as
    /// different.
    fn that_differ(&self, other: &Self) -> u64 {
        let each = |of: &Self| of.values.max(1);
        let [a, b] = [self, other].map(|of| of.bits.chunks(each(of)));
        let more = a.len().abs_diff(b.len());
        (a.zip(b).filter(|(a, b)| a != b).count() + more) as u64
    }
}

impl Comparison<'_> {
    /// Runs uncounted passes over the first events and frames.
    fn warm_up(&self, frames: &FramePasses<'_>) -> Result<(), PipelineError> {
        let warmup = self.options.warmup;
        if warmup == 0 {
            return Ok(());
        }
        self.over_events(frames.moments, usize::try_from(warmup).unwrap_or(usize::MAX))?;
        for skip in [Skip::Nothing, Skip::Exact] {
            frames.pass(skip, WARMUP_FRAMES, &mut FrameTimes::default(), |_| Ok(()))?;
        }
        Ok(())
    }

    /// Runs one pass of each, and records the predictions over frames, without and with skipping.
    fn round(
        &self,
        frames: &FramePasses<'_>,
        [whole, skipping]: [&mut Predictions; 2],
    ) -> Result<Round, PipelineError> {
        let events = self.over_events(frames.moments, usize::MAX)?;
        let (frames_everything, _) = over_frames(frames, Skip::Nothing, whole)?;
        let (frames_skipping, pass) = over_frames(frames, Skip::Exact, skipping)?;
        let Pass { outside, evicted, .. } = pass;
        Ok(Round { events, frames_everything, frames_skipping, outside, evicted })
    }

    /// Runs a new engine over the first events, up to the moment at which at least `most` events have entered.
    fn over_events(&self, moments: &Moments, most: usize) -> Result<Side, PipelineError> {
        let mut engine = Engine::new(Arc::new(self.model.network.clone()), self.input.sensor)?;
        let mut way = Side::default();
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
}

/// Runs a pass over frames, and records its predictions.
fn over_frames(
    frames: &FramePasses<'_>,
    skip: Skip,
    predictions: &mut Predictions,
) -> Result<(Side, Pass), PipelineError> {
    let mut times = FrameTimes::default();
    let mut way = Side::default();
    let pass = frames.pass(skip, u64::MAX, &mut times, |Predicted { values, work, .. }| {
        predictions.note(values);
        way.moments.record(work);
        Ok(())
    })?;
    let counters = pass.engine.counters();
    way.events = times.frame.total();
    way.push = Some(times.push.total());
    way.predict = times.predict.total();
    way.frames = Some(counters.frames);
    way.predictions = counters.predictions;
    way.multiply_adds = frames.model.multiply_adds(&counters.layers);
    way.state_bytes = pass.engine.state_bytes() as u64;
    Ok((way, pass))
}

impl Round {
    /// The faster pass of each.
    fn faster(self, other: Self) -> Self {
        let faster = |a: Side, b: Side| if b.compute() < a.compute() { b } else { a };
        Self {
            events: faster(self.events, other.events),
            frames_everything: faster(self.frames_everything, other.frames_everything),
            frames_skipping: faster(self.frames_skipping, other.frames_skipping),
            ..self
        }
    }

    /// The reports, for `stream_s` seconds of stream.
    fn report(&self, stream_s: f64) -> SidesReport {
        SidesReport {
            events: self.events.report(stream_s),
            frames_everything: self.frames_everything.report(stream_s),
            frames_skipping: self.frames_skipping.report(stream_s),
        }
    }
}

impl Side {
    fn compute(&self) -> Duration {
        self.events + self.push.unwrap_or_default() + self.predict
    }

    fn report(&self, stream_s: f64) -> SideReport {
        let compute_s = self.compute().as_secs_f64();
        SideReport {
            compute_s,
            compute_s_per_s: (stream_s > 0.0).then(|| compute_s / stream_s),
            events_s: self.events.as_secs_f64(),
            push_s: self.push.map(|push| push.as_secs_f64()),
            predict_s: self.predict.as_secs_f64(),
            frames: self.frames,
            predictions: self.predictions,
            multiply_adds: self.multiply_adds,
            state_bytes: self.state_bytes,
            moment_us: self.moments.distribution(),
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
    fn predictions_differ_in_bits_and_if_one_is_missing() {
        let a = predictions(&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]);
        assert_eq!(a.that_differ(&predictions(&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])), 0);
        assert_eq!(a.that_differ(&predictions(&[[-0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])), 1);
        assert_eq!(a.that_differ(&predictions(&[[9.0, 9.0], [2.0, 3.0]])), 2);
        assert_eq!(predictions(&[]).that_differ(&a), 3);
    }
}
