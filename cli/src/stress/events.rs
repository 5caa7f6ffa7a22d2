//! A network over events, run over a stream in three ways: event by event, from scratch, and in f64.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{
    Batch, Engine, EngineError, Event, Network, Options, Outcome, Search, Sensor, Stream, Trace,
};
use meissner_reference::{BatchNorm, Difference, EventReference, EventTrace};

use super::row::{Errors, Expect, LayerError, Row, same_bits};
use crate::error::CliError;

/// A stream through a network.
#[derive(Clone, Debug)]
pub(super) struct Subject {
    pub(super) network: Arc<Network>,
    pub(super) sensor: Sensor,
    pub(super) events: Vec<Event>,
}

/// A stream through a network, and what is known of it.
#[derive(Clone, Debug)]
pub(super) struct EventCase {
    pub(super) group: &'static str,
    pub(super) name: &'static str,
    pub(super) subject: Subject,
    /// Batch norms as they were before they were folded.
    pub(super) norms: BTreeMap<String, BatchNorm>,
    pub(super) expect: Expect,
    /// Largest relative error of a prediction.
    pub(super) within: f64,
    /// What its time is compared with.
    pub(super) ordinary: Subject,
}

/// Predictions of a stream that are compared with a batch.
const COMPARED: usize = 32;
/// Of these, every so many are computed in f64, too.
const PER_REFERENCE: usize = 8;

impl EventCase {
    /// Runs the case, with `passes` of timing.
    pub(super) fn run(&self, passes: usize) -> Result<Row, CliError> {
        let Subject { network, sensor, events } = &self.subject;
        let mut row = Row::new(self.group, self.name, network.name());
        let options = Options::new().with_poison(true);
        let mut engine = Engine::with_options(Arc::clone(network), *sensor, options)?;
        let search = Search::Proposed(meissner_reference::PROPOSE);
        let batch = Batch::new(Arc::clone(network), *sensor)?.with_search(search);
        // Parameters of no shipped network's head are needed: none that is stressed has one.
        let reference =
            EventReference::new(Arc::clone(network), *sensor, None).map_err(CliError::Reference)?;
        let reference = reference.with_norms(&self.norms);
        let mut errors = Found::default();
        let mut accepted = Vec::with_capacity(events.len());
        let stride = events.len().div_ceil(COMPARED);
        for (i, &event) in events.iter().enumerate() {
            if engine.push(event) == Outcome::Accepted {
                accepted.push(event);
            }
            if (i + 1) % stride == 0 || i + 1 == events.len() {
                let got = engine.predict().map(|prediction| prediction.values.to_vec());
                let trace = batch.forward(Stream::new(&accepted));
                compare(&mut row, &engine, &got, &trace);
                let last = i + 1 == events.len();
                if let Ok(trace) = &trace
                    && (last || (i + 1) / stride % PER_REFERENCE == 0)
                {
                    errors.add(network, trace, &reference.forward(Stream::new(&accepted)));
                }
            }
        }
        row.steps = accepted.len() as u64;
        errors.write(network, &mut row);
        self.time(&mut row, passes)?;
        Ok(row.judge(self.expect, self.within))
    }

    fn time(&self, row: &mut Row, passes: usize) -> Result<(), CliError> {
        let (mut own, mut ordinary) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..passes {
            ordinary = ordinary.min(self.ordinary.us_an_event()?);
            own = own.min(self.subject.us_an_event()?);
        }
        if passes > 0 {
            (row.us, row.times_ordinary) = (Some(own), Some(own / ordinary));
        }
        Ok(())
    }
}

impl Subject {
    /// Microseconds of an event and the prediction after it, mean over the stream.
    fn us_an_event(&self) -> Result<f64, EngineError> {
        let mut engine = Engine::new(Arc::clone(&self.network), self.sensor)?;
        let start = Instant::now();
        for &event in &self.events {
            engine.push(event);
            // What a layer that computes NaN costs is asked here, too.
            let _ = engine.predict();
        }
        Ok(start.elapsed().as_secs_f64() * 1e6 / self.events.len() as f64)
    }
}

/// Notes whether the engine has what the batch computed.
fn compare(
    row: &mut Row,
    engine: &Engine,
    got: &Result<Vec<f32>, EngineError>,
    trace: &Result<Trace, EngineError>,
) {
    let want = trace.as_ref().map(|trace| trace.prediction.clone()).map_err(Clone::clone);
    row.compare(got, &want);
    let Ok(trace) = trace else { return };
    for (l, level) in trace.levels.iter().enumerate() {
        for (f, feature) in level.features.iter().enumerate() {
            let stored = engine.feature(l, f);
            let rows = level.first..feature.rows();
            let equal = stored.len() == rows.len()
                && rows
                    .zip(&stored)
                    .all(|(row, got)| same_bits(&feature.values(row).collect::<Vec<_>>(), got));
            if !equal {
                row.different += 1;
                return;
            }
        }
    }
}

/// Differences from f64.
#[derive(Default)]
struct Found {
    prediction: Difference,
    /// Of each feature that a block wrote, level by level.
    layers: BTreeMap<(usize, usize), Difference>,
}

impl Found {
    fn add(&mut self, network: &Network, got: &Trace, want: &EventTrace) {
        self.prediction.add_all(&got.prediction, &want.prediction);
        for (l, (got, want)) in got.levels.iter().zip(&want.levels).enumerate() {
            for b in 0..network.level(l).blocks.len() {
                let layer = self.layers.entry((l, b)).or_default();
                for row in got.first..got.features[b + 1].rows() {
                    let values: Vec<f32> = got.features[b + 1].values(row).collect();
                    layer.add_all(&values, &want.features[b + 1][row]);
                }
            }
        }
    }

    fn write(&self, network: &Network, row: &mut Row) {
        if self.prediction.values > 0 {
            row.prediction = Some(Errors::from(&self.prediction));
        }
        let worst = self.layers.iter().max_by(|a, b| a.1.relative().total_cmp(&b.1.relative()));
        row.layer = worst.map(|(&(l, b), difference)| LayerError {
            layer: network.level(l).blocks[b].name.clone(),
            relative: difference.relative(),
        });
        row.largest_activation = self.layers.values().map(|layer| layer.largest).fold(0.0, f64::max);
        row.infinite_inside = self.layers.values().map(|layer| layer.infinite).sum();
    }
}
