//! Runs one engine over recordings in an endless loop, with random disturbances, to find errors
//! that show only after a long time.
//!
//! Input: recordings. Output: latencies, comparisons with the batch at checkpoints, broken
//! promises. Invariants: engine and batch take the same events, except those that a snapshot
//! forgets. Everything between two checkpoints, except latencies and memory, is determined by
//! recordings, network, seed and the number of the second one. So finished checkpoints are all that
//! a killed process must leave behind.

pub(crate) mod endless;
pub(crate) mod report;

pub use endless::Recording;
pub use report::{Calls, Checkpoint, Disturbances, Memory, PartReport, Ratio, Report};

use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{BatchEngine, Engine, EngineError, EventCounters, Network, Options, Search, Sensor};
use meissner_kernels::random::Random;
use meissner_run::fingerprint::Fingerprint;
use meissner_run::journal::Journal;
use meissner_run::latency::Latency;
use serde::{Deserialize, Serialize};

use crate::checked::CheckedEngine;
use crate::error::VerifyError;
use crate::error::bits;
use crate::incremental::Incremental as _;
use endless::{Deck, Disturbance, Endless};

/// Intervals of predictions, disturbances and checkpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Seed of silences and disturbances.
    pub seed: u64,
    /// Events from one prediction to the next.
    pub every: u64,
    /// Mean number of events from one disturbance to the next.
    pub disturb_every: u64,
    /// Events from one checkpoint to the next.
    pub checkpoint_every: u64,
}

/// Everything that determines a checkpoint, except latencies and memory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the keys of the file")]
pub struct Key {
    /// Fingerprint of network and weights.
    pub network: String,
    /// Fingerprint of the recordings.
    pub recordings: String,
    pub sensor: [u16; 2],
    #[serde(flatten)]
    pub settings: Settings,
    /// Number of the checkpoint, from 1 on.
    pub checkpoint: u64,
    /// Events up to it since the one before.
    pub events: u64,
    pub isa: String,
    pub version: String,
}

/// Finished checkpoints, and the file that keeps them.
pub type State = Journal<Key, Checkpoint>;

/// A running soak.
pub struct Soak {
    /// The key of the next checkpoint.
    key: Key,
    recordings: Arc<[Recording]>,
    checked: CheckedEngine,
    stream: Endless,
    deck: Deck,
    start: Instant,
    /// Accepted events before the last checkpoint.
    accepted: u64,
    /// Latencies since the last checkpoint.
    latencies: Calls<Latency>,
    disturbances: Disturbances,
    checkpoints: Vec<Checkpoint>,
}

impl Soak {
    /// An engine of `network` with the default options, before the first checkpoint.
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
        let batch = BatchEngine::new(Arc::clone(&network), sensor)?.with_search(search).with_bounded_memory();
        let recordings: Arc<[Recording]> = recordings.into();
        let mut fingerprint = Fingerprint::default();
        recordings.iter().for_each(|recording| fingerprint.events(recording.events()));
        let key = Key {
            network: format!("{:016x}", network.fingerprint()),
            recordings: fingerprint.finish(),
            sensor: [sensor.width, sensor.height],
            settings,
            checkpoint: 1,
            events: 0,
            isa: Options::default().isa.name().to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let (stream, deck) = beginning(&recordings, &settings, key.checkpoint);
        Ok(Self {
            key,
            checked: CheckedEngine::of(engine, batch),
            stream,
            deck,
            recordings,
            start: Instant::now(),
            accepted: 0,
            latencies: Calls::default(),
            disturbances: Disturbances::default(),
            checkpoints: Vec::new(),
        })
    }

    /// Events so far.
    pub fn events(&self) -> u64 {
        self.checkpoints.last().map_or(0, |last| last.events) + self.key.events
    }

    /// Counts of the accepted and dropped events that this process has pushed.
    pub fn counters(&self) -> EventCounters {
        self.checked.engine.counters().events
    }

