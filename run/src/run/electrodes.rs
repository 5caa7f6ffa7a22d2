//! Runs a network over readings of 24 electrodes (CSV), one prediction per window.
//!
//! Input: one reading per line, at 100 Hz. Output, before the next line is read: for each complete
//! window a prediction and, if its values are logits of classes, the decision of a
//! [`DecisionFilter`].
//!
//! The network is reset to the state before the first frame, the readings of a window are pushed,
//! and the prediction is read after the last of them. A reading is prepared once; the steps of the
//! network are computed again for each window.
//!
//! Invariant: the readings of a window are consecutive, and so are the windows of a decision. An
//! interruption starts a new window and clears the decision. Interruptions are rows that cannot be
//! read, which are reported with their line, and readings that are earlier than the one before or
//! more than 5 periods later, which are counted. The late or early reading is the first of the new
//! window. Other intervals off the rate, repeated times and values outside the range of the sensor
//! are only counted. Without a column of time, readings are assumed to be consecutive.

use std::fs::{self, File};
use std::io::BufRead;
use std::path::Path;
use std::time::Instant;

use meissner_engine::frames::FrameOptions;
use meissner_engine::representations::{TactileForm, TactileWindow};
use meissner_io::{ElectrodeSettings, Electrodes, IoError, Kind, Reading};
use meissner_models::FrameSource;
use meissner_models::systems::slip::DecisionFilter;

use super::prediction::{ElectrodePrediction, Observer, Prediction};
use super::summary::FramePredictor;
use super::summary::{ElectrodeCounts, Ended, Ending, FrameSummary, InputCounts, Summary};
use crate::answer::{Classes, Values};
use crate::error::{Result, RunError, chain};
use crate::latency::microseconds;
use crate::left_out::LineErrors;
use crate::losses::{Advice, InputLosses};
use crate::model::FrameModel;
use crate::{interrupt, streams};

/// Time from one reading to the next, in microseconds.
pub const PERIOD_US: u64 = 10_000;

/// Options of a run over electrodes.
#[derive(Clone, Debug)]
pub struct ElectrodeOptions {
    /// Whether a line that cannot be read ends the run.
    pub strict: bool,
    /// Largest number of lines to take.
    pub limit: Option<u64>,
    /// The filter that holds decisions.
    pub decisions: DecisionFilter,
    /// Advice at the end of warnings of lost input.
    pub advice: Advice,
}

/// A network over electrodes with its readings, before the run.
pub struct ElectrodeRun {
    live: bool,
    rows: Readings,
    /// The next row, read before anything is shown, so that a wrong header is found early.
    next: Option<Result<Reading, IoError>>,
    refusals: LineErrors,
    limit: u64,
    advice: Advice,
    steps: usize,
    windows: Windows,
}

/// Readings of electrodes, from a file or a stream.
pub type Readings = Electrodes<Box<dyn BufRead + Send>>;

/// Makes windows from readings, predictions from windows, and decisions from predictions.
struct Windows {
    predictor: FramePredictor,
    classes: Classes,
    window: TactileWindow,
    filter: DecisionFilter,
    values: Vec<f32>,
    /// Number of times that a decision was made or changed.
    decisions: u64,
}

impl ElectrodeRun {
    /// A run of `model` over the readings in the file at `path`, or on standard input if it is `-`.
    ///
    /// # Errors
    /// The model does not read electrodes, or the input cannot be opened or has a different header.
    pub fn open(
        model: &FrameModel,
        frame_options: FrameOptions,
        path: &Path,
        options: ElectrodeOptions,
    ) -> Result<Self> {
        let network = &model.name;
        let (readings, form) = match model.source {
            FrameSource::TactileImage(readings) => (readings, TactileForm::Image),
            FrameSource::Electrodes(readings) => (readings, TactileForm::Reading),
            _ => return Err(RunError::is_frame_network(network)),
        };
        let name = streams::name(path);
        let window = TactileWindow::new(readings.steps, readings.sampling, readings.scaling, form)
            .map_err(|source| RunError::Frames { network: network.clone(), source })?;
        let predictor = FramePredictor::new(model.network.clone(), frame_options, &model.card.outputs)?;
        let (mut rows, live) = open_readings(path)?;
        interrupt::listen();
        let next = next(&mut rows, &name)?;
        let classes = Classes::new(model.card.classes.clone());
        let ElectrodeOptions { strict, limit, decisions: filter, advice } = options;
        let windows = Windows { predictor, classes, window, filter, values: Vec::new(), decisions: 0 };
        Ok(Self {
            refusals: LineErrors::of(path, strict),
            live,
            rows,
            next,
            limit: limit.unwrap_or(u64::MAX),
            advice,
            steps: readings.steps,
            windows,
        })
    }

    /// Name of the input.
    pub fn name(&self) -> &str {
        self.refusals.name()
    }

    /// Whether readings are taken as they arrive.
    pub fn is_live(&self) -> bool {
        self.live
    }

