//! Plays recordings of one or several sensors at real speed, or the events of a stream, through
//! bounded queues that may overflow, with reports by their deadlines.
//!
//! Each input has a thread that offers events, and one that pushes and predicts. The caller's
//! thread requests all predictions at the time of every report, and one more that covers all
//! events. An input whose engine fails ends at that point, and the others continue.

mod reader;
mod summary;

use std::panic;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use meissner_engine::{
    BatchEngine, Event, EventCounters, LatePolicy, Network, Options, Propose, RestartPolicy, Search, Sensor,
    StaleReadout,
};
use meissner_live::{Fleet, Input, Live, Overload, Predictor, QueueOptions, TimedAnswer};

use crate::answer::{Classes, Values};
use crate::approximations::Approximations;
use crate::clock::Clock;
use crate::error::{Result, RunError};
use crate::interrupt;
use crate::latency::microseconds;
use crate::losses::{InputLosses, LossWatch};
use crate::memory::peak_resident_bytes;
use crate::model::Model;
use crate::run::{Observer, Prediction, ReportPrediction};
use crate::schedule::times_before;
use crate::source::Source;
use crate::training::Training;
use crate::work_counts::dropped;
use reader::{Laps, Reader};
pub use summary::{LastPrediction, PlaySummary, QueueReport, ReportCounts, Verified};
use summary::{Tally, state};

/// Options of a play.
#[derive(Clone, Debug)]
pub struct PlayOptions {
    /// Seconds of stream time per second.
    pub speed: f64,
    /// Number of times that recordings are played without a reset; at least 1.
    pub repeat: u32,
    /// Largest number of events that wait in a queue.
    pub queue: usize,
    /// Shortest time on the wall clock between two packets of events of a recording.
    pub packet: Duration,
    /// Cores to which engines are pinned, in turn; if empty, the system places them.
    pub cores: Vec<usize>,
    /// Whether engines compute while no event waits and no report is due.
    pub ahead: bool,
    /// Stream time between two reports; at least a microsecond.
    pub report_every: Duration,
    /// Longest wait for the predictions of a report.
    pub deadline: Duration,
    /// Policy for events that are earlier than an event before them.
    pub late: LatePolicy,
    /// Rule for restarts of a sensor's clock.
    pub restart: RestartPolicy,
    /// Approximations. Filters act before the queue.
    pub approximations: Approximations,
    /// Largest number of events to take from an input.
    pub limit: Option<u64>,
    /// If given, proposes candidates for a prediction from scratch, for comparison.
    pub verify: Option<Propose>,
}

/// An input of a play.
#[expect(missing_docs, reason = "the names say it")]
pub struct PlayInput {
    pub source: Source,
    pub sensor: Sensor,
    /// Policy when events arrive faster than the engine takes them.
    pub overload: Overload,
}

/// A network over events with its recordings, before the play.
pub struct Play {
    network: Arc<Network>,
    classes: Classes,
    training: Training,
    tracks: Vec<Track>,
    options: PlayOptions,
    /// Start of stream time on the wall clock, if it has begun.
    started: Option<Instant>,
}

/// An input with the times at which its reports are due.
struct Track {
    input: PlayInput,
    /// All events of a recording, or the first one of a stream.
    events: Vec<Event>,
    due: Due,
}

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

    /// The same, counted from the first event.
    fn elapsed_us(self, number: u64) -> i128 {
        i128::from(self.period_us) * i128::from(number)
    }

    fn has(self, number: u64) -> bool {
        self.reports.is_none_or(|reports| number <= reports)
    }
}

/// A thread that offers the events of an input; it returns its reader and the input.
type Offering = JoinHandle<Result<(Reader, PlayInput)>>;

struct Played {
    tally: Tally,
    reader: Reader,
    input: PlayInput,
    drain: Duration,
    last: LastPrediction,
}

