//! A network on a recording of a grasp.

use std::time::Instant;

use meissner_engine::Event;

use crate::error::EvaluateError;
use crate::regression::engine::{Count, PressEngine};
use crate::regression::press::{Presses, TimedPrediction, newest};

/// The label of the force.
pub(crate) const FORCE: &str = "force";
/// The labels of the phase's number and of the bolt's diameter.
const PHASE: &str = "phase";
const BOLT: &str = "bolt";

/// What a network said about a recording.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    /// Predicted and true force at the end of each frame, in newtons.
    pub(crate) values: Vec<f64>,
    pub(crate) truth: Vec<f64>,
    /// The number of the phase at the end of each frame; `None` where the file does not say.
    pub(crate) phases: Vec<Option<usize>>,
    /// Diameter of the bolt, where the file has it.
    pub(crate) bolt_mm: Option<f64>,
    /// Mean squared error of the newest prediction that a reader has, over the milliseconds.
    pub(crate) newest: Option<f64>,
    /// Number of pushed events.
    pub(crate) events: u64,
    pub(crate) count: Count,
    /// Time for each prediction, with the events since the one before it, in nanoseconds.
    pub(crate) update_ns: Vec<u64>,
    /// The part of it for the events, all together.
    pub(crate) push_ns: u64,
}

impl Outcome {
    /// The sum of `figure` of the error at each frame, and the number of frames.
    pub(crate) fn sum(&self, figure: impl Fn(f64) -> f64) -> (f64, u64) {
        let errors = self.values.iter().zip(&self.truth).map(|(value, truth)| figure(value - truth));
        (errors.sum(), self.values.len() as u64)
    }
}

/// Lets `engine` predict during recording `number`, from every `stride`-th event, every `every_us`,
/// which divides `period_us`. The force at the end of each `period_us` counts.
pub(crate) fn run(
    engine: &mut PressEngine,
    recordings: &Presses,
    number: usize,
    stride: usize,
    (every_us, period_us): (i64, i64),
) -> Result<Outcome, EvaluateError> {
    let [start, end] = recordings.truth.span_us(number);
    let label = |name: &str, since: i64| recordings.truth.at(name, number, start + since);
    let force = |since: i64| label(FORCE, since).unwrap_or(f64::NAN);
    engine.reset(0);
    let before = engine.count();
    let part = recordings.streams.parts()[number];
    // Frames begin with the truth, and so do the engine's times.
    let since_start = |event: &Event| Event::new(event.t_us - start, event.x, event.y, event.on);
    let mut events = part.iter().step_by(stride).map(since_start).peekable();
    let (mut values, mut pushed, mut push_ns, mut free_us) = (Vec::new(), 0, 0, 0.0_f64);
    let (mut found, mut update_ns): (Vec<TimedPrediction>, Vec<u64>) = (Vec::new(), Vec::new());
    for t_us in (every_us..=end - start).step_by(every_us as usize) {
        let clock = Instant::now();
        // An event at the end of a frame belongs to the next one.
        while let Some(event) = events.next_if(|event: &Event| event.t_us < t_us) {
            engine.push(event)?;
            pushed += 1;
        }
        push_ns += clock.elapsed().as_nanos() as u64;
        engine.predict(t_us, &mut values)?;
        let spent = clock.elapsed().as_nanos();
        update_ns.push(spent as u64);
        free_us = free_us.max(t_us as f64) + spent as f64 / 1e3;
        found.push(TimedPrediction {
            t_us,
            available_us: free_us,
            values: values.iter().copied().map(f64::from).collect(),
        });
    }
    let of_frames = || found.iter().filter(|found| found.t_us % period_us == 0);
    let square = |held: &TimedPrediction, t_us: i64| {
        vec![(held.values[0] - force(t_us)) * (held.values[0] - force(t_us))]
    };
    Ok(Outcome {
        values: of_frames().map(|found| found.values[0]).collect(),
        truth: of_frames().map(|found| force(found.t_us)).collect(),
        phases: of_frames()
            .map(|found| label(PHASE, found.t_us).map(|phase| phase.round() as usize))
            .collect(),
        bolt_mm: label(BOLT, 0),
        newest: newest(&found, 0, end - start, square).map(|means| means[0]),
        events: pushed,
        count: engine.count().since(before),
        update_ns,
        push_ns,
    })
}
