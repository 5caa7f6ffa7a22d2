//! What a run of a frame network amounts to: counts and latencies, in the names of the JSON summary.

use std::collections::BTreeMap;
use std::io::{self, Write};

use meissner_engine::frames::FrameLayerCounters;
use serde::Serialize;

use super::electrodes::ElectrodeCounts;
use crate::run::table::quantiles;
use crate::text::Table;
use meissner_pipeline::frame_predictor::FramePredictor;
use meissner_pipeline::latency::Quantiles;
use meissner_pipeline::lost::Warning;
use meissner_pipeline::salvage::Salvaged;
use meissner_pipeline::text::grouped;

/// The whole run.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    /// What was read.
    #[serde(flatten)]
    input: InputCounts,
    /// What was lost of it without anybody having asked for that, where that is much.
    warnings: Vec<Warning>,
    /// Frames pushed.
    frames: u64,
    /// Predictions read.
    pub(super) predictions: u64,
    /// Times in microseconds.
    latency_us: Latencies,
    /// Frames per second spent in making and pushing them and in predictions.
    frames_per_s: Option<f64>,
    /// Over all layers.
    pixels: Pixels,
    layers: Vec<LayerPixels>,
}

/// How long steps took; none where there was none.
#[derive(Clone, Copy, Debug, Serialize)]
struct Latencies {
    prepare: Option<Quantiles>,
    push: Option<Quantiles>,
    predict: Option<Quantiles>,
    /// Over electrodes: from a reading to the decision behind it.
    #[serde(skip_serializing_if = "Option::is_none")]
    decision: Option<Quantiles>,
}

/// What was read.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(super) enum InputCounts {
    Events(EventCounts),
    Electrodes(ElectrodeCounts),
    Pictures {
        /// Pictures read.
        pictures: u64,
    },
}

#[derive(Debug, Serialize)]
pub(super) struct EventCounts {
    /// What was left out of the recording; none where it is whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) salvaged: Option<Salvaged>,
    /// Events taken.
    pub(super) events: u64,
    /// Lines of a text that were no events; not among the events.
    pub(super) lines_refused: u64,
    pub(super) accepted: u64,
    /// The others, by reason.
    pub(super) dropped: BTreeMap<&'static str, u64>,
    /// Late events that entered at the newest time.
    pub(super) clamped: u64,
    /// Accepted events beside the part of the sensor that frames show.
    pub(super) outside_crop: u64,
    /// Events that left a sliding window early because it was full.
    pub(super) evicted: u64,
    /// Frames without events that were pushed.
    pub(super) empty_frames: u64,
    /// Frames without events that were not, beyond the longest silence.
    pub(super) empty_frames_left_out: u64,
    /// Resets of the state after the longest silence.
    pub(super) resets: u64,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Pixels {
    computed: u64,
    /// Left as they were: nothing that they read had changed.
    skipped: u64,
    /// Taken from what the layer makes of zeros.
    absorbed: u64,
}

#[derive(Debug, Serialize)]
struct LayerPixels {
    name: String,
    #[serde(flatten)]
    pixels: Pixels,
}

impl Summary {
    pub(super) fn new(machine: &FramePredictor, input: InputCounts, warnings: Vec<Warning>) -> Self {
        let counters = machine.counters();
        let layers: Vec<LayerPixels> = machine
            .layers()
            .zip(&counters.layers)
            .map(|(name, &FrameLayerCounters { computed, skipped, absorbed })| LayerPixels {
                name: name.to_owned(),
                pixels: Pixels { computed, skipped, absorbed },
            })
            .collect();
        let spent = machine.prepare.total() + machine.push.total() + machine.predict.total();
        let seconds = spent.as_secs_f64();
        let frames = counters.frames;
        Self {
            input,
            warnings,
            frames,
            predictions: counters.predictions,
            latency_us: Latencies {
                prepare: machine.prepare.quantiles(),
                push: machine.push.quantiles(),
                predict: machine.predict.quantiles(),
                decision: machine.decision.quantiles(),
            },
            frames_per_s: (frames > 0 && seconds > 0.0).then(|| frames as f64 / seconds),
            pixels: layers.iter().fold(Pixels::default(), |sum, layer| Pixels {
                computed: sum.computed + layer.pixels.computed,
                skipped: sum.skipped + layer.pixels.skipped,
                absorbed: sum.absorbed + layer.pixels.absorbed,
            }),
            layers,
        }
    }

    /// Writes counts and tables with units.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out)?;
        self.input.write(out)?;
        writeln!(out, "frames       {} pushed", grouped(self.frames))?;
        writeln!(out, "predictions  {}", grouped(self.predictions))?;
        let latencies = [
            ("prepare", self.latency_us.prepare),
            ("push", self.latency_us.push),
            ("predict", self.latency_us.predict),
            ("decision", self.latency_us.decision),
        ];
        quantiles(out, &latencies)?;
        if let Some(rate) = self.frames_per_s {
            writeln!(
                out,
                "  {rate:.1} frames/s, counting the time in preparing, pushing and predicting only"
            )?;
        }
        let mut table = Table::new(&["layer (pixels)", "computed", "skipped", "absorbed", "computed (%)"]);
        let mut row = |name: &str, Pixels { computed, skipped, absorbed }: Pixels| {
            let all = computed + skipped + absorbed;
            let share = match all {
                0 => "-".to_owned(),
                _ => format!("{:.2}", computed as f64 / all as f64 * 100.0),
            };
            table.row([name.to_owned(), grouped(computed), grouped(skipped), grouped(absorbed), share]);
        };
        for layer in &self.layers {
            row(&layer.name, layer.pixels);
        }
        row("all", self.pixels);
        writeln!(out)?;
        table.write(out)
    }
}

impl InputCounts {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        match self {
            Self::Events(counts) => counts.write(out),
            Self::Electrodes(counts) => counts.write(out),
            Self::Pictures { pictures } => writeln!(out, "pictures     {}", grouped(*pictures)),
        }
    }
}

impl EventCounts {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "events       {} taken, {} accepted", grouped(self.events), grouped(self.accepted))?;
        for (reason, &count) in self.dropped.iter().filter(|&(_, &count)| count > 0) {
            writeln!(out, "dropped      {} {}", grouped(count), reason.replace('_', " "))?;
        }
        let notes = [
            (self.lines_refused, "lines that are no events"),
            (self.clamped, "late events entered at the newest time"),
            (self.outside_crop, "events beside the part of the sensor that frames show"),
            (self.evicted, "events left their window early because it was full"),
            (self.empty_frames, "frames without events"),
            (self.empty_frames_left_out, "frames without events left out, beyond the longest silence"),
            (self.resets, "resets of the state in a silence"),
        ];
        for (count, note) in notes.into_iter().filter(|&(count, _)| count > 0) {
            writeln!(out, "             {} {note}", grouped(count))?;
        }
        Ok(())
    }
}
