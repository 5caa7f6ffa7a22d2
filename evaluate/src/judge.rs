//! The frame of every evaluation: networks of a task with their trainings, judged on labelled data.
//!
//! Input: candidates, and a `Judge`, which knows the data and the figures of its task. Output:
//! the report of each network, and the outputs of the trainings. Errors that can be found early are
//! reported before a network runs. Outcomes are taken in order: threads change no bit, except in
//! measured times.

use std::time::{Duration, Instant};

use meissner_models::{AnyDescription, ModelError, TensorFile};
use meissner_run::RunError;
use meissner_run::provenance::ModelCard;
use serde::Serialize;

use crate::error::{EvaluateError, Result, weights_error};
use crate::trainings::{EvaluatedNetwork, Evaluation, Task, Training};
use crate::trials::Trial;
use crate::workers::Workers;

/// The description of the networks that `J` judges.
type Description<J> = <<J as Judge>::Task as Task>::Description;

/// The data of a task, and how one network is judged on them.
pub(crate) trait Judge: Sync {
    /// The task.
    type Task: Task<Description: Clone + Into<AnyDescription> + Sync>;
    /// The task's plan for a network, made before it runs.
    type Plan: Sync;
    /// A network with the weights of a training.
    type Engine: Clone + Sync;
    /// The result of a network for a case.
    type Outcome: Send;
    /// Figures of the outcomes of a trial.
    type Figures;
    /// Figures of a network.
    type Network;

    /// Plans the trials of `candidate`.
    fn plan(&self, candidate: &EvaluatedNetwork<Description<Self>>) -> Result<(Self::Plan, Vec<Trial>)>;

    /// The network of `description` with the weights of `training`.
    fn engine(
        &self,
        description: &Description<Self>,
        plan: &Self::Plan,
        training: &Training,
    ) -> Result<Self::Engine>;

    /// Runs a network over a case.
    fn outcome(&self, plan: &Self::Plan, engine: &mut Self::Engine, case: usize) -> Result<Self::Outcome>;

    /// The figures of a trial; also writes its outputs.
    fn figures(&self, plan: &Self::Plan, judged: JudgedTrial<'_, Self::Outcome>) -> Self::Figures;

    /// The figures of a network from those of its trials. The card can be completed.
    fn network(
        &self,
        plan: Self::Plan,
        card: &mut ModelCard,
        judged: Vec<(Trial, Self::Figures)>,
    ) -> Self::Network;

    /// Number of cases that the caller runs itself, in addition to those of the networks.
    fn more_cases(&self) -> usize {
        0
    }
}

/// A trial with the outcomes of its cases, in their order.
pub(crate) struct JudgedTrial<'a, O> {
    pub(crate) network: &'a str,
    pub(crate) trial: &'a Trial,
    pub(crate) outcomes: Vec<(usize, O)>,
    pub(crate) logits: &'a mut TensorFile,
}

impl<O> JudgedTrial<'_, O> {
    /// Adds the `outputs` values of each case to the file of outputs.
    pub(crate) fn write(&mut self, outputs: usize, values: impl FnMut(&O) -> Vec<f32>) {
        let values: Vec<f32> = self.outcomes.iter().map(|(_, outcome)| outcome).flat_map(values).collect();
        self.trial.write(self.network, outputs, &values, self.logits);
    }

    pub(crate) fn into_outcomes(self) -> Vec<O> {
        self.outcomes.into_iter().map(|(_, outcome)| outcome).collect()
    }
}

/// Figures of a network, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct NetworkReport<F> {
    #[serde(flatten)]
    pub card: ModelCard,
    /// Source of its weights.
    #[serde(skip)]
    pub weights: String,
    #[serde(flatten)]
    pub result: F,
}

pub(crate) struct JudgedNetworks<F> {
    pub(crate) networks: Vec<NetworkReport<F>>,
    logits: TensorFile,
    start: Instant,
}

