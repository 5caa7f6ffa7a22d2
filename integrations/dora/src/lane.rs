//! The way of one sensor's events: from the messages through the engine's queue to predictions.
//!
//! Enters: messages of events. Leaves: predictions, losses, counts, states. Each lane has an engine in a thread of its own, as in
//! `meissner::live::Fleet`, and all share one copy of the weights. Invariant: a prediction has the bits of an engine that was given the same
//! events in one process; a message that finds no room in the engine's queue is dropped as a whole and counted, so it is known which.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner::io::{IoError, replace_file};
use meissner::live::{Asked, Input, Live, LiveError, Overload, QueueOptions};
use meissner::{EngineError, Event, Sensor};
use meissner_pipeline::PipelineError;
use thiserror::Error;

use crate::coverage::{Coverage, Reason};
use crate::engine::{Engine, Network};
use crate::kept::{Covered, Desk, Kept, Mark, Shared, lock};
use crate::message::{Counter, EventsHeader, Loss};

/// A lane cannot go on.
#[derive(Debug, Error)]
pub(crate) enum LaneError {
    /// The network does not fit the sensor.
    #[error(transparent)]
    Network(#[from] PipelineError),
    /// A state does not fit the engine.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The engine's thread has ended.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// The state cannot be read.
    #[error("the state in {path}")]
    Read { path: String, source: std::io::Error },
    /// The state cannot be written.
    #[error(transparent)]
    Write(#[from] IoError),
}

/// What all lanes of a node have in common.
#[derive(Clone)]
pub(crate) struct LaneOptions {
    /// The network with its weights.
    pub(crate) network: Network,
    /// Most events that wait for an engine.
    pub(crate) capacity: usize,
    /// Time between two predictions.
    pub(crate) every: Duration,
    /// Folder of the states, and the time between two of them.
    pub(crate) states: Option<(PathBuf, Duration)>,
}

/// A prediction of a lane.
#[derive(Debug)]
pub(crate) struct Predicted<'a> {
    /// The values.
    pub(crate) values: &'a [f32],
    /// Time of the newest event in the window, or of the newest frame.
    pub(crate) t_us: Option<i64>,
    /// Events in the window, or frames so far.
    pub(crate) nodes: usize,
    /// Whether it covers everything that had arrived.
    pub(crate) fresh: bool,
    /// What it covers.
    pub(crate) place: Mark,
}

/// One sensor.
pub(crate) struct Lane {
    sensor: String,
    stream: i64,
    geometry: Sensor,
    input: Input,
    live: Live<Kept>,
    desk: Shared,
    capacity: u64,
    coverage: Coverage,
    /// Events that were given to this engine.
    entered: u64,
    /// Events that the newest prediction covers.
    shown: Option<u64>,
    every: Duration,
    /// When the newest prediction was asked for.
    asked: Option<Instant>,
    state: Option<PathBuf>,
}

impl Lane {
    /// A lane for the source whose message has `header`. It goes on from the state that an earlier life of the node left, if it is of the same
    /// life of the source. A state that does not fit is not used, and why is returned.
    ///
    /// # Errors
    /// The engine cannot start, or the state cannot be read.
    pub(crate) fn start(
        sensor: &str,
        header: &EventsHeader,
        options: &LaneOptions,
    ) -> Result<(Self, Option<EngineError>), LaneError> {
        let mut engine = options.network.engine(header.sensor)?;
        let state = options.states.as_ref().map(|(folder, _)| folder.join(format!("{sensor}.state")));
        let (covered, refused) = match restore(&mut engine, state.as_ref(), header.boot) {
            Err(LaneError::Engine(error)) => (None, Some(error)),
            restored => (restored?, None),
        };
        let mut desk = Desk::default();
        let coverage = covered.map_or_else(Coverage::default, |covered: Covered| {
            desk.predictions = covered.predictions;
            Coverage::resumed(covered.next, covered.accepted, covered.lost)
        });
        let Coverage { next, accepted, lost, .. } = coverage;
        desk.marks.push_back(Mark { next, accepted, lost, ..Mark::default() });
        desk.ignored = engine.dropped();
        let desk = Shared::new(desk.into());
        let every = options.states.as_ref().map(|&(_, every)| every);
        let kept = Kept::new(engine, header.boot, Arc::clone(&desk), every);
        // Whether a message has room is known before it is offered: nothing is ever dropped here, and nobody waits.
        let queue = QueueOptions::new().with_capacity(options.capacity).with_overload(Overload::DropNewest);
        let (input, live) = Live::spawn(kept, queue)?;
        let (stream, geometry, capacity) = (header.boot, header.sensor, options.capacity as u64);
        let sensor = sensor.to_owned();
        let lane = Self {
            sensor,
            stream,
            geometry,
            input,
            live,
            desk,
            capacity,
            coverage,
            entered: 0,
            shown: None,
            every: options.every,
            asked: None,
            state,
        };
        Ok((lane, refused))
    }

    /// Name of the sensor.
    pub(crate) fn sensor(&self) -> &str {
        &self.sensor
    }

    /// Life of the source.
    pub(crate) fn stream(&self) -> i64 {
        self.stream
    }

    /// Whether a message with this header belongs to another life of the source, or to another sensor.
    pub(crate) fn is_other(&self, header: &EventsHeader) -> bool {
        (header.boot, header.sensor) != (self.stream, self.geometry)
    }

    /// Notes that the queue of the input dropped this many messages.
    pub(crate) fn dropped(&mut self, messages: u64) {
        self.coverage.dropped(messages);
    }

