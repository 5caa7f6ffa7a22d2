//! Runs a network over frames made of events, with one prediction per frame.

use std::io;
use std::time::{Duration, Instant};

use meissner_engine::frames::FrameOptions;
use meissner_engine::{EngineError, Event, Outcome, Sensor};
use serde::{Deserialize, Serialize};

use super::prediction::{FramePrediction, Observer, Prediction};
use super::summary::FramePredictor;
use super::summary::{EventCounts, FrameSummary, InputCounts, Summary};
use super::{EVERY, RunOptions, Saver, Steps, StreamRun};
use crate::answer::{Classes, Values};
use crate::error::{Result, RunError};
use crate::frame_feed::{EmptyFrameLimit, FeedOptions, FeedOutput, FeedState, FrameFeed, read_note};
use crate::latency::microseconds;
use crate::losses::{InputLosses, LossWarning};
use crate::model::FrameModel;
use crate::schedule::{Every, Last, Schedule};
use crate::source::Source;
use crate::text::display_us;
use crate::work_counts::dropped;

/// A network over frames of events with its source, before the run.
pub type FrameRun = StreamRun<FrameSteps>;

/// Makes frames of events.
pub struct FrameSteps {
    feed: FrameFeed,
    /// The preparation of frames and their sensor. States of other frames are refused.
    made: String,
    frames: Frames,
}

/// Pushes frames and reads predictions.
struct Frames {
    predictor: FramePredictor,
    /// Decides after which frames a prediction is due.
    schedule: Schedule,
    classes: Classes,
    /// Time of the first accepted event.
    epoch_us: Option<i64>,
    /// Time and events of the newest frame.
    newest: Option<(i64, u64)>,
    /// Empty frames that were pushed.
    empty: u64,
    /// Empty frames that were skipped.
    left_out: u64,
    resets: u64,
    taken: u64,
    /// The reason why predictions are no longer shown. All frames that an event completes are taken
    /// before the run ends, so that the state is always the one after an event.
    unshown: Option<io::Error>,
    values: Vec<f32>,
}

/// The note of a state: the progress in making frames.
#[derive(Debug, Serialize, Deserialize)]
struct Note {
    made: String,
    /// `None` before the first event.
    feed: Option<FeedState>,
    silence: u64,
    /// Frames since the last prediction.
    since: u64,
}

impl FrameRun {
    /// A run of `model` over the events of `source`, which come from `sensor`.
    ///
    /// # Errors
    /// Frames are not made of events, the sensor lacks their pixels, predictions would be due
    /// between frames, or (as [`RunError::Resume`]) the state does not fit.
    pub fn new(
        model: &FrameModel,
        frame_options: FrameOptions,
        source: Source,
        sensor: Sensor,
        options: RunOptions,
    ) -> Result<Self> {
        let network = &model.name;
        let RunOptions { every, late, restart, limit, resume, save, longest_silence, .. } = options;
        let mut predictor = FramePredictor::new(model.network.clone(), frame_options, &model.card.outputs)?;
        let made = format!("{:?} on {sensor}, late events: {late:?}", model.source);
        let note = match resume {
            Some(bytes) => {
                predictor.resume(&bytes).map_err(RunError::Resume)?;
                Some(Note::read(&bytes, &made, sensor).map_err(RunError::Resume)?)
            }
            None => None,
        };
        let state = note.as_ref().and_then(|note| note.feed.as_ref());
        let silence = EmptyFrameLimit::new(longest_silence, note.as_ref().map_or(0, |note| note.silence));
        let feed_options =
            FeedOptions { late, restart, every: every.unwrap_or(EVERY), silence, keeps: save.is_some() };
        let feed = FrameFeed::new(&model.description, sensor, feed_options, state)
            .map_err(|source| RunError::Frames { network: network.clone(), source })?
            .ok_or_else(|| RunError::is_frame_network(network))?;
        let mut schedule = Schedule::new(every_frames(network, every, &feed)?);
        if let Some(note) = &note {
            schedule.resume(0, 0, note.since);
        }
        let frames = Frames {
            predictor,
            schedule,
            classes: Classes::new(model.card.classes.clone()),
            epoch_us: state.map(|state| state.epoch_us),
            newest: None,
            empty: 0,
            left_out: 0,
            resets: 0,
            taken: 0,
            unshown: None,
            values: Vec::with_capacity(model.description.output().values()),
        };
        let (limit, saver) = (limit.unwrap_or(u64::MAX), save.map(Saver::new));
        Ok(Self { source, sensor, limit, saver, steps: FrameSteps { feed, made, frames } })
    }
}

impl Steps for FrameSteps {
    fn take(&mut self, event: Event, observer: &mut dyn Observer) -> Result<()> {
        let frames = &mut self.frames;
        frames.taken += 1;
        let (mut start, mut prepare) = (Instant::now(), Duration::ZERO);
        let outcome = self.feed.push(event, |output| {
            let spent = start.elapsed();
            frames.predictor.spent(spent);
            prepare += spent;
            // The first frame may already come with the first event.
            frames.epoch_us.get_or_insert(event.t_us);
            let taken = frames.take(output, observer);
            start = Instant::now();
            taken
        })?;
        let spent = start.elapsed();
        frames.predictor.spent(spent);
        frames.predictor.prepare.record(prepare + spent);
        if outcome == Outcome::Accepted {
            frames.epoch_us.get_or_insert(event.t_us);
            frames.predictor.passed.event(event.t_us);
        }
        frames.shown()
    }

