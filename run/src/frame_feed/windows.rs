//! The windows of a feed, and the number of empty frames that a silence delivers.
//!
//! Input: accepted events, and times. Output: frames with events, and runs of empty ones. A network
//! takes at most a given number of consecutive empty frames; the next one resets its state, once.

use meissner_engine::frames::FrameShape;
use meissner_engine::representations::{
    Completed, Consecutive, ConsecutiveFrames, EventFrame, RepresentationError, SlidingSigned,
};
use meissner_engine::{Event, Sensor};
use meissner_models::description::frames::SignedTiming;
use meissner_models::{FrameDescription, FrameSource};

use crate::schedule::{Every, Last, Schedule};

/// An item that a feed delivers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FeedOutput<'a> {
    /// A frame.
    Frame {
        /// (channels, rows, columns), row-major.
        values: &'a [f32],
        /// Time at which its window ends or is read, in microseconds.
        t_us: i64,
        /// Number of events in it; 0 for an empty frame.
        events: u64,
    },
    /// Empty frames that no network takes, because the silence is too long.
    LeftOut {
        /// Number of frames.
        count: u64,
        /// Whether a network's state is reset, with the first of these frames.
        resets: bool,
    },
    /// The clock of the sensor has restarted: everything before is forgotten.
    Restart,
}

/// Output of the windows.
#[derive(Clone, Copy)]
pub(super) enum Made<'a> {
    /// A frame with events.
    Frame { values: &'a [f32], t_us: i64, events: u64 },
    /// Empty frames: the time of the first, and the time from one to the next.
    Empty { count: u64, t_us: i64, period_us: i64 },
}

#[derive(Clone)]
pub(super) enum Windows {
    Consecutive {
        windows: ConsecutiveFrames,
        period_us: i64,
        /// The windows after a restart of the clock, if they begin at a given time.
        next: Option<Box<ConsecutiveFrames>>,
    },
    Sliding {
        window: SlidingSigned,
        span_us: i64,
        /// When the window is read.
        schedule: Schedule,
    },
}

impl Windows {
    /// The windows over events of `sensor`; `None` if the frames are not made of events. `every`
    /// reads a sliding window, and `start_us` begins the first consecutive one.
    pub(super) fn new(
        description: &FrameDescription,
        sensor: Sensor,
        every: Every,
        start_us: Option<i64>,
    ) -> Result<Option<Self>, RepresentationError> {
        let FrameShape::Image { height, width, .. } = description.input() else { return Ok(None) };
        let source = *description.source();
        let (FrameSource::EventCounts { place, .. } | FrameSource::Signed { place, .. }) = source else {
            return Ok(None);
        };
        // The sides in a description are at most 4096.
        let crop = place.crop(width as u16, height as u16, sensor);
        let consecutive = |start_us: Option<i64>| match source {
            FrameSource::EventCounts { period_us, maximum, .. } => {
                ConsecutiveFrames::counts(sensor, Consecutive { crop, period_us, start_us }, maximum)
            }
            FrameSource::Signed { timing: SignedTiming::Consecutive { period_us }, rule, .. } => {
                ConsecutiveFrames::signed(sensor, Consecutive { crop, period_us, start_us }, rule)
            }
            _ => unreachable!("these windows slide"),
        };
        Ok(Some(match source {
            FrameSource::Signed { timing: SignedTiming::Sliding { span_us }, rule, .. } => {
                let capacity = SlidingSigned::DEFAULT_CAPACITY;
                let window = SlidingSigned::new(sensor, crop, rule, span_us, capacity)?;
                Self::Sliding { window, span_us, schedule: Schedule::new(every) }
            }
            FrameSource::EventCounts { period_us, .. }
            | FrameSource::Signed { timing: SignedTiming::Consecutive { period_us }, .. } => {
                let next = start_us.map(|_| consecutive(None)).transpose()?.map(Box::new);
                Self::Consecutive { windows: consecutive(start_us)?, period_us, next }
            }
            _ => return Ok(None),
        }))
    }

    /// Takes the `events` of a feed that has accepted this number of events, from `first_us` to
    /// `now_us`.
    pub(super) fn resume(
        &mut self,
        events: impl Iterator<Item = Event>,
        first_us: i64,
        now_us: i64,
        accepted: u64,
    ) {
        for event in events {
            match self {
                Self::Consecutive { windows, .. } => windows.push(event, |_| {}),
                Self::Sliding { window, .. } => window.push(event),
            };
        }
        if let Self::Sliding { schedule, .. } = self {
            schedule.resume(first_us, now_us, accepted);
        }
    }

    /// Length of a window in microseconds.
    pub(super) fn length_us(&self) -> i64 {
        let (Self::Consecutive { period_us: length_us, .. } | Self::Sliding { span_us: length_us, .. }) =
            self;
        *length_us
    }

