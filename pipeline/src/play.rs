//! Plays a recording at real speed, or what arrives on a stream, through a bounded queue that may overflow, with reports by their
//! deadlines.
//!
//! One thread offers the events when they are due or arrive, a second thread pushes and predicts, and the
//! caller's thread requests a prediction at the time of every report. After the end, one more prediction covers all
//! waiting events.

mod reader;

use std::collections::BTreeMap;
use std::panic;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::filters::Chain;
use meissner_engine::{
    BatchEngine, Event, LatePolicy, Network, Options, Propose, Search, Sensor, StaleReadout,
};
use meissner_live::{Live, Overload, Predictor, QueueCounters, QueueOptions, Recorded, Timely};
use serde::Serialize;

use crate::answer::{Classes, Values, exact_digits};
use crate::approximations::{ApproximationReport, Approximations};
use crate::clock::Clock;
use crate::error::PipelineError;
use crate::interrupt;
use crate::latency::{Latencies, Latency, microseconds};
use crate::losses::LossWarning;
use crate::memory::peak_resident_bytes;
use crate::model::Model;
use crate::run::{Observer, Prediction, ReportPrediction, ReportState};
use crate::schedule::times_before;
use crate::skips::dropped;
use crate::source::Source;
use reader::Reader;

/// Options of a play.
#[derive(Clone, Debug)]
pub struct PlayOptions {
    /// Seconds of stream time per second.
    pub speed: f64,
    /// Largest number of events that wait in the queue.
    pub queue: usize,
    /// Policy when events arrive faster than the engine takes them.
    pub overload: Overload,
    /// Stream time between two reports; at least a microsecond.
    pub report_every: Duration,
    /// Longest wait for the prediction of a report.
    pub deadline: Duration,
    /// Policy for events that are earlier than an event before them.
    pub late: LatePolicy,
    /// Approximations. Filters act before the queue.
    pub approximations: Approximations,
    /// Largest number of events to take.
    pub limit: Option<u64>,
    /// If given, the last prediction is compared with one from scratch. This function proposes the candidate
    /// neighbours.
    pub verify: Option<Propose>,
}

impl PlayOptions {
    fn limit(&self) -> usize {
        self.limit.and_then(|limit| usize::try_from(limit).ok()).unwrap_or(usize::MAX)
    }
}

/// A network over events with its recording, before the play.
pub struct Play {
    network: Arc<Network>,
    classes: Classes,
    source: Source,
    sensor: Sensor,
    /// All events of a recording, or the first one of a stream.
    events: Vec<Event>,
    /// When the first event of a stream arrived; `None` for a recording.
    arrived: Option<Instant>,
    options: PlayOptions,
    due: Due,
}

/// The times at which reports are due.
#[derive(Clone, Copy, Debug)]
struct Due {
    first_us: i64,
    period_us: i64,
    /// The number of reports; `None` if reports are due as long as events may arrive.
    reports: Option<u64>,
}

impl Due {
    /// The time at which a report is due.
    fn at_us(self, number: u64) -> i64 {
        i128::from(self.first_us).saturating_add(self.elapsed_us(number)).try_into().unwrap_or(i64::MAX)
    }

    /// The same, from the first event on.
    fn elapsed_us(self, number: u64) -> i128 {
        i128::from(self.period_us) * i128::from(number)
    }
}

/// The outcome of a play.
struct Played {
    tally: Tally,
    queue: QueueCounters,
    chain: Chain,
    lag: Duration,
    /// Number of events of the recording that were due.
    taken: u64,
    drain: Duration,
    last: LastPrediction,
}

impl Play {
    /// A play of the events of `source`, which come from `sensor`. Waits for the first event of a stream.
    ///
    /// # Errors
    /// The source cannot be read.
    pub fn new(
        model: &Model,
        mut source: Source,
        sensor: Sensor,
        options: PlayOptions,
    ) -> Result<Self, PipelineError> {
        let live = source.is_live();
        if live {
            // From now on a signal ends the wait for an event.
            interrupt::listen();
        }
        let limit = options.limit();
        let events = source.by_ref().take(if live { limit.min(1) } else { limit });
        let events = events.collect::<Result<Vec<_>, _>>()?;
        let arrived = (live && !events.is_empty()).then(Instant::now);
        let first_us = events.first().map_or(0, |event| event.t_us);
        let last_us = events.iter().map(|event| event.t_us).max();
        let period_us = options.report_every.as_micros() as i64;
        // Up to the first time at or after the last event.
        let reports = last_us.map_or(0, |last_us| times_before(first_us, last_us, period_us).max(1));
        let reports = arrived.is_none().then_some(reports);
        let network = Arc::new(model.network.clone());
        let classes = Classes::new(model.card.classes.clone());
        let due = Due { first_us, period_us, reports };
        Ok(Self { network, classes, source, sensor, events, arrived, options, due })
    }

    /// The number of reports that will be due, if it is known.
    pub fn reports(&self) -> Option<u64> {
        self.due.reports
    }

