//! What an engine reads out of presses at their instants: the very bits that a head reads at a run.

use std::iter::from_fn;

use meissner_engine::{Engine, EngineError, Features};
use meissner_run::RunError;

use super::samples::Samples;
use crate::error::{EvaluateError, RequestPart, Result};
use crate::presses::Presses;
use crate::workers::Workers;

/// Readouts at all instants, in their order.
#[derive(Clone, Debug)]
pub(super) struct Readouts {
    /// Values of a readout: cells, newest grid first, each with its channels; or those that a
    /// network predicts.
    pub(super) columns: usize,
    /// How many of them belong to a cell.
    pub(super) channels: usize,
    /// A readout after the other.
    pub(super) values: Vec<f32>,
    /// Statistics of the windows that have events.
    pub(super) windows: Vec<Features>,
    /// Events of all presses, and those of them that are on.
    pub(super) events: [u64; 2],
}

impl Readouts {
    /// The readouts of `engine`, which takes every `stride`-th event; with `predicted` what it
    /// predicts instead. Memory for two of each.
    ///
    /// # Errors
    /// A recording cannot be read any more, the network computes NaN, or a readout is infinite.
    pub(super) fn of(
        of: (&Presses, &Samples),
        engine: &Engine,
        stride: usize,
        predicted: bool,
        workers: &Workers,
    ) -> Result<Self> {
        let network = engine.network();
        let (grid, channels) = (network.parts().readout, network.readout_channels());
        let (columns, channels) = if predicted {
            (network.outputs(), 1)
        } else {
            (grid.columns * grid.rows * network.readout_times() * channels, channels)
        };
        let (sensor, span_us) = (engine.sensor(), network.parts().span_us);
        let found = at_instants(of, engine, stride, workers, |engine| {
            // It brings the rows up to date.
            let values = engine.predict()?.values.to_vec();
            Ok((if predicted { values } else { engine.readout().concat() }, engine.window_statistics()))
        })?;
        let instants = of.1.instants.len();
        let (mut values, mut windows) = (Vec::with_capacity(columns * instants), Vec::new());
        let mut events = [0, 0];
        for (press, (readouts, counts)) in found.into_iter().enumerate() {
            for (own, window) in readouts {
                if let Some(odd) = own.iter().find(|value| !value.is_finite()) {
                    let name = &of.0.recordings[of.1.presses[press]].name;
                    let found = format!("{odd} of {name}");
                    return Err(EvaluateError::request(RequestPart::Data, "finite readouts", found));
                }
                values.extend(own);
                windows.extend((window.events > 0).then(|| window.features(sensor, span_us)));
            }
            events = [events[0] + counts[0], events[1] + counts[1]];
        }
        Ok(Self { columns, channels, values, windows, events })
    }
}

/// What `engine` predicts at all instants, in their order.
///
/// # Errors
/// A recording cannot be read any more, or the network computes NaN.
pub(super) fn predictions(
    of: (&Presses, &Samples),
    engine: &Engine,
    stride: usize,
    workers: &Workers,
) -> Result<Vec<Vec<f32>>> {
    let found = at_instants(of, engine, stride, workers, |engine| Ok(engine.predict()?.values.to_vec()))?;
    Ok(found.into_iter().flat_map(|(predicted, _)| predicted).collect())
}

/// What `read` finds at the instants of each press, and the events of the press, and those of them
/// that are on.
fn at_instants<T: Send>(
    (presses, samples): (&Presses, &Samples),
    engine: &Engine,
    stride: usize,
    workers: &Workers,
    read: impl Fn(&mut Engine) -> std::result::Result<T, EngineError> + Sync,
) -> Result<Vec<(Vec<T>, [u64; 2])>> {
    let chosen: Vec<usize> = (0..samples.presses.len()).collect();
    workers.expect(chosen.len());
    workers.for_each(engine, &chosen, |engine, &press| {
        let recording = samples.presses[press];
        let events = presses.events(recording)?;
        let named = |error: EngineError| -> EvaluateError {
            let EngineError::NotANumber { layer, .. } = error else { return RunError::Engine(error).into() };
            let found = format!("NaN in layer {layer} for {}", presses.recordings[recording].name);
            EvaluateError::request(RequestPart::Data, "presses of which the network computes numbers", found)
        };
        engine.reset();
        let mut due = events.iter().step_by(stride).copied().peekable();
        let first = samples.instants.partition_point(|instant| instant.press < press);
        let mut found = Vec::new();
        for instant in samples.instants[first..].iter().take_while(|instant| instant.press == press) {
            engine.push_all(from_fn(|| due.next_if(|event| event.t_us <= instant.t_us)));
            engine.advance(instant.t_us);
            found.push(read(engine).map_err(named)?);
        }
        let on = events.iter().filter(|event| event.on).count();
        Ok::<_, EvaluateError>((found, [events.len() as u64, on as u64]))
    })
}
