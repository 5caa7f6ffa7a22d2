//! The report of a fit: figures of each output, and how the sensor differs from the training's.

use meissner_engine::{Features, Sensor, TrainingWindows};
use meissner_run::provenance::{Header, InputCard};
use meissner_run::text::grouped;
use serde::Serialize;

use super::figures::{Errors, OutputFigures};
use super::readouts::Readouts;
use super::request::Head;
use super::samples::{Given, Instant, Target};
use super::validation::{HeldOut, class};
use crate::error::Result;
use crate::metrics::Confusion;

/// Figures of a fit, with the keys of the JSON report.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub data: DataReport,
    pub base: BaseReport,
    /// The heads that were fitted; the network has the one with the smallest error.
    pub heads: Vec<HeadReport>,
    pub sensor: SensorReport,
    /// Seed of random instants, of presses of the learning curve, and of intervals.
    pub seed: u64,
    /// Number of parts of the presses, each of which was held out once.
    pub folds: usize,
    /// Each output, or all classes together.
    pub outputs: Vec<OutputFigures>,
    /// Names of the classes, if they are predicted.
    pub classes: Option<Vec<String>>,
    /// Ends of presses that were held out: rows are true classes, columns predicted ones.
    pub confusion: Option<Confusion>,
    /// True and predicted values at the ends of presses that were held out, for each output.
    #[serde(rename = "pairs", serialize_with = "crate::thinned::of_each")]
    pub scatter: Vec<Vec<(f64, f64)>>,
}

/// The presses.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub folder: String,
    /// The table of labels.
    pub labels: String,
    pub presses: usize,
    pub events: u64,
    /// Number of readouts: at the end and at random ages of each press.
    pub instants: usize,
    /// Remarks about what was left out, for people.
    pub notes: Vec<String>,
}

/// The network whose layers of events stay.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct BaseReport {
    pub name: String,
    pub weights: String,
    /// Values that the fitted layers read.
    pub readout: usize,
    /// The network takes one of so many events.
    pub stride: usize,
}

/// A head that was fitted.
#[derive(Clone, Debug, Serialize)]
pub struct HeadReport {
    /// The layers between the readout and the fitted layers.
    #[serde(flatten)]
    pub head: Head,
    /// Values that the fitted layers read.
    pub values: usize,
    /// The error at the end of held-out presses as a part of that of a constant; the mean over
    /// outputs.
    pub error: f64,
}

/// The sensor, and the one of the training of the layers of events.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct SensorReport {
    pub size: [u16; 2],
    /// Size of the training's sensor, if the weights state it.
    pub trained_size: Option<[u16; 2]>,
    /// The median of the presses' events per second.
    pub events_per_s: Option<f64>,
    /// The part of the events that are on.
    pub on_share: f64,
    /// The differences, in words.
    pub notes: Vec<String>,
}

/// The inputs of a report.
pub(super) struct Inputs<'a> {
    pub(super) given: &'a Given<'a>,
    pub(super) head: Head,
    pub(super) readouts: &'a Readouts,
    pub(super) held_out: &'a HeldOut,
    /// Predictions of heads that were fitted to one of so many presses.
    pub(super) fewer: &'a [(usize, HeldOut)],
}

/// The error at an instant, from its index and the values predicted there.
type Error<'a> = &'a dyn Fn(usize, &[f64]) -> f64;