    /// Takes a message that arrived at `received_ns`; `None` for events that cannot be read, of which there are `len`. Every event of it, and
    /// those that are missing before it, is accepted or in one of the losses that are returned.
    ///
    /// # Errors
    /// The engine's thread has ended.
    pub(crate) fn take(
        &mut self,
        header: &EventsHeader,
        events: Option<&[Event]>,
        len: usize,
        received_ns: i64,
    ) -> Result<impl Iterator<Item = Loss> + use<>, LaneError> {
        let mut losses = [None, None];
        if let Some(placed) = self.coverage.place(header.number, header.first, len) {
            losses[0] = placed.gap;
            let new = len - placed.skip;
            let room = self.capacity - self.live.counters().waiting;
            match events {
                None if new > 0 => losses[1] = Some(self.coverage.lose(new, Reason::Malformed)),
                Some(_) if new as u64 > room => losses[1] = Some(self.coverage.lose(new, Reason::Overload)),
                Some(events) if new > 0 => {
                    self.coverage.take(new);
                    self.entered += new as u64;
                    let Coverage { next, accepted, lost, .. } = self.coverage;
                    let (entered, sent_ns) = (self.entered, header.sent_ns);
                    let mark = Mark { entered, next, accepted, lost, sent_ns, received_ns };
                    // Before the events: the worker looks for the place of each.
                    lock(&self.desk).marks.push_back(mark);
                    self.input.push_slice(&events[placed.skip..])?;
                }
                _ => (),
            }
        }
        let loss = |(from, until, reason): (u64, u64, Reason)| Loss {
            from,
            until,
            reason: reason.name().to_owned(),
        };
        Ok(losses.into_iter().flatten().map(loss))
    }

    /// Whether there are events that no prediction covers.
    pub(crate) fn has_news(&self) -> bool {
        self.entered > 0 && self.shown != Some(self.entered)
    }

    /// Time until a prediction is due; for ever without news.
    pub(crate) fn until_due(&self) -> Duration {
        let since = self.asked.map_or(self.every, |asked| asked.elapsed());
        if self.has_news() { self.every.saturating_sub(since) } else { Duration::MAX }
    }

    /// Asks for a prediction of everything that has arrived.
    pub(crate) fn ask(&mut self, deadline: Duration) -> Asked {
        self.asked = Some(Instant::now());
        self.live.ask(deadline)
    }

    /// The answer to `asked`, which is waited for until its deadline. `None` if it covers nothing new.
    ///
    /// # Errors
    /// The prediction failed, or the engine's thread has ended.
    pub(crate) fn answer(
        &mut self,
        asked: &Asked,
        deadline: Duration,
    ) -> Result<Option<Predicted<'_>>, LaneError> {
        self.live.wait(asked, deadline)?;
        let timely = self.live.timely(asked)?;
        let covered = self.entered - timely.behind_events;
        if covered == 0 || self.shown == Some(covered) {
            return Ok(None);
        }
        self.shown = Some(covered);
        let mut desk = lock(&self.desk);
        desk.predictions += 1;
        let place = desk.place(covered);
        desk.forget_before(covered);
        let (values, t_us, nodes, fresh) = (timely.values, timely.t_us, timely.nodes, timely.fresh);
        Ok(Some(Predicted { values, t_us, nodes, fresh, place }))
    }

    /// Counts since the start of the source.
    pub(crate) fn counters(&self) -> impl Iterator<Item = Counter> + use<> {
        let (predictions, ignored) = {
            let desk = lock(&self.desk);
            (desk.predictions, desk.ignored.clone())
        };
        let sensor = &self.sensor;
        let Coverage { next, accepted, lost, late_messages, .. } = self.coverage;
        let mut counters = vec![
            Counter::new(sensor, "events_known", next),
            Counter::new(sensor, "events_accepted", accepted),
            Counter::new(sensor, "messages_late", late_messages),
            Counter::new(sensor, "predictions", predictions),
        ];
        let lost = Reason::ALL.into_iter().zip(lost);
        counters.extend(
            lost.map(|(reason, count)| Counter::with_reason(sensor, "events_dropped", reason.name(), count)),
        );
        // Of the accepted events, those that the engine has no use for.
        counters.extend(
            ignored
                .into_iter()
                .map(|(reason, count)| Counter::with_reason(sensor, "events_ignored", reason.name(), count)),
        );
        counters.into_iter()
    }

    /// The newest state and where it belongs, if there is one that was not collected.
    pub(crate) fn collect(&mut self) -> Option<(PathBuf, Vec<u8>)> {
        let state = self.state.as_ref()?;
        Some((state.clone(), lock(&self.desk).collect()?))
    }

    /// Ends the engine's thread, and writes its state if states are kept.
    ///
    /// # Errors
    /// The thread has panicked, or the state cannot be written.
    pub(crate) fn close(self) -> Result<(), LaneError> {
        let mut kept = self.live.close()?;
        self.state.map_or(Ok(()), |path| write(&path, &kept.state()))
    }
}

/// Replaces the state in the file at `path` at once.
///
/// # Errors
/// It cannot be written; the state before it is then still there.
pub(crate) fn write(path: &std::path::Path, state: &[u8]) -> Result<(), LaneError> {
    Ok(replace_file(path, |out| out.write_all(state))?)
}

/// Restores the state in the file at `path` if there is one and it is of the life `stream` of a source.
fn restore(engine: &mut Engine, path: Option<&PathBuf>, stream: i64) -> Result<Option<Covered>, LaneError> {
    let Some(path) = path else { return Ok(None) };
    let bytes = match fs::read(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        read => read.map_err(|source| LaneError::Read { path: path.display().to_string(), source })?,
    };
    let covered = Covered::of_state(engine, &bytes)?;
    if covered.stream != stream {
        return Ok(None);
    }
    engine.restore_bytes(&bytes)?;
    Ok(Some(covered))
}

#[cfg(test)]
mod tests;
