//! The labels that are fitted, and the instants of presses. Both are checked before any network
//! runs.
//!
//! A press gives its end (its last complete labelled instant), and random ages from a tenth of it
//! on, where labels along time or a class of the whole press have a value there. Ages depend on the
//! seed and the events of the press alone.

use std::collections::BTreeSet;

use meissner_engine::Sensor;
use meissner_kernels::random::Random;
use meissner_models::description::Outputs;
use meissner_run::text::grouped;

use super::request::{Base, Options};
use crate::error::{EvaluateError, RequestPart, Result};
use crate::presses::{Presses, Row};
use crate::units::{DEGREES, factor};

/// No random age is in the first one of so many parts of a press.
const QUIET: i64 = 10;
/// Weight of all random ages of a press together; its end weighs 1. An unfinished press says less
/// about its end than it seems to, and its first events say little about the labels.
const AGES: f64 = 0.1;

/// Weight of an instant whose events are moved; other instants weigh 1.
const MOVED: f64 = 0.3;

/// A label of numbers that becomes an output.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    /// Index of the label.
    pub(super) label: usize,
    pub(super) name: String,
    /// The unit of the output.
    pub(super) unit: String,
    /// Factor from the label to the unit of the output.
    pub(super) factor: f64,
    /// The unit for people, and the factor from the output to it.
    pub(super) shown: (String, f64),
}

/// The labels that are fitted.
#[derive(Clone, Debug)]
pub(super) enum Target {
    Quantities(Vec<Quantity>),
    Classes { label: usize, names: Vec<String> },
}

/// An instant of a press.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Instant {
    /// Index among the presses that are taken.
    pub(super) press: usize,
    pub(super) t_us: i64,
    /// Time since the first event of the press.
    pub(super) age_us: i64,
    pub(super) is_end: bool,
    /// Columns and rows by which the events are moved.
    pub(super) moved: [i32; 2],
    /// Weight in a fit.
    pub(super) weight: f64,
    /// The value of each output, or the index of the class.
    pub(super) truth: Vec<f64>,
}

/// The presses that are taken, and their instants.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// Indices of the recordings.
    pub(super) presses: Vec<usize>,
    /// By press, motion and time; the last one of each press that is not moved is its end.
    pub(super) instants: Vec<Instant>,
    /// What was left out, in words for people.
    pub(super) notes: Vec<String>,
}

/// The data that a head is fitted to.
pub(super) struct Given<'a> {
    pub(super) presses: &'a Presses,
    pub(super) samples: &'a Samples,
    pub(super) target: &'a Target,
    /// Predictions of the original network, if it predicts the same labels.
    pub(super) before: Option<&'a [Vec<f32>]>,
    pub(super) base: &'a Base,
    pub(super) sensor: Sensor,
    pub(super) options: &'a Options,
    pub(super) fold: &'a [usize],
    /// The position of each press in the order of a learning curve.
    pub(super) order: &'a [usize],
}

impl Target {
    /// The labels of `presses` that `options` choose; by default all numbers, or else the classes.
    /// Angles are in the unit of the output of the same name in `known`, or else in radians.
    pub(super) fn choose(
        presses: &Presses,
        options: &Options,
        known: (&[String], &[String]),
    ) -> Result<Self> {
        let all = &presses.labels;
        let chosen: Vec<usize> = if let Some(names) = &options.labels {
            let find = |name: &String| {
                presses.label(name).ok_or_else(|| {
                    let labels: Vec<&str> = all.iter().map(|label| label.name.as_str()).collect();
                    EvaluateError::request(RequestPart::Outputs, labels.join(", "), name.clone())
                })
            };
            names.iter().map(find).collect::<Result<_>>()?
        } else {
            let numbers: Vec<usize> = (0..all.len()).filter(|&label| !all[label].is_class()).collect();
            if numbers.is_empty() { (0..all.len()).take(1).collect() } else { numbers }
        };
        if let Some(again) = (1..chosen.len()).find(|&i| chosen[..i].contains(&chosen[i])) {
            let found = format!("{} again", all[chosen[again]].name);
            return Err(EvaluateError::request(RequestPart::Outputs, "each label once", found));
        }
        match &chosen[..] {
            [] => Err(EvaluateError::request(RequestPart::Outputs, "a label", "none")),
            &[label] if all[label].is_class() => {
                Ok(Self::Classes { label, names: all[label].classes.clone() })
            }
            numbers => {
                if let Some(&class) = numbers.iter().find(|&&label| all[label].is_class()) {
                    let found = format!("{}, whose values are classes, beside others", all[class].name);
                    return Err(EvaluateError::request(
                        RequestPart::Outputs,
                        "labels of numbers, or one label of classes",
                        found,
                    ));
                }
                Ok(Self::Quantities(
                    numbers.iter().map(|&label| Quantity::of(presses, label, known)).collect(),
                ))
            }
        }
    }

