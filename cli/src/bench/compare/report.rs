//! All results of a comparison, in the names of the JSON report.

use std::collections::BTreeMap;

use serde::Serialize;

use super::super::report::Distribution;
use meissner_pipeline::lost::Warning;
use meissner_pipeline::provenance::{Header, ModelCard};

/// The whole comparison.
#[derive(Debug, Serialize)]
pub(super) struct Comparison {
    /// What ran on what.
    pub(super) header: Header,
    #[serde(skip)]
    pub(super) recording: String,
    /// The part of it, where not all is taken.
    pub(super) part: Option<String>,
    #[serde(skip)]
    pub(super) card: ModelCard,
    /// The frame network.
    pub(super) against: ModelCard,
    /// Columns and rows.
    #[serde(skip)]
    pub(super) sensor: [u16; 2],
    /// What makes the frames, with the keys of a description.
    pub(super) frames_of: String,
    /// What they show of the sensor.
    pub(super) field: String,
    /// Whether frames have pixels that the sensor has not.
    pub(super) padded: bool,
    /// From moment to moment.
    pub(super) period_us: i64,
    /// Instruction set of the kernels.
    pub(super) isa: &'static str,
    /// Passes of each way, of which the fastest counts.
    pub(super) passes: u32,
    pub(super) events: u64,
    /// Lines of a text that were no events; not among the events.
    pub(super) lines_refused: u64,
    pub(super) accepted: u64,
    pub(super) dropped: BTreeMap<&'static str, u64>,
    /// What was lost without anybody having asked for it, where that is much.
    pub(super) warnings: Vec<Warning>,
    /// Accepted events that no frame shows; the network over events takes them too.
    pub(super) outside_frames: u64,
    /// Events that left a sliding frame before their time because it was full.
    pub(super) evicted_from_frames: u64,
    /// Moments at which all predict.
    pub(super) moments: u64,
    /// From the first event to the last moment, in seconds.
    pub(super) stream_s: f64,
    /// Of a frame of which nothing is skipped.
    pub(super) multiply_adds_per_frame: u64,
    pub(super) ways: WaysReport,
    /// Compute of the network over events.
    pub(super) ratio_percent: Ratios,
    pub(super) multiply_adds_ratio_percent: Ratios,
    /// Predictions in which both ways over frames differ in any bit.
    pub(super) predictions_that_differ: u64,
    /// Most that the process had resident; none where the platform does not say.
    pub(super) peak_resident_bytes: Option<u64>,
}

/// The ways to predict at the same moments.
#[derive(Debug, Serialize)]
pub(super) struct WaysReport {
    /// The network over events, incrementally.
    pub(super) events: WayReport,
    /// The frame network, everything computed for every frame.
    pub(super) frames_everything: WayReport,
    /// The same, without what no change reaches.
    pub(super) frames_skipping: WayReport,
}

/// One way.
#[derive(Debug, Serialize)]
pub(super) struct WayReport {
    pub(super) compute_s: f64,
    /// Per second of stream.
    pub(super) compute_s_per_s: Option<f64>,
    /// Of these: events entering the window, or the frame.
    pub(super) events_s: f64,
    /// Taking frames.
    pub(super) push_s: Option<f64>,
    pub(super) predict_s: f64,
    pub(super) frames: Option<u64>,
    pub(super) predictions: u64,
    /// Of the network over events at full neighbourhoods, its readout and dense layers left out.
    pub(super) multiply_adds: u64,
    /// Activations, graph and state.
    pub(super) state_bytes: u64,
    /// Compute of a moment: its events, its frame, its prediction.
    pub(super) moment_us: Option<Distribution>,
}

/// The network over events in percent of both ways over frames.
#[derive(Debug, Serialize)]
pub(super) struct Ratios {
    pub(super) frames_everything: Option<f64>,
    pub(super) frames_skipping: Option<f64>,
}

impl Ratios {
    pub(super) fn of(ways: &WaysReport, of: impl Fn(&WayReport) -> f64) -> Self {
        let percent = |to: f64| (to > 0.0).then(|| of(&ways.events) / to * 100.0);
        Self {
            frames_everything: percent(of(&ways.frames_everything)),
            frames_skipping: percent(of(&ways.frames_skipping)),
        }
    }
}
