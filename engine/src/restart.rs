//! Clocks that restart, and single timestamps far ahead.
//!
//! Input: each event with the current time. Output: the events that are taken now, in order of
//! arrival, and whether the clock restarted before them. An event that agrees with the clock passes
//! at once; others are held until later ones decide:
//!
//! | a run of events | held until | then |
//! |---|---|---|
//! | back by more than the window | [`CONFIRMING`] events in a row run on from it | it restarted |
//! | | an event agrees with the clock | they are late |
//! | ahead by more than [`MAX_SILENCE_US`] | a second event, or an advance | it ends a silence |
//! | | an event agrees with the clock | it is an outlier, and dropped |
//!
//! Invariants: only outliers are lost, and no event is reordered; decisions depend on events and
//! advances, not on how they are split into calls. O(1) for an event; nothing is allocated.

use crate::{Event, Outcome, Sensor};

/// Rule for a restart of the sensor's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RestartPolicy {
    /// The engine resets and takes the new clock's events. A single event far ahead is dropped.
    #[default]
    Reset,
    /// The clock never goes back: events are late until they reach the old time; events far ahead
    /// are taken.
    Keep,
}

impl RestartPolicy {
    /// All policies.
    pub const ALL: [Self; 2] = [Self::Reset, Self::Keep];
}

names!(RestartPolicy { Reset => "reset", Keep => "keep" });

/// Number of events of a run that confirms a restart: more than late packets cause, few for a
/// sparse stream.
pub const CONFIRMING: usize = 8;

/// Longest silence, in microseconds, after which an event is taken without a second one.
pub const MAX_SILENCE_US: i64 = 10_000_000;

/// A run of events, in order of arrival.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    events: [Event; CONFIRMING],
    len: usize,
}

impl Held {
    const NONE: Self = Self { events: [Event { t_us: 0, x: 0, y: 0, on: false }; CONFIRMING], len: 0 };

    /// The events.
    pub fn events(&self) -> &[Event] {
        &self.events[..self.len]
    }

    fn push(&mut self, event: Event) {
        self.events[self.len] = event;
        self.len += 1;
    }
}

/// Decision about the held events and the newest one, carried out in the order of the fields.
#[derive(Clone, Copy, Debug)]
#[must_use]
pub struct Decision {
    /// Held events that are dropped because they were far ahead of the events around them.
    pub outliers: u64,
    /// Whether the clock has restarted: everything before `taken` is forgotten.
    pub restarts: bool,
    /// Events that are taken now: those that were held, and the newest one if it `passes`.
    pub taken: Held,
    /// Whether the newest event is the last of `taken`; otherwise it is held.
    pub passes: bool,
}

impl Decision {
    const NOTHING: Self = Self { outliers: 0, restarts: false, taken: Held::NONE, passes: false };

    /// Enters the taken events in order, up to an error. Returns the outcome of the newest event.
    ///
    /// # Errors
    /// As `enter`.
    pub fn enter<E>(&self, mut enter: impl FnMut(Event) -> Result<Outcome, E>) -> Result<Outcome, E> {
        let mut last = Outcome::Held;
        for &event in self.taken.events() {
            last = enter(event)?;
        }
        Ok(if self.passes { last } else { Outcome::Held })
    }
}

/// Watches the times of events for restarts and outliers.
#[derive(Clone, Copy, Debug)]
pub struct ClockWatch {
    policy: RestartPolicy,
    sensor: Sensor,
    window_us: i64,
    held: Held,
}

impl ClockWatch {
    /// A watch over the events of `sensor` in a window of `window_us` microseconds.
    pub fn new(policy: RestartPolicy, sensor: Sensor, window_us: i64) -> Self {
        Self { policy, sensor, window_us, held: Held::NONE }
    }

    /// The events that are held.
    pub fn held(&self) -> &[Event] {
        self.held.events()
    }

