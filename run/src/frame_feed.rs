//! Makes the frames that a network reads from events.
//!
//! Enters: events in order of arrival. Leaves: the frames that the `[input]` of a description
//! defines, (channels, rows, columns), each with its time on the clock of the events. Of a silence,
//! as many empty frames come as [`EmptyFrameLimit`] lets through, and then the news of how many
//! were left out: its cost does not depend on its length. Invariant: frames come in order of time,
//! and every accepted event inside the crop is or will be in a frame.
//!
//! The frame of a consecutive window comes once, when time has passed the end of the window. That
//! end is the time of the frame. A sliding window is read when [`Every`] says, and the time of its
//! frame is the time of reading.
//!
//! A feed that was told to [keep](FrameFeed::keep) events can return its state, and another feed
//! can resume from it. The state has the events of the open consecutive window, or the events in
//! the span of the sliding window.

mod state;

use std::collections::VecDeque;

use meissner_engine::frames::FrameShape;
use meissner_engine::representations::{
    Completed, Consecutive, ConsecutiveFrames, EventFrame, RepresentationError, SlidingSigned,
};
use meissner_engine::{
    Admission, ClockWatch, Decision, Event, EventCounters, LatePolicy, Outcome, RestartPolicy, Sensor,
};
use meissner_models::description::frames::SignedTiming;
use meissner_models::{FrameDescription, FrameSource};

use crate::empty_frames::{EmptyFrameLimit, EmptyFrames};
use crate::schedule::{Every, Last, Schedule};
pub(crate) use state::FeedState;

/// Makes the frames of one stream of events.
pub(crate) struct FrameFeed {
    /// Admits events before they reach the frames. The gates of the frames only drop late events,
    /// so they accept every event that this gate accepts.
    gate: Admission,
    /// Decides about restarts of the clock.
    watch: ClockWatch,
    frames: Frames,
    silence: EmptyFrameLimit,
    /// The values of an empty frame.
    zeros: Vec<f32>,
    /// Events that later frames will cover, if the state will be needed.
    kept: Option<VecDeque<Event>>,
    /// Events that were accepted before this input.
    before: u64,
    /// Events outside the crop, and evicted events, before this input.
    shown_before: [u64; 2],
}

enum Frames {
    Consecutive { windows: ConsecutiveFrames, period_us: i64 },
    Sliding(Sliding),
}

/// An item that a feed delivers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FeedOutput<'a> {
    /// A frame.
    Frame {
        /// (channels, rows, columns), row-major.
        values: &'a [f32],
        /// Time at which its window ends or is read, in microseconds.
        t_us: i64,
        /// Number of events in it; 0 for an empty frame.
        events: u64,
    },
    /// Empty frames that no network takes, since the silence is too long.
    LeftOut {
        /// Number of frames.
        count: u64,
        /// Whether a network's state is reset: with the first of them.
        resets: bool,
    },
    /// The clock of the sensor has restarted: what came before is forgotten.
    Restart,
}

/// What windows make.
#[derive(Clone, Copy)]
enum Made<'a> {
    /// A frame with events.
    Frame { values: &'a [f32], t_us: i64, events: u64 },
    /// Empty frames: the time of the first, and from one to the next.
    Empty { count: u64, t_us: i64, period_us: i64 },
}

/// A step back of the clock that is no restart, at least: frames may be shorter than a packet of
/// events is late.
const MIN_RESTART_US: i64 = 100_000;