    /// Plays all events, or the events up to a [requested](interrupt::requested) end.
    ///
    /// # Errors
    /// The engine or the queue refuses an option, a thread cannot be started, a result is not a number, or the observer
    /// cannot show a report.
    pub fn run(self, observer: &mut dyn Observer) -> Result<PlaySummary, PipelineError> {
        let Self { sensor, .. } = self;
        let late = self.options.late;
        let options = Options::new().with_late(late);
        let readout = self.options.approximations.readout(Arc::clone(&self.network), sensor, options)?;
        interrupt::listen();
        let Some(propose) = self.options.verify else {
            let (play, played, readout) = self.play(readout, observer)?;
            return Ok(play.summary(played, &readout, None));
        };
        let batch = BatchEngine::new(Arc::clone(&self.network), sensor)?.with_late(late);
        let batch = batch.with_search(Search::Proposed(propose)).with_bounded_memory();
        let (play, played, mut recorded) = self.play(Recorded::new(readout, batch), observer)?;
        let verified = verify(&mut recorded, &played.last.value)?;
        Ok(play.summary(played, recorded.predictor(), Some(verified)))
    }

    /// Plays into `predictor`, and returns it.
    fn play<P: Predictor<Input = Event> + Send + 'static>(
        mut self,
        predictor: P,
        observer: &mut dyn Observer,
    ) -> Result<(Self, Played, P), PipelineError> {
        let PlayOptions { queue: capacity, deadline, speed, .. } = self.options;
        let overload = self.options.overload.clone();
        let options = QueueOptions::new().with_capacity(capacity).with_overload(overload);
        let chain = self.options.approximations.chain(self.sensor)?;
        let (input, mut live) = Live::spawn(predictor, options)?;
        let due = self.due;
        let clock = Clock::new(self.arrived.unwrap_or_else(Instant::now), due.first_us, speed);
        let reader = Reader { clock, input, chain, lag: Duration::ZERO, taken: 0 };
        // It ends when `live` is dropped, and on a stream when the next event arrives after that: nobody waits for it if this fails.
        let (events, mut source, limit) = (self.events, self.source, self.options.limit());
        let reader = thread::spawn(move || {
            let reader = if let Some(reports) = due.reports {
                reader.read(&events, due.at_us(reports))?
            } else {
                reader.follow(&mut events.into_iter().map(Ok).chain(&mut source).take(limit))?
            };
            Ok::<_, PipelineError>((reader, source))
        });
        self.events = Vec::new();

        let reports = ReportCounts { due: due.reports.unwrap_or(0), ..ReportCounts::default() };
        let [waited, age, behind] = std::array::from_fn(|_| Latency::new());
        let mut tally = Tally { reports, waited, age, behind };
        for number in 1..=due.reports.unwrap_or(u64::MAX) {
            let at_us = due.at_us(number);
            if !clock.wait(at_us, || due.reports.is_none() && reader.is_finished()) {
                break;
            }
            let late = Instant::now().saturating_duration_since(clock.at(at_us));
            let timely = live.predict(deadline)?;
            tally.count(&timely, deadline, late);
            self.classes.update(timely.values);
            let report = ReportPrediction {
                at_us,
                t_us: timely.t_us,
                value: Values(timely.values),
                answer: self.classes.answer(),
                nodes: timely.nodes,
                state: state(&timely),
                behind_events: timely.behind_events,
                behind_us: timely.behind_us,
                age_us: microseconds(timely.age),
                waited_us: microseconds(timely.waited),
                number,
                elapsed_us: due.elapsed_us(number),
            };
            observer.prediction(&Prediction::Report(report)).map_err(PipelineError::Output)?;
        }
        if due.reports.is_none() {
            tally.reports.due = tally.reports.made;
        }
        let (reader, source) = reader.join().unwrap_or_else(|cause| panic::resume_unwind(cause))?;
        self.source = source;
        let ended = Instant::now();
        let last = live.predict(Duration::MAX)?;
        let played = Played {
            last: LastPrediction { t_us: last.t_us, value: last.values.to_vec(), nodes: last.nodes },
            drain: ended.elapsed(),
            tally,
            queue: reader.input.counters(),
            chain: reader.chain,
            lag: reader.lag,
            taken: reader.taken,
        };
        Ok((self, played, live.close()?))
    }

    fn summary(&self, played: Played, readout: &StaleReadout, verified: Option<Verified>) -> PlaySummary {
        let counters = readout.engine().counters();
        let Played { tally, queue, chain, lag, taken, drain, last } = played;
        let PlayOptions { overload, approximations, .. } = &self.options;
        PlaySummary {
            events: taken,
            lines_refused: self.source.lines_refused(),
            warnings: self.source.losses(counters.events, self.sensor).warn(&self.source.name),
            offered: queue.offered,
            delivered: queue.delivered,
            accepted: counters.events.accepted,
            dropped: queue.dropped_by_reason().into_iter().chain(dropped(&counters.events)).collect(),
            queue: QueueReport {
                capacity: self.options.queue as u64,
                overload: overload.name(),
                high_water: queue.high_water,
                blocked_us: microseconds(queue.blocked),
            },
            reports: tally.reports,
            latency_us: Latencies::of([
                ("waited", &tally.waited),
                ("age", &tally.age),
                ("behind", &tally.behind),
            ]),
            reader_lag_max_us: microseconds(lag),
            drain_us: microseconds(drain),
            last,
            verified,
            peak_resident_bytes: peak_resident_bytes(),
            approximations: approximations.report(&chain, &counters, readout.stale()),
        }
    }
}

