//! The frame of a session: what its engine shows, and what the session knows beside it.

use std::collections::BTreeMap;

use meissner_engine::{Candidates, Lifetime};
use serde::Serialize;

use super::Session;
use crate::frame::FrameWriter;
use crate::scene;

/// What seldom changes: the section FACT.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Facts {
    /// Counts changes of the network.
    pub version: u64,
    /// Name of the input.
    pub input: String,
    /// Columns and rows of the sensor.
    pub sensor: [u16; 2],
    /// Whether more events will come.
    pub live: bool,
    /// The networks that can be chosen.
    pub networks: Vec<String>,
    /// The one that runs.
    pub network: String,
    /// Length of its window in microseconds.
    pub span_us: i64,
    /// Most events of the window.
    pub capacity: usize,
    /// Most neighbours of an event.
    pub neighbours: usize,
    /// Which events can be neighbours: "all", "past", or "frozen": past, and rows never change.
    pub candidates: &'static str,
    /// Names of the outputs.
    pub outputs: Vec<String>,
    /// Units of the outputs.
    pub units: Vec<String>,
    /// Whether the outputs are logits of classes.
    pub classes: bool,
    /// Layers that compute rows, from below.
    pub layers: Vec<LayerFacts>,
    /// What is true, over the whole input.
    pub truth: Vec<TruthFacts>,
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
}

/// What is true of one output, over time.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct TruthFacts {
    /// Index of the output.
    pub output: usize,
    /// Times in milliseconds from the first event, and values; none where it is not known.
    pub points: Vec<(f64, Option<f64>)>,
}

/// Small things that change: the section INFO.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Info {
    /// Events that did not enter the window, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Events that left because they were older than the span.
    pub expired: u64,
    /// Events that left because the window was full.
    pub evicted: u64,
    /// Events that wait in front of the engine, and those that were lost there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub queue: Option<(u64, u64)>,
    /// Old live events to which the cursor cannot return.
    pub forgotten: u64,
    /// Whether the session compares with full recomputation.
    pub comparing: bool,
    /// The newest comparison.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compared: Option<Compared>,
    /// Why the newest command or prediction failed.
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
    /// Why there was none.
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

impl Session {
    /// Counts changes of [`Self::facts`]: where it has changed, a page needs them again.
    pub fn facts_version(&self) -> u64 {
        self.facts
    }

    /// A frame with the section FACT alone, for a page that has opened and after a change.
    pub fn facts(&self) -> Vec<u8> {
        let mut to = FrameWriter::new();
        to.json(*b"FACT", &self.describe());
        to.finish()
    }

    fn describe(&self) -> Facts {
        let (chosen, network) = (&self.chosen, &self.chosen.network);
        let parts = network.parts();
        let names = network.layers();
        let mut layers = Vec::with_capacity(names.len());
        for level in 0..network.levels() {
            let pooling = usize::from(level == 0);
            for (i, &channels) in network.channels(level).iter().enumerate().skip(pooling) {
                let name = names.get(layers.len()).copied().unwrap_or_default().to_owned();
                layers.push(LayerFacts { name, level, pooling: i == 0, channels });
            }
        }
        Facts {
            version: self.facts,
            input: self.name.clone(),
            sensor: [self.sensor.width, self.sensor.height],
            live: self.live,
            networks: self.networks.names(),
            network: self.network.clone(),
            span_us: parts.span_us,
            capacity: parts.capacity,
            neighbours: parts.graph.reach.most(),
            candidates: match parts.graph.candidates {
                Candidates::All => "all",
                Candidates::Past(Lifetime::Window) => "past",
                Candidates::Past(Lifetime::Frozen) => "frozen",
            },
            outputs: chosen.outputs.clone(),
            units: chosen.units.clone(),
            classes: chosen.classes,
            layers,
            truth: self.truths(),
        }
    }

    fn truths(&self) -> Vec<TruthFacts> {
        let first_us = self.history.absolute_us(0.0);
        let columns = self.truth.columns(&self.chosen.outputs, &self.chosen.units);
        let known = columns.into_iter().enumerate().filter_map(|(output, column)| Some((output, column?)));
        let point = |column: usize, (t_us, values): &(i64, Vec<f64>)| {
            let value = values.get(column).copied().filter(|value| value.is_finite());
            (t_us.saturating_sub(first_us) as f64 / 1e3, value)
        };
        let of = |(output, column)| TruthFacts {
            output,
            points: self.truth.rows.iter().map(|row| point(column, row)).collect(),
        };
        known.map(of).collect()
    }

    fn info(&self) -> Info {
        let counters = self.engine.event_counters();
        let dropped = counters.dropped().into_iter().map(|(reason, count)| (reason.name(), count));
        Info {
            dropped: dropped.filter(|(_, count)| *count > 0).collect(),
            expired: counters.expired,
            evicted: counters.evicted,
            queue: self.queue,
            forgotten: self.history.forgotten,
            comparing: self.comparison.is_on(),
            compared: self.comparison.newest.clone(),
            error: self.error.clone(),
        }
    }

    /// The frame of this moment.
    pub(super) fn frame(&self) -> Vec<u8> {
        let (history, outputs) = (&self.history, self.chosen.network.outputs());
        let now_us = history.time_of(history.cursor);
        let at_end = history.cursor == history.len();
        let seeking = !self.playing && history.cursor < self.target;
        let flags = [self.playing, at_end, self.live, seeking];
        let flags = (0..).zip(flags).map(|(bit, set)| u32::from(set) << bit).sum();
        let mut to = FrameWriter::new();
        to.section(*b"TIME", |to| {
            to.f64(now_us);
            to.f64(history.end_us() as f64);
            to.f64(history.cursor as f64);
            to.f64(history.len() as f64);
            to.f32(self.speed as f32);
            to.u32(flags);
        });
        scene::write(&self.engine, &mut to);
        let truths = self.truth.columns(&self.chosen.outputs, &self.chosen.units);
        let truth = truths.iter().map(|column| {
            column.map_or(f32::NAN, |column| self.truth.at(column, history.absolute_us(now_us)) as f32)
        });
        to.section(*b"PRED", |to| {
            to.count(outputs);
            to.count(self.engine.nodes());
            to.f32(self.unlike.unwrap_or(f32::NAN));
            to.f32(self.took_us.map_or(f32::NAN, |us| us as f32));
            (0..outputs).for_each(|i| to.f32(self.prediction.get(i).copied().unwrap_or(f32::NAN)));
            truth.chain(std::iter::repeat(f32::NAN)).take(outputs).for_each(|value| to.f32(value));
        });
        to.section(*b"SERS", |to| self.series.write(outputs, to));
        to.section(*b"LATE", |to| self.latency.write(to));
        to.section(*b"WORK", |to| scene::work(&self.engine.counters(), to));
        to.json(*b"INFO", &self.info());
        to.finish()
    }
}
