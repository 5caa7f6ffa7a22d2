//! Networks over frames of events: a recording or standard input, a prediction a frame.

use std::time::{Duration, Instant};

use meissner_engine::{Event, Outcome};
use serde::Serialize;

use super::FrameModel;
use super::header::header;
use super::report::Report;
use super::state::{Note, made};
use super::summary::{EventCounts, InputCounts, Summary};
use crate::answer::{Answer, Answers};
use crate::args::Every;
use crate::error::CliError;
use crate::progress::Progress;
use crate::run::ending::Ending;
use crate::run::json::Values;
use crate::run::{EVERY, RunArgs};
use crate::skips::dropped_of;
use meissner_pipeline::PipelineError;
use meissner_pipeline::frame_feed::{FeedOutput, FrameFeed};
use meissner_pipeline::frame_predictor::FramePredictor;
use meissner_pipeline::interrupt;
use meissner_pipeline::latency::microseconds;
use meissner_pipeline::lost::{Lost, Watch};
use meissner_pipeline::provenance::InputCard;
use meissner_pipeline::source::{self, Source};
use meissner_pipeline::text::grouped;

/// Empty frames in a row that are pushed where nothing else is asked for.
const LONGEST_SILENCE: u64 = 6000;

/// A prediction, as programs see it.
#[derive(Serialize)]
struct Line<'a> {
    t_us: i64,
    value: Values<'a>,
    #[serde(flatten)]
    answer: Option<Answer<'a>>,
    frames: u64,
    events: u64,
    update_us: f64,
}

pub(super) fn run(args: &RunArgs, model: &FrameModel, mut machine: FramePredictor) -> Result<(), CliError> {
    let input = &args.input;
    let mut source = input.source(&model.card)?;
    interrupt::listen();
    let sensor = source.sensor(input.sensor)?;
    let (every, late) = (args.every.unwrap_or(EVERY), input.late.into());
    let made = made(model, sensor, late);
    let resumed = args.state.read()?;
    if let Some(resumed) = &resumed {
        machine.resume(&resumed.bytes).map_err(|source| resumed.refused(source))?;
    }
    let note = resumed.as_ref().map(|resumed| Note::read(resumed, &made, sensor)).transpose()?;
    let feed = match &note {
        Some(note) => note.resume(model, sensor, late, every),
        None => FrameFeed::new(&model.description, sensor, late, every),
    };
    let mut feed = feed
        .map_err(|source| PipelineError::Frames { network: input.network.clone(), source })?
        .ok_or_else(|| PipelineError::IsFrameNetwork(input.network.clone()))?;
    let mut predictions = Predictions::new(args, &feed)?;
    if let (Predictions::Frames { every, since }, Some(note)) = (&mut predictions, &note) {
        *since = note.since % *every;
    }
    let mut saver = args.state.saver();
    if saver.is_some() {
        feed.keep();
    }

    let limit = input.limit.unwrap_or(u64::MAX);
    let total = source.remaining().map(|remaining| remaining.min(limit));
    let live = input.recording.as_deref().is_some_and(source::is_stdin);
    let progress = Progress::new(total, args.json);
    let answers = Answers::new(&model.card);
    let provenance = model.header(InputCard::events(&source.name, &source.format, sensor, source.recorded()));
    let report = Report::new(args.json, live, &provenance, total, progress.clone(), |out| {
        let events = source.recorded().map_or_else(String::new, |n| format!(", {} events", grouped(n)));
        let about = format!("{}, {sensor} pixels{events}", source.format);
        header(out, args, model, machine.options(), &[&source.name, &about])?;
        headings(out, &answers)
    })?;
    let mut steps = Steps {
        machine,
        report,
        predictions,
        longest_silence: args.frames.longest_silence.unwrap_or(LONGEST_SILENCE),
        zeros: vec![0.0; model.description.input().values()],
        epoch_us: note.as_ref().and_then(|note| Some(note.feed.as_ref()?.epoch_us)),
        newest: None,
        silence: note.as_ref().map_or(0, |note| note.silence),
        empty: 0,
        left_out: 0,
        resets: 0,
        taken: 0,
        unshown: None,
        values: Vec::with_capacity(model.description.output().values()),
        answers,
        outputs: model.description.outputs().0.len(),
    };
    let lost = |feed: &FrameFeed, source: &Source| Lost {
        events: *feed.counters(),
        sensor,
        outside_crop: feed.outside_crop(),
        lines_refused: source.lines_refused(),
    };
    let mut ended = Ok(());
    let mut watch = Watch::new(live);
    while ended.is_ok() && steps.taken < limit && !interrupt::requested() {
        let Some(event) = source.next() else { break };
        ended = event.map_err(CliError::from).and_then(|event| steps.event(&mut feed, event));
        progress.set(steps.taken);
        if let Some((saver, now_us)) = saver.as_mut().zip(feed.now_us())
            && ended.is_ok()
            && saver.is_due(now_us)
        {
            ended = saver.write(&steps.state(&mut feed, &made));
        }
        watch.look(steps.taken, &source.name, || lost(&feed, &source));
    }
    let mut ending = Ending::new(ended);
    if let Some(saver) = saver.as_ref().filter(|_| ending.saves()) {
        ending.then(saver.write(&steps.state(&mut feed, &made)));
    }
    // The open window, and what is due later, are left to a run that goes on.
    if ending.predicts() && (saver.is_none() || every == Every::End) {
        let finished = feed.finish(|fed| steps.take(fed)).and_then(|()| steps.end());
        ending.then(finished);
    }
    progress.finish();
    let warnings = watch.end(&source.name, lost(&feed, &source));
    let counts = counts(&steps, &feed, &source);
    let summary = Summary::new(&steps.machine, InputCounts::Events(counts), warnings);
    ending.sum_up(|| steps.report.summary(&summary))
}

