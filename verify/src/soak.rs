//! One engine over recordings in an endless loop, disturbed at random: errors of a long time.
//!
//! Enters: recordings. Leaves: latencies, comparisons with the batch at checkpoints, broken
//! promises. Invariant: engine and batch take the same events, except those that a snapshot
//! forgets. All but latencies and memory is determined by recordings, network and seed.

pub(crate) mod endless;
pub(crate) mod report;

pub use endless::Recording;
pub use report::{Calls, Checkpoint, Disturbances, Memory, PartReport, Ratio, Report};

use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{BatchEngine, Engine, EngineError, EventCounters, Network, Options, Search, Sensor};
use meissner_kernels::random::Random;
use meissner_run::latency::Latency;

use crate::checked::CheckedEngine;
use crate::error::VerifyError;
use crate::error::bits;
use crate::incremental::Incremental as _;
use endless::{Deck, Disturbance, Endless};
use report::{Part, judged, ratios};

/// How often predictions, disturbances and checkpoints come.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Seed of silences and disturbances.
    pub seed: u64,
    /// Events from one prediction to the next.
    pub every: u64,
    /// Mean number of events from one disturbance to the next.
    pub disturb_every: u64,
    /// Number of checkpoints, of which the first and the last tenth are compared.
    pub checkpoints: u64,
}

/// A soak under way.
pub struct Soak {
    settings: Settings,
    checked: CheckedEngine,
    stream: Endless,
    deck: Deck,
    start: Instant,
    /// Since the last checkpoint.
    latencies: Calls<Latency>,
    first: Part,
    last: Part,
    /// The counts and checkpoints so far.
    report: Report,
}

impl Soak {
    /// An engine of `network` with the default options, before the first of `recordings`.
    ///
    /// # Errors
    /// The engine refuses the network or the sensor.
    pub fn new(
        network: impl Into<Arc<Network>>,
        sensor: Sensor,
        recordings: Vec<Recording>,
        settings: Settings,
    ) -> Result<Self, VerifyError> {
        let network = network.into();
        let engine = Engine::new(Arc::clone(&network), sensor)?;
        let search = Search::Proposed(meissner_reference::PROPOSE);
        let batch = BatchEngine::new(network, sensor)?.with_search(search).with_bounded_memory();
        let stream = Endless::new(recordings, Random::new(settings.seed));
        let report = Report {
            recordings: stream.names(),
            isa: Options::default().isa.name(),
            seed: settings.seed,
            every: settings.every,
            ..Report::default()
        };
        Ok(Self {
            checked: CheckedEngine::of(engine, batch),
            stream,
            deck: Deck::new(Random::new(!settings.seed), settings.disturb_every),
            start: Instant::now(),
            latencies: Calls::default(),
            first: Part::default(),
            last: Part::default(),
            report,
            settings,
        })
    }

    /// Events so far.
    pub fn events(&self) -> u64 {
        self.report.events
    }

    /// Counts of accepted and dropped events.
    pub fn counters(&self) -> EventCounters {
        self.checked.engine.counters().events
    }

    /// Performs the disturbance that is due, pushes an event, and reads the prediction that is due.
    ///
    /// # Errors
    /// A layer computed NaN, or the engine refuses a state of its own.
    pub fn push(&mut self) -> Result<(), VerifyError> {
        if let Some(disturbance) = self.deck.after_an_event() {
            self.disturb(disturbance)?;
        }
        let event = self.stream.next();
        self.report.events += 1;
        let start = Instant::now();
        self.checked.engine.push(event);
        let pushed = Instant::now();
        if self.report.events.is_multiple_of(self.settings.every) {
            self.checked.engine.predict()?;
            self.latencies.predict.record(pushed.elapsed());
        }
        self.latencies.push.record(pushed - start);
        self.checked.batch.push(event);
        Ok(())
    }

    fn disturb(&mut self, disturbance: Disturbance) -> Result<(), EngineError> {
        let done = &mut self.report.disturbances;
        match disturbance {
            Disturbance::Silence => {
                done.silences += 1;
                self.stream.fall_silent();
            }
            Disturbance::Advance => {
                done.advances += 1;
                self.checked.advance(self.stream.fall_silent());
            }
            Disturbance::Bytes => {
                done.bytes += 1;
                let before = self.prediction()?;
                let engine = &mut self.checked.engine;
                let bytes = engine.to_bytes();
                *engine = Engine::new(Arc::clone(engine.network()), engine.sensor())?;
                engine.restore_bytes(&bytes)?;
                self.compare_return(&before)?;
            }
            Disturbance::Snapshot { detour } => {
                done.snapshots += 1;
                let before = self.prediction()?;
                let mut ahead = self.stream.clone();
                self.checked.engine.detour((0..detour).map(|_| ahead.next()))?;
                self.compare_return(&before)?;
            }
            Disturbance::Reset => {
                done.resets += 1;
                self.checked.reset();
            }
        }
        Ok(())
    }

    fn prediction(&mut self) -> Result<Vec<u32>, EngineError> {
        Ok(bits(self.checked.engine.predict()?.values))
    }

    /// Counts the return to a state that does not predict as it did.
    fn compare_return(&mut self, before: &[u32]) -> Result<(), EngineError> {
        self.report.disturbances.returns_that_differ += u64::from(self.prediction()? != before);
        Ok(())
    }

    /// Compares the prediction with the batch's. `memory` gives live and resident bytes after it.
    ///
    /// # Errors
    /// A layer computed NaN.
    pub fn checkpoint(
        &mut self,
        memory: impl FnOnce() -> [Option<u64>; 2],
    ) -> Result<&Checkpoint, VerifyError> {
        let batch = bits(&self.checked.batch.trace()?.prediction);
        let latencies = std::mem::take(&mut self.latencies);
        let compared = self.checked.batch.events().len();
        let prediction = self.checked.engine.predict()?;
        let found = bits(prediction.values);
        let [live_bytes, resident_bytes] = memory();
        let row = Checkpoint {
            events: self.report.events,
            t_us: prediction.t_us,
            nodes: prediction.nodes,
            compared,
            equal: found == batch,
            bits: found.iter().map(|bits| format!("{bits:08x}")).collect(),
            latency_us: latencies.quantiles(),
            live_bytes,
            resident_bytes,
            seconds: self.start.elapsed().as_secs_f64(),
        };
        let checkpoints = &mut self.report.checkpoints;
        let (number, part) = (checkpoints.len() as u64, self.settings.checkpoints.div_ceil(10));
        if number < part {
            self.first.add(&row, &latencies);
        }
        if number >= self.settings.checkpoints.saturating_sub(part) {
            self.last.add(&row, &latencies);
        }
        checkpoints.push(row);
        Ok(&checkpoints[number as usize])
    }

    /// The result. Live memory may grow by `memory_growth` percent after warm-up.
    pub fn report(self, memory_growth: u32, peak_resident_bytes: Option<u64>) -> Report {
        let accepted = self.counters().accepted;
        let (first, last) = (self.first.report(), self.last.report());
        let report = Report {
            rounds: self.stream.rounds(),
            accepted,
            ratio: ratios(&first, &last),
            first,
            last,
            peak_resident_bytes,
            seconds: self.start.elapsed().as_secs_f64(),
            ..self.report
        };
        judged(report, memory_growth)
    }
}
