//! The frame with a task of its own.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use meissner_models::{AnyDescription, TensorFile};
use meissner_run::provenance::ModelCard;
use rayon::ThreadPoolBuilder;

use super::{Judge, JudgedTrial, judge};
use crate::error::EvaluateError;
use crate::regression::Regression;
use crate::trainings::{EvaluatedNetwork, Request, Training, candidates};
use crate::trials::{Cases, Trial};
use crate::workers::{ProgressHandle, Workers};

const CASES: usize = 5;

/// Its networks say the number of the case; the network called `refused` has no engine.
struct Numbers {
    refused: &'static str,
    run: AtomicUsize,
}

impl Judge for Numbers {
    type Task = Regression;
    type Plan = ();
    type Engine = ();
    type Outcome = f32;
    type Figures = f32;
    type Network = Vec<f32>;

    fn plan(&self, candidate: &EvaluatedNetwork<AnyDescription>) -> Result<((), Vec<Trial>), EvaluateError> {
        let mut cases = Cases::default();
        cases.push("own", CASES);
        let all: Vec<usize> = (0..CASES).collect();
        Ok(((), cases.trials(&candidate.trainings, &all, |_| Ok(()))?))
    }

    fn engine(&self, description: &AnyDescription, (): &(), _: &Training) -> Result<(), EvaluateError> {
        let refused = description.name() == self.refused;
        if refused { Err(EvaluateError::twice(self.refused)) } else { Ok(()) }
    }

    fn outcome(&self, (): &(), (): &mut (), case: usize) -> Result<f32, EvaluateError> {
        self.run.fetch_add(1, Ordering::Relaxed);
        Ok(case as f32)
    }

    fn figures(&self, (): &(), mut judged: JudgedTrial<'_, f32>) -> f32 {
        judged.write(1, |&outcome| vec![outcome]);
        judged.into_outcomes().into_iter().sum()
    }

    fn network(&self, (): (), _: &mut ModelCard, judged: Vec<(Trial, f32)>) -> Vec<f32> {
        judged.into_iter().map(|(_, figures)| figures).collect()
    }

    fn more_cases(&self) -> usize {
        3
    }
}

/// The figures of two networks or an error, the cases that ran, and those that are done and
/// expected.
fn run(refused: &'static str) -> (Result<Vec<Vec<f32>>, EvaluateError>, usize, [u64; 2]) {
    let networks = ["tactigraph-past", "tactip-past"].map(str::to_owned);
    let request = Request { networks: &networks, ..Request::default() };
    let (candidates, _) = candidates::<Regression>(request).expect("they are shipped");
    let watch = ProgressHandle::default();
    let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    let numbers = Numbers { refused, run: AtomicUsize::new(0) };
    let logits = TensorFile::new(BTreeMap::new());
    let workers = Workers::new(pool, watch.clone());
    let judged = judge(&numbers, &candidates, logits, &workers, |_, _| {});
    let figures = judged.map(|judged| judged.networks.into_iter().map(|network| network.result).collect());
    (figures, numbers.run.into_inner(), [watch.done(), watch.total()])
}

#[test]
fn every_case_of_every_network_is_expected_before_the_first_and_judged() {
    let (figures, ran, [done, total]) = run("none");
    assert_eq!(figures.expect("both fit"), [[10.0], [10.0]]);
    assert_eq!((ran, done, total), (2 * CASES, 2 * CASES as u64, 2 * CASES as u64 + 3));
}

#[test]
fn a_second_network_that_does_not_fit_is_refused_before_the_first_runs() {
    let (figures, ran, progress) = run("tactip-past");
    assert!(figures.is_err());
    assert_eq!((ran, progress), (0, [0, 0]));
}
