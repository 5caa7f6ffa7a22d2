//! An engine for one stream of a sensor, in a thread behind a bounded queue, whose state is saved.
//!
//! A packet without room in the queue is dropped completely and counted.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{DropReason, EngineError, Event, Sensor};
use meissner_io::{IoError, read_whole};
use meissner_live::{Asked, Input, Live, Overload, QueueOptions};

use crate::coverage::{Coverage, Gap, Reason};
use crate::error::PacketError;
use crate::network::{AnyEngine, AnyNetwork};
use crate::saved::{self, Covered, Mark, SavedEngine, Shared, StateTable, lock};

/// The common options of all sensors of a process.
#[derive(Clone)]
pub struct LiveOptions {
    /// The network with its weights.
    pub network: AnyNetwork,
    /// Greatest number of events that wait for an engine.
    pub capacity: usize,
    /// Time between two predictions.
    pub every: Duration,
    /// Folder of the states, and the time between two of them.
    pub states: Option<(PathBuf, Duration)>,
}

/// A prediction, and the events that it covers.
#[derive(Debug)]
pub struct LivePrediction<'a> {
    /// The values.
    pub values: &'a [f32],
    /// Time of the newest event in the window, or of the newest frame, in microseconds.
    pub t_us: Option<i64>,
    /// Events in the window, or frames so far.
    pub nodes: usize,
    /// Whether it covers everything that had arrived.
    pub fresh: bool,
    /// The position up to which it covers events.
    pub place: Mark,
}

/// One sensor.
pub struct LiveSensor {
    name: String,
    stream: i64,
    sensor: Sensor,
    input: Input,
    live: Live<SavedEngine>,
    table: Shared,
    capacity: u64,
    coverage: Coverage,
    /// Events that this engine got.
    entered: u64,
    /// Events that the newest prediction covers.
    shown: Option<u64>,
    every: Duration,
    /// Time of the newest request for a prediction.
    asked: Option<Instant>,
    state: Option<PathBuf>,
}

