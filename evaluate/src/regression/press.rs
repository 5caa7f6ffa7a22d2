//! Presses: streams of events with the truth along time, and a network on each.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{EngineError, Event};
use meissner_models::AnyDescription;

use crate::error::{EvaluateError, RequestPart, Result, StreamsError};
use crate::regression::engine::{Count, PressEngine};
use crate::streams::{Streams, Truth};
use crate::trainings::Training;
use crate::trials::{Cases, Trial};
use crate::units::{DEGREES, factor};

const MILLISECOND_US: i64 = 1_000;
/// An angle that stays within this many degrees of the truth has settled.
const SETTLED_DEG: f64 = 1.0;

pub(crate) struct Presses {
    pub(crate) streams: Streams,
    pub(crate) truth: Truth,
}

/// A network's predictions for a press, in the units of the report.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outcome {
    /// The values at the end, as the network gives them.
    pub(super) values: Vec<f32>,
    pub(super) truth: Vec<f64>,
    /// Absolute errors of each output at every time since contact, and at the end.
    pub(super) errors_at: Vec<Vec<f64>>,
    /// How unlike the window was at these times.
    pub(super) unlike_at: Vec<Option<f32>>,
    /// The mean of each output's absolute error of the newest prediction that a reader has, over
    /// the milliseconds since contact; `None` where no prediction came in time.
    pub(super) newest: Option<Vec<f64>>,
    /// Share of the press from which on all angles stay within [`SETTLED_DEG`], if they do.
    pub(super) settled: Option<f64>,
    /// The network's readout at the end, if it is embedded.
    pub(super) readout: Option<Vec<f32>>,
    pub(super) effort: Effort,
}

/// The cost of a press.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Effort {
    /// Pushed events.
    pub(crate) events: u64,
    pub(crate) count: Count,
    /// Time for each prediction, with the events since the one before it, in nanoseconds.
    pub(crate) update_ns: Vec<u64>,
    /// The part of this time for all events.
    pub(crate) push_ns: u64,
}

