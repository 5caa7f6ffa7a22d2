//! The JSON in frames: facts about the input and the network, and small values that change.

use std::collections::BTreeMap;

use meissner_engine::{Candidates, EventCounters, Lifetime, Sensor};
use serde::Serialize;

use crate::networks::Chosen;

/// Data that seldom changes: the section FACT.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Facts {
    /// Counts changes of the network.
    pub version: u64,
    /// The input of the engine: "events", "pictures", "electrodes", "frames" of events, or events
    /// of several "sensors".
    pub kind: &'static str,
    /// Name of the input.
    pub input: String,
    /// Columns and rows of the sensor.
    pub sensor: [u16; 2],
    /// Whether more events will come.
    pub live: bool,
    /// Whether commands are carried out; false if another program runs the engine.
    pub controls: bool,
    /// The networks that can be chosen.
    pub networks: Vec<String>,
    /// The running network.
    pub network: String,
    /// Length of its window in microseconds.
    pub span_us: i64,
    /// Maximum number of events in the window.
    pub capacity: usize,
    /// Maximum number of neighbours of an event.
    pub neighbours: usize,
    /// Which events can be neighbours: "all", "past", or "frozen": past, and rows never change.
    pub candidates: &'static str,
    /// Names of the outputs.
    pub outputs: Vec<String>,
    /// Units of the outputs.
    pub units: Vec<String>,
    /// Whether the outputs are logits of classes.
    pub classes: bool,
    /// Layers that compute rows, from the lowest.
    pub layers: Vec<LayerFacts>,
    /// The truth over the whole input.
    pub truth: Vec<TruthFacts>,
    /// Facts of a network over frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameFacts>,
    /// Facts of several sensors side by side.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<SensorFacts>,
}

/// One of several sensors.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SensorFacts {
    /// Name of its input.
    pub name: String,
    /// Columns and rows.
    pub size: [u16; 2],
}

/// Facts of a network over frames.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FrameFacts {
    /// Number of frames after which the state is reset, if it is.
    pub steps: Option<usize>,
    /// Whether a prediction depends on earlier frames.
    pub remembers: bool,
    /// Column and row of each electrode.
    pub electrodes: Vec<[usize; 2]>,
}

/// A layer that computes rows.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct LayerFacts {
    /// Its name.
    pub name: String,
    /// Its level: 0 is that of the events.
    pub level: usize,
    /// Whether it is the pooling that starts the level.
    pub pooling: bool,
    /// Channels of a row.
    pub channels: usize,
    /// The word for a layer over frames in a file: "conv".
    #[serde(skip_serializing_if = "str::is_empty")]
    pub word: &'static str,
}

/// The truth about one output over time.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct TruthFacts {
    /// Index of the output.
    pub output: usize,
    /// Times in milliseconds from the first event, and values; `None` if unknown.
    pub points: Vec<(f64, Option<f64>)>,
}

/// Small values that change: the section INFO.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Info {
    /// Events that did not enter the window, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Events that left because they were older than the span.
    pub expired: u64,
    /// Events that left because the window was full.
    pub evicted: u64,
    /// Events that wait in front of the engine, and events that were lost there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub queue: Option<(u64, u64)>,
    /// Old live events to which the cursor cannot return.
    pub forgotten: u64,
    /// Whether the session compares with full recomputation.
    pub comparing: bool,
    /// The newest comparison.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compared: Option<Compared>,
    /// The reason why the newest command or prediction failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// A comparison with full recomputation.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Compared {
    /// Events before the cursor at that time.
    pub event: u64,
    /// Time of the full recomputation in microseconds.
    pub batch_us: f64,
    /// The events, each layer, the readout.
    pub layers: Vec<ComparedLayer>,
    /// The reason why there was no comparison.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Rows of a layer in a comparison.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct ComparedLayer {
    /// The layer.
    pub name: String,
    /// Its rows.
    pub rows: u64,
    /// Rows with other bits.
    pub differ: u64,
}

impl Facts {
    /// Facts of a network over an input without controls and without known truth.
    pub(crate) fn of(input: &str, sensor: Sensor, name: &str, chosen: &Chosen) -> Self {
        let (network, parts) = (&chosen.network, chosen.network.parts());
        let names = network.layers();
        let mut layers = Vec::with_capacity(names.len());
        for level in 0..network.levels() {
            // The input of the event level is not a layer.
            let first = usize::from(level == 0);
            for (i, &channels) in network.channels(level).iter().enumerate().skip(first) {
                let name = names.get(layers.len()).copied().unwrap_or_default().to_owned();
                layers.push(LayerFacts { name, level, pooling: i == 0, channels, word: "" });
            }
        }
        Self {
            span_us: parts.span_us,
            capacity: parts.capacity,
            neighbours: parts.graph.reach.most(),
            candidates: match parts.graph.candidates {
                Candidates::All => "all",
                Candidates::Past(Lifetime::Window) => "past",
                Candidates::Past(Lifetime::Frozen) => "frozen",
            },
            layers,
            ..Self::empty(input, [sensor.width, sensor.height], name, chosen)
        }
    }

    /// The same without the facts that only networks over events have.
    pub(crate) fn empty<N>(input: &str, sensor: [u16; 2], name: &str, chosen: &Chosen<N>) -> Self {
        Self {
            version: 0,
            kind: "events",
            input: input.to_owned(),
            sensor,
            live: true,
            controls: false,
            networks: vec![name.to_owned()],
            network: name.to_owned(),
            span_us: 0,
            capacity: 0,
            neighbours: 0,
            candidates: "",
            outputs: chosen.outputs.clone(),
            units: chosen.units.clone(),
            classes: chosen.classes,
            layers: Vec::new(),
            truth: Vec::new(),
            frames: None,
            sensors: Vec::new(),
        }
    }
}

impl Info {
    /// The counts of an engine.
    pub(crate) fn of(counters: &EventCounters) -> Self {
        let dropped = counters.dropped().into_iter().map(|(reason, count)| (reason.name(), count));
        Self {
            dropped: dropped.filter(|(_, count)| *count > 0).collect(),
            expired: counters.expired,
            evicted: counters.evicted,
            ..Self::default()
        }
    }
}
