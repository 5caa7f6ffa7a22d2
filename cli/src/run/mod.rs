//! `meissner run`: input through a network, predictions and measurements out. Frame networks are in [`frames`]; the rest
//! is about networks over events.
//!
//! Events are pushed as fast as they come. Only pushes, moves of time and predictions are timed: neither reading nor
//! writing.

mod args;
mod ending;
mod frames;
pub(crate) mod json;
pub(crate) mod lines;
mod report;
mod state;
mod summary;
pub(crate) mod table;

use std::io::{BufWriter, stdout};
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::filters::{Chain, EventFilter};
use meissner_engine::{Engine, Event, Outcome};
use meissner_models::AnyDescription;

use crate::answer::Answers;
use crate::args::{Every, Mode};
use crate::error::CliError;
use crate::header::header;
use crate::progress::Progress;
use crate::text::Folded;
pub(crate) use args::RunArgs;
use ending::Ending;
use frames::Kind;
pub(crate) use frames::readers;
use json::{JsonLines, Predictions};
use meissner_pipeline::approximations::Approximations;
use meissner_pipeline::interrupt;
use meissner_pipeline::latency::Latency;
use meissner_pipeline::lost::{Lost, Watch};
use meissner_pipeline::model::{Model, describe_any};
use meissner_pipeline::predictor::Predictor;
use meissner_pipeline::provenance::{Header, InputCard};
use meissner_pipeline::schedule::{Last, Schedule};
use meissner_pipeline::source;
use report::{Reading, Report};
use state::Saver;
use summary::Summary;
use table::People;

/// Predictions of networks over events, where nothing else is asked for.
const EVERY: Every = Every::StreamUs(10_000);

/// Runs what `args` ask for, to standard output.
pub(crate) fn run(args: &RunArgs) -> Result<(), CliError> {
    let input = &args.input;
    if let (AnyDescription::Frames(description), shipped) = describe_any(&input.network)? {
        return frames::run(args, description, shipped);
    }
    Kind::EventGraph.check(args)?;
    check_mode(args)?;
    let model = input.model()?;
    let network = Arc::new(model.network.clone());
    check_stride(args, &model)?;
    let mut source = input.source(&model.card)?;
    interrupt::listen();
    let sensor = source.sensor(input.sensor)?;
    let described = InputCard::events(&source.name, &source.format, sensor, source.recorded());
    let provenance = Header::new("run", described, model.card.clone());
    provenance.warn();
    let late = input.late.into();
    let mut machine =
        Predictor::new(args.mode.into(), Arc::clone(&network), sensor, late, &input.approximations.values())?;
    let mut schedule = Schedule::new(args.every.unwrap_or(EVERY), sensor, late);
    if let Some(resumed) = args.state.read()? {
        machine = machine.resume(&resumed.bytes).map_err(|source| resumed.refused(source))?;
        if let Some(engine) = machine.engine()
            && let (Some(first_us), Some(now_us)) = (engine.epoch_us(), engine.now_us())
        {
            schedule.resume(first_us, now_us, engine.counters().events.accepted);
        }
    }

    let limit = input.limit.unwrap_or(u64::MAX);
    let total = source.remaining().map(|remaining| remaining.min(limit));
    let live = input.recording.as_deref().is_some_and(source::is_stdin);
    let progress = Progress::new(total, args.json);
    let mut out = Folded::new(BufWriter::new(stdout().lock()), !args.json);
    let mut report: Box<dyn Report + '_> = if args.json {
        let mut lines = JsonLines::new(out, live);
        lines.header(&provenance)?;
        Box::new(Predictions::new(lines, Answers::new(&model.card)))
    } else {
        let mode = match args.mode {
            Mode::Incremental => "incremental",
            Mode::Batch => "batch: every row at every prediction",
        };
        header(&mut out, &model, mode, &source, sensor)?;
        Box::new(People::new(out, Answers::new(&model.card), total, progress.clone())?)
    };
    let mut runner = Runner {
        schedule,
        saver: args.state.saver(),
        chain: input.approximations.values().chain(sensor)?,
        epoch_us: machine.engine().and_then(Engine::epoch_us),
        machine,
        report: &mut *report,
        push: Latency::new(),
        predict: Latency::new(),
        update: Duration::ZERO,
        taken: 0,
        nodes_max: 0,
    };
    let mut watch = Watch::new(live);
    let mut ended = Ok(());
    while ended.is_ok() && runner.taken < limit && !interrupt::requested() {
        let Some(event) = source.next() else { break };
        ended = event.map_err(CliError::from).and_then(|event| runner.take(event));
        progress.set(runner.taken);
        watch.look(runner.taken, &source.name, || Lost {
            events: runner.machine.counters().events,
            sensor,
            outside_crop: 0,
            lines_refused: source.lines_refused(),
        });
    }
    let mut ending = Ending::new(ended);
    let mut summary = runner.end(&mut ending, &network.layers(), &input.approximations.values());
    progress.finish();
    summary.lines_refused = source.lines_refused();
    summary.salvaged = source.salvaged.take();
    let (events, lines_refused) = (summary.gate, summary.lines_refused);
    summary.warnings = watch.end(&source.name, Lost { events, sensor, outside_crop: 0, lines_refused });
    ending.sum_up(|| report.summary(&summary))
}

