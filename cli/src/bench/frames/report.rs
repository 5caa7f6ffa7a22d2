//! All results of a frame network, in the names of the JSON report.

use std::collections::BTreeMap;

use meissner_engine::frames::FrameEngine;
use serde::Serialize;

use super::super::report::{DeadlineReport, Distribution};
use super::model::FrameModel;
use super::pass::FrameLatencies;
use meissner_pipeline::lost::Warning;
use meissner_pipeline::provenance::{Header, ModelCard};

/// The whole benchmark. Counts are of one pass, except those of distributions.
#[derive(Debug, Serialize)]
pub(super) struct FrameReport {
    /// What ran on what.
    pub(super) header: Header,
    #[serde(skip)]
    pub(super) recording: String,
    /// The part of it, where not all is taken.
    pub(super) part: Option<String>,
    /// Columns and rows.
    #[serde(skip)]
    pub(super) sensor: [u16; 2],
    #[serde(skip)]
    pub(super) card: ModelCard,
    /// What makes the frames, with the keys of a description.
    pub(super) frames_of: String,
    /// What they show of the sensor.
    pub(super) field: String,
    /// From frame to frame.
    pub(super) period_us: i64,
    /// Instruction set of the kernels.
    pub(super) isa: &'static str,
    /// Passes that count, each with skipping and without.
    pub(super) passes: u32,
    pub(super) warmup_frames: u64,
    /// What a measurement of nothing takes; it is contained in every push and prediction.
    pub(super) clock_us: f64,
    pub(super) events: u64,
    /// Lines of a text that were no events; not among the events.
    pub(super) lines_refused: u64,
    pub(super) accepted: u64,
    pub(super) dropped: BTreeMap<&'static str, u64>,
    /// What was lost without anybody having asked for it, where that is much.
    pub(super) warnings: Vec<Warning>,
    /// Accepted events that no frame shows.
    pub(super) outside_frames: u64,
    /// Events that left a sliding window before their time because it was full.
    pub(super) evicted: u64,
    pub(super) frames: u64,
    /// From the first event to the last frame, in seconds.
    pub(super) stream_s: f64,
    /// Of a frame of which nothing is skipped.
    pub(super) multiply_adds_per_frame: u64,
    /// What no change reaches keeps its values.
    pub(super) skipping: WayReport,
    /// Everything is computed.
    pub(super) everything: WayReport,
    /// Most that the process had resident; none where the platform does not say.
    pub(super) peak_resident_bytes: Option<u64>,
    /// Of the first pass with skipping.
    pub(super) deadline: DeadlineReport,
}

/// One way to compute.
#[derive(Debug, Serialize)]
pub(super) struct WayReport {
    pub(super) latency_us: FrameLatencyReport,
    /// Seconds of compute for the whole stream, of one pass in the mean.
    pub(super) compute_s: f64,
    /// Frames over that time.
    pub(super) frames_per_s: Option<f64>,
    pub(super) layers: Vec<LayerPixels>,
    pub(super) multiply_adds: u64,
    pub(super) multiply_adds_per_s: Option<f64>,
    /// Activations and state.
    pub(super) state_bytes: u64,
}

#[derive(Debug, Serialize)]
pub(super) struct FrameLatencyReport {
    /// Events entering the frame, and reading it.
    pub(super) frame: Option<Distribution>,
    pub(super) push: Option<Distribution>,
    pub(super) predict: Option<Distribution>,
    pub(super) push_predict: Option<Distribution>,
}

/// Pixels of a layer; a layer over vectors has one.
#[derive(Debug, Serialize)]
pub(super) struct LayerPixels {
    pub(super) name: String,
    /// Of all frames.
    pub(super) pixels: u64,
    /// Of these, computed: whole blocks, so that some of those below are computed nevertheless.
    pub(super) computed: u64,
    /// Left as they were, because nothing that they read had changed.
    pub(super) skipped: u64,
    /// Taken from what the layer gives without events.
    pub(super) absorbed: u64,
    pub(super) multiply_adds: u64,
}

impl WayReport {
    /// What `passes` passes measured; counters are those of the last one's `engine`.
    pub(super) fn new(
        model: &FrameModel,
        engine: &FrameEngine,
        latencies: &FrameLatencies,
        passes: u32,
    ) -> Self {
        let counters = engine.counters();
        let compute_s = latencies.total().as_secs_f64() / f64::from(passes);
        let over = |amount: u64| (compute_s > 0.0).then(|| amount as f64 / compute_s);
        let layers = model.costs.iter().zip(&counters.layers).map(|(cost, layer)| LayerPixels {
            name: cost.name.clone(),
            pixels: cost.pixels * counters.frames,
            computed: layer.computed,
            skipped: layer.skipped,
            absorbed: layer.absorbed,
            multiply_adds: cost.of(layer),
        });
        let multiply_adds = model.multiply_adds(&counters.layers);
        let FrameLatencies { frame, push, predict, push_predict } = latencies;
        Self {
            latency_us: FrameLatencyReport {
                frame: Distribution::of(frame),
                push: Distribution::of(push),
                predict: Distribution::of(predict),
                push_predict: Distribution::of(push_predict),
            },
            compute_s,
            frames_per_s: over(counters.frames),
            layers: layers.collect(),
            multiply_adds,
            multiply_adds_per_s: over(multiply_adds),
            state_bytes: engine.state_bytes() as u64,
        }
    }
}
