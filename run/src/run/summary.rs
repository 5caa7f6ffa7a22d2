//! A frame engine with a clock around each call, and the counts and latencies of a run, with the
//! names of the JSON summary.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::EngineError;
use meissner_engine::frames::{
    FrameCounters, FrameEngine, FrameLayerCounters, FrameNetwork, FrameOptions, FramePrediction,
};
use serde::Serialize;

use crate::approximations::ApproximationReport;
use crate::clock::Passed;
use crate::error::{Result, RunError};
use crate::latency::{Latencies, Latency};
use crate::losses::{LossWarning, Salvaged};
use crate::training::{Output, Training};
use crate::work_counts::WorkCounts;

/// A run that has ended.
#[derive(Debug)]
#[must_use]
pub struct Ended {
    /// Counts and latencies up to the end.
    pub summary: Summary,
    /// The first error, if there was one.
    pub result: Result<()>,
}

/// The first error of a stream, and the steps that are still possible after it.
pub(super) struct Ending(pub(super) Result<()>);

impl Ending {
    /// Whether the state is worth keeping.
    pub(super) fn saves(&self) -> bool {
        !matches!(self.0, Err(RunError::Engine(_) | RunError::Lines { .. }))
    }

    /// Whether due predictions can be read and shown.
    pub(super) fn predicts(&self) -> bool {
        !matches!(self.0, Err(RunError::Engine(_) | RunError::Output(_)))
    }

    /// Records the result of one more step.
    pub(super) fn then(&mut self, next: Result<()>) {
        if self.0.is_ok() {
            self.0 = next;
        }
    }
}

/// The summary of a run.
#[derive(Debug, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Summary {
    /// The summary of a network over events.
    Events(Box<EventSummary>),
    /// The summary of a network over frames: events, electrodes or pictures.
    Frames(Box<FrameSummary>),
}

/// The summary of a network over events.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct EventSummary {
    pub events: u64,
    /// Lines of a text that could not be read; they do not count as events.
    pub lines_refused: u64,
    /// Events that entered the window.
    pub accepted: u64,
    /// The other events, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Restarts of the sensor's clock, each of which reset the engine.
    pub restarts: u64,
    pub predictions: u64,
    /// Largest number of events in the window after any push.
    pub nodes_max: usize,
    /// Times of pushes, and of predictions with advancing the clock to them.
    pub latency_us: Latencies,
    /// Events taken, divided by the time in pushes and predictions.
    pub events_per_s: Option<f64>,
    /// Stream time divided by that time: if it is at least 1, the network keeps up on average.
    pub real_time: Option<f64>,
    /// Predictions with a value outside the range of the training, if the weights state it.
    pub outside_training: Option<u64>,
    /// Predictions of windows unlike those of the training, if the weights contain statistics of
    /// these.
    pub unlike_training: Option<u64>,
    pub skips: WorkCounts,
    pub warnings: Vec<LossWarning>,
    /// The approximations; `None` if results are exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub approximations: Option<ApproximationReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub salvaged: Option<Salvaged>,
}

/// The summary of a network over frames.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct FrameSummary {
    /// Counts of the input.
    #[serde(flatten)]
    pub input: InputCounts,
    pub warnings: Vec<LossWarning>,
    pub frames: u64,
    pub predictions: u64,
    /// Times of making a frame, of pushes, of predictions, of decisions over electrodes, and from
    /// the arrival of a video's picture to its prediction.
    pub latency_us: Latencies,
    /// Frames divided by the time for making them, pushing them and predicting.
    pub frames_per_s: Option<f64>,
    /// Stream time of the input divided by the same time: if it is at least 1, the network keeps up
    /// with the recording on average. `None` for pictures, which have no time, unless a video has a
    /// rate.
    pub real_time: Option<f64>,
    /// Predictions with a value outside the range of the training, if the weights state it.
    pub outside_training: Option<u64>,
    /// Predictions of frames unlike those of the training, if the weights contain statistics of
    /// these.
    pub unlike_training: Option<u64>,
    /// Sums over all layers.
    pub pixels: Pixels,
    pub layers: Vec<LayerPixels>,
}

/// Counts of an input.
#[derive(Debug, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum InputCounts {
    /// Counts of events.
    Events(EventCounts),
    /// Counts of readings of electrodes.
    Electrodes(ElectrodeCounts),
    /// Counts of pictures.
    Pictures {
        /// Pictures read.
        pictures: u64,
    },
    /// Counts of the pictures of a video.
    Video(VideoCounts),
}

/// Counts of the pictures of a raw video.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct VideoCounts {
    /// Complete pictures, without those that waited at the end.
    pub pictures: u64,
    /// Dropped pictures: a newer one had arrived when they could have been taken.
    pub pictures_late: u64,
    /// Bytes after the last whole picture.
    pub bytes_left_out: u64,
}

/// Counts of the events from which frames are made.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct EventCounts {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub salvaged: Option<Salvaged>,
    pub events: u64,
    /// Lines of a text that could not be read; they do not count as events.
    pub lines_refused: u64,
    pub accepted: u64,
    /// The other events, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Late events that entered at the newest time.
    pub clamped: u64,
    /// Accepted events outside the part of the sensor that frames cover.
    pub outside_crop: u64,
    /// Events that left a sliding window early because it was full.
    pub evicted: u64,
    /// Frames without events that were pushed.
    pub empty_frames: u64,
    /// Frames without events beyond the longest silence, which were skipped.
    pub empty_frames_left_out: u64,
    /// Resets of the state after the longest silence.
    pub resets: u64,
    /// Restarts of the sensor's clock, each of which reset the network.
    pub restarts: u64,
}