impl Play {
    /// A play of `inputs` at once, which waits for the first event of a stream.
    ///
    /// # Errors
    /// An input cannot be read, or one of several is a stream.
    pub fn new(model: &Model, inputs: Vec<PlayInput>, options: PlayOptions) -> Result<Self> {
        let several = inputs.len() > 1;
        let mut started = None;
        let mut tracks = Vec::with_capacity(inputs.len());
        for mut input in inputs {
            let live = input.source.is_live();
            if live {
                if several {
                    return Err(RunError::SeveralStreams(input.source.name));
                }
                // From now on a signal ends the wait for an event.
                interrupt::listen();
            }
            let limit = limit(&options);
            let events = input.source.by_ref().take(if live { limit.min(1) } else { limit });
            let events = events.collect::<Result<Vec<_>, _>>()?;
            started = (live && !events.is_empty()).then(Instant::now);
            let first_us = events.first().map_or(0, |event| event.t_us);
            let last_us = events.iter().map(|event| event.t_us).max();
            let period_us = options.report_every.as_micros() as i64;
            // Up to the first time at or after the last event.
            let reports = last_us.map_or(0, |last_us| times_before(first_us, last_us, period_us).max(1));
            let reports = reports.saturating_mul(options.repeat.into());
            let due = Due { first_us, period_us, reports: started.is_none().then_some(reports) };
            tracks.push(Track { input, events, due });
        }
        let network = Arc::new(model.network.clone());
        let classes = Classes::new(model.card.classes.clone());
        let training = Training::new(&model.card.outputs);
        Ok(Self { network, classes, training, tracks, options, started })
    }

    /// The number of reports that will be due, if it is known: that of the longest input.
    pub fn reports(&self) -> Option<u64> {
        self.tracks
            .iter()
            .map(|track| track.due.reports)
            .try_fold(0, |most, reports| Some(reports?.max(most)))
    }

    /// Plays until a [requested](interrupt::requested) end. Returns each summary or error.
    ///
    /// # Errors
    /// An option is refused, a thread cannot start, or the observer cannot show a report.
    pub fn run(self, observer: &mut dyn Observer) -> Result<Vec<Result<PlaySummary>>> {
        let options = self.options.clone();
        let sensors: Vec<_> = self.tracks.iter().map(|track| track.input.sensor).collect();
        let readout = |&sensor: &Sensor| {
            let exact = Options::new().with_late(options.late).with_restart(options.restart);
            options.approximations.readout(Arc::clone(&self.network), sensor, exact)
        };
        interrupt::listen();
        let Some(propose) = options.verify else {
            let readouts = sensors.iter().map(readout).collect::<Result<_, _>>()?;
            let played = self.play(readouts, observer)?.into_iter();
            let summary = |(played, readout): (Played, _)| played.summary(&options, &readout, None);
            return Ok(played.map(|played| played.map(summary)).collect());
        };
        let recorded = |sensor: &Sensor| {
            let batch = BatchEngine::new(Arc::clone(&self.network), *sensor)?.with_late(options.late);
            let batch = batch.with_restart(options.restart);
            let batch = batch.with_search(Search::Proposed(propose)).with_bounded_memory();
            Ok::<_, RunError>((readout(sensor)?, batch))
        };
        let recorded = sensors.iter().map(recorded).collect::<Result<_, _>>()?;
        let verified = |(played, (readout, batch)): (Played, (StaleReadout, _))| {
            let verified = verify(batch, &played.last.value)?;
            Ok(played.summary(&options, &readout, Some(verified)))
        };
        Ok(self.play(recorded, observer)?.into_iter().map(|played| played.and_then(verified)).collect())
    }