/// Compares `values` with the prediction from scratch over the events that `recorded` accepted.
fn verify(recorded: &mut Recorded<StaleReadout>, values: &[f32]) -> Result<Verified, PipelineError> {
    let start = Instant::now();
    let batch = recorded.from_scratch()?.values.to_vec();
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    Ok(Verified {
        events: recorded.batch().events().len(),
        equal: bits(&batch) == bits(values),
        batch_us: microseconds(start.elapsed()),
    })
}

/// How current the prediction of `timely` is.
fn state(timely: &Timely<'_>) -> ReportState {
    match timely {
        Timely { fresh: true, .. } => ReportState::Fresh,
        Timely { own: true, .. } => ReportState::Behind,
        _ => ReportState::Old,
    }
}

/// Counts and times of reports.
struct Tally {
    reports: ReportCounts,
    waited: Latency,
    age: Latency,
    behind: Latency,
}

impl Tally {
    /// Counts a report with this `deadline`. It was requested `late` after it was due.
    fn count(&mut self, timely: &Timely<'_>, deadline: Duration, late: Duration) {
        let reports = &mut self.reports;
        reports.made += 1;
        match state(timely) {
            ReportState::Fresh => reports.fresh += 1,
            ReportState::Behind => reports.behind += 1,
            ReportState::Old => reports.old += 1,
        }
        let past = timely.waited.saturating_sub(deadline);
        reports.past_deadline += u64::from(!past.is_zero());
        reports.past_deadline_max_us = reports.past_deadline_max_us.max(microseconds(past));
        reports.asked_late_max_us = reports.asked_late_max_us.max(microseconds(late));
        self.waited.record(timely.waited);
        self.age.record(timely.age);
        self.behind.record(Duration::from_micros(timely.behind_us));
    }
}

/// The summary of a play.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct PlaySummary {
    /// Events taken from the recording.
    pub events: u64,
    /// Lines of a text that could not be read; they do not count as events.
    pub lines_refused: u64,
    /// Unintended losses of input.
    pub warnings: Vec<LossWarning>,
    /// Events offered to the queue.
    pub offered: u64,
    /// Events delivered to the engine.
    pub delivered: u64,
    /// Events accepted by the engine.
    pub accepted: u64,
    /// Events dropped by the queue and by the engine, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// The queue.
    pub queue: QueueReport,
    /// Counts of reports.
    pub reports: ReportCounts,
    /// Times of reports: since the request, since the start of the prediction, and stream time that is not covered.
    pub latency_us: Latencies,
    /// Longest time from the due time of an event until it was offered.
    pub reader_lag_max_us: f64,
    /// Time from the end of the recording until all waiting events were covered.
    pub drain_us: f64,
    /// The prediction after the last event.
    #[serde(rename = "final")]
    pub last: LastPrediction,
    /// The comparison with a prediction from scratch, if one was made.
    pub verified: Option<Verified>,
    /// Peak resident memory of the process; `None` if the platform does not report it.
    pub peak_resident_bytes: Option<u64>,
    /// The approximations; `None` if results are exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub approximations: Option<ApproximationReport>,
}

/// Counts of reports.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct ReportCounts {
    /// Reports that were due.
    pub due: u64,
    /// Reports that were made.
    pub made: u64,
    /// Reports that covered all events that had entered the queue.
    pub fresh: u64,
    /// Reports that covered only the events that the engine had taken.
    pub behind: u64,
    /// Reports with the prediction of an earlier report.
    pub old: u64,
    /// Reports that returned after the deadline.
    pub past_deadline: u64,
    /// Longest time after the deadline.
    pub past_deadline_max_us: f64,
    /// Longest time from the due time of a report until it was requested.
    pub asked_late_max_us: f64,
}

/// The queue between the reader and the engine.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct QueueReport {
    /// Capacity in events.
    pub capacity: u64,
    /// Name of the overload policy.
    pub overload: &'static str,
    /// Largest number of events that waited.
    pub high_water: u64,
    /// Time that the reader waited for room.
    pub blocked_us: f64,
}

/// The prediction after the last event.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct LastPrediction {
    /// Time of the newest event that it covers; `None` before the first.
    pub t_us: Option<i64>,
    /// The values.
    #[serde(serialize_with = "exact_digits")]
    pub value: Vec<f32>,
    /// Events in the window.
    pub nodes: usize,
}

/// The last prediction compared with one from scratch.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Verified {
    /// Number of events in the prediction from scratch.
    pub events: usize,
    /// Whether all bits are equal.
    pub equal: bool,
    /// Time of the prediction from scratch.
    pub batch_us: f64,
}
