//! Events in, the frames that a network reads out.
//!
//! Enters: events in order of arrival. Leaves: the frames that a description's `[input]` asks for, (channels, rows,
//! columns), each with its time on the events' own clock; consecutive empty frames as one run, however long the silence.
//! Invariant: frames come in order of time, and every accepted event inside the crop is in a frame or will be in one.
//!
//! Frames over consecutive windows come once each, when time has passed the window's end, which is their time. A sliding
//! window is read when [`Every`] says, and the time of its frame is that at which it is read.

mod state;

use meissner_engine::frames::FrameShape;
use meissner_engine::representations::{
    Completed, Consecutive, EventCounts, EventFrame, RepresentationError, SignedWindows, SlidingSigned,
};
use meissner_engine::{Admission, Event, EventCounters, LatePolicy, Outcome, Sensor};
use meissner_models::description::frames::SignedTiming;
use meissner_models::{FrameDescription, FrameSource};

use crate::schedule::Every;
pub use state::FeedState;
use state::KeptEvents;

/// Makes the frames of one stream of events.
pub struct FrameFeed {
    /// Stands before the frames, whose own gates know no policy but to drop; what it lets through, they do too.
    gate: Admission,
    frames: Frames,
    /// Events that frames to come will show, where someone will ask for the state.
    kept: Option<KeptEvents>,
    /// Events that were accepted before this input.
    before: u64,
    /// Events beside the frame, and evicted ones, that were so before this input.
    shown_before: [u64; 2],
}

enum Frames {
    Counts { counts: EventCounts, period_us: i64 },
    Signed { windows: SignedWindows, period_us: i64 },
    Sliding(Sliding),
}

/// What a feed delivers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FeedOutput<'a> {
    /// A frame with at least one event.
    Frame {
        /// (channels, rows, columns), row-major.
        values: &'a [f32],
        /// When its window ends or is read, in microseconds.
        t_us: i64,
        /// Events in it.
        events: u64,
    },
    /// At least one frame of zeros.
    Empty {
        /// How many.
        count: u64,
        /// When the first of them ends or is read, in microseconds.
        t_us: i64,
        /// From one to the next, in microseconds.
        period_us: i64,
    },
}

impl FrameFeed {
    /// A feed for the network of `description` on `sensor`; `None` where its frames are not made of events. `every`
    /// says when a sliding window is read; consecutive windows do not ask it.
    ///
    /// # Errors
    /// Where the sensor does not have the pixels that a frame shows.
    pub fn new(
        description: &FrameDescription,
        sensor: Sensor,
        late: LatePolicy,
        every: Every,
    ) -> Result<Option<Self>, RepresentationError> {
        Self::beginning(description, sensor, late, every, None)
    }

    /// The same with consecutive windows from `start_us` on, where that is given.
    fn beginning(
        description: &FrameDescription,
        sensor: Sensor,
        late: LatePolicy,
        every: Every,
        start_us: Option<i64>,
    ) -> Result<Option<Self>, RepresentationError> {
        let FrameShape::Image { height, width, .. } = description.input() else { return Ok(None) };
        // A description's sides are at most 4096.
        let (width, height) = (width as u16, height as u16);
        let frames = match *description.source() {
            FrameSource::EventCounts { period_us, place, maximum } => {
                let crop = place.crop(width, height, sensor);
                let options = Consecutive { crop, period_us, start_us };
                Frames::Counts { counts: EventCounts::new(sensor, options, maximum)?, period_us }
            }
            FrameSource::Signed { timing: SignedTiming::Consecutive { period_us }, place, rule } => {
                let crop = place.crop(width, height, sensor);
                let options = Consecutive { crop, period_us, start_us };
                Frames::Signed { windows: SignedWindows::new(sensor, options, rule)?, period_us }
            }
            FrameSource::Signed { timing: SignedTiming::Sliding { span_us }, place, rule } => {
                let crop = place.crop(width, height, sensor);
                let capacity = SlidingSigned::DEFAULT_CAPACITY;
                let window = SlidingSigned::new(sensor, crop, rule, span_us, capacity)?;
                Frames::Sliding(Sliding { window, span_us, every, due_us: None, accepted: 0 })
            }
            _ => return Ok(None),
        };
        let gate = Admission::new(sensor, late);
        Ok(Some(Self { gate, frames, kept: None, before: 0, shown_before: [0; 2] }))
    }

