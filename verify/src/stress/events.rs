//! A network over a stream of events, computed event by event, from scratch, and in f64.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{BatchEngine, Engine, EngineError, Event, Network, Search, Sensor, Trace};
use meissner_reference::{BatchNorm, Difference, EventReference, EventTrace};

use super::Run;
use super::result::{CaseResult, Errors, LayerError};
use crate::checked::{CheckedEngine, poisoned};
use crate::error::VerifyError;

/// A network and a stream for it.
#[derive(Clone, Debug)]
pub(super) struct EventRun {
    pub(super) network: Arc<Network>,
    /// Batch norms as they were before they were folded.
    pub(super) norms: BTreeMap<String, BatchNorm>,
    pub(super) sensor: Sensor,
    pub(super) events: Vec<Event>,
}

/// Predictions of a stream that are compared with a batch.
const COMPARED: usize = 32;
/// One in so many of these is computed in f64, too.
const PER_REFERENCE: usize = 8;

impl Run for EventRun {
    fn network(&self) -> String {
        self.network.name().to_owned()
    }

    fn compare(&self, result: &mut CaseResult) -> Result<(), VerifyError> {
        let Self { network, norms, sensor, events } = self;
        let batch = BatchEngine::new(Arc::clone(network), *sensor)?;
        let batch = batch.with_search(Search::Proposed(meissner_reference::PROPOSE));
        let mut checked = CheckedEngine::of(poisoned(Arc::clone(network), *sensor)?, batch);
        // No network that is stressed has a head.
        let reference = EventReference::new(Arc::clone(network), *sensor, None)?.with_norms(norms);
        let mut errors = LayerErrors::default();
        let stride = events.len().div_ceil(COMPARED);
        for (i, &event) in events.iter().enumerate() {
            checked.push(event);
            if (i + 1) % stride == 0 || i + 1 == events.len() {
                let trace = checked.batch.trace();
                let got = checked.engine.predict().map(|prediction| prediction.values.to_vec());
                result.compare(
                    &got,
                    &trace.as_ref().map(|trace| trace.prediction.clone()).map_err(Clone::clone),
                );
                let Ok(trace) = trace else { continue };
                // Counted at the prediction, if that is another one.
                result.different += u64::from(got.is_ok() && checked.compare_rows(&trace).is_err());
                if i + 1 == events.len() || (i + 1) / stride % PER_REFERENCE == 0 {
                    errors.add(network, &trace, &reference.forward(checked.batch.stream()));
                }
            }
        }
        result.steps = checked.engine.counters().events.accepted;
        errors.write(network, result);
        Ok(())
    }

    fn time_us(&self) -> Result<f64, EngineError> {
        let mut engine = Engine::new(Arc::clone(&self.network), self.sensor)?;
        let start = Instant::now();
        for &event in &self.events {
            engine.push(event);
            // A prediction that is refused is timed, too.
            let _ = engine.predict();
        }
        Ok(start.elapsed().as_secs_f64() * 1e6 / self.events.len() as f64)
    }
}

/// Differences from f64.
#[derive(Default)]
struct LayerErrors {
    prediction: Difference,
    /// Of each feature that a block wrote, level by level.
    layers: BTreeMap<(usize, usize), Difference>,
}

impl LayerErrors {
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

    fn write(&self, network: &Network, result: &mut CaseResult) {
        if self.prediction.values > 0 {
            result.prediction = Some(Errors::from(&self.prediction));
        }
        let worst = self.layers.iter().max_by(|a, b| a.1.relative().total_cmp(&b.1.relative()));
        result.layer = worst.map(|(&(l, b), difference)| LayerError {
            layer: network.level(l).blocks[b].name.clone(),
            relative: difference.relative(),
        });
        result.largest_activation = self.layers.values().map(|layer| layer.largest).fold(0.0, f64::max);
        result.infinite_inside = self.layers.values().map(|layer| layer.infinite).sum();
    }
}