impl LiveSensor {
    /// The sensor called `name`, for the stream that is named by its number. It continues from the
    /// state that an earlier process left in `NAME.state`, if that is of the same stream. A state
    /// that does not fit is not used, and the reason is returned.
    ///
    /// # Errors
    /// The engine cannot start, or the state cannot be read.
    pub fn start(
        name: &str,
        stream: i64,
        sensor: Sensor,
        options: &LiveOptions,
    ) -> Result<(Self, Option<EngineError>), PacketError> {
        let mut engine = options.network.engine(sensor)?;
        let state = options.states.as_ref().map(|(folder, _)| folder.join(format!("{name}.state")));
        let (covered, refused) = match restore(&mut engine, state.as_deref(), stream) {
            Err(PacketError::Engine(error)) => (None, Some(error)),
            restored => (restored?, None),
        };
        let mut table = StateTable::default();
        let coverage = covered.map_or_else(Coverage::default, |covered: Covered| {
            table.predictions = covered.predictions;
            Coverage::resumed(covered.next, covered.accepted, covered.lost)
        });
        let Coverage { next, accepted, lost, .. } = coverage;
        table.marks.push_back(Mark { next, accepted, lost, ..Mark::default() });
        table.ignored = engine.dropped().to_vec();
        let table = Shared::new(table.into());
        let every = options.states.as_ref().map(|&(_, every)| every);
        let engine = SavedEngine::new(engine, stream, Arc::clone(&table), every);
        // The room for a packet is known before it is offered, so nothing is dropped here and
        // nobody waits.
        let queue = QueueOptions::new().with_capacity(options.capacity).with_overload(Overload::DropNewest);
        let (input, live) = Live::spawn(engine, queue)?;
        let started = Self {
            name: name.to_owned(),
            stream,
            sensor,
            input,
            live,
            table,
            capacity: options.capacity as u64,
            coverage,
            entered: 0,
            shown: None,
            every: options.every,
            asked: None,
            state,
        };
        Ok((started, refused))
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its stream.
    pub fn stream(&self) -> i64 {
        self.stream
    }

    /// Whether a packet of `stream` on `sensor` belongs to another stream or sensor.
    pub fn is_other(&self, stream: i64, sensor: Sensor) -> bool {
        (stream, sensor) != (self.stream, self.sensor)
    }

    /// The known data about its events.
    pub fn coverage(&self) -> &Coverage {
        &self.coverage
    }

    /// Notes that the queue of its packets dropped this number.
    pub fn dropped(&mut self, packets: u64) {
        self.coverage.dropped(packets);
    }

    /// Takes the packet of this number, whose `len` events begin with number `first`; `None` for
    /// events that cannot be read. `times_ns`: its sending time and its arrival. Its events, and
    /// the missing ones before it, are accepted or in one of the gaps.
    ///
    /// # Errors
    /// The engine's thread has ended.
    pub fn take(
        &mut self,
        (number, first, len): (u64, u64, usize),
        events: Option<&[Event]>,
        [sent_ns, received_ns]: [i64; 2],
    ) -> Result<impl Iterator<Item = Gap> + use<>, PacketError> {
        let mut gaps = [None, None];
        if let Some(placed) = self.coverage.place(number, Some(first), len) {
            gaps[0] = placed.gap;
            let new = len - placed.skip;
            let room = self.capacity - self.live.counters().waiting;
            match events {
                _ if new == 0 => (),
                None => gaps[1] = Some(self.coverage.lose(new, Reason::Malformed)),
                Some(_) if new as u64 > room => gaps[1] = Some(self.coverage.lose(new, Reason::Overload)),
                Some(events) => {
                    self.coverage.take(new);
                    self.entered += new as u64;
                    let Coverage { next, accepted, lost, .. } = self.coverage;
                    let entered = self.entered;
                    let mark = Mark { entered, next, accepted, lost, sent_ns, received_ns };
                    // This comes before the events, because the worker looks for the position of
                    // each.
                    lock(&self.table).marks.push_back(mark);
                    self.input.push_slice(&events[placed.skip..])?;
                }
            }
        }
        Ok(gaps.into_iter().flatten())
    }

    /// Whether there are events that no prediction covers.
    pub fn has_news(&self) -> bool {
        self.entered > 0 && self.shown != Some(self.entered)
    }

    /// Time until a prediction is due; without end if there is no news.
    pub fn until_due(&self) -> Duration {
        let since = self.asked.map_or(self.every, |asked| asked.elapsed());
        if self.has_news() { self.every.saturating_sub(since) } else { Duration::MAX }
    }

    /// Requests a prediction for everything that has arrived.
    pub fn ask(&mut self, deadline: Duration) -> Asked {
        self.asked = Some(Instant::now());
        self.live.ask(deadline)
    }

    /// The answer to `asked` by its deadline. `None` if it covers nothing new.
    ///
    /// # Errors
    /// The prediction failed, or the engine's thread has ended.
    pub fn answer(
        &mut self,
        asked: &Asked,
        deadline: Duration,
    ) -> Result<Option<LivePrediction<'_>>, PacketError> {
        self.live.wait(asked, deadline)?;
        let timely = self.live.timely(asked)?;
        let covered = self.entered - timely.behind_events;
        if covered == 0 || self.shown == Some(covered) {
            return Ok(None);
        }
        self.shown = Some(covered);
        let mut table = lock(&self.table);
        table.predictions += 1;
        let place = table.place(covered);
        table.forget_before(covered);
        let (values, t_us, nodes, fresh) = (timely.values, timely.t_us, timely.nodes, timely.fresh);
        Ok(Some(LivePrediction { values, t_us, nodes, fresh, place }))
    }

    /// Number of predictions so far, and accepted events that the engine does not use, by reason.
    pub fn counts(&self) -> (u64, Vec<(DropReason, u64)>) {
        let table = lock(&self.table);
        (table.predictions, table.ignored.clone())
    }

    /// The newest state and its path, if it was not collected yet.
    pub fn collect(&mut self) -> Option<(PathBuf, Vec<u8>)> {
        let state = self.state.as_ref()?;
        Some((state.clone(), lock(&self.table).state.take()?))
    }

    /// Ends the engine's thread, and writes its state if states are saved.
    ///
    /// # Errors
    /// The thread has panicked, or the state cannot be written.
    pub fn close(self) -> Result<(), PacketError> {
        let mut engine = self.live.close()?;
        Ok(self.state.map_or(Ok(()), |path| saved::write(&path, &engine.state()))?)
    }
}

/// Restores the state in the file at `path` if there is one and it is of this stream.
fn restore(engine: &mut AnyEngine, path: Option<&Path>, stream: i64) -> Result<Option<Covered>, PacketError> {
    let Some(path) = path else { return Ok(None) };
    let bytes = match read_whole(path) {
        Err(IoError::File { source, .. }) if source.kind() == ErrorKind::NotFound => return Ok(None),
        read => read?,
    };
    let covered = Covered::of_state(engine, &bytes)?;
    if covered.stream != stream {
        return Ok(None);
    }
    engine.restore_bytes(&bytes)?;
    Ok(Some(covered))
}
