//! Networks on labelled data sets: accuracies and errors, and run time against them.
//!
//! Input: a data set, networks. Output: the program's JSON report, for `meissner/_evaluate.py`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use meissner::frames::FrameOptions;
use meissner::io::ReadOptions;
use meissner_evaluate::events::Digits;
use meissner_evaluate::events::{self, EventTask};
use meissner_evaluate::events::{TouchContainers, TouchLetters, TouchObjects};
use meissner_evaluate::pareto::{self, AngleOptions, Progress, State, Study};
use meissner_evaluate::trainings::{Evaluation, Request};
use meissner_evaluate::{EvaluateError, ProgressHandle, TaskName, Workers, area, force, regression, slip};
use meissner_run::model::WeightsFile;
use meissner_run::predictor::Mode;
use meissner_run::source::Source;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Serialize;

use crate::arrays::Pixels;
use crate::error::{Failure, Outcome};
use crate::threads::{Parts, Seen, watched, workers};

/// Default microseconds from one prediction to the next.
const EVERY_US: i64 = 10_000;
const EVERY_OF_PRESSES_US: i64 = 1_000;

/// Networks, trainings and their settings.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Asked {
    networks: Vec<String>,
    weights: Option<PathBuf>,
    trainings: Option<PathBuf>,
    folds: Option<usize>,
    stride: Option<usize>,
    every_us: Option<i64>,
    mode: String,
    threads: Option<u16>,
}

impl Asked {
    fn request(&self) -> Request<'_> {
        Request { networks: &self.networks, weights: self.weights(), trainings: self.trainings.as_deref() }
    }

    fn weights(&self) -> Option<WeightsFile<'_>> {
        self.weights.as_deref().map(WeightsFile::from)
    }

    fn mode(&self) -> Outcome<Mode> {
        let found = [Mode::Incremental, Mode::Batch].into_iter().find(|mode| mode.word() == self.mode);
        let expected = "mode: expected \"incremental\" or \"batch\"";
        found.ok_or_else(|| Failure::input(format!("{expected}, found {:?}", self.mode)))
    }

    fn every_us(&self, default: i64) -> Outcome<i64> {
        let every_us = self.every_us.unwrap_or(default);
        if (100..=10_000_000).contains(&every_us) {
            return Ok(every_us);
        }
        Err(Failure::input(format!("every_us: expected 100 us to 10 s, found {every_us} us")))
    }

    /// Refuses values that would make a loop endless.
    fn check(&self) -> Outcome<()> {
        let zero = |what, least| Failure::input(format!("{what}: expected at least {least}, found less"));
        match self {
            Self { stride: Some(0), .. } => Err(zero("stride", 1)),
            Self { threads: Some(0), .. } => Err(zero("threads", 1)),
            Self { folds: Some(0 | 1), .. } => Err(zero("folds", 2)),
            _ => Ok(()),
        }
    }
}

/// A report as JSON, and the outputs of the networks as safetensors.
type Judged = (String, Vec<u8>);

fn judged<R: Serialize>(evaluation: Evaluation<R>) -> Judged {
    let text = serde_json::to_string(&evaluation.report).expect("a report has names as keys");
    (text, evaluation.logits.into_bytes())
}

/// The task called `name`.
fn known(name: &str) -> Outcome<TaskName> {
    TaskName::of(name).ok_or_else(|| {
        let names = TaskName::ALL.map(|task| format!("{:?}", task.name())).join(", ");
        Failure::input(format!("task: expected one of {names}, found {name:?}"))
    })
}