impl FrameFeed {
    /// A feed for the network of `description` on `sensor`; `None` if its frames are not made of
    /// events. `every` says when a sliding window is read, and has no effect on consecutive
    /// windows. The feed continues from `state` if it is given, with `silence` as it stood. The
    /// sensor must have the pixels that a frame covers.
    pub(crate) fn new(
        description: &FrameDescription,
        sensor: Sensor,
        (late, restart): (LatePolicy, RestartPolicy),
        every: Every,
        silence: EmptyFrameLimit,
        state: Option<&FeedState>,
    ) -> Result<Option<Self>, RepresentationError> {
        let start_us = state.and_then(|state| state.open_us);
        let FrameShape::Image { height, width, .. } = description.input() else { return Ok(None) };
        // The sides in a description are at most 4096.
        let (width, height) = (width as u16, height as u16);
        let frames = match *description.source() {
            FrameSource::EventCounts { period_us, place, maximum } => {
                let crop = place.crop(width, height, sensor);
                let options = Consecutive { crop, period_us, start_us };
                let windows = ConsecutiveFrames::counts(sensor, options, maximum)?;
                Frames::Consecutive { windows, period_us }
            }
            FrameSource::Signed { timing: SignedTiming::Consecutive { period_us }, place, rule } => {
                let crop = place.crop(width, height, sensor);
                let options = Consecutive { crop, period_us, start_us };
                let windows = ConsecutiveFrames::signed(sensor, options, rule)?;
                Frames::Consecutive { windows, period_us }
            }
            FrameSource::Signed { timing: SignedTiming::Sliding { span_us }, place, rule } => {
                let crop = place.crop(width, height, sensor);
                let capacity = SlidingSigned::DEFAULT_CAPACITY;
                let window = SlidingSigned::new(sensor, crop, rule, span_us, capacity)?;
                Frames::Sliding(Sliding { window, span_us, schedule: Schedule::new(every) })
            }
            _ => return Ok(None),
        };
        let gate = Admission::new(sensor, late);
        let (Frames::Consecutive { period_us: window_us, .. }
        | Frames::Sliding(Sliding { span_us: window_us, .. })) = frames;
        let watch = ClockWatch::new(restart, sensor, window_us.max(MIN_RESTART_US));
        let zeros = vec![0.0; description.input().values()];
        let (before, shown_before) = (0, [0; 2]);
        let mut feed = Self { gate, watch, frames, silence, zeros, kept: None, before, shown_before };
        if let Some(state) = state {
            feed.resume(state);
        }
        Ok(Some(feed))
    }

    /// Continues from `state`.
    fn resume(&mut self, state: &FeedState) {
        let events = state.events.iter().map(|&(t_us, x, y, on)| Event::new(t_us, x, y, on));
        self.kept = Some(events.clone().collect());
        for event in events {
            match &mut self.frames {
                Frames::Consecutive { windows, .. } => drop(windows.push(event, |_| {})),
                Frames::Sliding(sliding) => drop(sliding.window.push(event)),
            }
        }
        if let Frames::Sliding(sliding) = &mut self.frames {
            sliding.schedule.resume(state.epoch_us, state.now_us, state.accepted);
        }
        self.gate.resume(state.epoch_us, state.now_us);
        let held = state.held.iter().map(|&(t_us, x, y, on)| Event::new(t_us, x, y, on));
        self.watch.hold(&held.collect::<Vec<_>>(), Some(state.now_us));
        self.before = state.accepted;
        self.shown_before = [self.outside_crop(), self.evicted()];
    }

    /// Length of the windows in microseconds, if they are consecutive.
    pub(crate) fn period_us(&self) -> Option<i64> {
        match self.frames {
            Frames::Consecutive { period_us, .. } => Some(period_us),
            Frames::Sliding(_) => None,
        }
    }