fn counts(steps: &Steps, feed: &FrameFeed, source: &Source) -> EventCounts {
    let counters = feed.counters();
    EventCounts {
        salvaged: source.salvaged.clone(),
        events: counters.pushed,
        lines_refused: source.lines_refused(),
        accepted: counters.accepted,
        dropped: dropped_of(counters),
        clamped: counters.clamped,
        outside_crop: feed.outside_crop(),
        evicted: feed.evicted(),
        empty_frames: steps.empty,
        empty_frames_left_out: steps.left_out,
        resets: steps.resets,
    }
}

fn headings(out: &mut impl std::io::Write, answers: &Answers) -> std::io::Result<()> {
    let values = answers.headings();
    writeln!(out, "{:>5}  {:>13}{values}  {:>8}  {:>11}", "done", "time (ms)", "events", "update (us)")
}

/// After which frames a prediction is read.
#[derive(Clone, Copy, Debug)]
enum Predictions {
    End,
    /// Every so many frames; and how many came since the last one.
    Frames {
        every: u64,
        since: u64,
    },
}

impl Predictions {
    /// What `args` ask for, where `feed` gives the frames.
    fn new(args: &RunArgs, feed: &FrameFeed) -> Result<Self, CliError> {
        let found = match (args.every, feed.period_us()) {
            (Some(Every::End), Some(_)) => return Ok(Self::End),
            // The feed delivers a frame whenever a prediction is due.
            (None, _) | (_, None) => return Ok(Self::Frames { every: 1, since: 0 }),
            (Some(Every::StreamUs(us)), Some(period_us)) if us % period_us == 0 => {
                return Ok(Self::Frames { every: (us / period_us) as u64, since: 0 });
            }
            (Some(every), Some(_)) => every.to_string(),
        };
        let (network, period_us) = (args.input.network.clone(), feed.period_us().unwrap_or_default());
        Err(CliError::BetweenFrames { network, period_us, found })
    }

    /// A frame has been pushed; whether a prediction is due.
    fn is_due(&mut self) -> bool {
        let Self::Frames { every, since } = self else { return false };
        *since += 1;
        let is_due = since == every;
        if is_due {
            *since = 0;
        }
        is_due
    }
}

/// Pushes frames and reads predictions when they are due.
struct Steps {
    machine: FramePredictor,
    report: Report,
    predictions: Predictions,
    longest_silence: u64,
    zeros: Vec<f32>,
    /// Time of the first accepted event.
    epoch_us: Option<i64>,
    /// Time and events of the newest frame.
    newest: Option<(i64, u64)>,
    /// Empty frames since the last one with events.
    silence: u64,
    empty: u64,
    left_out: u64,
    resets: u64,
    taken: u64,
    /// Why predictions are no longer shown. An event that completes several frames is done with all of them first, so that
    /// the state is one behind an event.
    unshown: Option<std::io::Error>,
    /// The newest prediction.
    values: Vec<f32>,
    /// What its values are called.
    answers: Answers,
    /// How many values or channels that are.
    outputs: usize,
}

