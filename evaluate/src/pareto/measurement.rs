//! Times, work and errors of a network with one setting.
//!
//! Numerical errors compare all values a with the values e of the exact network:
//!
//! ```text
//! max = max |a - e|     rms = sqrt(mean (a - e)^2)     relative rms = rms / sqrt(mean e^2)
//! ```
//!
//! Sums are in f64 in the order of the moments. Both are also computed for each tenth of a stream,
//! so that an error that grows with time is visible. Times are medians over repeats. All repeats
//! compute the same, so an interruption of one changes no figure.

use std::time::Duration;

use meissner_run::latency::{Latency, microseconds};
use serde::{Deserialize, Serialize};

use super::task_error::TaskError;

/// Name of the setting without approximations.
pub const EXACT: &str = "exact";

/// Number of parts of each stream with their own errors.
const PARTS: usize = 10;

/// Times, work and errors of one setting, for an event, a window, a picture or a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Measurement {
    /// Events, windows, pictures or recordings that were timed in each repeat.
    pub timed: u64,
    /// Share of these that no filter dropped and no setting left out.
    pub entered: f64,
    #[serde(flatten)]
    pub timing: Timing,
    /// Computed rows of events and cells, or pixels of frames.
    pub rows: f64,
    /// Multiply-adds of these.
    pub multiply_adds: f64,
    /// Errors against the exact network.
    pub numerical: Numerical,
    /// Errors of the task; settings are compared by the first. Empty without labels.
    pub task: Vec<TaskError>,
}

/// Times in microseconds of an event, a window, a picture or a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Time {
    pub mean: f64,
    pub p50: f64,
    pub p99: f64,
}

/// Times of all repeats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Filters and push.
    pub push_us: Time,
    /// Filters, push and prediction.
    pub push_predict_us: Time,
    /// Mean push and prediction of the exact network in the same runs, in microseconds.
    pub exact_us: f64,
    /// Mean push and prediction of the setting as a multiple of `exact_us`.
    pub ratio: f64,
}

/// Errors against the exact network, in the units of the outputs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Numerical {
    pub max: f64,
    pub rms: f64,
    /// `rms` as a share of the RMS of the exact outputs; `None` if these are all 0.
    pub relative_rms: Option<f64>,
    /// `max` for each tenth of a stream; `None` for a tenth without values.
    pub max_by_tenth: Vec<Option<f64>>,
    /// `rms` for each tenth of a stream; `None` for a tenth without values.
    pub rms_by_tenth: Vec<Option<f64>>,
}

impl Measurement {
    /// The error by which settings are compared, and its interval if there is one.
    pub fn error(&self) -> (f64, Option<(f64, f64)>) {
        match self.task.first() {
            Some(task) => (task.error, task.interval_95),
            None => (self.numerical.compared(), None),
        }
    }
}

impl Numerical {
    /// The error by which settings without labels are compared.
    pub fn compared(&self) -> f64 {
        self.relative_rms.unwrap_or(self.rms)
    }
}

/// Times of the events of a repeat: of filters and push, and of these with the prediction.
pub(super) type Lap = Vec<(Duration, Duration)>;

/// Measures the times of two networks over `streams`, `repeats` times, in alternating turns of
/// `turn` items, so that a slower machine slows both. `begin` begins a stream, `run` pushes items.
/// In the first repeat, `after` gets the index of a turn's first item and the number of items of
/// the stream.
pub(super) fn take_turns<N, I, E>(
    (exact, own): (&mut N, &mut N),
    (streams, repeats, turn): (&[Vec<I>], u32, usize),
    begin: impl Fn(&mut N) -> Result<(), E>,
    run: impl Fn(&mut N, &[I], &mut Lap) -> Result<(), E>,
    mut after: impl FnMut((usize, usize), &N, &N),
) -> Result<Timing, E> {
    let mut laps = Vec::new();
    for repeat in 0..repeats {
        let (mut own_lap, mut exact_lap) = (Lap::new(), Lap::new());
        for items in streams {
            begin(own)?;
            begin(exact)?;
            for (place, part) in items.chunks(turn).enumerate() {
                if place % 2 == 0 {
                    run(exact, part, &mut exact_lap)?;
                    run(own, part, &mut own_lap)?;
                } else {
                    run(own, part, &mut own_lap)?;
                    run(exact, part, &mut exact_lap)?;
                }
                if repeat == 0 {
                    after((place * turn, items.len()), exact, own);
                }
            }
        }
        laps.push((own_lap, exact_lap));
    }
    Ok(Timing::of(&laps))
}

