//! The process that infers: slices out of shared memory, predictions into it.

use std::collections::BTreeMap;
use std::time::Duration;

use meissner_packets::{AnyNetwork, Counts, Gap, Lost, by_reason};
use meissner_run::interrupt;
use serde::Serialize;

use crate::Error;
use crate::channel::{Channel, Receiver, Sender};
use crate::driver::{events_of, now_ns};
use crate::inference::{Inference, Taken};
use crate::wire::{EventRecord, PredictionHeader, SliceHeader};

/// Longest wait until an end is noticed.
const NAP: Duration = Duration::from_millis(100);
/// Gaps that a summary lists.
const GAPS: usize = 1000;

/// The name of the service for the predictions of `name`.
pub fn predictions_of(name: &str) -> String {
    format!("{name}/predictions")
}

/// How the process runs.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Slices that may wait; more are lost, the oldest first.
    pub buffer: usize,
    /// Whether it ends with the first run that a driver ends.
    pub once: bool,
}

/// Something to tell.
#[derive(Clone, Debug)]
pub enum News {
    /// It is connected, and waits.
    Ready,
    /// A driver has started.
    Run(u64),
    /// Slices of this run are missing.
    Gap(u64, Gap),
    /// A slice was refused, with the reason.
    Refused(String),
    /// There is no prediction, with the reason.
    NoPrediction(String),
    /// A driver has ended.
    End,
}

/// What a process did.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// What was taken.
    #[serde(flatten)]
    pub counts: Counts,
    /// What is missing, by reason.
    pub lost: BTreeMap<&'static str, Lost>,
    /// The first thousand gaps, with their runs.
    pub gaps: Vec<(u64, Gap)>,
    /// What the engine dropped since its sensor is known, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
}

/// Infers under this name until a driver ends (`once`), or until the program is asked to end.
///
/// # Errors
/// A service cannot be opened, or breaks. A slice that is refused is no error: it is counted and
/// told.
pub fn infer(
    name: &str,
    network: AnyNetwork,
    options: Options,
    mut tell: impl FnMut(News),
) -> Result<Summary, Error> {
    let outputs = network.outputs();
    let mut inference = Inference::new(network, now_ns());
    let predictions: Sender<f32, PredictionHeader> = Channel::open(&predictions_of(name))?.sender(outputs)?;
    let events: Receiver<EventRecord, SliceHeader> =
        Channel::open(&events_of(name))?.receiver(options.buffer)?;
    let mut gaps = Vec::new();
    tell(News::Ready);
    let mut is_over = false;
    while !is_over && !interrupt::requested() {
        events.wait(NAP)?;
        let mut has_ended = false;
        // At most what fits: under a flood, predictions still appear.
        for _ in 0..options.buffer {
            let Some(slice) = events.take()? else { break };
            let run = slice.user_header().run;
            match inference.take(slice.user_header(), slice.payload(), now_ns()) {
                Ok(Taken { is_new_run, gap, refused, is_end }) => {
                    let new_run = is_new_run.then_some(News::Run(run));
                    let refused = refused.map(|why| News::Refused(why.to_string()));
                    let missing = gap.map(|gap| News::Gap(run, gap));
                    new_run.into_iter().chain(missing).chain(refused).for_each(&mut tell);
                    gaps.extend(gap.filter(|_| gaps.len() < GAPS).map(|gap| (run, gap)));
                    has_ended = is_end;
                }
                Err(refused) => tell(News::Refused(refused.to_string())),
            }
            if has_ended {
                break;
            }
        }
        match inference.predict() {
            Ok(Some((header, values))) => {
                let header = PredictionHeader { predicted_ns: now_ns(), ..header };
                predictions.publish(header, values.len(), |index| values[index])?;
            }
            Ok(None) => {}
            Err(error) => tell(News::NoPrediction(error.to_string())),
        }
        if has_ended {
            tell(News::End);
            is_over = options.once;
        }
    }
    let engine = inference.engine;
    let dropped = engine.dropped().into_iter().map(|(reason, count)| (reason.name(), count)).collect();
    Ok(Summary { counts: engine.counts(), lost: by_reason(&engine.losses()), gaps, dropped })
}