    /// Takes an accepted event, after the frames that its time completes and before a frame due
    /// with it.
    pub(super) fn push<E>(
        &mut self,
        event: Event,
        sink: &mut impl FnMut(Made<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        match self {
            Self::Consecutive { windows, period_us, .. } => {
                let mut done = Ok(());
                windows.push(event, |window| hand_over(window, *period_us, &mut done, sink));
                done
            }
            Self::Sliding { window, schedule, .. } => {
                schedule.begin(event.t_us);
                read_before(window, schedule, event.t_us, sink)?;
                window.push(event);
                if schedule.is_due_after_event() {
                    sink(made(&window.frame(), event.t_us, 0))?;
                }
                Ok(())
            }
        }
    }

    /// Delivers the frames that end, or are due, before `now_us`.
    pub(super) fn advance<E>(
        &mut self,
        now_us: i64,
        sink: &mut impl FnMut(Made<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        match self {
            Self::Consecutive { windows, period_us, .. } => {
                let mut done = Ok(());
                windows.advance(now_us, |window| hand_over(window, *period_us, &mut done, sink));
                done
            }
            Self::Sliding { window, schedule, .. } => read_before(window, schedule, now_us, sink),
        }
    }

    /// Delivers the open window, or a sliding window if it is due once more.
    pub(super) fn finish<E>(
        &mut self,
        now_us: Option<i64>,
        sink: &mut impl FnMut(Made<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        match self {
            Self::Consecutive { windows, period_us, .. } => windows.open().map_or(Ok(()), |frame| {
                sink(made(&frame, frame.start_us.saturating_add(*period_us), *period_us))
            }),
            Self::Sliding { window, schedule, .. } => {
                let t_us = match schedule.last() {
                    Last::Nothing => None,
                    Last::Now => now_us,
                    Last::At(due_us) => Some(due_us),
                };
                let Some(t_us) = t_us else { return Ok(()) };
                window.advance(t_us);
                sink(made(&window.frame(), t_us, schedule.period_us().unwrap_or(0)))
            }
        }
    }

    /// Forgets time and events. Returns the number of events outside the crop that the discarded
    /// windows counted.
    pub(super) fn restart(&mut self) -> u64 {
        match self {
            Self::Consecutive { windows, next, .. } => {
                let outside = windows.outside_crop();
                if let Some(next) = next.take() {
                    *windows = *next;
                    return outside;
                }
                windows.reset();
            }
            Self::Sliding { window, schedule, .. } => {
                window.reset();
                schedule.restart();
            }
        }
        0
    }

    /// Start of the open consecutive window.
    pub(super) fn open_us(&mut self) -> Option<i64> {
        match self {
            Self::Consecutive { windows, .. } => windows.open().map(|frame| frame.start_us),
            Self::Sliding { .. } => None,
        }
    }

    pub(super) fn outside_crop(&self) -> u64 {
        match self {
            Self::Consecutive { windows, .. } => windows.outside_crop(),
            Self::Sliding { window, .. } => window.outside_crop(),
        }
    }

    /// Events that left a sliding window early because it was full.
    pub(super) fn evicted(&self) -> u64 {
        match self {
            Self::Consecutive { .. } => 0,
            Self::Sliding { window, .. } => window.counters().evicted,
        }
    }
}

/// Delivers the frames of a sliding window that are due before `t_us`.
fn read_before<E>(
    window: &mut SlidingSigned,
    schedule: &mut Schedule,
    t_us: i64,
    sink: &mut impl FnMut(Made<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let period_us = schedule.period_us().unwrap_or(0);
    while let Some(due_us) = schedule.due_before(t_us) {
        window.advance(due_us);
        let frame = window.frame();
        if frame.is_empty() {
            let count = 1 + schedule.skip_to(t_us);
            sink(Made::Empty { count, t_us: due_us, period_us })?;
        } else {
            sink(made(&frame, due_us, period_us))?;
        }
    }
    Ok(())
}

/// Output of one window.
fn made<'a>(frame: &EventFrame<'a>, t_us: i64, period_us: i64) -> Made<'a> {
    if frame.is_empty() {
        Made::Empty { count: 1, t_us, period_us }
    } else {
        Made::Frame { values: frame.values, t_us, events: frame.events[0] + frame.events[1] }
    }
}

/// Delivers completed windows to the sink, up to its first error.
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

/// The default for the largest number of consecutive empty frames that a network takes.
const MAX: u64 = 6000;

/// Counts the empty frames since the last frame with events, and limits them.
#[derive(Clone, Copy, Debug)]
pub struct EmptyFrameLimit {
    longest: u64,
    frames: u64,
}

impl EmptyFrameLimit {
    /// A silence of `frames` empty frames so far. `longest` replaces the default of 6000 frames.
    pub fn new(longest: Option<u64>, frames: u64) -> Self {
        Self { longest: longest.unwrap_or(MAX), frames }
    }

    /// Empty frames since the last one with events.
    pub(super) fn frames(self) -> u64 {
        self.frames
    }

    /// A frame with events ends the silence.
    pub(super) fn end(&mut self) {
        self.frames = 0;
    }

    /// Takes `count` empty frames; returns the number of delivered frames, the number of omitted
    /// ones, and whether a reset follows.
    pub(super) fn take(&mut self, count: u64) -> (u64, u64, bool) {
        let taken = count.min(self.longest.saturating_sub(self.frames));
        let left_out = count - taken;
        // Once per silence, even if it consists of several runs of empty frames.
        let resets = left_out > 0 && self.frames <= self.longest;
        self.frames = self.frames.saturating_add(count);
        (taken, left_out, resets)
    }

    /// Delivers the output of windows within the limit; `zeros` is an empty frame.
    pub(super) fn deliver<E>(
        &mut self,
        made: Made<'_>,
        zeros: &[f32],
        sink: &mut impl FnMut(FeedOutput<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        match made {
            Made::Frame { values, t_us, events } => {
                self.end();
                sink(FeedOutput::Frame { values, t_us, events })
            }
            Made::Empty { count, t_us, period_us } => {
                let (taken, left_out, resets) = self.take(count);
                for i in 0..taken {
                    let t_us = t_us.saturating_add(period_us.saturating_mul(i as i64));
                    sink(FeedOutput::Frame { values: zeros, t_us, events: 0 })?;
                }
                if left_out > 0 { sink(FeedOutput::LeftOut { count: left_out, resets }) } else { Ok(()) }
            }
        }
    }
}
