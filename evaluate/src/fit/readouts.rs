//! What an engine reads out of presses at their instants: the very bits that a head reads at a run.

use std::iter::from_fn;

use meissner_engine::{Engine, EngineError};
use meissner_run::RunError;

use super::samples::Samples;
use crate::error::{EvaluateError, RequestPart, Result};
use crate::presses::Presses;
use crate::workers::Workers;

/// Readouts at all instants, in their order.
#[derive(Clone, Debug)]
pub(super) struct Readouts {
    /// Values of a readout: cells, newest grid first, each with its channels.
    pub(super) columns: usize,
    /// A readout after the other.
    pub(super) values: Vec<f32>,
    /// What the network predicts as it is, at each instant.
    pub(super) predicted: Vec<Vec<f32>>,
    /// Events of all presses, and those of them that are on.
    pub(super) events: [u64; 2],
}

/// What a press gives.
struct OfPress {
    values: Vec<f32>,
    predicted: Vec<Vec<f32>>,
    events: [u64; 2],
}

impl Readouts {
    /// The readouts of `engine`, which takes every `stride`-th event. Memory for two of each.
    ///
    /// # Errors
    /// A recording cannot be read any more, the network computes NaN, or a readout is infinite.
    pub(super) fn of(
        (presses, samples): (&Presses, &Samples),
        engine: &Engine,
        stride: usize,
        workers: &Workers,
    ) -> Result<Self> {
        let columns = {
            let parts = engine.network().parts().readout;
            parts.columns
                * parts.rows
                * engine.network().readout_times()
                * engine.network().readout_channels()
        };
        let chosen: Vec<usize> = (0..samples.presses.len()).collect();
        workers.expect(chosen.len());
        let found = workers.for_each(engine, &chosen, |engine, &press| {
            of_press((presses, samples), engine, stride, press).map(|found| (press, found))
        })?;
        let (mut values, mut predicted, mut events) =
            (Vec::with_capacity(columns * samples.instants.len()), Vec::new(), [0, 0]);
        for (press, of) in found {
            if let Some(odd) = of.values.iter().find(|value| !value.is_finite()) {
                let name = &presses.recordings[samples.presses[press]].name;
                let found = format!("{odd} of {name}");
                return Err(EvaluateError::request(RequestPart::Data, "finite readouts", found));
            }
            values.extend(of.values);
            predicted.extend(of.predicted);
            events = [events[0] + of.events[0], events[1] + of.events[1]];
        }
        Ok(Self { columns, values, predicted, events })
    }
}

fn of_press(
    (presses, samples): (&Presses, &Samples),
    engine: &mut Engine,
    stride: usize,
    press: usize,
) -> Result<OfPress> {
    let recording = samples.presses[press];
    let events = presses.events(recording)?;
    let named = |error: EngineError| -> EvaluateError {
        let name = presses.recordings[recording].name.clone();
        match error {
            EngineError::NotANumber { layer, .. } => {
                let found = format!("NaN in layer {layer} for {name}");
                EvaluateError::request(
                    RequestPart::Data,
                    "presses of which the network computes numbers",
                    found,
                )
            }
            other => RunError::Engine(other).into(),
        }
    };
    engine.reset();
    let mut due = events.iter().step_by(stride).copied().peekable();
    let mut of = OfPress {
        values: Vec::new(),
        predicted: Vec::new(),
        events: [events.len() as u64, events.iter().filter(|event| event.on).count() as u64],
    };
    let first = samples.instants.partition_point(|instant| instant.press < press);
    for instant in samples.instants[first..].iter().take_while(|instant| instant.press == press) {
        engine.push_all(from_fn(|| due.next_if(|event| event.t_us <= instant.t_us)));
        engine.advance(instant.t_us);
        of.predicted.push(engine.predict().map_err(named)?.values.to_vec());
        of.values.extend(engine.readout().concat());
    }
    Ok(of)
}