/// Refuses approximations of what is kept from one prediction to the next where nothing is, and states of what has none.
fn check_mode(args: &RunArgs) -> Result<(), CliError> {
    let approximations = &args.input.approximations;
    let batch = args.mode == Mode::Batch;
    let given = [
        ("--tolerance", approximations.tolerance.is_some()),
        ("--stale-events", approximations.stale_events.is_some()),
        ("--stale-time", approximations.stale_us.is_some()),
    ];
    if let Some((option, _)) = given.into_iter().find(|(_, given)| *given && batch) {
        return Err(CliError::Option {
            option,
            expected: "--mode incremental with it, since it says what may be kept".to_owned(),
            found: "--mode batch, which computes every row at every prediction".to_owned(),
        });
    }
    let Some(option) = args.state.given() else { return Ok(()) };
    let found = match approximations.remembers() {
        _ if batch => "--mode batch, which keeps all events".to_owned(),
        Some(other) => format!("{other}, which remembers what the state does not hold"),
        None => return Ok(()),
    };
    let expected = "neither --mode batch nor filters nor a stale readout with it".to_owned();
    Err(CliError::Option { option, expected, found })
}

/// Refuses a state of a run that passes events over: which of two is next is not in it.
fn check_stride(args: &RunArgs, model: &Model) -> Result<(), CliError> {
    match (args.state.given(), model.card.stride()) {
        (Some(option), 2..) => Err(CliError::Option {
            option,
            expected: "weights of a network that takes every event".to_owned(),
            found: format!("weights with metadata \"stride\" {}", model.card.stride()),
        }),
        _ => Ok(()),
    }
}

/// Takes events one after the other and reads predictions when they are due.
struct Runner<'a> {
    schedule: Schedule,
    saver: Option<Saver>,
    /// Stands before schedule and machine: what it drops moves no time on.
    chain: Chain,
    machine: Predictor,
    report: &'a mut dyn Report,
    push: Latency,
    predict: Latency,
    /// Time spent since the last prediction.
    update: Duration,
    /// Time of the first accepted event.
    epoch_us: Option<i64>,
    taken: u64,
    nodes_max: usize,
}

impl Runner<'_> {
    fn take(&mut self, event: Event) -> Result<(), CliError> {
        let mut filtering = Duration::ZERO;
        if !self.chain.filters().is_empty() {
            let start = Instant::now();
            let passes = self.chain.admit(event);
            filtering = start.elapsed();
            if !passes {
                self.pushed(filtering);
                return Ok(());
            }
        }
        if let Some(t_us) = self.schedule.arrival_us(event) {
            while let Some(due_us) = self.schedule.due_before(t_us) {
                if self.read(Some(due_us))? == 0 {
                    self.schedule.skip_to(t_us);
                }
            }
        }
        let start = Instant::now();
        let outcome = self.machine.push(event);
        self.pushed(filtering + start.elapsed());
        self.nodes_max = self.nodes_max.max(self.machine.nodes());
        if outcome == Outcome::Accepted {
            self.epoch_us = self.epoch_us.or(Some(event.t_us));
            if self.schedule.is_due_after_event() {
                self.read(None)?;
            }
            if self.saver.as_mut().zip(self.machine.engine()).is_some_and(|(saver, engine)| {
                // A late event that is let in counts as of now.
                saver.is_due(engine.now_us().unwrap_or(event.t_us))
            }) {
                self.save()?;
            }
        }
        Ok(())
    }

    /// Writes the state, where that was asked for.
    fn save(&self) -> Result<(), CliError> {
        let Some((saver, engine)) = self.saver.as_ref().zip(self.machine.engine()) else { return Ok(()) };
        saver.write(&engine.to_bytes())
    }

    /// Notes that an event was taken.
    fn pushed(&mut self, spent: Duration) {
        self.push.record(spent);
        self.update += spent;
        self.taken += 1;
    }

    /// Reads a prediction, at `due_us` where that is given; the number of events in its window.
    fn read(&mut self, due_us: Option<i64>) -> Result<usize, CliError> {
        let start = Instant::now();
        if let Some(due_us) = due_us {
            self.machine.advance(due_us);
        }
        let prediction = self.machine.predict();
        let spent = start.elapsed();
        self.predict.record(spent);
        self.update += spent;
        let prediction = prediction?;
        let now_us = due_us.or(prediction.t_us);
        let reading = Reading {
            prediction,
            elapsed_us: now_us.zip(self.epoch_us).map(|(now, epoch)| i128::from(now) - i128::from(epoch)),
            update: std::mem::take(&mut self.update),
            taken: self.taken,
        };
        self.report.reading(&reading)?;
        Ok(prediction.nodes)
    }

    /// Writes the state, reads what is due at the end, and sums up.
    fn end(mut self, ending: &mut Ending, layers: &[&str], approximations: &Approximations) -> Summary {
        if ending.saves() {
            ending.then(self.save());
        }
        if ending.predicts() {
            let due = match self.schedule.last() {
                Last::Nothing => Ok(0),
                Last::Now => self.read(None),
                // Not due yet: another run goes on.
                Last::At(_) if self.saver.is_some() => Ok(0),
                Last::At(due_us) => self.read(Some(due_us)),
            };
            ending.then(due.map(drop));
        }
        let (mut counters, stale) = (self.machine.counters(), self.machine.stale());
        let gate = counters.events;
        counters.events.pushed += self.chain.counters().dropped;
        counters.predictions.read += stale;
        Summary {
            gate,
            approximations: approximations.report(&self.chain, &counters, stale),
            ..Summary::new(&counters, layers, self.nodes_max, &self.push, &self.predict)
        }
    }
}