    /// Length of the windows in microseconds, where they are consecutive.
    pub fn period_us(&self) -> Option<i64> {
        match self.frames {
            Frames::Counts { period_us, .. } | Frames::Signed { period_us, .. } => Some(period_us),
            Frames::Sliding(_) => None,
        }
    }

    /// Takes `event`. The frames that its time completes go to `sink` before it enters, a sliding one that is due
    /// because of it after that. At most three calls.
    ///
    /// # Errors
    /// The first error of `sink`, which is not called again then.
    pub fn push<E>(
        &mut self,
        event: Event,
        mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<Outcome, E> {
        let event = match self.gate.admit(event) {
            Ok(event) => event,
            Err(reason) => return Ok(Outcome::Dropped(reason)),
        };
        let mut done = Ok(());
        let mut completed = false;
        let mut sink = |output: FeedOutput<'_>| {
            completed = true;
            sink(output)
        };
        match &mut self.frames {
            Frames::Counts { counts, period_us } => {
                counts.push(event, |completed| deliver(completed, *period_us, &mut done, &mut sink));
            }
            Frames::Signed { windows, period_us } => {
                windows.push(event, |completed| deliver(completed, *period_us, &mut done, &mut sink));
            }
            Frames::Sliding(sliding) => done = sliding.push(event, self.gate.epoch_us(), &mut sink),
        }
        if let Some(kept) = &mut self.kept {
            match &self.frames {
                Frames::Sliding(sliding) => kept.note(event, false, Some(sliding.span_us)),
                _ => kept.note(event, completed, None),
            }
        }
        done.map(|()| Outcome::Accepted)
    }

    /// After the last event: the window that is still open, or the sliding window where it is due once more. Nothing
    /// where no event has been accepted.
    ///
    /// # Errors
    /// Those of `sink`.
    pub fn finish<E>(&mut self, mut sink: impl FnMut(FeedOutput<'_>) -> Result<(), E>) -> Result<(), E> {
        let (open, period_us) = match &mut self.frames {
            Frames::Counts { counts, period_us } => (counts.open(), *period_us),
            Frames::Signed { windows, period_us } => (windows.open(), *period_us),
            Frames::Sliding(sliding) => return sliding.finish(self.gate.now_us(), &mut sink),
        };
        open.map_or(Ok(()), |frame| {
            sink(feed_output(&frame, frame.start_us.saturating_add(period_us), period_us))
        })
    }

    /// The newest time; none before the first event.
    pub fn now_us(&self) -> Option<i64> {
        self.gate.now_us()
    }

    /// What became of the events so far.
    pub fn counters(&self) -> &EventCounters {
        self.gate.counters()
    }

    /// Accepted events that no frame shows because they lie outside its part of the sensor.
    pub fn outside_crop(&self) -> u64 {
        let outside_crop = match &self.frames {
            Frames::Counts { counts, .. } => counts.outside_crop(),
            Frames::Signed { windows, .. } => windows.outside_crop(),
            Frames::Sliding(sliding) => sliding.window.outside_crop(),
        };
        outside_crop - self.shown_before[0]
    }

    /// Events that left a sliding window before their time because it was full.
    pub fn evicted(&self) -> u64 {
        match &self.frames {
            Frames::Counts { .. } | Frames::Signed { .. } => 0,
            Frames::Sliding(sliding) => sliding.window.counters().evicted - self.shown_before[1],
        }
    }
}

/// A sliding window, and when it is read.
struct Sliding {
    window: SlidingSigned,
    span_us: i64,
    every: Every,
    /// Next time of [`Every::StreamUs`]; none before the first event and beyond the clock's end.
    due_us: Option<i64>,
    /// Accepted events since the last frame, for [`Every::Events`].
    accepted: u64,
}

impl Sliding {
    /// Goes on where another one was that had seen so many events, from the time of the first to `now_us`.
    fn resume(&mut self, first_us: i64, now_us: i64, accepted: u64) {
        match self.every {
            Every::End => {}
            Every::Events(events) => self.accepted = accepted % events,
            Every::StreamUs(period_us) => {
                // At least one: the first is due a period after the first event.
                let count = if now_us > first_us { times(first_us, now_us, period_us) } else { 1 };
                self.due_us = later(first_us, count, period_us);
            }
        }
    }