impl<F> JudgedNetworks<F> {
    pub(crate) fn evaluation<R>(self, report: impl FnOnce(Vec<NetworkReport<F>>) -> R) -> Evaluation<R> {
        let took = self.start.elapsed();
        Evaluation { report: report(self.networks), logits: self.logits, took }
    }
}

/// Judges `candidates` with the threads of `workers`, and adds their outputs to `logits`. `done` is
/// called after each training with its label and the time since judging began.
pub(crate) fn judge<J: Judge>(
    judge: &J,
    candidates: &[EvaluatedNetwork<Description<J>>],
    mut logits: TensorFile,
    workers: &Workers,
    mut done: impl FnMut(&str, Duration),
) -> Result<JudgedNetworks<J::Network>> {
    let mut plans = Vec::new();
    for candidate in candidates {
        let (plan, trials) = judge.plan(candidate)?;
        for training in &candidate.trainings {
            judge.engine(&candidate.description, &plan, training)?;
        }
        plans.push((candidate, plan, trials));
    }
    let cases: usize = plans.iter().flat_map(|(.., trials)| trials).map(Trial::cases).sum();
    workers.expect(cases + judge.more_cases());

    let start = Instant::now();
    let mut networks = Vec::new();
    for (candidate, plan, trials) in plans {
        let EvaluatedNetwork { description, trainings } = candidate;
        let mut judged = Vec::new();
        for trial in trials {
            let outcomes = trial.outcomes(
                |training| done(&training.label, start.elapsed()),
                |training, chosen| {
                    let engine = judge.engine(description, &plan, training)?;
                    let work = |engine: &mut J::Engine, &case: &usize| judge.outcome(&plan, engine, case);
                    let named = |error| of_weights(&training.label, error);
                    workers.for_each(&engine, chosen, work).map_err(named)
                },
            )?;
            let (network, trial, logits) = (J::Task::name(description), &trial, &mut logits);
            let figures = judge.figures(&plan, JudgedTrial { network, trial, outcomes, logits });
            judged.push((trial.clone(), figures));
        }
        let weights = candidate.weights();
        let mut card = ModelCard::new(&description.clone().into(), &trainings[0].weights, weights.clone())?;
        let result = judge.network(plan, &mut card, judged);
        networks.push(NetworkReport { card, weights, result });
    }
    Ok(JudgedNetworks { networks, logits, start })
}

/// An engine's `error`, which names the weights.
fn of_weights(label: &str, error: EvaluateError) -> EvaluateError {
    let EvaluateError::Run(error) = error else { return error };
    match *error {
        RunError::Engine(source) => weights_error(label)(ModelError::Engine(source)),
        other => other.into(),
    }
}

/// Figures of one training.
pub trait Figures: Sized {
    /// Figures of several trainings together.
    type Mean;

    /// The figures of `each` training together; `None` for no trainings.
    fn mean(each: &[&Self]) -> Option<Self::Mean>;
}

/// Figures of several trainings on the same data.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Judged<F: Figures> {
    pub trainings: usize,
    /// Figures of all trainings together.
    #[serde(flatten)]
    pub mean: F::Mean,
    pub each: Vec<TrainingFigures<F>>,
}

/// Figures of one training, or of the folds of one seed together.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct TrainingFigures<F> {
    /// Seed of the training, where the weights state it.
    pub seed: Option<i64>,
    /// Files of the weights; none for shipped ones.
    pub files: Vec<String>,
    #[serde(flatten)]
    pub figures: F,
}

impl<F: Figures> Judged<F> {
    /// The figures of `each` trial; `None` without trials, and if a trial has no figures.
    pub(crate) fn new(each: impl IntoIterator<Item = (Trial, Option<F>)>) -> Option<Self> {
        let judged = |(trial, figures): (Trial, Option<F>)| {
            Some(TrainingFigures { seed: trial.seed, files: trial.files(), figures: figures? })
        };
        let each: Vec<TrainingFigures<F>> = each.into_iter().filter_map(judged).collect();
        let mean = F::mean(&each.iter().map(|one| &one.figures).collect::<Vec<_>>())?;
        Some(Self { trainings: each.len(), mean, each })
    }
}