    /// Holds `events`, which a watch of the same policy and window held at `now_us`. False if there
    /// are too many, or one would not be held.
    pub fn hold(&mut self, events: &[Event], now_us: Option<i64>) -> bool {
        self.held = Held::NONE;
        let can = events.iter().all(|&event| {
            self.decide(event, now_us)
                .is_some_and(|decision| !decision.passes && decision.taken.len == 0 && decision.outliers == 0)
        });
        if !can {
            self.held = Held::NONE;
        }
        can
    }

    /// Decides about `event`. `None`: it is taken at once, as is every event outside the sensor.
    /// `now_us` is `None` before the first event.
    #[inline]
    pub fn decide(&mut self, event: Event, now_us: Option<i64>) -> Option<Decision> {
        let agrees = self.policy == RestartPolicy::Keep
            || (self.held.len == 0 && now_us.is_none_or(|now| self.agrees(event.t_us, now)))
            || !self.sensor.contains(event.x, event.y);
        if agrees { None } else { Some(self.decide_with_held(event, now_us)) }
    }

    fn decide_with_held(&mut self, event: Event, now_us: Option<i64>) -> Decision {
        let now = now_us.unwrap_or(event.t_us);
        let mut held = std::mem::replace(&mut self.held, Held::NONE);
        let runs_on = held.events().last().is_none_or(|last| self.agrees(event.t_us, last.t_us));
        let (was_back, was_ahead) = held
            .events()
            .first()
            .map_or((false, false), |first| (self.is_back(first.t_us, now), is_ahead(first.t_us, now)));
        let (back, ahead) = (self.is_back(event.t_us, now), is_ahead(event.t_us, now));
        let mut decision = Decision::NOTHING;
        if runs_on && was_back && back && held.len + 1 < CONFIRMING {
            held.push(event);
            self.held = held;
            return decision;
        } else if runs_on && was_back && back {
            (decision.restarts, decision.passes) = (true, true);
        } else if runs_on && was_ahead && ahead {
            // A clock that cannot represent both times restarts.
            (decision.restarts, decision.passes) = (event.t_us.checked_sub(now).is_none(), true);
        } else {
            // The held run ends here; the event agrees with the clock or begins another run.
            if was_ahead {
                decision.outliers = held.len as u64;
                held = Held::NONE;
            }
            decision.passes = !back && !ahead;
        }
        if decision.passes { &mut held } else { &mut self.held }.push(event);
        Decision { taken: held, ..decision }
    }

    /// Decides about held events when the clock advances to `t_us`: confirmed ones are taken first.
    pub fn advance(&mut self, t_us: i64, now_us: Option<i64>) -> Decision {
        let is_confirmed = self
            .held
            .events()
            .first()
            .zip(now_us)
            .is_some_and(|(first, now)| is_ahead(first.t_us, now) && !is_ahead(first.t_us, t_us));
        let taken = if is_confirmed { std::mem::replace(&mut self.held, Held::NONE) } else { Held::NONE };
        Decision { taken, ..Decision::NOTHING }
    }

    /// Decides about held events at the end of the stream, when no event can confirm them any more.
    pub fn end(&mut self, now_us: Option<i64>) -> Decision {
        let held = std::mem::replace(&mut self.held, Held::NONE);
        let ahead = held.events().first().zip(now_us).is_some_and(|(first, now)| is_ahead(first.t_us, now));
        if ahead {
            Decision { outliers: held.len as u64, ..Decision::NOTHING }
        } else {
            Decision { taken: held, ..Decision::NOTHING }
        }
    }

    fn agrees(&self, t_us: i64, now_us: i64) -> bool {
        !self.is_back(t_us, now_us) && !is_ahead(t_us, now_us)
    }

    fn is_back(&self, t_us: i64, now_us: i64) -> bool {
        t_us < now_us.saturating_sub(self.window_us)
    }
}

fn is_ahead(t_us: i64, now_us: i64) -> bool {
    t_us > now_us.saturating_add(MAX_SILENCE_US)
}