    /// Takes an accepted event; `epoch_us` is the time of the first one.
    fn push<E>(
        &mut self,
        event: Event,
        epoch_us: Option<i64>,
        sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        if let Every::StreamUs(period_us) = self.every {
            let is_first = self.window.counters().pushed == 0;
            if is_first {
                self.due_us = epoch_us.and_then(|epoch| epoch.checked_add(period_us));
            }
            // An event at the due time belongs to the frame.
            while let Some(due_us) = self.due_us.filter(|&due_us| due_us < event.t_us) {
                self.window.advance(due_us);
                let frame = self.window.frame();
                if frame.is_empty() {
                    let count = times(due_us, event.t_us, period_us);
                    self.due_us = later(due_us, count, period_us);
                    sink(FeedOutput::Empty { count, t_us: due_us, period_us })?;
                } else {
                    self.due_us = due_us.checked_add(period_us);
                    sink(feed_output(&frame, due_us, period_us))?;
                }
            }
        }
        self.window.push(event);
        if let Every::Events(events) = self.every {
            self.accepted += 1;
            if self.accepted == events {
                self.accepted = 0;
                sink(feed_output(&self.window.frame(), event.t_us, 0))?;
            }
        }
        Ok(())
    }

    fn finish<E>(
        &mut self,
        now_us: Option<i64>,
        sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let (t_us, period_us) = match self.every {
            Every::End => (now_us, 0),
            Every::Events(_) => (None, 0),
            // All times before the last event are done: this is the first one that covers it.
            Every::StreamUs(period_us) => (self.due_us, period_us),
        };
        let Some(t_us) = t_us else { return Ok(()) };
        self.window.advance(t_us);
        sink(feed_output(&self.window.frame(), t_us, period_us))
    }
}

/// A frame as it is delivered.
fn feed_output<'a>(frame: &EventFrame<'a>, t_us: i64, period_us: i64) -> FeedOutput<'a> {
    if frame.is_empty() {
        FeedOutput::Empty { count: 1, t_us, period_us }
    } else {
        FeedOutput::Frame { values: frame.values, t_us, events: frame.events[0] + frame.events[1] }
    }
}

/// Hands on what a window has completed, up to the sink's first error.
fn deliver<E>(
    completed: Completed<'_>,
    period_us: i64,
    done: &mut Result<(), E>,
    sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
) {
    if done.is_ok() {
        *done = match completed {
            Completed::Frame(frame) => {
                sink(feed_output(&frame, frame.start_us.saturating_add(period_us), period_us))
            }
            Completed::Empty(run) => {
                let t_us = run.start_us.saturating_add(period_us);
                sink(FeedOutput::Empty { count: run.count, t_us, period_us })
            }
        };
    }
}

/// Number of `first`, `first + period`, ... that are before `end`, which is after `first`.
fn times(first: i64, end: i64, period: i64) -> u64 {
    // The difference can exceed an i64 where times span its whole range.
    let (span, period) = (i128::from(end) - i128::from(first), i128::from(period));
    ((span + period - 1) / period) as u64
}

/// The time `count` periods after `first`; none beyond the clock's end.
fn later(first: i64, count: u64, period: i64) -> Option<i64> {
    i64::try_from(i128::from(first) + i128::from(count) * i128::from(period)).ok()
}

#[cfg(test)]
mod tests;