/// Counts of readings of electrodes.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct ElectrodeCounts {
    /// Rows that were readings.
    pub readings: u64,
    /// Lines that could not be read; a new window begins after each.
    pub lines_refused: u64,
    /// Values outside the range of the sensor.
    pub values_out_of_range: u64,
    /// Readings too early or too late after the one before.
    pub rows_off_rate: u64,
    /// Readings so long after the one before that a new window begins.
    pub gaps: u64,
    /// Readings earlier than the one before; a new window begins with each.
    pub times_backwards: u64,
    /// Readings with the time of the one before.
    pub times_repeated: u64,
    /// Readings of a window.
    pub steps: usize,
    /// Number of times that a decision was made or changed, if values are logits of classes.
    pub decisions: Option<u64>,
}

/// Counts of pixels.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Pixels {
    pub computed: u64,
    /// Kept because their inputs had not changed.
    pub skipped: u64,
    /// Taken from the layer's output over zeros.
    pub absorbed: u64,
}

/// Counts of the pixels of a layer.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct LayerPixels {
    pub name: String,
    #[serde(flatten)]
    pub pixels: Pixels,
}

impl FrameSummary {
    pub(super) fn new(
        predictor: &FramePredictor,
        input: InputCounts,
        warnings: Vec<LossWarning>,
    ) -> Box<Self> {
        let counters = predictor.counters();
        let pixels =
            |&FrameLayerCounters { computed, skipped, absorbed }| Pixels { computed, skipped, absorbed };
        let layers: Vec<LayerPixels> = predictor
            .engine
            .network()
            .layers()
            .zip(&counters.layers)
            .map(|(name, counters)| LayerPixels { name: name.to_owned(), pixels: pixels(counters) })
            .collect();
        let FramePredictor { prepare, push, predict, decision, .. } = predictor;
        let spent = prepare.total() + push.total() + predict.total();
        let seconds = spent.as_secs_f64();
        let frames = counters.frames;
        let mut latency_us = Latencies::of([("prepare", prepare), ("push", push), ("predict", predict)]);
        latency_us.0.extend(decision.quantiles().map(|quantiles| ("decision", Some(quantiles))));
        Box::new(Self {
            input,
            warnings,
            frames,
            predictions: counters.predictions,
            latency_us,
            frames_per_s: (frames > 0 && seconds > 0.0).then(|| frames as f64 / seconds),
            real_time: predictor.passed.times_real_time(spent),
            outside_training: predictor.training.outside(),
            unlike_training: predictor.training.unlike(),
            pixels: layers.iter().fold(Pixels::default(), |sum, layer| Pixels {
                computed: sum.computed + layer.pixels.computed,
                skipped: sum.skipped + layer.pixels.skipped,
                absorbed: sum.absorbed + layer.pixels.absorbed,
            }),
            layers,
        })
    }
}

/// A frame engine that records the durations of its calls.
pub(super) struct FramePredictor {
    pub(super) engine: FrameEngine,
    before: FrameCounters,
    /// Time to make frames, for each event, reading or picture.
    pub(super) prepare: Latency,
    pub(super) push: Latency,
    pub(super) predict: Latency,
    /// Time from a reading to the decision after it, for readings that complete a window.
    pub(super) decision: Latency,
    pub(super) training: Training,
    /// Stream time that the input has covered.
    pub(super) passed: Passed,
    /// Time spent since the last prediction.
    update: Duration,
}

impl FramePredictor {
    pub(super) fn new(
        network: Arc<FrameNetwork>,
        options: FrameOptions,
        outputs: &[Output],
    ) -> Result<Self, EngineError> {
        let engine = FrameEngine::with_options(network, options)?;
        Ok(Self {
            before: engine.counters().clone(),
            engine,
            prepare: Latency::new(),
            push: Latency::new(),
            predict: Latency::new(),
            decision: Latency::new(),
            training: Training::new(outputs),
            passed: Passed::default(),
            update: Duration::ZERO,
        })
    }

    pub(super) fn resume(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.engine.restore_bytes(bytes)?;
        self.before = self.engine.counters().clone();
        Ok(())
    }

    /// Adds time spent on making a frame. [`Self::prepare`] records complete frames.
    pub(super) fn spent(&mut self, spent: Duration) {
        self.update += spent;
    }

    pub(super) fn prepared(&mut self, spent: Duration) {
        self.prepare.record(spent);
        self.spent(spent);
    }

    /// Pushes `frame`, (channels, rows, columns), row-major.
    pub(super) fn push(&mut self, frame: &[f32]) -> Result<(), EngineError> {
        let start = Instant::now();
        let pushed = self.engine.push(frame);
        let spent = start.elapsed();
        self.push.record(spent);
        self.update += spent;
        pushed
    }

    /// Predicts, and passes the prediction to `read`. The time of `read` counts too.
    pub(super) fn predict<T, E: From<EngineError>>(
        &mut self,
        read: impl FnOnce(FramePrediction<'_>) -> Result<T, E>,
    ) -> Result<T, E> {
        let start = Instant::now();
        let read = self.engine.predict().map_err(E::from).and_then(read);
        let spent = start.elapsed();
        self.predict.record(spent);
        self.update += spent;
        read
    }

    /// Resets to the state before the first frame.
    pub(super) fn reset(&mut self) {
        let start = Instant::now();
        self.engine.reset();
        self.update += start.elapsed();
    }

    /// Time spent since the last call.
    pub(super) fn take_update(&mut self) -> Duration {
        std::mem::take(&mut self.update)
    }

    pub(super) fn counters(&self) -> FrameCounters {
        self.engine.counters().since(&self.before)
    }
}
