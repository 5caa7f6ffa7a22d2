//! The process that infers: slices out of shared memory, predictions into it.

use std::sync::Arc;
use std::time::Duration;

use meissner_engine::{EventCounters, Network};
use meissner_pipeline::interrupt;
use serde::Serialize;

use crate::Error;
use crate::channel::{Channel, Receiver, Sender};
use crate::clock::now_ns;
use crate::driver::events_of;
use crate::inference::{Counts, Inference, Taken};
use crate::losses::{Gap, Losses};
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
    /// Slices are missing.
    Gap(Gap),
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
    /// What is missing.
    pub lost: Losses,
    /// The first thousand gaps.
    pub gaps: Vec<Gap>,
    /// What the engine dropped since its sensor is known, by reason.
    pub dropped: Dropped,
}

/// Events that an engine dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// Outside the sensor.
    pub outside_sensor: u64,
    /// Earlier than one before them.
    pub late: u64,
    /// Too far in time from the first one.
    pub time_out_of_range: u64,
}

impl From<EventCounters> for Dropped {
    fn from(events: EventCounters) -> Self {
        let EventCounters { outside_sensor, late, time_out_of_range, .. } = events;
        Self { outside_sensor, late, time_out_of_range }
    }
}

/// Infers under this name until a driver ends (`once`), or until the program is asked to end.
///
/// # Errors
/// A service cannot be opened, or breaks. A slice that is refused is no error: it is counted and told.
pub fn infer(
    name: &str,
    network: impl Into<Arc<Network>>,
    options: Options,
    mut tell: impl FnMut(News),
) -> Result<Summary, Error> {
    let mut inference = Inference::new(network, now_ns());
    let predictions: Sender<f32, PredictionHeader> =
        Channel::open(&predictions_of(name))?.sender(inference.outputs())?;
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
            match inference.take(slice.user_header(), slice.payload(), now_ns()) {
                Ok(Taken { is_new_run, gap, is_end }) => {
                    if is_new_run {
                        tell(News::Run(slice.user_header().run));
                    }
                    if let Some(gap) = gap {
                        tell(News::Gap(gap));
                        if gaps.len() < GAPS {
                            gaps.push(gap);
                        }
                    }
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
    let (counts, lost) = (inference.counts(), inference.losses());
    Ok(Summary { counts, lost, gaps, dropped: inference.engine_counters().into() })
}
