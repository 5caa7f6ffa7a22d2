//! Compares a network over events with a frame network over the same stream.
//!
//! At each moment, the network over events takes the events of the moment and predicts. The frame
//! network makes a frame of the same events, takes it, and predicts. It runs twice: with everything
//! computed, and with exact skipping. Both runs give the same bits. Everything runs on one thread.
//!
//! The clock is read two or three times per moment; the creation of an engine does not count.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::frames::Skip;
use meissner_engine::{Engine, Sensor};
use serde::Serialize;

use super::frame_passes::{
    EventFrameModel, FrameLatencies, FramePasses, Pass, Predicted, PredictionTimes, WARMUP_FRAMES,
};
use super::{BenchInput, BenchOptions, FrameInputReport, InputReport};
use crate::error::{Result, RunError};
use crate::latency::Latency;
use crate::losses::InputLosses;
use crate::memory::peak_resident_bytes;
use crate::model::Model;
use crate::provenance::ModelCard;

/// The report of a comparison.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct CompareReport {
    #[serde(flatten)]
    pub input: InputReport,
    #[serde(flatten)]
    pub made: FrameInputReport,
    pub against: ModelCard,
    /// Whether frames have pixels that the sensor lacks.
    pub padded: bool,
    /// Events that left a sliding frame early because the frame was full.
    pub evicted_from_frames: u64,
    /// Number of moments at which all networks predict.
    pub moments: u64,
    /// The compared passes, the fastest of each.
    pub ways: SidesReport,
    /// Compute of the network over events.
    pub ratio_percent: Ratios,
    /// Multiply-adds of the network over events.
    pub multiply_adds_ratio_percent: Ratios,
    /// Predictions over frames that differ in any bit between the runs with and without skipping.
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
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct SideReport {
    pub compute_s: f64,
    /// Seconds of compute per second of stream.
    pub compute_s_per_s: Option<f64>,
    /// The time to enter events into the window or the frame.
    pub events_s: f64,
    /// Taking frames.
    pub push_s: Option<f64>,
    /// Advancing the clock, and predictions.
    pub predict_s: f64,
    pub frames: Option<u64>,
    pub predictions: u64,
    /// Over events: at full neighbourhoods, without readout and dense layers.
    pub multiply_adds: u64,
    /// Activations, graph and state.
    pub state_bytes: u64,
    /// Compute of a moment: its events, its frame, its prediction.
    pub moment_us: Latency,
}

/// The network over events in percent of the frame network.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Ratios {
    pub frames_everything: Option<f64>,
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

impl SideReport {
    /// The times of a pass over `stream_s` seconds of stream.
    fn new(stream_s: f64, events: Duration, push: Option<Duration>, predict: Duration) -> Self {
        let compute_s = (events + push.unwrap_or_default() + predict).as_secs_f64();
        Self {
            compute_s,
            compute_s_per_s: (stream_s > 0.0).then(|| compute_s / stream_s),
            events_s: events.as_secs_f64(),
            push_s: push.map(|push| push.as_secs_f64()),
            predict_s: predict.as_secs_f64(),
            ..Self::default()
        }
    }
}

/// Compares `model` with the frame network `against` over `input`.
///
/// # Errors
/// The period differs from that of the frames, there are too many frames, or an engine refuses an
/// option.
pub fn compare(
    model: &Model,
    against: &EventFrameModel,
    input: &BenchInput,
    options: &BenchOptions,
) -> Result<CompareReport> {
    let period_us = against.period_us(options.every)?;
    let moments =
        PredictionTimes::new(&input.events, (input.sensor, options.late), period_us, against.end())?;
    let field = against.field(input.sensor);
    let frames = FramePasses { model: against, field, moments: &moments };
    if options.warmup > 0 {
        over_events(model, input.sensor, &moments, usize::try_from(options.warmup).unwrap_or(usize::MAX))?;
        for skip in [Skip::Nothing, Skip::Exact] {
            frames.pass(skip, WARMUP_FRAMES, &mut FrameLatencies::default(), &mut |_| ())?;
        }
    }
    let round = || {
        let events = over_events(model, input.sensor, &moments, usize::MAX)?;
        let (frames_everything, whole, _) = over_frames(&frames, Skip::Nothing)?;
        let (frames_skipping, skipping, Pass { outside, evicted, .. }) = over_frames(&frames, Skip::Exact)?;
        let sides = SidesReport { events, frames_everything, frames_skipping };
        Ok::<_, RunError>((sides, whole.that_differ(&skipping), outside, evicted))
    };
    let (mut ways, predictions_that_differ, outside, evicted_from_frames) = round()?;
    for _ in 1..options.repeat {
        ways = ways.faster(round()?.0);
    }
    let losses = InputLosses { outside_crop: outside, ..input.losses(moments.counters) };
    Ok(CompareReport {
        made: FrameInputReport::new(input, against, field, &moments, outside),
        input: input.report(&moments.counters, &losses, options.repeat.max(1)),
        against: against.model.card.clone(),
        padded: field.is_padded(),
        evicted_from_frames,
        moments: moments.count() as u64,
        ratio_percent: Ratios::of(&ways, |way| way.compute_s),
        multiply_adds_ratio_percent: Ratios::of(&ways, |way| way.multiply_adds as f64),
        ways,
        predictions_that_differ,
        peak_resident_bytes: peak_resident_bytes(),
    })
}

