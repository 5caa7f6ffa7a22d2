//! `meissner play`: a recording at real speed, a queue that may overflow, reports by their deadline.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for |
//! | `clock` | stream time on the wall clock |
//! | `reader` | the sensor's side: events at their time |
//! | `tally` | what becomes of reports |
//! | `summary`, `report` | results for people and for programs |
//!
//! The recording is read beforehand. A thread offers its events when they are due, a worker pushes and predicts, and this
//! one asks for a prediction at every report's time. Behind the end, one more prediction covers all that waits.

mod args;
mod clock;
mod reader;
mod report;
mod summary;
mod tally;

use std::io::{BufWriter, Write, stdout};
use std::panic;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::filters::Chain;
use meissner_engine::{BatchEngine, Engine, Event, Options, Search, Sensor, StaleReadout};
use meissner_live::{Live, Predictor, QueueCounters, QueueOptions, Recorded};

use crate::answer::Answers;
use crate::bench::peak_resident_bytes;
use crate::error::CliError;
use crate::header::header;
use crate::run::json::Values;
use crate::skips::dropped;
use crate::text::Folded;
pub(crate) use args::PlayArgs;
use clock::Clock;
use meissner_pipeline::interrupt;
use meissner_pipeline::latency::microseconds;
use meissner_pipeline::lost::Lost;
use meissner_pipeline::provenance::{Header, InputCard};
use meissner_pipeline::source::{self, Source};
use reader::Reader;
use report::{Due, Report};
use summary::{Last, Latencies, Queue, Summary, Verified};
use tally::Tally;

/// Plays what `args` ask for, to standard output.
pub(crate) fn play(args: &PlayArgs) -> Result<(), CliError> {
    check(args)?;
    let input = &args.input;
    let model = input.model()?;
    let mut source = input.source(&model.card)?;
    let sensor = source.sensor(input.sensor)?;
    let described = InputCard::events(&source.name, &source.format, sensor, source.recorded());
    let provenance = Header::new("play", described, model.card.clone());
    provenance.warn();
    let network = Arc::new(model.network.clone());
    let approximations = &input.approximations;
    let tolerance = approximations.tolerance.unwrap_or(0.0);
    let options = Options::new().with_late(input.late.into()).with_tolerance(tolerance);
    let engine = Engine::with_options(Arc::clone(&network), sensor, options)?;
    let readout = StaleReadout::new(engine, approximations.values().staleness())?;

    let mut out = Folded::new(BufWriter::new(stdout().lock()), !args.json);
    if !args.json {
        let policy = args.overload.overload(sensor)?.name().replace('_', " ");
        let mode = format!("live, {} s of stream time a second, queue: {policy}", args.speed);
        header(&mut out, &model, &mode, &source, sensor)?;
    }
    let limit = input.limit.and_then(|limit| usize::try_from(limit).ok()).unwrap_or(usize::MAX);
    let events = source.by_ref().take(limit).collect::<Result<Vec<_>, _>>()?;
    let plan = Plan::new(&events, args);
    let answers = Answers::new(&model.card);
    let report = if args.json {
        Report::json(out, &provenance, answers)?
    } else {
        Report::people(out, answers, plan.reports)?
    };
    interrupt::listen();
    let mut stage = Stage { args, source: &source, sensor, events: &events, plan, report };
    if args.verify {
        let search = Search::Proposed(meissner_reference::PROPOSE);
        let batch = BatchEngine::new(network, sensor)?.with_late(input.late.into()).with_search(search);
        let recorded = Recorded::new(readout, batch.with_bounded_memory());
        let (played, mut recorded) = stage.play(recorded)?;
        let verified = verify(&mut recorded, &played.values)?;
        stage.end(&played, recorded.predictor(), Some(verified))?;
        return if verified.equal { Ok(()) } else { Err(CliError::NotEqual) };
    }
    let (played, readout) = stage.play(readout)?;
    stage.end(&played, &readout, None)
}

/// Refuses what has no real time, or no batch to be equal to.
fn check(args: &PlayArgs) -> Result<(), CliError> {
    if args.input.recording.as_deref().is_some_and(source::is_stdin) {
        return Err(CliError::Option {
            option: "INPUT",
            expected: "a recording, whose times say when events are due".to_owned(),
            found: "standard input".to_owned(),
        });
    }
    let approximations = &args.input.approximations;
    let given = [
        ("--tolerance", approximations.tolerance.is_some()),
        ("--stale-events", approximations.stale_events.is_some()),
        ("--stale-time", approximations.stale_us.is_some()),
    ];
    match given.into_iter().find(|&(_, given)| given && args.verify) {
        None => Ok(()),
        Some((option, _)) => Err(CliError::Option {
            option: "--verify",
            expected: "predictions that are exact over the accepted events".to_owned(),
            found: format!("{option}, with which they are not"),
        }),
    }
}

/// When reports are due.
#[derive(Clone, Copy)]
struct Plan {
    first_us: i64,
    period_us: i64,
    reports: u64,
}