    /// Takes `event`. The frames that its time completes go to `sink` before it enters. A sliding
    /// frame that becomes due with it goes to `sink` after it enters. `sink` is not called again
    /// after an error.
    pub(crate) fn push<E>(
        &mut self,
        event: Event,
        mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<Outcome, E> {
        match self.watch.decide(event, self.gate.now_us()) {
            None => self.enter(event, &mut sink),
            Some(decision) => self.carry_out(&decision, &mut sink),
        }
    }

    /// Decides about events that wait for others: there will be none.
    pub(crate) fn settle<E>(
        &mut self,
        mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let decision = self.watch.end(self.gate.now_us());
        self.carry_out(&decision, &mut sink).map(drop)
    }

    /// Returns what became of the newest event.
    fn carry_out<E>(
        &mut self,
        decision: &Decision,
        sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<Outcome, E> {
        self.gate.count(decision);
        if decision.restarts {
            self.gate.reset();
            match &mut self.frames {
                Frames::Consecutive { windows, .. } => windows.reset(),
                Frames::Sliding(sliding) => {
                    sliding.window.reset();
                    sliding.schedule.restart();
                }
            }
            self.kept.iter_mut().for_each(VecDeque::clear);
            self.silence.end();
            sink(FeedOutput::Restart)?;
        }
        decision.enter(|event| self.enter(event, sink))
    }

    /// Takes an event whose time is that of the clock.
    fn enter<E>(
        &mut self,
        event: Event,
        sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<Outcome, E> {
        let event = match self.gate.admit(event) {
            Ok(event) => event,
            Err(reason) => return Ok(Outcome::Dropped(reason)),
        };
        let mut done = Ok(());
        let mut completed = false;
        let (silence, zeros) = (&mut self.silence, &self.zeros);
        let mut sink = |made: Made<'_>| {
            completed = true;
            deliver(made, silence, zeros, sink)
        };
        match &mut self.frames {
            Frames::Consecutive { windows, period_us } => {
                windows.push(event, |window| hand_over(window, *period_us, &mut done, &mut sink));
            }
            Frames::Sliding(sliding) => done = sliding.push(event, &mut sink),
        }
        if let Some(kept) = &mut self.kept {
            match &self.frames {
                Frames::Sliding(sliding) => {
                    let first = event.t_us.saturating_sub(sliding.span_us);
                    let old = kept.partition_point(|kept| kept.t_us < first);
                    kept.drain(..old);
                }
                Frames::Consecutive { .. } if completed => kept.clear(),
                Frames::Consecutive { .. } => {}
            }
            kept.push_back(event);
        }
        done.map(|()| Outcome::Accepted)
    }

    /// Advances time to `t_us`. The frames that end or are due before it go to `sink`. Earlier
    /// times, and any time before the first event, change nothing. `sink` is not called again after
    /// an error.
    pub(crate) fn advance<E>(
        &mut self,
        t_us: i64,
        mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let decision = self.watch.advance(t_us, self.gate.now_us());
        self.carry_out(&decision, &mut sink)?;
        self.gate.advance(t_us);
        let Some(now_us) = self.gate.now_us() else { return Ok(()) };
        let mut done = Ok(());
        let (silence, zeros) = (&mut self.silence, &self.zeros);
        let mut sink = |made: Made<'_>| deliver(made, silence, zeros, &mut sink);
        match &mut self.frames {
            Frames::Consecutive { windows, period_us } => {
                let mut completed = false;
                windows.advance(now_us, |window| {
                    completed = true;
                    hand_over(window, *period_us, &mut done, &mut sink);
                });
                if let Some(kept) = self.kept.as_mut().filter(|_| completed) {
                    kept.clear();
                }
            }
            Frames::Sliding(sliding) => done = sliding.read_before(now_us, &mut sink),
        }
        done
    }

    /// Delivers the last frame after the last event: the window that is still open, or the sliding
    /// window if it is due once more. Delivers nothing if no event has been accepted.
    pub(crate) fn finish<E>(
        &mut self,
        mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let now_us = self.gate.now_us();
        let (silence, zeros) = (&mut self.silence, &self.zeros);
        let mut sink = |made: Made<'_>| deliver(made, silence, zeros, &mut sink);
        let (open, period_us) = match &mut self.frames {
            Frames::Consecutive { windows, period_us } => (windows.open(), *period_us),
            Frames::Sliding(sliding) => return sliding.finish(now_us, &mut sink),
        };
        open.map_or(Ok(()), |frame| sink(made(&frame, frame.start_us.saturating_add(period_us), period_us)))
    }

    /// From now on, keeps the events that [`Self::state`] needs.
    pub(crate) fn keep(&mut self) {
        self.kept.get_or_insert_default();
    }

    /// The state of the feed; `None` before the first event, and if the feed was not told to
    /// [keep](Self::keep) events.
    pub(crate) fn state(&mut self) -> Option<FeedState> {
        let events = self.kept.as_ref()?.iter().map(|e| (e.t_us, e.x, e.y, e.on)).collect();
        let open_us = match &mut self.frames {
            Frames::Consecutive { windows, .. } => windows.open().map(|frame| frame.start_us),
            Frames::Sliding(_) => None,
        };
        Some(FeedState {
            epoch_us: self.gate.epoch_us()?,
            now_us: self.gate.now_us()?,
            accepted: self.before.saturating_add(self.gate.counters().accepted),
            open_us,
            events,
            held: self.watch.held().iter().map(|e| (e.t_us, e.x, e.y, e.on)).collect(),
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

    /// Counts of the events so far.
    pub(crate) fn counters(&self) -> &EventCounters {
        self.gate.counters()
    }

    /// Accepted events outside the part of the sensor that frames cover.
    pub(crate) fn outside_crop(&self) -> u64 {
        let outside_crop = match &self.frames {
            Frames::Consecutive { windows, .. } => windows.outside_crop(),
            Frames::Sliding(sliding) => sliding.window.outside_crop(),
        };
        outside_crop - self.shown_before[0]
    }

    /// Events that left a sliding window early because it was full.
    pub(crate) fn evicted(&self) -> u64 {
        match &self.frames {
            Frames::Consecutive { .. } => 0,
            Frames::Sliding(sliding) => sliding.window.counters().evicted - self.shown_before[1],
        }
    }
}

/// A sliding window with its schedule.
struct Sliding {
    window: SlidingSigned,
    span_us: i64,
    schedule: Schedule,
}

impl Sliding {
    /// Takes an accepted event.
    fn push<E>(&mut self, event: Event, sink: &mut impl FnMut(Made<'_>) -> Result<(), E>) -> Result<(), E> {
        self.schedule.begin(event.t_us);
        self.read_before(event.t_us, sink)?;
        self.window.push(event);
        if self.schedule.is_due_after_event() {
            sink(made(&self.window.frame(), event.t_us, 0))?;
        }
        Ok(())
    }

    /// Delivers the frames that are due before `t_us`.
    fn read_before<E>(
        &mut self,
        t_us: i64,
        sink: &mut impl FnMut(Made<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let period_us = self.schedule.period_us().unwrap_or(0);
        while let Some(due_us) = self.schedule.due_before(t_us) {
            self.window.advance(due_us);
            let frame = self.window.frame();
            if frame.is_empty() {
                let count = 1 + self.schedule.skip_to(t_us);
                sink(Made::Empty { count, t_us: due_us, period_us })?;
            } else {
                sink(made(&frame, due_us, period_us))?;
            }
        }
        Ok(())
    }

    fn finish<E>(
        &mut self,
        now_us: Option<i64>,
        sink: &mut impl FnMut(Made<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let t_us = match self.schedule.last() {
            Last::Nothing => None,
            Last::Now => now_us,
            Last::At(due_us) => Some(due_us),
        };
        let Some(t_us) = t_us else { return Ok(()) };
        self.window.advance(t_us);
        sink(made(&self.window.frame(), t_us, self.schedule.period_us().unwrap_or(0)))
    }
}

/// What a window made.
fn made<'a>(frame: &EventFrame<'a>, t_us: i64, period_us: i64) -> Made<'a> {
    if frame.is_empty() {
        Made::Empty { count: 1, t_us, period_us }
    } else {
        Made::Frame { values: frame.values, t_us, events: frame.events[0] + frame.events[1] }
    }
}

/// Hands completed windows to the sink, up to its first error.
fn hand_over<E>(
    completed: Completed<'_>,
    period_us: i64,
    done: &mut Result<(), E>,
    sink: &mut impl FnMut(Made<'_>) -> Result<(), E>,
) {
    if done.is_ok() {
        *done = match completed {
            Completed::Frame(frame) => {
                sink(made(&frame, frame.start_us.saturating_add(period_us), period_us))
            }
            Completed::Empty(run) => {
                let t_us = run.start_us.saturating_add(period_us);
                sink(Made::Empty { count: run.count, t_us, period_us })
            }
        };
    }
}

/// Delivers what windows made, as far as `silence` lets empty frames through.
fn deliver<E>(
    made: Made<'_>,
    silence: &mut EmptyFrameLimit,
    zeros: &[f32],
    sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
) -> Result<(), E> {
    match made {
        Made::Frame { values, t_us, events } => {
            silence.end();
            sink(FeedOutput::Frame { values, t_us, events })
        }
        Made::Empty { count, t_us, period_us } => {
            let EmptyFrames { taken, left_out, resets } = silence.take(count);
            for i in 0..taken {
                let t_us = t_us.saturating_add(period_us.saturating_mul(i as i64));
                sink(FeedOutput::Frame { values: zeros, t_us, events: 0 })?;
            }
            if left_out > 0 { sink(FeedOutput::LeftOut { count: left_out, resets }) } else { Ok(()) }
        }
    }
}

#[cfg(test)]
mod tests;