    /// Takes all readings, or the readings up to a [requested](interrupt::requested) end.
    pub fn run(mut self, observer: &mut dyn Observer) -> Ended {
        let ending = Ending(self.take_all(observer));
        let (taken, refused) = (self.refusals.taken(), self.refusals.count());
        let found = self.rows.warnings();
        let counts = ElectrodeCounts {
            readings: taken,
            lines_refused: refused,
            values_out_of_range: found.values_out_of_range,
            rows_off_rate: found.rows_off_rate,
            gaps: found.gaps,
            times_backwards: found.times_backwards,
            times_repeated: found.times_repeated,
            steps: self.steps,
            decisions: self.windows.classes.are_known().then_some(self.windows.decisions),
        };
        let losses = InputLosses::of_lines(taken).with_advice(self.advice);
        let losses = InputLosses { lines_refused: refused, ..losses };
        let warnings = losses.warn(self.name());
        self.windows.predictor.passed.add(taken.saturating_mul(PERIOD_US));
        self.windows.predictor.training.warn(self.name());
        let summary = FrameSummary::new(&self.windows.predictor, InputCounts::Electrodes(counts), warnings);
        if summary.predictions == 0 {
            let (name, steps) = (self.name(), self.steps);
            tracing::warn!(
                "{name}: no prediction: expected a window of {steps} readings, found {taken} readings in all"
            );
        }
        Ended { summary: Summary::Frames(summary), result: ending.0 }
    }

    fn lines(&self) -> u64 {
        self.refusals.taken() + self.refusals.count()
    }

    fn take_all(&mut self, observer: &mut dyn Observer) -> Result<()> {
        while self.lines() < self.limit {
            let Some(row) = self.next.take() else {
                return if interrupt::requested() { Ok(()) } else { self.refusals.end() };
            };
            let problem = match row {
                Ok(reading) => {
                    let problem = self.windows.take(&reading, self.rows.follows(), observer)?;
                    problem.map(|problem| format!("line {}: {problem}", reading.line))
                }
                Err(error) => Some(chain(&error)),
            };
            match problem {
                None => self.refusals.take(),
                Some(problem) => {
                    self.windows.begin_anew();
                    self.refusals.refuse(problem)?;
                }
            }
            if interrupt::requested() {
                break;
            }
            if self.lines() < self.limit {
                self.next = next(&mut self.rows, self.refusals.name())?;
            }
        }
        Ok(())
    }
}

impl Windows {
    /// Separates later readings from earlier ones: no window and no decision uses both.
    fn begin_anew(&mut self) {
        self.window.reset();
        self.filter.reset();
    }

    /// Takes a reading, which continues the one before if it `follows`, or returns its problem.
    fn take(
        &mut self,
        reading: &Reading,
        follows: bool,
        observer: &mut dyn Observer,
    ) -> Result<Option<String>> {
        let start = Instant::now();
        if !follows {
            self.begin_anew();
        }
        let sequence = self.window.push(&reading.values);
        self.predictor.prepared(start.elapsed());
        let sequence = match sequence {
            Ok(None) => return Ok(None),
            Ok(Some(sequence)) => sequence,
            Err(error) => return Ok(Some(error.to_string())),
        };
        self.predictor.reset();
        let [_, rows, columns] = sequence.shape;
        for frame in sequence.values.chunks_exact(rows * columns) {
            self.predictor.push(frame)?;
        }
        let Self { predictor, classes, values, filter, .. } = self;
        let (class, unlike) = predictor.predict(|predicted| {
            values.clear();
            values.extend_from_slice(predicted.values);
            Ok::<_, RunError>((classes.update(values), predicted.unlike))
        })?;
        let decision = class.and_then(|(class, probability)| filter.push(class, probability));
        self.decisions += u64::from(decision.is_some_and(|decision| decision.held == 1));
        self.predictor.decision.record(start.elapsed());
        self.predictor.training.update(&self.values, unlike);
        let update_us = microseconds(self.predictor.take_update());
        let answer = self.classes.answer();
        let prediction = ElectrodePrediction {
            line: reading.line,
            time_s: reading.time_s,
            value: Values(&self.values),
            probabilities: answer.map(|answer| answer.probabilities),
            class: answer.map(|answer| answer.class),
            decision: decision.map(|decision| self.classes.name(decision.class)),
            held: decision.map(|decision| decision.held),
            outside_training: self.predictor.training.newest(),
            unlike,
            update_us,
        };
        observer.prediction(&Prediction::Electrodes(prediction)).map_err(RunError::Output)?;
        Ok(None)
    }
}

/// The readings in the file at `path`, or on the stream of this name, and whether they arrive while
/// they are read.
///
/// # Errors
/// It cannot be opened, or has other contents.
pub fn open_readings(path: &Path) -> Result<(Readings, bool)> {
    // A pipe or a serial port is live, like standard input.
    let live = streams::is_live(path) || fs::metadata(path).is_ok_and(|file| !file.is_file());
    Ok((Electrodes::new(open(path)?, ElectrodeSettings::default()), live))
}

fn open(path: &Path) -> Result<Box<dyn BufRead + Send>> {
    if streams::is_live(path) {
        return streams::lines(path);
    }
    // A pipe is not read ahead: data that has been read cannot be read again.
    if (path.is_dir() || path.is_file())
        && let Ok(Some(found)) = Kind::of_file(path)
        && found != Kind::Electrodes
    {
        let source = IoError::OtherKind { expected: "readings of electrodes", found };
        return Err(RunError::recording(&path.display().to_string(), source));
    }
    let file = File::open(path).map_err(|source| RunError::file("open", path, source))?;
    Ok(Box::new(interrupt::awaited(file)))
}

/// The next row: a reading, or its problem; `None` at the end, and on a signal.
///
/// # Errors
/// An error that ends the rows.
fn next<R: BufRead>(rows: &mut Electrodes<R>, name: &str) -> Result<Option<Result<Reading, IoError>>> {
    match rows.next() {
        Some(Err(_)) if interrupt::requested() => Ok(None),
        Some(Err(error)) if !matches!(error, IoError::Malformed { what: "row" | "field", .. }) => {
            Err(RunError::recording(name, error))
        }
        row => Ok(row),
    }
}