/// The report of `task` on `data` as JSON, and the outputs of the networks as safetensors.
#[pyfunction]
#[pyo3(name = "_evaluate")]
pub(crate) fn judge<'py>(
    py: Python<'py>,
    task: &str,
    data: PathBuf,
    asked: Asked,
    tick: &Bound<'py, PyAny>,
) -> Outcome<(String, Bound<'py, PyBytes>)> {
    asked.check()?;
    let (watch, parts) = (ProgressHandle::default(), Parts::default());
    let workers = workers(asked.threads, &watch)?;
    let mode = asked.mode()?;
    let done = |training: &str, _: Duration| parts.set(|seen| training.clone_into(&mut seen.name));
    let seen = || Seen { done: watch.done(), total: watch.total(), ..parts.get() };
    let run =
        |work: &(dyn Fn() -> Result<Judged, EvaluateError> + Sync)| watched(py, &watch, tick, seen, work);
    let task = known(task)?;
    let every_us = asked.every_us(match task {
        TaskName::Angle | TaskName::Force => EVERY_OF_PRESSES_US,
        _ => EVERY_US,
    })?;
    let (request, stride, folds) = (asked.request(), asked.stride, asked.folds);
    let options = events::Options { request, stride, folds, every_us, mode };
    let (report, logits) = match task {
        TaskName::Digits => run(&|| events::evaluate::<Digits>(&data, &options, &workers, done).map(judged)),
        TaskName::Objects => {
            run(&|| events::evaluate::<TouchObjects>(&data, &options, &workers, done).map(judged))
        }
        TaskName::Containers => {
            run(&|| events::evaluate::<TouchContainers>(&data, &options, &workers, done).map(judged))
        }
        TaskName::Letters => {
            run(&|| events::evaluate::<TouchLetters>(&data, &options, &workers, done).map(judged))
        }
        TaskName::Slip => run(&|| slip::evaluate(&data, request, &workers, done).map(judged)),
        TaskName::Angle => {
            let options = regression::Options { request, stride, every_us, mode, embeds: false };
            run(&|| regression::evaluate(&data, &options, &workers, done).map(judged))
        }
        TaskName::Area => {
            let data = [data];
            let options = area::Options { request, data: &data, frames: FrameOptions::new() };
            run(&|| area::evaluate(&options, &workers, done).map(judged))
        }
        TaskName::Force => {
            let options = force::Options { request, every_us, mode };
            run(&|| force::evaluate(&data, &options, &workers, done).map(judged))
        }
    }?;
    Ok((report, PyBytes::new(py, &logits)))
}

/// The settings of a measurement of run time and error.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Measured {
    only: Vec<String>,
    timed: Option<usize>,
    repeats: u32,
    state: Option<PathBuf>,
    sensor: Option<Pixels>,
    from_us: i64,
}

/// The report of run time against error of `task` on `data`, as JSON.
#[pyfunction]
#[pyo3(name = "_pareto")]
pub(crate) fn measure(
    py: Python<'_>,
    task: &str,
    data: PathBuf,
    asked: Asked,
    measured: Measured,
    tick: &Bound<'_, PyAny>,
) -> Outcome<String> {
    asked.check()?;
    if measured.repeats == 0 {
        return Err(Failure::input("repeats: expected at least 1, found 0"));
    }
    let task = known(task)?;
    let (watch, parts) = (ProgressHandle::default(), Parts::default());
    let workers = workers(asked.threads, &watch)?;
    let Measured { only, timed, repeats, state, sensor, from_us } = measured;
    let options = pareto::Options { timed, repeats, only };
    let work = || {
        let run = |study: Study<'_>| run(study, &options, state.as_deref(), &watch, &parts);
        match task {
            TaskName::Digits => run(of_recordings::<Digits>(&data, &asked, &options, &workers)?),
            TaskName::Objects => run(of_recordings::<TouchObjects>(&data, &asked, &options, &workers)?),
            TaskName::Containers => run(of_recordings::<TouchContainers>(&data, &asked, &options, &workers)?),
            TaskName::Letters => run(of_recordings::<TouchLetters>(&data, &asked, &options, &workers)?),
            TaskName::Slip => run(pareto::slip(&data, asked.request(), &options, &workers)?),
            TaskName::Area => {
                let files = std::slice::from_ref(&data);
                run(pareto::area(files, asked.request(), &options, &workers)?)
            }
            TaskName::Force => run(pareto::force(&data, asked.request(), &options, &workers)?),
            TaskName::Angle => {
                let read = ReadOptions::default().sensor(sensor.as_ref().map(|pixels| pixels.0));
                let source = Source::open(Some(&data), &read, sensor.is_some(), false)?;
                let asked = AngleOptions {
                    networks: &asked.networks,
                    weights: asked.weights(),
                    ignore_preparation: false,
                    sensor: sensor.as_ref().map(|pixels| pixels.0),
                    from_us,
                };
                run(pareto::angle(source, asked, &options)?)
            }
        }
    };
    watched(py, &watch, tick, || parts.get(), work)
}

fn of_recordings<'a, T: EventTask>(
    data: &Path,
    asked: &Asked,
    options: &pareto::Options,
    workers: &'a Workers,
) -> Result<Study<'a>, EvaluateError> {
    pareto::events::<T>(data, asked.request(), asked.folds, options, workers)
}

/// Measures a study, and reports to `parts`.
fn run(
    study: Study<'_>,
    options: &pareto::Options,
    state: Option<&Path>,
    watch: &ProgressHandle,
    parts: &Parts,
) -> Result<String, EvaluateError> {
    let mut state = State::open(state)?;
    let report = study.run(options, &mut state, |progress| {
        parts.set(|seen| match progress {
            Progress::Missing(count) => seen.total = count,
            Progress::Started { network, setting } => seen.name = format!("{network}, {setting}"),
            Progress::Finished => seen.done += 1,
        });
        watch.check()
    })?;
    Ok(serde_json::to_string(&report).expect("a report has names as keys"))
}
