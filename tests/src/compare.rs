//! An engine beside the stream that it has seen, and the comparison with a batch, bit for bit.

use std::sync::Arc;

use meissner_engine::{BatchEngine, Engine, Event, Network, Options, Outcome, Search, Sensor, Stream, Trace};
use meissner_kernels::Neighbour;

use crate::streams::{Script, Verb};

/// An engine beside a batch over the same events.
#[derive(Debug)]
pub struct Watched {
    /// The engine.
    pub engine: Engine,
    batch: BatchEngine,
}

impl Watched {
    /// An engine that poisons what expires.
    ///
    /// # Panics
    /// If the engine refuses the network.
    pub fn new(network: impl Into<Arc<Network>>, sensor: Sensor, search: Search) -> Self {
        Self::with_options(network, sensor, search, Options::new().with_poison(true))
    }

    /// An engine with these options.
    ///
    /// # Panics
    /// If the engine refuses the network or the options.
    pub fn with_options(
        network: impl Into<Arc<Network>>,
        sensor: Sensor,
        search: Search,
        options: Options,
    ) -> Self {
        let network = network.into();
        Self {
            engine: Engine::with_options(Arc::clone(&network), sensor, options)
                .expect("the network is exact"),
            batch: BatchEngine::new(network, sensor)
                .expect("the sensor has pixels")
                .with_late(options.late)
                .with_search(search),
        }
    }

    /// Pushes an event.
    ///
    /// # Panics
    /// If the batch does something else with it than the engine.
    pub fn push(&mut self, event: Event) -> Outcome {
        let outcome = self.engine.push(event);
        assert_eq!(self.batch.push(event), outcome, "{event:?}");
        outcome
    }

    /// Moves time on.
    pub fn advance(&mut self, t_us: i64) {
        self.engine.advance(t_us);
        self.batch.advance(t_us);
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.engine.reset();
        self.batch.reset();
    }

    /// The stream as a batch takes it.
    pub fn stream(&self) -> Stream<'_> {
        self.batch.stream()
    }

    /// What a batch computes.
    ///
    /// # Errors
    /// Why it does not.
    pub fn trace(&self) -> Result<Trace, String> {
        self.batch.trace().map_err(|e| e.to_string())
    }

    /// The prediction, after asserting that it equals the batch's bit for bit.
    ///
    /// # Errors
    /// What differs.
    pub fn predict(&mut self) -> Result<Vec<f32>, String> {
        let expected = self.trace()?.prediction;
        let got = self.engine.predict().map_err(|e| e.to_string())?.values.to_vec();
        if bits(&got) == bits(&expected) {
            Ok(got)
        } else {
            Err(format!("predicted {got:?}, batch {expected:?}"))
        }
    }

    /// Asserts that prediction, neighbourhoods and every row of every layer equal the batch's bit for bit.
    ///
    /// # Errors
    /// What differs first.
    pub fn compare(&mut self) -> Result<(), String> {
        self.compare_to(&self.trace()?)
    }

    /// The same with another search in the batch.
    ///
    /// # Errors
    /// What differs first.
    pub fn compare_with(&mut self, search: Search) -> Result<(), String> {
        let batch = self.batch.batch().clone().with_search(search);
        self.compare_to(&batch.forward(self.stream()).map_err(|e| e.to_string())?)
    }

    fn compare_to(&mut self, trace: &Trace) -> Result<(), String> {
        let got = self.engine.predict().map_err(|e| e.to_string())?.values.to_vec();
        let events = &trace.levels[0];
        let nodes = events.features[0].rows() - events.first;
        if self.engine.nodes() != nodes {
            return Err(format!("{} nodes, batch {nodes}", self.engine.nodes()));
        }
        for index in 0..nodes {
            let first = events.first as u32;
            let edges = events.edges.row(events.first + index).iter();
            // A frozen neighbour may have left the window; the engine then no longer tells it.
            let present = edges.filter(|n| n.row >= first);
            let expected: Vec<Neighbour> = present.map(|n| Neighbour { row: n.row - first, ..*n }).collect();
            let got = self.engine.neighbourhood(index);
            if got != expected {
                return Err(format!("neighbourhood of event {index}: {got:?}, batch {expected:?}"));
            }
        }
        for (l, level) in trace.levels.iter().enumerate() {
            for (f, feature) in level.features.iter().enumerate() {
                let expected: Vec<Vec<u32>> = (level.first..feature.rows())
                    .map(|row| bits(&feature.values(row).collect::<Vec<_>>()))
                    .collect();
                let got: Vec<Vec<u32>> = self.engine.feature(l, f).iter().map(|row| bits(row)).collect();
                if got != expected {
                    let row = got.iter().zip(&expected).position(|(a, b)| a != b);
                    return Err(format!(
                        "level {l} feature {f}: {} rows, batch {}; first difference in row {row:?}",
                        got.len(),
                        expected.len()
                    ));
                }
            }
        }
        if bits(&got) == bits(&trace.prediction) {
            Ok(())
        } else {
            Err(format!("predicted {got:?}, batch {:?}", trace.prediction))
        }
    }

    /// Runs a script, comparing at every `Predict`, after every reset and at the end.
    ///
    /// # Errors
    /// Where and what differs first.
    pub fn run(&mut self, script: &Script) -> Result<(), String> {
        self.run_with(script, Self::compare)
    }

    /// Runs a script, with `check` in the place of the comparison.
    ///
    /// # Errors
    /// Where and what it finds first.
    pub fn run_with(
        &mut self,
        script: &Script,
        mut check: impl FnMut(&mut Self) -> Result<(), String>,
    ) -> Result<(), String> {
        let mut clock = script.origin_us;
        for (i, verb) in script.verbs.iter().enumerate() {
            let compare = match *verb {
                Verb::Push { dt, x, y, on } => {
                    let event = script.event(clock, (dt, x, y, on));
                    if self.push(event) == Outcome::Accepted {
                        clock = event.t_us;
                    }
                    false
                }
                Verb::Advance { dt } => {
                    self.advance(clock + dt);
                    clock = if self.batch.events().is_empty() { clock } else { clock + dt };
                    false
                }
                Verb::Predict => true,
                Verb::Reset => {
                    self.reset();
                    true
                }
                Verb::Snapshot => {
                    let snapshot = self.engine.snapshot();
                    for step in 0..5 {
                        self.engine.push(script.event(clock, (step * 40, step as u16, 1, true)));
                    }
                    self.engine.predict().map_err(|e| format!("verb {i}: {e}"))?;
                    self.engine.restore(&snapshot).map_err(|e| format!("verb {i}: {e}"))?;
                    true
                }
            };
            if compare {
                check(self).map_err(|e| format!("verb {i}: {e}"))?;
            }
        }
        check(self).map_err(|e| format!("at the end: {e}"))
    }
}

/// Bit patterns.
pub fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}
