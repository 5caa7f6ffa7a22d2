//! The engine's rows beside those of full recomputation, bit by bit.

use std::sync::Arc;

use meissner_engine::{BatchEngine, Engine, EngineError, Event, Search, Trace};

use crate::clock::Clock;
use crate::facts::{Compared, ComparedLayer};

/// While playing, comparisons take at most this share of the time.
const SHARE: f64 = 0.25;
/// Why there is no comparison of a very long live input.
const FORGOTTEN: &str = "its first events are forgotten, on which full recomputation depends";

/// Comparisons with full recomputation, while they are wanted.
#[derive(Debug, Default)]
pub(super) struct Comparison {
    on: bool,
    pub(super) newest: Option<Compared>,
    /// Time of the clock before which the next one does not begin while playing.
    next: f64,
}

impl Comparison {
    pub(super) fn is_on(&self) -> bool {
        self.on
    }

    pub(super) fn switch(&mut self, on: bool) {
        *self = Self { on, ..Self::default() };
    }

    /// Forgets what was compared.
    pub(super) fn forget(&mut self) {
        self.newest = None;
    }

    pub(super) fn is_due(&self, cursor: usize, playing: bool, clock: Clock) -> bool {
        let is_new = self.newest.as_ref().is_none_or(|newest| newest.event != cursor as u64);
        self.on && cursor > 0 && is_new && (!playing || clock() >= self.next)
    }

    /// Compares `engine` after `cursor` `events`, whose prediction has been read. `None`: some of
    /// them are not known any more.
    pub(super) fn compare(&mut self, engine: &Engine, cursor: usize, events: Option<&[Event]>, clock: Clock) {
        let start = clock();
        let compared = events.ok_or_else(|| FORGOTTEN.to_owned());
        let compared = compared.and_then(|events| layers(engine, events).map_err(|error| error.to_string()));
        let batch_us = clock() - start;
        self.next = clock() + batch_us * (1.0 / SHARE - 1.0);
        let (layers, error) = match compared {
            Ok(layers) => (layers, None),
            Err(error) => (Vec::new(), Some(error)),
        };
        self.newest = Some(Compared { event: cursor as u64, batch_us, layers, error });
    }
}

/// The events, each layer and the readout, compared.
fn layers(engine: &Engine, events: &[Event]) -> Result<Vec<ComparedLayer>, EngineError> {
    let batch = BatchEngine::new(Arc::clone(engine.network()), engine.sensor())?;
    let mut batch = batch.with_search(Search::Grid).with_bounded_memory();
    batch.push_slice(events);
    let trace = batch.trace()?;
    let names = std::iter::once("events").chain(engine.network().layers()).map(str::to_owned);
    let rows = features(engine, &trace);
    let mut layers: Vec<_> =
        names.zip(rows).map(|(name, (rows, differ))| ComparedLayer { name, rows, differ }).collect();
    let readout = trace.readout;
    let cells = (0..readout.rows()).map(|cell| readout.values(cell).collect::<Vec<f32>>());
    let (rows, differ) = differing(&engine.readout(), cells);
    layers.push(ComparedLayer { name: "readout".to_owned(), rows, differ });
    Ok(layers)
}

/// For the events and each layer: its rows, and those of other bits.
fn features(engine: &Engine, trace: &Trace) -> Vec<(u64, u64)> {
    let mut out = Vec::new();
    for (l, level) in trace.levels.iter().enumerate() {
        for (f, feature) in level.features.iter().enumerate() {
            let expected = (level.first..feature.rows()).map(|row| feature.values(row).collect());
            out.push(differing(&engine.feature(l, f), expected));
        }
    }
    out
}

fn differing(found: &[Vec<f32>], expected: impl ExactSizeIterator<Item = Vec<f32>>) -> (u64, u64) {
    let rows = found.len().max(expected.len());
    let bits = |row: &[f32]| row.iter().map(|value| value.to_bits()).collect::<Vec<u32>>();
    let equal = found.iter().zip(expected).filter(|(found, expected)| bits(found) == bits(expected)).count();
    (rows as u64, (rows - equal) as u64)
}
