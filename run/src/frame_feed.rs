//! Makes the frames that a network reads from events.
//!
//! Input: events in order of arrival. Output: the frames that the `[input]` of a description
//! defines, (channels, rows, columns), each with its time on the clock of the events. In a silence,
//! the feed delivers as many empty frames as [`EmptyFrameLimit`] allows, and then the number of
//! omitted frames: the cost of a silence does not depend on its length. Invariant: frames come in
//! order of time, and every accepted event inside the crop is or will be in a frame.
//!
//! The frame of a consecutive window is delivered once, when time has passed its end, and has the
//! time of that end. A sliding window is read when [`Every`] says; its frame has the time of
//! reading.
//!
//! A feed that keeps events can return its state, from which another feed can resume: the events of
//! the open consecutive window, or those in the span of the sliding window.

mod windows;

use std::collections::VecDeque;

use meissner_engine::representations::RepresentationError;
use meissner_engine::{
    Admission, ClockWatch, Decision, EngineError, Event, EventCounters, LatePolicy, Outcome, RestartPolicy,
    Sensor, snapshot_note,
};
use meissner_models::FrameDescription;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::schedule::Every;
use windows::Windows;
pub use windows::{EmptyFrameLimit, FeedOutput};

/// How a feed makes frames.
#[derive(Clone, Copy, Debug)]
pub struct FeedOptions {
    /// Policy for events that are earlier than an event before them.
    pub late: LatePolicy,
    /// Rule for restarts of the sensor's clock.
    pub restart: RestartPolicy,
    /// When a sliding window is read. Consecutive windows are delivered when they end.
    pub every: Every,
    /// Limit of the number of delivered empty frames.
    pub silence: EmptyFrameLimit,
    /// Whether the feed keeps the events that its state needs.
    pub keeps: bool,
}

/// Makes the frames of one stream of events.
#[derive(Clone)]
pub struct FrameFeed {
    /// Admits events before they reach the windows, which then accept all of them.
    gate: Admission,
    watch: ClockWatch,
    windows: Windows,
    silence: EmptyFrameLimit,
    /// The values of an empty frame.
    zeros: Vec<f32>,
    /// Events that later frames will cover, if they are kept.
    kept: Option<VecDeque<Event>>,
    /// Events that were accepted before this input.
    before: u64,
    /// Events outside the crop that earlier windows counted, minus those of earlier inputs.
    outside_before: i64,
    /// Events that were evicted before this input.
    evicted_before: u64,
}

/// The state of a feed between two inputs: its clock, and the events that later frames will cover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeedState {
    /// Time of the first accepted event.
    pub(crate) epoch_us: i64,
    /// The newest time.
    now_us: i64,
    /// Accepted events so far.
    accepted: u64,
    /// Start of the open window, if windows are consecutive.
    open_us: Option<i64>,
    /// Time, column, row, polarity of the events of the open window or of the span.
    events: Vec<(i64, u16, u16, bool)>,
    /// The same of events that wait until it is clear whether the clock has restarted.
    #[serde(default)]
    held: Vec<(i64, u16, u16, bool)>,
    /// State of each filter of the network: column, row and time of pixels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    filters: Vec<Vec<(u16, u16, i64)>>,
}

impl FeedState {
    /// The state of a feed whose clock, and so its first consecutive window, begins at `t_us`.
    pub fn beginning(t_us: i64) -> Self {
        let (events, held, filters) = (Vec::new(), Vec::new(), Vec::new());
        Self { epoch_us: t_us, now_us: t_us, accepted: 0, open_us: Some(t_us), events, held, filters }
    }