    fn taken(&self) -> u64 {
        self.frames.taken
    }

    fn now_us(&self) -> Option<i64> {
        self.feed.now_us()
    }

    fn state(&mut self) -> Option<Vec<u8>> {
        let Self { feed, made, frames } = self;
        let (silence, since) = (feed.silence(), frames.schedule.since());
        let note = Note { made: made.clone(), feed: feed.state(), silence, since };
        let note = serde_json::to_vec(&note).expect("numbers and text are JSON");
        Some(frames.predictor.engine.to_bytes_with(&note))
    }

    fn settle(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let Self { feed, frames, .. } = self;
        feed.settle(|output| frames.take(output, observer))
    }

    fn finish(&mut self, resumes: bool, observer: &mut dyn Observer) -> Result<()> {
        let Self { feed, frames, .. } = self;
        let ends_now = frames.schedule.last() == Last::Now;
        // The open window, and predictions that are due later, are left to the resumed run.
        if resumes && !ends_now {
            return Ok(());
        }
        feed.finish(|output| frames.take(output, observer))?;
        if ends_now {
            frames.predict(observer)?;
        }
        frames.shown()
    }

    fn losses(&self, source: &Source, sensor: Sensor) -> InputLosses {
        let losses = source.losses(*self.feed.counters(), sensor);
        InputLosses { outside_crop: self.feed.outside_crop(), ..losses }
    }

    fn summary(self, source: Source, warnings: Vec<LossWarning>) -> Summary {
        let Self { feed, frames, .. } = &self;
        frames.predictor.training.warn(&source.name);
        let counters = feed.counters();
        let counts = EventCounts {
            lines_refused: source.lines_refused(),
            salvaged: source.salvaged,
            events: counters.pushed,
            accepted: counters.accepted,
            dropped: dropped(counters),
            clamped: counters.clamped,
            outside_crop: feed.outside_crop(),
            evicted: feed.evicted(),
            empty_frames: frames.empty,
            empty_frames_left_out: frames.left_out,
            resets: frames.resets,
            restarts: counters.restarts,
        };
        let counts = InputCounts::Events(counts);
        Summary::Frames(FrameSummary::new(&frames.predictor, counts, warnings))
    }
}

/// Converts `every` from stream time to a schedule over frames, if `feed` makes the frames.
fn every_frames(network: &str, every: Option<Every>, feed: &FrameFeed) -> Result<Every> {
    match (every, feed.period_us()) {
        (Some(Every::End), Some(_)) => Ok(Every::End),
        // The feed delivers a frame whenever a prediction is due.
        (None, _) | (_, None) => Ok(Every::Events(1)),
        (Some(Every::StreamUs(us)), Some(period_us)) if us % period_us == 0 => {
            Ok(Every::Events((us / period_us) as u64))
        }
        (Some(every), Some(period_us)) => {
            let period = display_us(period_us);
            let expected = format!(
                "`end` or a multiple of {period}, since network {network} reads a frame every {period}"
            );
            Err(RunError::FramePeriod { expected, found: every })
        }
    }
}

impl Note {
    /// The note in the state `bytes` of a run that made frames of `sensor` as described by `made`.
    fn read(bytes: &[u8], made: &str, sensor: Sensor) -> Result<Self, EngineError> {
        let note: Self = read_note(bytes, "where the making of frames stands, as `meissner run` writes it")?;
        FeedState::check(note.feed.as_ref(), sensor, (made, &note.made))?;
        Ok(note)
    }
}

impl Frames {
    /// Whether all predictions could be shown so far.
    fn shown(&mut self) -> Result<()> {
        self.unshown.take().map_or(Ok(()), |error| Err(RunError::Output(error)))
    }

    fn take(&mut self, output: FeedOutput<'_>, observer: &mut dyn Observer) -> Result<()> {
        match output {
            FeedOutput::Frame { values, t_us, events } => {
                self.predictor.push(values)?;
                self.empty += u64::from(events == 0);
                self.newest = Some((t_us, events));
                if self.schedule.is_due_after_event() { self.predict(observer) } else { Ok(()) }
            }
            FeedOutput::LeftOut { count, resets } => {
                if resets {
                    self.predictor.reset();
                    self.resets += 1;
                }
                self.left_out += count;
                Ok(())
            }
            FeedOutput::Restart => {
                self.predictor.reset();
                self.predictor.passed.restart();
                (self.epoch_us, self.newest) = (None, None);
                Ok(())
            }
        }
    }

    fn predict(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let Some((t_us, events)) = self.newest else { return Ok(()) };
        let values = &mut self.values;
        let (frames, unlike) = self.predictor.predict(|predicted| {
            values.clear();
            values.extend_from_slice(predicted.values);
            Ok::<_, RunError>((predicted.frames, predicted.unlike))
        })?;
        let update_us = microseconds(self.predictor.take_update());
        if self.unshown.is_some() {
            return Ok(());
        }
        self.classes.update(&self.values);
        self.predictor.training.update(&self.values, unlike);
        let epoch_us = self.epoch_us.unwrap_or(t_us);
        let prediction = FramePrediction {
            t_us,
            value: Values(&self.values),
            answer: self.classes.answer(),
            outside_training: self.predictor.training.newest(),
            unlike,
            frames,
            events,
            update_us,
            elapsed_us: i128::from(t_us) - i128::from(epoch_us),
            taken: self.taken,
        };
        self.unshown = observer.prediction(&Prediction::Frames(prediction)).err();
        Ok(())
    }
}