    /// Performs a due disturbance, pushes an event, and reads a due prediction.
    ///
    /// # Errors
    /// A layer computed NaN, or the engine refuses its own state.
    pub fn push(&mut self) -> Result<(), VerifyError> {
        if let Some(disturbance) = self.deck.after_an_event() {
            self.disturb(disturbance)?;
        }
        let event = self.stream.next();
        self.key.events += 1;
        let start = Instant::now();
        self.checked.engine.push(event);
        let pushed = Instant::now();
        if self.key.events.is_multiple_of(self.key.settings.every) {
            self.checked.engine.predict()?;
            self.latencies.predict.record(pushed.elapsed());
        }
        self.latencies.push.record(pushed - start);
        self.checked.batch.push(event);
        Ok(())
    }

    fn disturb(&mut self, disturbance: Disturbance) -> Result<(), EngineError> {
        let done = &mut self.disturbances;
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

    /// Counts the return if the prediction after it differs from the one before.
    fn compare_return(&mut self, before: &[u32]) -> Result<(), EngineError> {
        self.disturbances.returns_that_differ += u64::from(self.prediction()? != before);
        Ok(())
    }

    /// Takes the next checkpoint from `state`, if it has the one after `events` further events.
    pub fn resume(&mut self, state: &State, events: u64) -> Option<&Checkpoint> {
        let found = state.find(&Key { events, ..self.key.clone() })?;
        self.begin_after(found.clone());
        self.checkpoints.last()
    }

    /// Compares the prediction with the batch's. `memory` gives live and resident bytes after it.
    /// Then everything is forgotten.
    ///
    /// # Errors
    /// A layer computed NaN, or the state cannot be written.
    pub fn checkpoint(
        &mut self,
        state: &mut State,
        memory: impl FnOnce() -> [Option<u64>; 2],
    ) -> Result<&Checkpoint, VerifyError> {
        let batch = bits(&self.checked.batch.trace()?.prediction);
        let compared = self.checked.batch.events().len();
        let prediction = self.checked.engine.predict()?;
        let found = bits(prediction.values);
        let (t_us, nodes) = (prediction.t_us, prediction.nodes);
        let [live_bytes, resident_bytes] = memory();
        let checkpoint = Checkpoint {
            events: self.events(),
            accepted: self.counters().accepted - self.accepted,
            rounds: self.stream.rounds(),
            disturbances: self.disturbances,
            t_us,
            nodes,
            compared,
            equal: found == batch,
            bits: found.iter().map(|bits| format!("{bits:08x}")).collect(),
            latency_us: self.latencies.quantiles(),
            live_bytes,
            resident_bytes,
            seconds: self.checkpoints.last().map_or(0.0, |last| last.seconds)
                + self.start.elapsed().as_secs_f64(),
        };
        let checkpoint = state.add(self.key.clone(), checkpoint)?;
        self.begin_after(checkpoint);
        Ok(&self.checkpoints[self.checkpoints.len() - 1])
    }

    fn begin_after(&mut self, checkpoint: Checkpoint) {
        self.checkpoints.push(checkpoint);
        (self.key.checkpoint, self.key.events) = (self.key.checkpoint + 1, 0);
        (self.stream, self.deck) = beginning(&self.recordings, &self.key.settings, self.key.checkpoint);
        self.checked.reset();
        self.accepted = self.counters().accepted;
        self.latencies = Calls::default();
        self.disturbances = Disturbances::default();
        self.start = Instant::now();
    }

    /// The result. Live memory may grow by `memory_growth` percent after warm-up.
    pub fn report(self, memory_growth: u32, peak_resident_bytes: Option<u64>) -> Report {
        let settings = self.key.settings;
        let report = Report {
            recordings: self.recordings.iter().map(|recording| recording.name().to_owned()).collect(),
            isa: self.key.isa,
            seed: settings.seed,
            every: settings.every,
            peak_resident_bytes,
            ..Report::default()
        };
        report::judged(report.with_checkpoints(self.checkpoints), memory_growth)
    }
}

/// Stream and disturbances from a checkpoint to the one with this number.
fn beginning(recordings: &Arc<[Recording]>, settings: &Settings, checkpoint: u64) -> (Endless, Deck) {
    // Numbers of a sequence, because sequences of neighbouring seeds contain each other.
    let mut random = Random::new(settings.seed ^ checkpoint.rotate_right(16));
    let mut random = || Random::new(random.bits());
    (Endless::new(Arc::clone(recordings), random()), Deck::new(random(), settings.disturb_every))
}