impl Plan {
    /// Up to the first time at or after the last event; one at least, where there is an event.
    fn new(events: &[Event], args: &PlayArgs) -> Self {
        let first_us = events.first().map_or(0, |event| event.t_us);
        let last_us = events.iter().map(|event| event.t_us).max().unwrap_or(first_us);
        let period_us = args.report_every.as_micros() as i64;
        let span_us = (i128::from(last_us) - i128::from(first_us)).max(i128::from(!events.is_empty()));
        let reports = span_us.unsigned_abs().div_ceil(period_us.unsigned_abs().into());
        Self { first_us, period_us, reports: u64::try_from(reports).unwrap_or(u64::MAX) }
    }

    fn due(&self, number: u64) -> Due {
        let elapsed_us = i128::from(self.period_us) * i128::from(number);
        let at_us = i128::from(self.first_us).saturating_add(elapsed_us).try_into().unwrap_or(i64::MAX);
        Due { number, at_us, elapsed_us }
    }
}

/// A recording, and what is to be done with it.
struct Stage<'a, W: Write> {
    args: &'a PlayArgs,
    source: &'a Source,
    sensor: Sensor,
    events: &'a [Event],
    plan: Plan,
    report: Report<W>,
}

/// What happened.
struct Played {
    tally: Tally,
    counters: QueueCounters,
    chain: Chain,
    lag: Duration,
    /// Events of the recording that were due.
    taken: u64,
    drain: Duration,
    /// The prediction behind the last event.
    values: Vec<f32>,
    t_us: Option<i64>,
    nodes: usize,
}

impl<W: Write> Stage<'_, W> {
    /// Plays into `predictor`, and gives it back.
    fn play<P: Predictor<Input = Event> + Send + 'static>(
        &mut self,
        predictor: P,
    ) -> Result<(Played, P), CliError> {
        let (args, plan) = (self.args, self.plan);
        let overload = args.overload.overload(self.sensor)?;
        let options = QueueOptions::new().with_capacity(args.queue as usize).with_overload(overload);
        let chain = args.input.approximations.values().chain(self.sensor)?;
        thread::scope(|threads| {
            // Inside, so that whatever happens here ends the reader before it is waited for.
            let (input, mut live) = Live::spawn(predictor, options)?;
            let clock = Clock::new(Instant::now(), plan.first_us, args.speed);
            let reader = Reader { clock, input, chain, lag: Duration::ZERO, taken: 0 };
            let (events, end_us) = (self.events, plan.due(plan.reports).at_us);
            let reader = threads.spawn(move || reader.read(events, end_us));

            let mut tally = Tally::new(plan.reports, args.deadline);
            for number in 1..=plan.reports {
                let due = plan.due(number);
                clock.wait(due.at_us);
                if interrupt::requested() {
                    break;
                }
                let late = Instant::now().saturating_duration_since(clock.at(due.at_us));
                let timely = live.predict(args.deadline)?;
                tally.count(&timely, late);
                self.report.line(due, &timely)?;
            }
            let reader = reader.join().unwrap_or_else(|cause| panic::resume_unwind(cause))?;
            let ended = Instant::now();
            let last = live.predict(Duration::MAX)?;
            let played = Played {
                values: last.values.to_vec(),
                t_us: last.t_us,
                nodes: last.nodes,
                drain: ended.elapsed(),
                tally,
                counters: reader.input.counters(),
                chain: reader.chain,
                lag: reader.lag,
                taken: reader.taken,
            };
            Ok((played, live.close()?))
        })
    }

    /// Sums up.
    fn end(
        &mut self,
        played: &Played,
        readout: &StaleReadout,
        verified: Option<Verified>,
    ) -> Result<(), CliError> {
        let counters = readout.engine().counters();
        let Played { tally, counters: queue, .. } = played;
        let approximations = &self.args.input.approximations;
        let lines_refused = self.source.lines_refused();
        let lost = Lost { events: counters.events, sensor: self.sensor, outside_crop: 0, lines_refused };
        Ok(self.report.summary(&Summary {
            events: played.taken,
            lines_refused,
            warnings: lost.warn(&self.source.name),
            offered: queue.offered,
            delivered: queue.delivered,
            accepted: counters.events.accepted,
            dropped: queue.dropped_by_reason().into_iter().chain(dropped(&counters)).collect(),
            queue: Queue {
                capacity: self.args.queue,
                overload: self.args.overload.overload(self.sensor)?.name(),
                high_water: queue.high_water,
                blocked_us: microseconds(queue.blocked),
            },
            reports: tally.reports,
            latency_us: Latencies {
                waited: tally.waited.quantiles(),
                age: tally.age.quantiles(),
                behind: tally.behind.quantiles(),
            },
            reader_lag_max_us: microseconds(played.lag),
            drain_us: microseconds(played.drain),
            last: Last { t_us: played.t_us, value: Values(&played.values), nodes: played.nodes },
            verified,
            peak_resident_bytes: peak_resident_bytes(),
            approximations: approximations.values().report(&played.chain, &counters, readout.stale()),
        })?)
    }
}

/// Holds `values` against the batch over what `recorded` accepted.
fn verify(recorded: &mut Recorded<StaleReadout>, values: &[f32]) -> Result<Verified, CliError> {
    let start = Instant::now();
    let batch = recorded.from_scratch()?.values.to_vec();
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    Ok(Verified {
        events: recorded.batch().events().len(),
        equal: bits(&batch) == bits(values),
        batch_us: microseconds(start.elapsed()),
    })
}