impl SidesReport {
    fn faster(self, other: Self) -> Self {
        let faster = |a: SideReport, b: SideReport| if b.compute_s < a.compute_s { b } else { a };
        Self {
            events: faster(self.events, other.events),
            frames_everything: faster(self.frames_everything, other.frames_everything),
            frames_skipping: faster(self.frames_skipping, other.frames_skipping),
        }
    }
}

/// The bits of consecutive predictions.
#[derive(Debug, Default)]
pub(super) struct Predictions {
    values: usize,
    bits: Vec<u32>,
}

impl Predictions {
    pub(super) fn note(&mut self, values: &[f32]) {
        self.values = values.len();
        self.bits.extend(values.iter().map(|value| value.to_bits()));
    }

    /// The number of predictions that differ in any bit, or that exist on only one side.
    pub(super) fn that_differ(&self, other: &Self) -> u64 {
        let each = |of: &Self| of.values.max(1);
        let [a, b] = [self, other].map(|of| of.bits.chunks(each(of)));
        let more = a.len().abs_diff(b.len());
        (a.zip(b).filter(|(a, b)| a != b).count() + more) as u64
    }
}

/// Runs a new engine over the first events, until at least `most` have entered.
fn over_events(model: &Model, sensor: Sensor, moments: &PredictionTimes, most: usize) -> Result<SideReport> {
    let mut engine = Engine::new(Arc::new(model.network.clone()), sensor)?;
    let (mut events, mut predict, mut moment_us) = (Duration::ZERO, Duration::ZERO, Latency::new());
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
        events += entered - begin;
        predict += end - entered;
        moment_us.record(end - begin);
    }
    let counters = engine.counters();
    let work = counters.layers.iter().zip(&model.multiply_adds);
    Ok(SideReport {
        predictions: counters.predictions.read,
        multiply_adds: work.map(|(layer, of_row)| layer.recomputed * of_row).sum(),
        state_bytes: u64::try_from(engine.state_bytes()).unwrap_or(u64::MAX),
        moment_us,
        ..SideReport::new(moments.stream_s(), events, None, predict)
    })
}

/// Runs a pass over frames, and returns its predictions too.
fn over_frames(frames: &FramePasses<'_>, skip: Skip) -> Result<(SideReport, Predictions, Pass)> {
    let (mut times, mut moment_us) = (FrameLatencies::default(), Latency::new());
    let mut predictions = Predictions::default();
    let pass = frames.pass(skip, u64::MAX, &mut times, &mut |Predicted { values, work, .. }| {
        predictions.note(values);
        moment_us.record(work);
    })?;
    let counters = pass.engine.counters();
    let FrameLatencies { frame, calls } = times;
    let [frame, push, predict] = [&frame, &calls.push, &calls.predict].map(Latency::total);
    let side = SideReport {
        frames: Some(counters.frames),
        predictions: counters.predictions,
        multiply_adds: frames.model.multiply_adds(&counters.layers),
        state_bytes: pass.engine.state_bytes() as u64,
        moment_us,
        ..SideReport::new(frames.moments.stream_s(), frame, Some(push), predict)
    };
    Ok((side, predictions, pass))
}
