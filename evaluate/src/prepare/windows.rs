//! Statistics of the windows of a training.
//!
//! Input: streams of events of the training, and weights. Output: the weights, with statistics of
//! the windows of these streams in their metadata.

use std::path::PathBuf;

use meissner_engine::{Event, Sensor, TrainingWindows, WindowStatistics};
use meissner_kernels::random::Random;
use meissner_models::{Description, Weights, windows_text};
use meissner_run::RunError;
use meissner_run::text::grouped;
use rayon::prelude::*;

use super::{Prepared, passing};
use crate::error::{EvaluateError, RequestPart, Result};
use crate::streams::Streams;

/// Times of the streams at which the network was trained to predict.
#[derive(Clone, Copy, Debug)]
pub struct Ages {
    /// Number of random times of each stream, in addition to its end.
    pub count: usize,
    /// The earliest of them, as a part of the stream: 0 is contact, or the first event of a stream
    /// without labels, and 1 the end.
    pub youngest: f64,
    /// Seed of the random times.
    pub seed: u64,
}

/// Times of streams at which a prediction counts.
pub(super) struct Times {
    ages: Ages,
    random: Random,
}

impl Times {
    pub(super) fn new(ages: Ages) -> Self {
        Self { ages, random: Random::new(ages.seed) }
    }

    /// The random times of each of `streams`, and its end.
    pub(super) fn of(&mut self, streams: &Streams) -> Vec<Vec<i64>> {
        let Self { ages, random } = self;
        let of_stream = |stream| {
            let [contact, end] = streams.span_us(stream);
            let mut at = |_| {
                let age = ages.youngest + (1.0 - ages.youngest) * random.uniform();
                contact + (age * (end - contact) as f64) as i64
            };
            (0..ages.count).map(&mut at).chain([end]).collect()
        };
        (0..streams.parts().len()).map(of_stream).collect()
    }
}

/// `weights` of the network of `description`, with statistics of its windows at `ages` of the
/// streams in `files`. O(events) for each age.
///
/// # Errors
/// A file cannot be read or does not fit, the files are of several sensors, there are fewer than 20
/// windows with events, or the weights have an invalid stride.
pub fn training_windows(
    files: &[PathBuf],
    description: &Description,
    (weights, label): (&Weights, &str),
    ages: Ages,
) -> Result<Prepared> {
    let card = weights.card().map_err(|source| RunError::weights(label.to_owned(), source))?;
    let (mut windows, mut sensor): (_, Option<Sensor>) = (Vec::new(), None);
    let mut times = Times::new(ages);
    for file in files {
        let streams = Streams::read(file)?;
        let own = *sensor.get_or_insert(streams.sensor);
        if own != streams.sensor {
            let found = format!("{} in {}", streams.sensor, file.display());
            return Err(EvaluateError::request(RequestPart::Events, format!("streams of {own}"), found));
        }
        let times = times.of(&streams);
        let of_stream = |(events, times): (&&[Event], &Vec<i64>)| {
            let taken: Vec<Event> = events.iter().copied().step_by(card.stride).collect();
            let kept = passing(&taken, description.filters(), own)?;
            let events: Vec<Event> = kept.into_iter().map(|at| taken[at]).collect();
            let window = |&now_us: &i64| {
                let oldest = now_us.saturating_sub(description.span_us());
                let range = [oldest, now_us.saturating_add(1)]
                    .map(|t_us| events.partition_point(|event| event.t_us < t_us));
                // If more events arrive than fit, the window keeps the newest ones.
                let start = range[0].max(range[1].saturating_sub(description.capacity()));
                let events = &events[start.min(range[1])..range[1]];
                let statistics = WindowStatistics::of(events, own, now_us);
                (!events.is_empty()).then(|| statistics.features(own, description.span_us()))
            };
            Ok::<_, EvaluateError>(times.iter().filter_map(window).collect::<Vec<_>>())
        };
        let parts = streams.parts();
        let found: Vec<_> = parts.par_iter().zip(&times).map(of_stream).collect::<Result<_>>()?;
        windows.extend(found.into_iter().flatten());
    }
    let described = TrainingWindows::of(&windows).ok_or_else(|| {
        let found = format!("{} windows with events", windows.len());
        EvaluateError::request(RequestPart::Events, "streams of at least 20 windows with events", found)
    })?;
    let contents = format!("{label}, and what {} windows were like", grouped(windows.len() as u64));
    Ok(told(weights, windows_text(&described), contents))
}

/// `weights` with `text` about their training in the metadata.
pub(super) fn told(weights: &Weights, text: String, contents: String) -> Prepared {
    let mut metadata = weights.metadata().clone();
    metadata.insert("training_windows".to_owned(), text);
    Prepared { file: weights.to_file(metadata), contents }
}