    /// Plays each input into its predictor, and returns both.
    #[expect(clippy::type_complexity, reason = "the outcome and the predictor of each input, or its error")]
    fn play<P: Predictor<Input = Event> + Send + 'static>(
        self,
        predictors: Vec<P>,
        observer: &mut dyn Observer,
    ) -> Result<Vec<Result<(Played, P)>>> {
        let Self { mut classes, training, tracks, options, started, .. } = self;
        let dues: Vec<_> = tracks.iter().map(|track| track.due).collect();
        let queue = |(index, predictor): (usize, P)| {
            let core = options.cores.get(index % options.cores.len().max(1)).copied();
            let queue =
                QueueOptions::new().with_capacity(options.queue).with_core(core).with_ahead(options.ahead);
            (predictor, queue.with_overload(tracks[index].input.overload.clone()))
        };
        let mut watches: Vec<_> = tracks
            .iter()
            .map(|Track { input: PlayInput { source, sensor, .. }, .. }| {
                let losses = source.losses(EventCounters::default(), *sensor);
                (LossWatch::new(source.is_live()), source.name.clone(), losses)
            })
            .collect();
        let (queues, mut fleet) = Fleet::spawn(predictors.into_iter().enumerate().map(queue))?;
        let start = started.unwrap_or_else(Instant::now);
        let (taps, taken): (Vec<_>, Vec<_>) = tracks.iter().map(|_| mpsc::channel()).unzip();
        let takes_events = observer.takes_events();
        let offering =
            tracks.into_iter().zip(queues).zip(taps).map(|((track, queue), tap)| {
                track.offer(queue, start, &options, takes_events.then_some(tap))
            });
        let offering = offering.collect::<Result<Vec<_>, _>>()?;

        let tally = |due: &Due| Tally::new(due.reports.unwrap_or(0), training.clone());
        let mut tallies: Vec<_> = dues.iter().map(tally).collect();
        let mut failed: Vec<_> = dues.iter().map(|_| None).collect();
        let (clock, mut shown) = (Clock::new(start, 0, options.speed), Ok(()));
        for number in 1.. {
            // A stream ends when its thread does.
            let ended = || {
                dues.iter().zip(&offering).all(|(due, thread)| match due.reports {
                    Some(reports) => number > reports,
                    None => thread.is_finished(),
                })
            };
            if ended() {
                break;
            }
            let at_us = i64::try_from(dues[0].elapsed_us(number)).unwrap_or(i64::MAX);
            if !clock.wait(at_us, ended) {
                break;
            }
            let late = Instant::now().saturating_duration_since(clock.at(at_us));
            show(&taken, observer);
            let asked: Vec<_> =
                (0..dues.len()).filter(|&input| failed[input].is_none() && dues[input].has(number)).collect();
            fleet.predict(options.deadline, asked.iter().copied(), |input, timely| match timely {
                Ok(timely) => {
                    tallies[input].count(&timely, options.deadline, late);
                    if shown.is_ok() {
                        let report = report(
                            input,
                            number,
                            dues[input],
                            &timely,
                            &mut classes,
                            &tallies[input].training,
                        );
                        shown = observer.prediction(&Prediction::Report(report));
                    }
                }
                Err(error) => failed[input] = Some(RunError::from(error)),
            });
            for (input, (watch, name, losses)) in watches.iter_mut().enumerate() {
                let events = fleet.sensors()[input].event_counters();
                watch.look(events.pushed, Instant::now, name, || InputLosses { events, ..*losses });
            }
            if shown.is_err() || failed.iter().all(Option::is_some) {
                break;
            }
        }
        shown.map_err(RunError::Output)?;
        let lives = fleet.into_sensors().into_iter();
        let inputs = lives.zip(offering).zip(tallies).zip(failed).zip(&dues);
        let end = |((((live, offering), tally), failed), due): ((((Live<P>, Offering), Tally), _), &Due)| {
            match failed {
                // The thread that offers events ends because the other side of the queue has ended.
                Some(error) => Err(error),
                None => end(live, offering, tally, *due),
            }
        };
        let ended = inputs.map(end).collect();
        show(&taken, observer);
        Ok(ended)
    }
}

impl Track {
    /// Starts the thread that offers the events to `queue`.
    fn offer(
        self,
        queue: Input,
        start: Instant,
        options: &PlayOptions,
        tap: Option<Sender<Vec<Event>>>,
    ) -> Result<Offering> {
        let Self { mut input, events, due } = self;
        let chain = options.approximations.chain(input.sensor)?;
        let clock = Clock::new(start, due.first_us, options.speed);
        let reader =
            Reader { clock, input: queue, chain, packet: options.packet, lag: Duration::ZERO, taken: 0, tap };
        let (limit, repeat) = (limit(options), options.repeat);
        // It ends when the other side of the queue ends; on a stream, at the next event after that.
        Ok(thread::spawn(move || {
            let reader = if let Some(reports) = due.reports {
                let laps = Laps { number: repeat, us: due.elapsed_us(reports / u64::from(repeat)) };
                reader.read(&events, laps, due.at_us(reports))?
            } else {
                reader.follow(&mut events.into_iter().map(Ok).chain(&mut input.source).take(limit))?
            };
            Ok((reader, input))
        }))
    }
}