impl Presses {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let mut streams = Streams::read(path)?;
        let truth = streams.truth.take().ok_or_else(|| EvaluateError::Streams {
            path: path.to_owned(),
            source: StreamsError::Tensor {
                tensor: "truth.t_us".to_owned(),
                expected: "labels along time, as `simulate markers` copies them from tracks".to_owned(),
                found: "nothing".to_owned(),
            },
        })?;
        Ok(Self { streams, truth })
    }

    pub(crate) fn len(&self) -> usize {
        self.streams.parts().len()
    }

    pub(super) fn labels(&self) -> Vec<String> {
        self.truth.names().map(str::to_owned).collect()
    }

    /// `Ok` where there is a label for each output of `network`, in a unit that can be compared.
    pub(crate) fn check(&self, network: &str, quantities: &[Quantity]) -> Result<()> {
        match quantities.iter().find(|quantity| !self.truth.names().any(|name| name == quantity.name)) {
            None => quantities.iter().try_for_each(|quantity| {
                if self.in_unit_of(quantity).is_some() {
                    return Ok(());
                }
                let Quantity { name, unit, .. } = quantity;
                let expected = format!("labels {name} in {unit}, as {network} predicts");
                Err(EvaluateError::request(RequestPart::Labels, expected, &self.streams.units[name]))
            }),
            Some(Quantity { name, .. }) => {
                let expected =
                    format!("networks that predict labels of the file: {}", self.labels().join(", "));
                let found = format!("{network}, which predicts {name}");
                Err(EvaluateError::request(RequestPart::Networks, expected, found))
            }
        }
    }

    /// The factor from a label to the unit of `quantity`; `None` if that is another kind of unit. A
    /// label without a unit has the one of the network's output.
    fn in_unit_of(&self, quantity: &Quantity) -> Option<f64> {
        let unit = self.streams.units.get(&quantity.name);
        unit.map_or(Some(quantity.scale), |unit| factor(unit, &quantity.unit))
    }

    /// The trials of `trainings`: a whole training has seen no press.
    pub(crate) fn trials(&self, trainings: &[Arc<Training>]) -> Result<Vec<Trial>> {
        let mut cases = Cases::default();
        (0..self.len()).for_each(|press| cases.push(&press.to_string(), 1));
        let all: Vec<usize> = (0..self.len()).collect();
        cases.trials(trainings, &all, |_| Ok(()))
    }

    /// Contact and end of `press`.
    fn span_us(&self, press: usize) -> [i64; 2] {
        self.truth.contact_and_end_us(press)
    }

    /// Multiples of `every_us` since contact, from 0 to the end of the longest press.
    pub(super) fn times(&self, every_us: i64) -> Vec<i64> {
        let length = |press| {
            let [contact, end] = self.span_us(press);
            end - contact
        };
        let longest = (0..self.len()).map(length).max().unwrap_or(0);
        (0..=(longest + every_us - 1) / every_us).map(|i| i * every_us).collect()
    }

    /// Lets `engine` predict from every `stride`-th event; `embeds` asks for the readout.
    pub(super) fn judge(
        &self,
        engine: &mut PressEngine,
        press: usize,
        quantities: &[Quantity],
        stride: usize,
        every_us: i64,
        embeds: bool,
    ) -> Result<Outcome> {
        let [contact, end] = self.span_us(press);
        let start = self.truth.span_us(press)[0];
        let factors: Vec<f64> =
            quantities.iter().map(|quantity| self.in_unit_of(quantity).unwrap_or(f64::NAN)).collect();
        let truth_at = |t_us: i64| -> Vec<f64> {
            let label = |quantity: &Quantity| self.truth.at(&quantity.name, press, t_us).unwrap_or(f64::NAN);
            quantities.iter().zip(&factors).map(|(quantity, factor)| label(quantity) * factor).collect()
        };
        let part = self.streams.parts()[press];
        engine.reset(part.first().map_or(start, |event| event.t_us.min(start)));
        let events = part.iter().step_by(stride).copied();
        let times = due(start, contact, end, every_us);
        let shown = |(&value, quantity): (&f32, &Quantity)| f64::from(value) * quantity.scale;
        let mut values = Vec::new();
        // An event at the due time belongs to its window.
        let (found, effort) = drive(
            engine,
            events,
            times,
            |event_us, t_us| event_us <= t_us,
            |found| {
                values.clear();
                values.extend_from_slice(found);
                found.iter().zip(quantities).map(shown).collect()
            },
        )?;
        let since_contact = found.iter().filter(|found| found.t_us >= contact);
        let unlike_at = since_contact.clone().map(|found| found.unlike).collect();
        let errors_at: Vec<Vec<f64>> =
            since_contact.map(|found| found.errors(&truth_at(found.t_us))).collect();
        Ok(Outcome {
            truth: truth_at(end),
            newest: newest(&found, contact, end, |held, t_us| held.errors(&truth_at(t_us))),
            settled: settled(&errors_at, quantities).map(|tick| {
                let t_us = if tick + 1 == errors_at.len() { end } else { contact + tick as i64 * every_us };
                if end > contact { (t_us - contact) as f64 / (end - contact) as f64 } else { 0.0 }
            }),
            values,
            errors_at,
            unlike_at,
            readout: if embeds { engine.readout() } else { None },
            effort,
        })
    }
}

/// Lets `engine` take `events` and predict at `times`, each from the events that are `within` it.
/// `shown` are the values of a prediction in the units of a report.
pub(crate) fn drive(
    engine: &mut PressEngine,
    events: impl Iterator<Item = Event>,
    times: impl Iterator<Item = i64>,
    within: impl Fn(i64, i64) -> bool,
    mut shown: impl FnMut(&[f32]) -> Vec<f64>,
) -> Result<(Vec<TimedPrediction>, Effort), EngineError> {
    let (before, mut events) = (engine.count(), events.peekable());
    let (mut found, mut effort, mut values) = (Vec::new(), Effort::default(), Vec::new());
    let mut free_us = f64::MIN;
    for t_us in times {
        let clock = Instant::now();
        while let Some(event) = events.next_if(|event| within(event.t_us, t_us)) {
            engine.push(event)?;
            effort.events += 1;
        }
        effort.push_ns += clock.elapsed().as_nanos() as u64;
        let unlike = engine.predict(t_us, &mut values)?;
        let spent = clock.elapsed().as_nanos();
        effort.update_ns.push(spent as u64);
        // The worker starts when the prediction is due, or when it has finished the one before.
        free_us = free_us.max(t_us as f64) + spent as f64 / 1e3;
        found.push(TimedPrediction { t_us, available_us: free_us, values: shown(&values), unlike });
    }
    effort.count = engine.count().since(before);
    Ok((found, effort))
}

