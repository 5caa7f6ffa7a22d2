//! A network over events with each of its settings.
//!
//! Enters: streams of events. Leaves: times, work and numerical error of a setting; with labels, its wrong answers, too.
//! The exact network and the setting take turns, [`TURN`] events each, so that whatever slows the machine slows both. A
//! prediction is read after each event that enters; it stands until the next one, and is compared at every event with what
//! the exact network says then.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{Counters, Event, Network, Options, Outcome, Sensor};

use super::measurement::{Measurement, Subject};
use super::numerical::Differences;
use super::settings::{Setting, row_costs};
use super::timing::{Lap, Timing};
use super::wrong::Judge;
use crate::error::CliError;
use meissner_pipeline::approximations::Approximations;
use meissner_pipeline::filtered::FilteredEngine;

/// Events from one turn to the next.
const TURN: usize = 1000;

/// A network over events, and what it is measured on.
pub(super) struct EventSubject<'a> {
    pub(super) name: String,
    /// Where the weights come from.
    pub(super) weights: String,
    pub(super) fingerprint: String,
    /// The exact one.
    pub(super) network: Network,
    pub(super) sensor: Sensor,
    pub(super) settings: Vec<Setting>,
    /// What is timed; each begins with an engine that has seen no event.
    pub(super) streams: Vec<&'a [Event]>,
    pub(super) repeats: u32,
    /// Answers against labels, where there are any.
    pub(super) judge: Option<Judge<'a>>,
}

/// An engine that runs, and what it has said last.
struct Machine {
    front: FilteredEngine,
    last: Vec<f32>,
    lap: Lap,
}

impl Subject for EventSubject<'_> {
    fn network(&self) -> &str {
        &self.name
    }

    fn weights(&self) -> &str {
        &self.weights
    }

    fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    fn settings(&self) -> Vec<String> {
        self.settings.iter().map(|setting| setting.name.clone()).collect()
    }

    fn measure(&self, setting: usize) -> Result<Measurement, CliError> {
        let setting = &self.settings[setting];
        let adapted = Arc::new(setting.network(&self.network)?);
        let exact = Arc::new(self.network.clone());
        let mut own = Machine::new(Arc::clone(&adapted), self.sensor, &setting.approximations)?;
        let mut exact = Machine::new(exact, self.sensor, &Approximations::default())?;
        let mut differences = Differences::default();
        let mut counters = None;
        let mut laps = Vec::new();
        for repeat in 0..self.repeats {
            self.take_turns(&mut own, &mut exact, (repeat == 0).then_some(&mut differences))?;
            counters.get_or_insert_with(|| own.front.counters());
            laps.push((own.take_lap(), exact.take_lap()));
        }
        let timed = self.streams.iter().map(|events| events.len() as u64).sum();
        let per_event = |count: u64| count as f64 / timed as f64;
        let Counters { layers, .. } = counters.expect("there is at least one repeat");
        let costs = row_costs(&adapted);
        let products = layers.iter().zip(&costs).map(|(layer, cost)| layer.recomputed * cost).sum();
        let passed = own.front.passed() / u64::from(self.repeats);
        Ok(Measurement {
            timed,
            entered: per_event(passed),
            timing: Timing::of(&laps),
            rows: per_event(layers.iter().map(|layer| layer.recomputed).sum()),
            multiply_adds: per_event(products),
            numerical: differences.finish(),
            task: match &self.judge {
                Some(judge) => judge.task(setting)?.into_iter().collect(),
                None => Vec::new(),
            },
        })
    }
}

impl EventSubject<'_> {
    /// Both over all streams; compares what they say where that is asked for.
    fn take_turns(
        &self,
        own: &mut Machine,
        exact: &mut Machine,
        mut differences: Option<&mut Differences>,
    ) -> Result<(), CliError> {
        let outputs = self.network.outputs();
        let (mut said, mut right) = (Vec::new(), Vec::new());
        for events in &self.streams {
            own.reset()?;
            exact.reset()?;
            for (turn, part) in events.chunks(TURN).enumerate() {
                // Neither always runs on what the other left in the caches.
                if turn % 2 == 0 {
                    exact.run(part, &mut right)?;
                    own.run(part, &mut said)?;
                } else {
                    own.run(part, &mut said)?;
                    exact.run(part, &mut right)?;
                }
                let Some(differences) = differences.as_deref_mut() else { continue };
                let pairs = right.chunks_exact(outputs).zip(said.chunks_exact(outputs));
                for (place, (right, said)) in pairs.enumerate() {
                    differences.add((turn * TURN + place, events.len()), right, said);
                }
            }
        }
        Ok(())
    }
}

impl Machine {
    fn new(network: Arc<Network>, sensor: Sensor, approximations: &Approximations) -> Result<Self, CliError> {
        let front = FilteredEngine::new(network, sensor, approximations, Options::default())?;
        Ok(Self { front, last: Vec::new(), lap: Lap::default() })
    }

    /// Forgets all events, and says what it says of none.
    fn reset(&mut self) -> Result<(), CliError> {
        self.front.reset();
        self.last.clear();
        self.last.extend_from_slice(self.front.readout.predict()?.values);
        Ok(())
    }

    /// Takes `events`, and leaves what it says after each of them in `said`.
    fn run(&mut self, events: &[Event], said: &mut Vec<f32>) -> Result<(), CliError> {
        said.clear();
        for &event in events {
            let (passes, filtering) = self.front.admit(event);
            let start = Instant::now();
            let accepted = passes && self.front.readout.push(event) == Outcome::Accepted;
            let push = filtering + start.elapsed();
            let mut predict = Duration::ZERO;
            if accepted {
                let start = Instant::now();
                let prediction = self.front.readout.predict();
                predict = start.elapsed();
                self.last.copy_from_slice(prediction?.values);
            }
            self.lap.record(push, push + predict);
            said.extend_from_slice(&self.last);
        }
        Ok(())
    }

    fn take_lap(&mut self) -> Lap {
        std::mem::take(&mut self.lap)
    }
}
