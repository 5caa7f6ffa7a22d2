//! An engine over events, as a session runs it.

use std::sync::Arc;

use meissner_engine::{BatchEngine, Engine, EngineError, Event, Network, Options, Search, Sensor, Trace};

use crate::error::ViewError;
use crate::facts::{ComparedLayer, Facts, Info};
use crate::frame::{Bytes, FrameWriter};
use crate::networks::Chosen;
use crate::scene;
use crate::subject::{Seen, Subject};

/// An engine over events that records which rows it computes.
pub struct EventGraph(Engine);

impl EventGraph {
    fn of(network: &Arc<Network>, sensor: Sensor) -> Result<Self, EngineError> {
        let options = Options::new().with_record_rows(true);
        Engine::with_options(Arc::clone(network), sensor, options).map(Self)
    }
}

impl Subject for EventGraph {
    type Network = Network;
    type Item = Event;
    type Sensor = Sensor;

    fn new(chosen: &Chosen, &sensor: &Sensor) -> Result<Self, ViewError> {
        Ok(Self::of(&chosen.network, sensor)?)
    }

    fn begin(&mut self) -> Result<(), ViewError> {
        *self = Self::of(self.0.network(), self.0.sensor())?;
        Ok(())
    }

    fn take(&mut self, events: &[Event]) -> Result<Option<Seen<'_>>, ViewError> {
        match *events {
            [event] => drop(self.0.push(event)),
            _ => drop(self.0.push_slice(events)),
        }
        let prediction = self.0.predict()?;
        Ok(Some(Seen { values: prediction.values, unlike: prediction.unlike }))
    }

    fn depends_from(&self, _events: &[Event]) -> Option<usize> {
        None
    }

    fn state(&self) -> Option<Vec<u8>> {
        Some(self.0.to_bytes())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), ViewError> {
        self.0.restore_bytes(state)?;
        self.0.predict()?;
        Ok(())
    }

    fn compare(&self, events: &[Event]) -> Result<Vec<ComparedLayer>, ViewError> {
        Ok(layers(&self.0, events)?)
    }

    fn facts(input: &str, &sensor: &Sensor, name: &str, chosen: &Chosen) -> Facts {
        Facts::of(input, sensor, name, chosen)
    }

    fn info(&self) -> Info {
        Info::of(self.0.event_counters())
    }

    fn nodes(&self) -> usize {
        self.0.nodes()
    }

    fn write(&self, _events: &[Event], to: &mut FrameWriter) {
        scene::write(&self.0, to);
    }

    fn work(&self, to: &mut Bytes<'_>) {
        scene::work(&self.0.counters(), to);
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

/// For the events and each layer: the number of rows, and of rows with other bits.
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
