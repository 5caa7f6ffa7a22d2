//! Readouts of an engine at the instants of presses, bit for bit as a head reads them in a run.

use std::iter::from_fn;

use meissner_engine::{Engine, EngineError, Event, Features, Sensor};
use meissner_run::RunError;

use super::samples::{Instant, Samples};
use crate::error::{EvaluateError, RequestPart, Result};
use crate::presses::Presses;
use crate::workers::Workers;

/// Readouts at all instants, in their order.
#[derive(Clone, Debug)]
pub(super) struct Readouts {
    /// Number of values of a readout: cells, newest grid first, each with its channels; or number
    /// of predicted values.
    pub(super) columns: usize,
    /// Number of values of a cell.
    pub(super) channels: usize,
    /// The readouts, one after the other.
    pub(super) values: Vec<f32>,
    /// Statistics of the windows with events, of presses that are not moved.
    pub(super) windows: Vec<Features>,
    /// Number of events of all presses, and of on events among them.
    pub(super) events: [u64; 2],
}

impl Readouts {
    /// The readouts of `engine`, which takes every `stride`-th event; with `predicted`, its
    /// predictions instead. Memory for two of each.
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
        let found = at_instants(of, engine, stride, workers, |engine, instant| {
            // `predict` brings the rows up to date.
            let values = engine.predict()?.values.to_vec();
            let window = engine.window_statistics();
            let is_real = instant.moved == [0, 0] && window.events > 0;
            let values = if predicted { values } else { engine.readout().concat() };
            Ok((values, is_real.then(|| window.features(sensor, span_us))))
        })?;
        let instants = of.1.instants.len();
        let (mut values, mut windows) = (Vec::with_capacity(columns * instants), Vec::new());
        let mut events = [0, 0];
        for (press, (readouts, counts)) in found.into_iter().enumerate() {
            for (own, window) in readouts {
                if let Some(odd) = own.iter().find(|value| !value.is_finite()) {
                    let name = &of.0.recordings[of.1.presses[press]].name;
                    let found = format!("{odd} of {name}");
                    return Err(EvaluateError::request(RequestPart::Folder, "finite readouts", found));
                }
                values.extend(own);
                windows.extend(window);
            }
            events = [events[0] + counts[0], events[1] + counts[1]];
        }
        Ok(Self { columns, channels, values, windows, events })
    }
}

/// The predictions of `engine` at all instants, in their order.
///
/// # Errors
/// A recording cannot be read any more, or the network computes NaN.
pub(super) fn predictions(
    of: (&Presses, &Samples),
    engine: &Engine,
    stride: usize,
    workers: &Workers,
) -> Result<Vec<Vec<f32>>> {
    let found = at_instants(of, engine, stride, workers, |engine, _| Ok(engine.predict()?.values.to_vec()))?;
    Ok(found.into_iter().flat_map(|(predicted, _)| predicted).collect())
}

/// The results of `read` at the instants of each press, the number of its events, and of on events
/// among them.
fn at_instants<T: Send>(
    (presses, samples): (&Presses, &Samples),
    engine: &Engine,
    stride: usize,
    workers: &Workers,
    read: impl Fn(&mut Engine, &Instant) -> std::result::Result<T, EngineError> + Sync,
) -> Result<Vec<(Vec<T>, [u64; 2])>> {
    let chosen: Vec<usize> = (0..samples.presses.len()).collect();
    workers.expect(chosen.len());
    workers.for_each(engine, &chosen, |engine, &press| {
        let recording = samples.presses[press];
        let events = presses.events(recording)?;
        let named = |error: EngineError| -> EvaluateError {
            let EngineError::NotANumber { layer, .. } = error else { return RunError::Engine(error).into() };
            let found = format!("NaN in layer {layer} for {}", presses.recordings[recording].name);
            EvaluateError::request(
                RequestPart::Folder,
                "presses of which the network computes numbers",
                found,
            )
        };
        let [first, end] =
            [press, press + 1].map(|press| samples.instants.partition_point(|instant| instant.press < press));
        let mut found = Vec::new();
        for instants in samples.instants[first..end].chunk_by(|a, b| a.moved == b.moved) {
            engine.reset();
            let sensor = engine.sensor();
            let taken = events.iter().step_by(stride);
            let mut due = taken.filter_map(|event| moved(event, instants[0].moved, sensor)).peekable();
            for instant in instants {
                engine.push_all(from_fn(|| due.next_if(|event| event.t_us <= instant.t_us)));
                engine.advance(instant.t_us);
                found.push(read(engine, instant).map_err(named)?);
            }
        }
        let on = events.iter().filter(|event| event.on).count();
        Ok::<_, EvaluateError>((found, [events.len() as u64, on as u64]))
    })
}

/// `event` moved by columns and rows; `None` beside the sensor.
fn moved(event: &Event, [columns, rows]: [i32; 2], sensor: Sensor) -> Option<Event> {
    let to = |from: u16, by: i32| u16::try_from(i32::from(from) + by).ok();
    let moved = Event { x: to(event.x, columns)?, y: to(event.y, rows)?, ..*event };
    (moved.x < sensor.width && moved.y < sensor.height).then_some(moved)
}