impl Inputs<'_> {
    pub(super) fn report(&self) -> Result<Report> {
        let Given { presses, samples, target, base, sensor, options, .. } = *self.given;
        let instants = &samples.instants;
        let folder = presses.folder.display().to_string();
        let [events, on] = self.readouts.events;
        let kept_back = (presses.kept_back > 0)
            .then(|| format!("{} presses of the split test are left out", grouped(presses.kept_back as u64)));
        let (outputs, scatter): (Vec<_>, Vec<_>) = match target {
            Target::Quantities(each) => (0..each.len()).map(|output| self.quantity(output)).unzip(),
            Target::Classes { names, .. } => (vec![self.classes(names)], Vec::new()),
        };
        let confusion = match target {
            Target::Quantities(_) => None,
            Target::Classes { names, .. } => {
                let mut confusion = Confusion::new(names.len());
                for (row, _) in self.ends() {
                    let predicted = class(self.held_out.predicted.row(row).iter().copied());
                    confusion.add(instants[row].truth[0] as usize, predicted);
                }
                Some(confusion)
            }
        };
        let parts = outputs.iter().map(|of: &OutputFigures| of.error.mean / of.constant.mean);
        let error = parts.sum::<f64>() / outputs.len() as f64;
        Ok(Report {
            heads: vec![HeadReport { head: self.head, values: self.readouts.columns, error }],
            header: Header::of_many("fit", InputCard::events(&folder, &"folder", sensor, Some(events))),
            data: DataReport {
                folder,
                labels: presses.table.display().to_string(),
                presses: samples.presses.len(),
                events,
                instants: instants.len(),
                notes: kept_back.into_iter().chain(samples.notes.iter().cloned()).collect(),
            },
            base: BaseReport {
                name: base.name.clone(),
                weights: base.label.clone(),
                readout: self.readouts.columns,
                stride: base.stride,
            },
            sensor: self.sensor(events, on)?,
            seed: options.seed,
            folds: options.folds,
            outputs,
            classes: if let Target::Classes { names, .. } = target { Some(names.clone()) } else { None },
            confusion,
            scatter,
        })
    }

    fn sensor(&self, events: u64, on: u64) -> Result<SensorReport> {
        let label = &self.given.base.label;
        let card = self.given.base.weights.card();
        let card = card.map_err(|source| meissner_run::RunError::weights(label.clone(), source))?;
        let size = |sensor: Sensor| [sensor.width, sensor.height];
        let mut notes = Vec::new();
        if let Some(trained) = card.sensor.filter(|trained| *trained != self.given.sensor) {
            notes.push(format!(
                "the layers of events were trained on {trained}, and the presses are of {}: neighbourhoods of pixels are another \
                 part of the sensor",
                self.given.sensor
            ));
        }
        // Ages are parts of the span.
        if let Some(trained) = card.training_windows.filter(|_| self.given.options.span_us.is_none()) {
            notes.extend(unlike(&trained, &self.readouts.windows));
        }
        let mut lengths: Vec<i64> =
            self.given.samples.presses.iter().map(|&press| self.length_us(press)).collect();
        lengths.sort_unstable();
        let window = self.given.options.span_us.unwrap_or(self.given.base.description.span_us());
        if let Some(&middle) = lengths.get(lengths.len() / 2).filter(|middle| **middle > window) {
            notes.push(format!(
                "the middle press lasts {} ms, and the window {}: what is older has left it at the end (--span)",
                middle / 1_000,
                window / 1_000
            ));
        }
        let on_share = if events > 0 { on as f64 / events as f64 } else { 0.0 };
        if !(0.1..=0.9).contains(&on_share) {
            notes.push(format!("{:.0} % of the events are on: one polarity nearly alone", 100.0 * on_share));
        }
        Ok(SensorReport {
            size: size(self.given.sensor),
            trained_size: card.sensor.map(size),
            events_per_s: self.given.presses.summary().median_rate,
            on_share,
            notes,
        })
    }

    /// From the first event of a recording to the last one.
    fn length_us(&self, press: usize) -> i64 {
        let recording = &self.given.presses.recordings[press];
        recording.last_us.saturating_sub(recording.first_us)
    }

    /// The rows of the ends, by press.
    fn ends(&self) -> impl Iterator<Item = (usize, &Instant)> {
        self.given.samples.instants.iter().enumerate().filter(|(_, instant)| instant.is_end)
    }

    /// The ends of presses of other folds than that of `press`.
    fn others(&self, press: usize) -> impl Iterator<Item = &Instant> {
        let fold = self.given.fold[press];
        self.given.samples.ends().filter(move |end| self.given.fold[end.press] != fold)
    }

    /// Errors of an output. `of` is the error at a row, given all values predicted there.
    fn errors(&self, of: Error<'_>, constant: Vec<f64>, before: Option<Vec<f64>>) -> Errors {
        let at = |held_out: &HeldOut, row: usize| of(row, &held_out.predicted.row(row).to_vec());
        let ends = |held_out: &HeldOut| self.ends().map(|(row, _)| at(held_out, row)).collect::<Vec<_>>();
        // Heads are fitted to all folds but one.
        let share = |presses: usize| presses * (self.given.options.folds - 1) / self.given.options.folds;
        let fewer = self.fewer.iter().map(|(part, held_out)| {
            let taken = self.given.order.iter().filter(|order| order.is_multiple_of(*part)).count();
            (share(taken), ends(held_out))
        });
        let instants = self.given.samples.instants.iter().enumerate();
        Errors {
            own: ends(self.held_out),
            constant,
            before,
            fewer: fewer.collect(),
            presses: share(self.given.samples.presses.len()),
            at: instants
                .filter(|(_, instant)| instant.moved == [0, 0])
                .map(|(row, instant)| (instant.age_us, at(self.held_out, row)))
                .collect(),
        }
    }

    fn quantity(&self, output: usize) -> (OutputFigures, Vec<(f64, f64)>) {
        let Target::Quantities(each) = self.given.target else { unreachable!("a quantity is of quantities") };
        let quantity = &each[output];
        let (unit, scale) = (&quantity.shown.0, quantity.shown.1);
        let truth = |row: usize| self.given.samples.instants[row].truth[output];
        let of = |row: usize, values: &[f64]| (values[output] - truth(row)).abs() * scale;
        let sums: Vec<(f64, f64)> = (0..self.given.options.folds)
            .map(|fold| {
                let others = self.given.samples.ends().filter(|end| self.given.fold[end.press] != fold);
                others.fold((0.0, 0.0), |(sum, count), end| (sum + end.truth[output], count + 1.0))
            })
            .collect();
        let mean = |press: usize| sums[self.given.fold[press]].0 / sums[self.given.fold[press]].1;
        let constant = self.ends().map(|(row, end)| (mean(end.press) - truth(row)).abs() * scale).collect();
        let known = quantity.place_in(self.given.base.description.outputs()).zip(self.given.before);
        let before = known.map(|((place, factor), predicted)| {
            let value = |row: usize| f64::from(predicted[row][place]) * factor;
            self.ends().map(|(row, _)| (value(row) - truth(row)).abs() * scale).collect()
        });
        let errors = self.errors(&of, constant, before);
        let choice = self.held_out.choices[output];
        let figures = OutputFigures::new((&quantity.name, unit), choice, &errors, self.given.options.seed);
        let predicted = |row: usize| self.held_out.predicted[[row, output]];
        let scatter = self.ends().map(|(row, _)| (truth(row) * scale, predicted(row) * scale)).collect();
        (figures, scatter)
    }

    fn classes(&self, names: &[String]) -> OutputFigures {
        let wrong = |row: usize, found: usize| {
            f64::from(u8::from(found != self.given.samples.instants[row].truth[0] as usize))
        };
        let of = |row: usize, logits: &[f64]| wrong(row, class(logits.iter().copied()));
        let frequent: Vec<usize> = self
            .given
            .samples
            .ends()
            .map(|end| {
                let mut counts = vec![0_usize; names.len()];
                self.others(end.press).for_each(|other| counts[other.truth[0] as usize] += 1);
                (0..names.len()).rev().max_by_key(|&class| counts[class]).unwrap_or(0)
            })
            .collect();
        let constant = self.ends().map(|(row, end)| wrong(row, frequent[end.press])).collect();
        let known = self.given.base.description.outputs().0;
        let places: Option<Vec<usize>> =
            names.iter().map(|name| known.iter().position(|other| other == name)).collect();
        let before = places.zip(self.given.before).map(|(places, predicted)| {
            let logits = |row: usize| places.iter().map(move |&i| f64::from(predicted[row][i]));
            self.ends().map(|(row, _)| wrong(row, class(logits(row)))).collect()
        });
        let errors = self.errors(&of, constant, before);
        let name = &self.given.presses.labels[self.label()].name;
        OutputFigures::new((name, "share"), self.held_out.choices[0], &errors, self.given.options.seed)
    }

    fn label(&self) -> usize {
        match self.given.target {
            Target::Quantities(each) => each[0].label,
            Target::Classes { label, .. } => *label,
        }
    }
}

/// How `windows` differ from those that layers were `trained` on, if most of them do.
fn unlike(trained: &TrainingWindows, windows: &[Features]) -> Option<String> {
    let unlike = windows.iter().filter(|window| trained.unlikeness(**window) > 1.0).count();
    if 2 * unlike <= windows.len() {
        return None;
    }
    // The first feature is the fourth root of the number of events, the fourth the share that is
    // on.
    let mean = |i: usize| {
        let values = windows.iter().filter_map(|window| window[i]);
        values.sum::<f64>() / windows.len() as f64
    };
    let events = |root: f64| grouped(root.powi(4).round() as u64);
    let (of, [there, there_on]) = (trained.parts().0, [0, 3].map(mean));
    Some(format!(
        "{} of {} windows are unlike those that the layers were trained on: about {} events, {:.0} % of them on, instead of \
         {} and {:.0} %",
        grouped(unlike as u64),
        grouped(windows.len() as u64),
        events(there),
        100.0 * there_on,
        events(of[0]),
        100.0 * of[3],
    ))
}