    /// The outputs of a network that predicts this target.
    pub(super) fn outputs(&self) -> Outputs {
        match self {
            Self::Quantities(each) => {
                Outputs::Quantities(each.iter().map(|one| (one.name.clone(), one.unit.clone())).collect())
            }
            Self::Classes { names, .. } => Outputs::Classes(names.clone()),
        }
    }

    fn truth(&self, presses: &Presses, press: usize, t_us: i64) -> Option<Vec<f64>> {
        match self {
            Self::Quantities(each) => {
                each.iter().map(|one| Some(presses.at(press, one.label, t_us)? * one.factor)).collect()
            }
            Self::Classes { label, .. } => Some(vec![presses.at(press, *label, t_us)?]),
        }
    }

    /// Whether `row` has all labels.
    fn is_complete(&self, row: &Row) -> bool {
        match self {
            Self::Quantities(each) => each.iter().all(|one| !row.values[one.label].is_nan()),
            Self::Classes { label, .. } => !row.values[*label].is_nan(),
        }
    }

    /// Whether a network with these outputs predicts all classes, or some of the quantities.
    pub(super) fn is_predicted_by(&self, known: (&[String], &[String])) -> bool {
        match self {
            Self::Quantities(each) => each.iter().any(|one| one.place_in(known).is_some()),
            Self::Classes { names, .. } => names.iter().all(|name| known.0.contains(name)),
        }
    }

    fn is_class(&self) -> bool {
        matches!(self, Self::Classes { .. })
    }
}

impl Quantity {
    /// The index of the output with this name, and the factor of its values for this unit.
    pub(super) fn place_in(&self, (names, units): (&[String], &[String])) -> Option<(usize, f64)> {
        let place = names.iter().position(|name| *name == self.name)?;
        Some((place, factor(&units[place], &self.unit)?))
    }

    fn of(presses: &Presses, label: usize, (names, units): (&[String], &[String])) -> Self {
        let of = &presses.labels[label];
        let known = names.iter().position(|name| *name == of.name).map(|i| units[i].as_str());
        let unit = of.unit.clone().unwrap_or_else(|| "1".to_owned());
        let (unit, factor) = match (unit.as_str(), known) {
            ("deg", Some("deg")) => ("deg", 1.0),
            ("rad", Some("deg")) => ("deg", DEGREES),
            ("deg", _) => ("rad", 1.0 / DEGREES),
            (unit, _) => (unit, 1.0),
        };
        let shown = if unit == "rad" { ("deg".to_owned(), DEGREES) } else { (unit.to_owned(), 1.0) };
        Self { label, name: of.name.clone(), unit: unit.to_owned(), factor, shown }
    }
}

impl Samples {
    /// The instants of `target` in the labelled presses, of each recording once.
    ///
    /// # Errors
    /// Too few presses for the folds, a label with one value or one that is not finite, or a class
    /// that not every fold has.
    pub(super) fn of(presses: &Presses, target: &Target, options: &Options) -> Result<Self> {
        let (mut taken, mut instants, mut met) = (Vec::new(), Vec::new(), BTreeSet::new());
        let [mut copies, mut lacking, mut silent] = [0_u64; 3];
        for press in presses.labelled() {
            let recording = &presses.recordings[press];
            let rows: Vec<&Row> =
                presses.rows_of(press).iter().filter(|row| target.is_complete(row)).collect();
            if rows.is_empty() {
                lacking += 1;
            } else if recording.events == 0 {
                silent += 1;
            } else if !met.insert((recording.fingerprint, recording.events)) {
                copies += 1;
            } else {
                let mut random = Random::new(Random::new(options.seed).bits() ^ recording.fingerprint);
                let found = of_press((presses, press), target, &rows, options, &mut random, taken.len());
                if found.last().is_some_and(|last| last.is_end) {
                    let moved: Vec<Instant> =
                        motions(options.shift).flat_map(|by| moved(&found, by)).collect();
                    instants.extend(found.into_iter().chain(moved));
                    taken.push(press);
                } else {
                    lacking += 1;
                }
            }
        }
        let note = |(count, what): (u64, &str)| (count > 0).then(|| format!("{what}: {}", grouped(count)));
        let notes = [
            (lacking, "presses that lack a label are left out"),
            (silent, "presses without events are left out"),
            (copies, "copies of other recordings are left out"),
        ];
        let samples = Self { presses: taken, instants, notes: notes.into_iter().filter_map(note).collect() };
        samples.check(presses, target, options.folds)?;
        Ok(samples)
    }