impl Timing {
    /// Times over repeats (setting, exact).
    pub(super) fn of(laps: &[(Lap, Lap)]) -> Self {
        let own = || laps.iter().map(|(own, _)| own);
        let push_predict_us = time(own(), |event| event.1);
        let exact_us = time(laps.iter().map(|(_, exact)| exact), |event| event.1).mean;
        Self {
            push_us: time(own(), |event| event.0),
            push_predict_us,
            exact_us,
            // A clock may not resolve a short time.
            ratio: push_predict_us.mean.max(1e-6) / exact_us.max(1e-6),
        }
    }
}

/// The times of events, each the median over the repeats `laps`.
fn time<'a>(laps: impl Iterator<Item = &'a Lap>, of: fn(&(Duration, Duration)) -> Duration) -> Time {
    let laps: Vec<&Lap> = laps.collect();
    let mut latency = Latency::new();
    for event in 0..laps.iter().map(|lap| lap.len()).min().unwrap_or(0) {
        latency.record(median(laps.iter().map(|lap| of(&lap[event])).collect()));
    }
    latency.quantiles().map_or_else(Time::default, |quantiles| Time {
        mean: microseconds(latency.total()) / latency.count() as f64,
        p50: quantiles.p50,
        p99: quantiles.p99,
    })
}

/// The median, for an even number the mean of both middle times; 0 for no times.
pub(super) fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    match times.len() {
        0 => Duration::ZERO,
        count => (times[(count - 1) / 2] + times[count / 2]) / 2,
    }
}

/// Sums of differences.
#[derive(Clone, Debug, Default)]
pub(super) struct Differences {
    parts: [Sum; PARTS],
    /// Sum of the squares of the exact values.
    exact: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: u64,
    squares: f64,
    max: f64,
}

impl Differences {
    /// Adds the values `found` and `exact` at moment `place` of the `count` moments of a stream.
    pub(super) fn add(&mut self, (place, count): (usize, usize), exact: &[f32], found: &[f32]) {
        let part = &mut self.parts[place * PARTS / count];
        for (&exact, &found) in exact.iter().zip(found) {
            let difference = f64::from(found) - f64::from(exact);
            part.count += 1;
            part.squares += difference * difference;
            part.max = part.max.max(difference.abs());
            self.exact += f64::from(exact) * f64::from(exact);
        }
    }

    pub(super) fn finish(&self) -> Numerical {
        let all = self.parts.iter().fold(Sum::default(), |all, part| Sum {
            count: all.count + part.count,
            squares: all.squares + part.squares,
            max: all.max.max(part.max),
        });
        let by_tenth = |figure: fn(&Sum) -> f64| -> Vec<Option<f64>> {
            self.parts.iter().map(|part| (part.count > 0).then(|| figure(part))).collect()
        };
        Numerical {
            max: all.max,
            rms: all.rms(),
            relative_rms: (self.exact > 0.0).then(|| (all.squares / self.exact).sqrt()),
            max_by_tenth: by_tenth(|part| part.max),
            rms_by_tenth: by_tenth(Sum::rms),
        }
    }
}

impl Sum {
    fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.squares / self.count as f64).sqrt() }
    }
}

/// Source of the weights of so many trainings.
pub(super) fn timed_label(trainings: usize, first: &str) -> String {
    if trainings == 1 { first.to_owned() } else { format!("{trainings} trainings, timed with {first}") }
}

/// Some of `chosen`, as far apart as possible: at least one, with about `count` events.
pub(super) fn spread(chosen: &[usize], events: impl Fn(usize) -> usize, count: usize) -> Vec<usize> {
    let all: usize = chosen.iter().map(|&place| events(place)).sum();
    // A recording has at least one event.
    let mean = (all / chosen.len()).max(1);
    evenly(chosen, count.div_ceil(mean).min(chosen.len()))
}

/// `count` of `items`, as far apart as possible.
pub(super) fn evenly<T: Copy>(items: &[T], count: usize) -> Vec<T> {
    (0..count).map(|i| items[(2 * i + 1) * items.len() / (2 * count)]).collect()
}