/// Shows the events that were taken since the last call.
fn show(taken: &[Receiver<Vec<Event>>], observer: &mut dyn Observer) {
    for (input, taken) in taken.iter().enumerate() {
        taken.try_iter().flatten().for_each(|event| observer.event(input, event));
    }
}

/// Ends an input: all waiting events are taken, and one more prediction covers them.
fn end<P: Predictor<Input = Event>>(
    mut live: Live<P>,
    offering: Offering,
    mut tally: Tally,
    due: Due,
) -> Result<(Played, P)> {
    if due.reports.is_none() {
        tally.reports.due = tally.reports.made;
    }
    let (reader, input) = offering.join().unwrap_or_else(|cause| panic::resume_unwind(cause))?;
    let ended = Instant::now();
    let last = live.predict(Duration::MAX)?;
    tally.covered(&last);
    let last = LastPrediction { t_us: last.t_us, value: last.values.to_vec(), nodes: last.nodes };
    let drain = ended.elapsed();
    Ok((Played { tally, reader, input, drain, last }, live.close()?))
}

fn report<'a>(
    input: usize,
    number: u64,
    due: Due,
    timely: &TimedAnswer<'a>,
    classes: &'a mut Classes,
    training: &'a Training,
) -> ReportPrediction<'a> {
    classes.update(timely.values);
    ReportPrediction {
        input,
        at_us: due.at_us(number),
        t_us: timely.t_us,
        value: Values(timely.values),
        answer: classes.answer(),
        outside_training: training.newest(),
        unlike: timely.unlike,
        nodes: timely.nodes,
        state: state(timely),
        behind_events: timely.behind_events,
        behind_us: timely.behind_us,
        lost_events: timely.lost_events,
        dropped_events: timely.dropped_events,
        restarts: timely.restarts,
        age_us: microseconds(timely.age),
        waited_us: microseconds(timely.waited),
        number,
        elapsed_us: due.elapsed_us(number),
    }
}

fn limit(options: &PlayOptions) -> usize {
    options.limit.and_then(|limit| usize::try_from(limit).ok()).unwrap_or(usize::MAX)
}

impl Played {
    fn summary(
        self,
        options: &PlayOptions,
        readout: &StaleReadout,
        verified: Option<Verified>,
    ) -> PlaySummary {
        let Self { tally, reader, input, drain, last } = self;
        let Reader { input: queue, chain, lag, taken, .. } = reader;
        let (counters, offered) = (readout.engine().counters(), queue.counters());
        let PlayInput { source, sensor, overload } = input;
        tally.training.warn(&source.name);
        let declared = QueueOptions::new().with_capacity(options.queue).bytes::<Event>() as u64;
        PlaySummary {
            events: taken,
            lines_refused: source.lines_refused(),
            warnings: source.losses(counters.events, sensor).warn(&source.name),
            offered: offered.offered,
            delivered: offered.delivered,
            accepted: counters.events.accepted,
            dropped: offered.dropped_by_reason().into_iter().chain(dropped(&counters.events)).collect(),
            restarts: counters.events.restarts,
            queue: QueueReport {
                capacity: options.queue as u64,
                overload: overload.name(),
                high_water: offered.high_water,
                blocked_us: microseconds(offered.blocked),
            },
            reports: tally.reports,
            outside_training: tally.training.outside(),
            unlike_training: tally.training.unlike(),
            latency_us: tally.latencies(),
            reader_lag_max_us: microseconds(lag),
            drain_us: microseconds(drain),
            last,
            verified,
            bytes: u64::try_from(readout.engine().state_bytes()).unwrap_or(u64::MAX).saturating_add(declared),
            peak_resident_bytes: peak_resident_bytes(),
            approximations: options.approximations.report(&chain, &counters, readout.stale()),
        }
    }
}

/// Compares `values` with the prediction of `batch`, which received the same events.
fn verify(mut batch: BatchEngine, values: &[f32]) -> Result<Verified> {
    let start = Instant::now();
    let expected = batch.predict()?.values.to_vec();
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    Ok(Verified {
        events: batch.events().len(),
        equal: bits(&expected) == bits(values),
        batch_us: microseconds(start.elapsed()),
    })
}