pub(crate) struct TimedPrediction {
    pub(crate) t_us: i64,
    /// The time at which a reader has the prediction.
    pub(crate) available_us: f64,
    pub(crate) values: Vec<f64>,
    pub(crate) unlike: Option<f32>,
}

impl TimedPrediction {
    pub(super) fn errors(&self, truth: &[f64]) -> Vec<f64> {
        self.values.iter().zip(truth).map(|(value, truth)| (value - truth).abs()).collect()
    }
}

/// Times of predictions: every `every_us` around `contact`, from `start` on, and `end`.
pub(super) fn due(start: i64, contact: i64, end: i64, every_us: i64) -> impl Iterator<Item = i64> {
    let before = (contact - start) / every_us;
    let ticks = (-before..).map(move |tick| contact + tick * every_us);
    ticks.take_while(move |&t_us| t_us < end).chain([end])
}

/// Mean `errors` of the newest prediction of a reader at every millisecond from `contact` on.
pub(crate) fn newest(
    found: &[TimedPrediction],
    contact: i64,
    end: i64,
    errors: impl Fn(&TimedPrediction, i64) -> Vec<f64>,
) -> Option<Vec<f64>> {
    let (mut sums, mut count) = (Vec::new(), 0_u32);
    let mut next = 0;
    for t_us in (contact..=end).step_by(MILLISECOND_US as usize) {
        while found.get(next).is_some_and(|found| found.available_us <= t_us as f64) {
            next += 1;
        }
        let Some(held) = next.checked_sub(1).map(|held| &found[held]) else { continue };
        let errors = errors(held, t_us);
        sums.resize(errors.len(), 0.0);
        sums.iter_mut().zip(errors).for_each(|(sum, error): (&mut f64, f64)| *sum += error);
        count += 1;
    }
    (count > 0).then(|| sums.into_iter().map(|sum| sum / f64::from(count)).collect())
}

/// The first time from which on the errors of all angles are small; `None` without angles.
pub(super) fn settled(errors_at: &[Vec<f64>], quantities: &[Quantity]) -> Option<usize> {
    let small = |errors: &Vec<f64>| {
        let angles = errors.iter().zip(quantities).filter(|(_, quantity)| quantity.is_angle());
        angles.map(|(error, _)| *error).all(|error| error <= SETTLED_DEG)
    };
    let first = errors_at.iter().rposition(|errors| !small(errors)).map_or(0, |last| last + 1);
    (first < errors_at.len() && quantities.iter().any(Quantity::is_angle)).then_some(first)
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quantity {
    pub(crate) name: String,
    pub(crate) unit: String,
    /// Factor from the network's value to `unit`.
    pub(crate) scale: f64,
}

impl Quantity {
    /// The outputs of `description`: angles in radians are reported in degrees.
    pub(crate) fn of(description: &AnyDescription) -> Vec<Self> {
        let (names, units) = description.outputs();
        let quantity = |(name, unit): (&String, &String)| match unit.as_str() {
            "rad" => Self { name: name.clone(), unit: "deg".to_owned(), scale: DEGREES },
            unit => Self { name: name.clone(), unit: unit.to_owned(), scale: 1.0 },
        };
        names.iter().zip(units).map(quantity).collect()
    }

    pub(crate) fn is_angle(&self) -> bool {
        self.unit == "deg"
    }
}