    /// Refuses frames whose preparation is not `expected`, and the first field of `state` that a
    /// feed on `sensor` cannot have written.
    pub(crate) fn check(
        state: Option<&Self>,
        sensor: Sensor,
        (expected, found): (&str, &str),
    ) -> Result<(), EngineError> {
        let misfit = |what, expected, found| Err(EngineError::Snapshot { what, expected, found });
        if found != expected {
            return misfit("frames", expected.to_owned(), found.chars().take(200).collect());
        }
        let Some(&Self { epoch_us, now_us, accepted, open_us, ref events, ref held, ref filters }) = state
        else {
            return Ok(());
        };
        if now_us.checked_sub(epoch_us).is_none_or(|span_us| span_us < 0) {
            let expected = format!("from {epoch_us} to 2^63 after it");
            return misfit("newest time in the note", expected, now_us.to_string());
        }
        if let Some(open_us) = open_us.filter(|open_us| !(epoch_us..=now_us).contains(open_us)) {
            let expected = format!("from {epoch_us} to {now_us}");
            return misfit("open window in the note", expected, open_us.to_string());
        }
        if accepted < events.len() as u64 {
            let expected = format!("at least {}, the events that are kept", events.len());
            return misfit("accepted events in the note", expected, accepted.to_string());
        }
        if let Some((_, x, y, _)) = held.iter().find(|&&(_, x, y, _)| !sensor.contains(x, y)) {
            return misfit("held event in the note", format!("a pixel of {sensor}"), format!("({x}, {y})"));
        }
        if let Some((x, y, _)) = filters.iter().flatten().find(|&&(x, y, _)| !sensor.contains(x, y)) {
            return misfit(
                "filtered pixel in the note",
                format!("a pixel of {sensor}"),
                format!("({x}, {y})"),
            );
        }
        let mut least_us = open_us.unwrap_or(epoch_us);
        for &(t_us, x, y, _) in events {
            if !(least_us..=now_us).contains(&t_us) || !sensor.contains(x, y) {
                let expected = format!("from {least_us} to {now_us} us on {sensor}");
                return misfit("kept event in the note", expected, format!("{t_us} us at ({x}, {y})"));
            }
            least_us = t_us;
        }
        Ok(())
    }
}

/// The note in the state `bytes`, as `expected`.
pub(crate) fn read_note<N: DeserializeOwned>(bytes: &[u8], expected: &str) -> Result<N, EngineError> {
    serde_json::from_slice(snapshot_note(bytes)?).map_err(|error| EngineError::Snapshot {
        what: "note",
        expected: expected.to_owned(),
        found: error.to_string(),
    })
}

/// Smallest step back that counts as a restart: frames may be shorter than the delay of a packet of
/// events.
const MIN_RESTART_US: i64 = 100_000;

impl FrameFeed {
    /// A feed on `sensor`, from `state` on if given; `None` if frames are not made of events.
    ///
    /// # Errors
    /// The sensor lacks pixels that a frame covers.
    pub fn new(
        description: &FrameDescription,
        sensor: Sensor,
        options: FeedOptions,
        state: Option<&FeedState>,
    ) -> Result<Option<Self>, RepresentationError> {
        let FeedOptions { late, restart, every, silence, keeps } = options;
        let start_us = state.and_then(|state| state.open_us);
        let Some(windows) = Windows::new(description, sensor, every, start_us)? else { return Ok(None) };
        let mut feed = Self {
            gate: Admission::new(sensor, late).with_filters(description.filters())?,
            watch: ClockWatch::new(restart, sensor, windows.length_us().max(MIN_RESTART_US)),
            windows,
            silence,
            zeros: vec![0.0; description.input().values()],
            kept: keeps.then(VecDeque::new),
            before: 0,
            outside_before: 0,
            evicted_before: 0,
        };
        if let Some(state) = state {
            feed.resume(state);
        }
        Ok(Some(feed))
    }

    fn resume(&mut self, state: &FeedState) {
        let event = |&(t_us, x, y, on): &(i64, u16, u16, bool)| Event::new(t_us, x, y, on);
        let events = state.events.iter().map(event);
        if let Some(kept) = &mut self.kept {
            kept.extend(events.clone());
        }
        self.windows.resume(events, state.epoch_us, state.now_us, state.accepted);
        self.gate.resume(state.epoch_us, state.now_us);
        // A new feed has no filter state; a given state was checked.
        let _ = self.gate.filters_mut().remember(&state.filters);
        self.watch.hold(&state.held.iter().map(event).collect::<Vec<_>>(), Some(state.now_us));
        self.before = state.accepted;
        self.outside_before = -(self.windows.outside_crop() as i64);
        self.evicted_before = self.windows.evicted();
    }

    /// Length of the windows in microseconds, if they are consecutive.
    pub(crate) fn period_us(&self) -> Option<i64> {
        matches!(self.windows, Windows::Consecutive { .. }).then(|| self.windows.length_us())
    }

    /// Whether the window slides.
    pub fn slides(&self) -> bool {
        self.period_us().is_none()
    }