impl Steps {
    fn event(&mut self, feed: &mut FrameFeed, event: Event) -> Result<(), CliError> {
        self.taken += 1;
        let (mut start, mut prepare) = (Instant::now(), Duration::ZERO);
        let outcome = feed.push(event, |fed| {
            let spent = start.elapsed();
            self.machine.spent(spent);
            prepare += spent;
            // The first frame may come with the first event.
            self.epoch_us.get_or_insert(event.t_us);
            let taken = self.take(fed);
            start = Instant::now();
            taken
        })?;
        let spent = start.elapsed();
        self.machine.spent(spent);
        self.machine.prepare.record(prepare + spent);
        if outcome == Outcome::Accepted {
            self.epoch_us.get_or_insert(event.t_us);
        }
        self.shown()
    }

    /// Whether all predictions so far could be shown.
    fn shown(&mut self) -> Result<(), CliError> {
        self.unshown.take().map_or(Ok(()), |error| Err(error.into()))
    }

    fn take(&mut self, fed: FeedOutput<'_>) -> Result<(), CliError> {
        match fed {
            FeedOutput::Frame { values, t_us, events } => {
                self.silence = 0;
                self.machine.push(values)?;
                self.pushed(t_us, events)
            }
            FeedOutput::Empty { count, t_us, period_us } => self.silence(count, t_us, period_us),
        }
    }

    /// Takes `count` empty frames: up to the longest silence they are pushed, then the state is reset.
    fn silence(&mut self, count: u64, t_us: i64, period_us: i64) -> Result<(), CliError> {
        let pushed = count.min(self.longest_silence.saturating_sub(self.silence));
        let zeros = std::mem::take(&mut self.zeros);
        for i in 0..pushed {
            self.machine.push(&zeros)?;
            self.empty += 1;
            self.pushed(t_us.saturating_add(period_us.saturating_mul(i as i64)), 0)?;
        }
        self.zeros = zeros;
        if pushed < count {
            // Once in a silence, however many runs it has.
            if self.silence <= self.longest_silence {
                self.machine.reset();
                self.resets += 1;
            }
            self.left_out += count - pushed;
        }
        self.silence = self.silence.saturating_add(count);
        Ok(())
    }

    fn pushed(&mut self, t_us: i64, events: u64) -> Result<(), CliError> {
        self.newest = Some((t_us, events));
        if self.predictions.is_due() { self.predict() } else { Ok(()) }
    }

    fn predict(&mut self) -> Result<(), CliError> {
        let Some((t_us, events)) = self.newest else { return Ok(()) };
        let values = &mut self.values;
        let frames = self.machine.predict(|predicted| {
            values.clear();
            values.extend_from_slice(predicted.values);
            Ok::<_, CliError>(predicted.frames)
        })?;
        let update_us = microseconds(self.machine.take_update());
        let columns = self.answers.columns(&means(&self.values, self.outputs));
        let answer = self.answers.of(&self.values);
        let line = Line { t_us, value: Values(&self.values), answer, frames, events, update_us };
        if self.unshown.is_some() {
            return Ok(());
        }
        let (taken, epoch_us) = (self.taken, self.epoch_us.unwrap_or(t_us));
        let shown = self.report.prediction(taken, &line, |total| {
            let done = total.map_or_else(String::new, |total| format!("{} %", taken * 100 / total.max(1)));
            let time_ms = (i128::from(t_us) - i128::from(epoch_us)) as f64 / 1e3;
            format!("{done:>5}  {time_ms:>13.3}{columns}  {:>8}  {update_us:>11.1}", grouped(events))
        });
        self.unshown = shown.err();
        Ok(())
    }

    /// The state, to go on from.
    fn state(&self, feed: &mut FrameFeed, made: &str) -> Vec<u8> {
        let since = match self.predictions {
            Predictions::End => 0,
            Predictions::Frames { since, .. } => since,
        };
        let note = Note { made: made.to_owned(), feed: feed.state(), silence: self.silence, since };
        self.machine.to_bytes_with(&note.to_bytes())
    }

    /// Reads what is due at the end.
    fn end(&mut self) -> Result<(), CliError> {
        if let Predictions::End = self.predictions {
            self.predict()?;
        }
        self.shown()
    }
}

/// Of each of `outputs` its value, or for an image the mean of its channel.
fn means(values: &[f32], outputs: usize) -> Vec<f32> {
    let each = values.len() / outputs.max(1);
    let mean = |channel: &[f32]| channel.iter().map(|&v| f64::from(v)).sum::<f64>() / each as f64;
    values.chunks_exact(each.max(1)).map(|channel| mean(channel) as f32).collect()
}
