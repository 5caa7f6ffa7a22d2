//! The content that frames must have, computed from all events: the twin of
//! `meissner_engine::representations`.

use std::collections::BTreeSet;

use meissner_engine::representations::{
    Completed, Consecutive, ConsecutiveFrames, Crop, EventFrame, SignedRule,
};
use meissner_engine::{Event, Sensor};

/// All events since the last reset that a representation must have accepted, and the time.
#[derive(Clone, Debug)]
pub struct History {
    sensor: Sensor,
    start_us: Option<i64>,
    clock: Option<(i64, i64)>,
    events: Vec<Event>,
}

impl History {
    /// No events yet; time begins at `start_us`, else with the first event.
    pub fn new(sensor: Sensor, start_us: Option<i64>) -> Self {
        Self { sensor, start_us, clock: start_us.map(|start| (start, start)), events: vec![] }
    }

    /// Notes `event`, if it is on the sensor and not late.
    pub fn push(&mut self, event: Event) {
        let (epoch, now) = self.clock.unwrap_or((event.t_us, event.t_us));
        if event.x < self.sensor.width && event.y < self.sensor.height && event.t_us >= now {
            self.clock = Some((epoch, event.t_us));
            self.events.push(event);
        }
    }

    /// Moves time on.
    pub fn advance(&mut self, t_us: i64) {
        if let Some((_, now)) = &mut self.clock {
            *now = t_us.max(*now);
        }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::new(self.sensor, self.start_us);
    }

    /// The start of time, and the current time.
    pub fn clock(&self) -> Option<(i64, i64)> {
        self.clock
    }

    /// The events with `from_us <= t <= to_us`, in order of arrival.
    pub fn between(&self, from_us: i64, to_us: i64) -> Vec<Event> {
        self.events.iter().copied().filter(|event| (from_us..=to_us).contains(&event.t_us)).collect()
    }
}

/// A stored frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kept {
    /// Start of its window.
    pub start_us: i64,
    /// Its values.
    pub values: Vec<f32>,
    /// Number of its events, negative and positive.
    pub events: [u64; 2],
    /// Pixels with events.
    pub touched: BTreeSet<u32>,
    /// Pixels that differ from the previous frame.
    pub changed: BTreeSet<u32>,
}

impl Kept {
    /// A copy of `frame`.
    ///
    /// # Panics
    /// If the frame names a pixel twice.
    pub fn of(frame: EventFrame<'_>) -> Self {
        Self {
            start_us: frame.start_us,
            values: frame.values.to_vec(),
            events: frame.events,
            touched: set(frame.touched),
            changed: set(frame.changed),
        }
    }

    /// The frame over `events`; the previous one had the values `before`.
    pub fn over(what: FrameKind, crop: Crop, events: &[Event], start_us: i64, before: &[f32]) -> Self {
        let (pixels, channels) = (crop.pixels(), what.channels());
        let inside = |event: &&Event| place(crop, event).is_some();
        let events: Vec<&Event> = events.iter().filter(inside).collect();
        let values: Vec<f32> = (0..channels * pixels)
            .map(|i| {
                let mut here = events.iter().filter(|event| place(crop, event) == Some(i % pixels));
                let sign = |event: &&Event| if event.on { 1.0 } else { -1.0 };
                match what {
                    FrameKind::Counts(maximum) => {
                        here.filter(|event| usize::from(event.on) == i / pixels).count() as f32 / maximum
                    }
                    FrameKind::Signed(SignedRule::Sum) => {
                        here.copied().map(|event| sign(&event)).sum::<f32>() + 0.0
                    }
                    FrameKind::Signed(SignedRule::Latest) => here.next_back().map_or(0.0, sign),
                }
            })
            .collect();
        let differs =
            |&pixel: &usize| (pixel..channels * pixels).step_by(pixels).any(|i| values[i] != before[i]);
        let changed = (0..pixels).filter(differs).map(|pixel| pixel as u32).collect();
        let of = |on: bool| events.iter().filter(|event| event.on == on).count() as u64;
        let touched =
            events.iter().filter_map(|event| place(crop, event)).map(|pixel| pixel as u32).collect();
        Self { start_us, events: [of(false), of(true)], touched, changed, values }
    }
}

/// The content of a frame.
#[derive(Clone, Copy, Debug)]
pub enum FrameKind {
    /// Counts divided by a maximum.
    Counts(f32),
    /// Polarities.
    Signed(SignedRule),
}

impl FrameKind {
    /// Channels of the frame.
    pub fn channels(self) -> usize {
        match self {
            Self::Counts(_) => 2,
            Self::Signed(_) => 1,
        }
    }

    /// Frames of this kind over consecutive windows.
    ///
    /// # Panics
    /// If the options are not admissible.
    pub fn frames(self, sensor: Sensor, options: Consecutive) -> ConsecutiveFrames {
        match self {
            Self::Counts(maximum) => ConsecutiveFrames::counts(sensor, options, maximum),
            Self::Signed(rule) => ConsecutiveFrames::signed(sensor, options, rule),
        }
        .expect("admissible")
    }
}

/// Stores completed frames, with empty frames of so many `values` one by one.
///
/// # Panics
/// If it is a frame without events, or a run without frames.
pub fn keep(kept: &mut Vec<Kept>, values: usize, completed: Completed<'_>) {
    let count = completed.count();
    match completed {
        Completed::Frame(frame) => {
            assert!(!frame.is_empty() && count == 1);
            kept.push(Kept::of(frame));
        }
        Completed::Empty(run) => {
            assert!(count > 0);
            kept.extend((0..count as i64).map(|k| Kept {
                start_us: run.start_us + k * run.period_us,
                values: vec![0.0; values],
                changed: if k == 0 { set(run.changed) } else { [].into() },
                ..Kept::default()
            }));
        }
    }
}

/// The index of `event` in a channel of the frame, if it is inside.
pub fn place(crop: Crop, event: &Event) -> Option<usize> {
    let [x, y, left, top, width, height] =
        [event.x, event.y, crop.x, crop.y, crop.width, crop.height].map(i32::from);
    let (x, y) = (x - left, y - top);
    ((0..width).contains(&x) && (0..height).contains(&y)).then_some((y * width + x) as usize)
}

/// The members of a list.
///
/// # Panics
/// If a member occurs twice.
pub fn set(list: &[u32]) -> BTreeSet<u32> {
    let set: BTreeSet<u32> = list.iter().copied().collect();
    assert_eq!(set.len(), list.len(), "named twice in {list:?}");
    set
}