    /// Takes `event`. The frames that its time completes go to `sink` before it enters. A sliding
    /// frame that becomes due with it goes to `sink` after it enters.
    ///
    /// # Errors
    /// The first error of `sink`, which is not called again after it.
    pub fn push<E>(
        &mut self,
        event: Event,
        mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<Outcome, E> {
        match self.watch.decide(event, self.gate.now_us()) {
            None => self.enter(event, &mut sink),
            Some(decision) => self.carry_out(&decision, &mut sink),
        }
    }

    /// Decides about the events that wait for later events: there will be none.
    ///
    /// # Errors
    /// The first error of `sink`, which is not called again after it.
    pub fn settle<E>(&mut self, mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>) -> Result<(), E> {
        let decision = self.watch.end(self.gate.now_us());
        self.carry_out(&decision, &mut sink).map(drop)
    }

    /// Carries out a decision; returns the outcome of the newest event.
    fn carry_out<E>(
        &mut self,
        decision: &Decision,
        sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<Outcome, E> {
        self.gate.count(decision);
        if decision.restarts {
            self.gate.reset();
            self.outside_before += self.windows.restart() as i64;
            self.kept.iter_mut().for_each(VecDeque::clear);
            self.silence.end();
            sink(FeedOutput::Restart)?;
        }
        decision.enter(|event| self.enter(event, sink))
    }

    /// Takes an event whose time agrees with the clock.
    fn enter<E>(
        &mut self,
        event: Event,
        sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<Outcome, E> {
        let event = match self.gate.admit(event) {
            Ok(event) => event,
            Err(reason) => return Ok(Outcome::Dropped(reason)),
        };
        let Self { windows, silence, zeros, kept, .. } = self;
        let mut completed = false;
        let done = windows.push(event, &mut |made| {
            completed = true;
            silence.deliver(made, zeros, sink)
        });
        if let Some(kept) = kept {
            match windows {
                Windows::Sliding { span_us, .. } => {
                    let first = event.t_us.saturating_sub(*span_us);
                    let old = kept.partition_point(|kept| kept.t_us < first);
                    kept.drain(..old);
                }
                Windows::Consecutive { .. } if completed => kept.clear(),
                Windows::Consecutive { .. } => {}
            }
            kept.push_back(event);
        }
        done.map(|()| Outcome::Accepted)
    }

    /// Advances time to `t_us`. The frames that end or are due before it go to `sink`. Earlier
    /// times, and times before the first event, change nothing.
    ///
    /// # Errors
    /// The first error of `sink`, which is not called again after it.
    pub fn advance<E>(
        &mut self,
        t_us: i64,
        mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let decision = self.watch.advance(t_us, self.gate.now_us());
        self.carry_out(&decision, &mut sink)?;
        self.gate.advance(t_us);
        let Some(now_us) = self.gate.now_us() else { return Ok(()) };
        let Self { windows, silence, zeros, kept, .. } = self;
        let mut completed = false;
        let done = windows.advance(now_us, &mut |made| {
            completed = true;
            silence.deliver(made, zeros, &mut sink)
        });
        if let (Some(kept), Windows::Consecutive { .. }, true) = (kept, windows, completed) {
            kept.clear();
        }
        done
    }

    /// Delivers the open window, or the sliding one if it is due once more; nothing before the
    /// first event.
    ///
    /// # Errors
    /// The error of `sink`.
    pub fn finish<E>(&mut self, mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>) -> Result<(), E> {
        let Self { gate, windows, silence, zeros, .. } = self;
        windows.finish(gate.now_us(), &mut |made| silence.deliver(made, zeros, &mut sink))
    }

    /// The state of the feed; `None` before the first event, and if events are not kept.
    pub(crate) fn state(&mut self) -> Option<FeedState> {
        let tuple = |e: &Event| (e.t_us, e.x, e.y, e.on);
        let now_us = self.gate.now_us()?;
        Some(FeedState {
            filters: self.gate.filters().remembered(now_us),
            events: self.kept.as_ref()?.iter().map(tuple).collect(),
            epoch_us: self.gate.epoch_us()?,
            now_us,
            accepted: self.before.saturating_add(self.gate.counters().accepted),
            open_us: self.windows.open_us(),
            held: self.watch.held().iter().map(tuple).collect(),
        })
    }

    /// Empty frames since the last one with events.
    pub(crate) fn silence(&self) -> u64 {
        self.silence.frames()
    }

    /// The newest time; `None` before the first event.
    pub(crate) fn now_us(&self) -> Option<i64> {
        self.gate.now_us()
    }

    pub(crate) fn counters(&self) -> &EventCounters {
        self.gate.counters()
    }

    /// Accepted events outside the part of the sensor that frames cover.
    pub(crate) fn outside_crop(&self) -> u64 {
        self.windows.outside_crop().saturating_add_signed(self.outside_before)
    }

    /// Events that left a sliding window early because it was full.
    pub(crate) fn evicted(&self) -> u64 {
        self.windows.evicted() - self.evicted_before
    }
}

#[cfg(test)]
mod tests;