    /// The end of each press.
    pub(super) fn ends(&self) -> impl Iterator<Item = &Instant> {
        self.instants.iter().filter(|instant| instant.is_end)
    }

    fn check(&self, presses: &Presses, target: &Target, folds: usize) -> Result<()> {
        let refused = |expected: String, found: String| {
            Err(EvaluateError::request(RequestPart::Labels, expected, found))
        };
        if self.presses.len() < 2 * folds {
            let expected =
                format!("at least {} presses with labels, two in each of {folds} folds", 2 * folds);
            let found = grouped(self.presses.len() as u64);
            return Err(EvaluateError::request(RequestPart::Folder, expected, found));
        }
        match target {
            Target::Quantities(each) => {
                for (i, quantity) in each.iter().enumerate() {
                    let value = |instant: &Instant| instant.truth[i];
                    if let Some(odd) = self.instants.iter().find(|instant| !value(instant).is_finite()) {
                        let name = &presses.recordings[self.presses[odd.press]].name;
                        let found = format!("{} of {name} at {} us", value(odd), odd.t_us);
                        return refused(format!("finite values of {}", quantity.name), found);
                    }
                    let mut values = self.instants.iter().map(value);
                    let first = values.next().unwrap_or(0.0);
                    if values.all(|value| value == first) {
                        let found = format!("{} in all presses", first / quantity.factor);
                        return refused(format!("different values of {}", quantity.name), found);
                    }
                }
            }
            Target::Classes { names, .. } => {
                if names.len() < 2 {
                    return refused("at least two classes".to_owned(), names.join(", "));
                }
                for (class, name) in names.iter().enumerate() {
                    let of_class = self.ends().filter(|end| end.truth[0] == class as f64).count();
                    if of_class < folds {
                        let found = format!("{of_class} of {name}");
                        return refused(format!("at least {folds} presses of each class, one a fold"), found);
                    }
                }
            }
        }
        Ok(())
    }
}

/// The instants of a press, by time; `rows` are its complete labelled instants.
fn of_press(
    (presses, press): (&Presses, usize),
    target: &Target,
    rows: &[&Row],
    options: &Options,
    random: &mut Random,
    index: usize,
) -> Vec<Instant> {
    let recording = &presses.recordings[press];
    let whole = target.is_class() && rows.iter().any(|row| row.whole);
    let (first, last) = (rows[0].t_us, rows[rows.len() - 1].t_us);
    let [begin, end] = if whole { [recording.first_us, recording.last_us] } else { [first, last] };
    let mut times = BTreeSet::from([end]);
    let from = begin + (end - begin) / QUIET;
    for _ in 0..options.ages {
        let t_us = from + ((end - from) as f64 * random.uniform()) as i64;
        // There is no value between rows that are far apart; the next row has one.
        let next = rows[rows.partition_point(|row| row.t_us < t_us).min(rows.len() - 1)].t_us;
        times.insert(if target.truth(presses, press, t_us).is_some() { t_us } else { next });
    }
    let other = AGES / (times.range(..end).count().max(1)) as f64;
    let instant = |t_us: i64| {
        let truth = target.truth(presses, press, t_us)?;
        let age_us = t_us.saturating_sub(recording.first_us).max(0);
        let is_end = t_us == end;
        let weight = if is_end { 1.0 } else { other };
        Some(Instant { press: index, t_us, age_us, is_end, moved: [0, 0], weight, truth })
    };
    times.range(..=end).filter_map(|&t_us| instant(t_us)).collect()
}

/// Motions to the left, right, top and bottom by `pixels`, or none.
fn motions(pixels: u16) -> impl Iterator<Item = [i32; 2]> {
    let by = i32::from(pixels);
    [[-by, 0], [by, 0], [0, -by], [0, by]].into_iter().filter(|motion| *motion != [0, 0])
}

/// The instants of a press whose events are moved.
fn moved(instants: &[Instant], by: [i32; 2]) -> impl Iterator<Item = Instant> {
    instants.iter().map(move |of| Instant {
        is_end: false,
        moved: by,
        weight: MOVED * of.weight,
        ..of.clone()
    })
}
