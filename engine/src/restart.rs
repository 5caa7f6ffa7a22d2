//! Clocks that restart, and single stamps far ahead.
//!
//! Enters: each event with the current time. Leaves: which events are taken now, in order of
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
//! Invariants: only outliers are lost, and nothing is reordered; decisions depend on events and
//! advances, not on how they are split into calls. O(1) for an event; nothing is allocated.

use std::fmt;

use crate::{Event, Outcome, Sensor};

/// What is done when the clock of the sensor restarts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RestartPolicy {
    /// The engine resets and takes the new clock's events. A single stamp far ahead is dropped.
    #[default]
    Reset,
    /// The clock never goes back: events are late until the old time; stamps ahead are taken.
    Keep,
}

impl RestartPolicy {
    /// All policies.
    pub const ALL: [Self; 2] = [Self::Reset, Self::Keep];

    /// Short name, as in the program's reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reset => "reset",
            Self::Keep => "keep",
        }
    }
}

impl fmt::Display for RestartPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Events of a run that confirm a restart: more than late packets bring, few for a sparse stream.
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

/// What becomes of the held events and the newest one, carried out in the order of the fields.
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

    /// Enters the taken events in order, up to an error. Returns what became of the newest.
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

    /// Holds `events`, which a watch of the same policy and window held at `now_us`. False if they
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
            // A clock that cannot hold both times begins anew.
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

    /// Decides about held events at the end of the stream, where nothing confirms them any more.
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

#[cfg(test)]
mod tests {
    use super::{CONFIRMING, ClockWatch, MAX_SILENCE_US, RestartPolicy};
    use crate::{Event, Sensor};

    const SENSOR: Sensor = Sensor { width: 4, height: 4 };

    const WINDOW_US: i64 = 100;
    const FAR_US: i64 = 1_000 * MAX_SILENCE_US;

    /// The clocks of events at `times`, each with the times taken, late ones included; then
    /// outliers, and events still held.
    fn clocks(policy: RestartPolicy, times: &[i64]) -> (Vec<Vec<i64>>, u64, usize) {
        let mut watch = ClockWatch::new(policy, SENSOR, WINDOW_US);
        let (mut clocks, mut outliers) = (vec![Vec::new()], 0);
        for &t_us in times {
            let clock: &mut Vec<i64> = clocks.last_mut().expect("there is one");
            let now_us = clock.iter().copied().max();
            let Some(decision) = watch.decide(Event::new(t_us, 0, 0, true), now_us) else {
                clock.push(t_us);
                continue;
            };
            outliers += decision.outliers;
            if decision.restarts {
                clocks.push(Vec::new());
            }
            let clock = clocks.last_mut().expect("there is one");
            clock.extend(decision.taken.events().iter().map(|event| event.t_us));
            assert_eq!(decision.passes, decision.taken.events().last().is_some_and(|last| last.t_us == t_us));
        }
        (clocks, outliers, watch.held().len())
    }

    fn reset(times: &[i64]) -> (Vec<Vec<i64>>, u64, usize) {
        clocks(RestartPolicy::Reset, times)
    }

    #[test]
    fn a_run_back_by_more_than_the_window_restarts_the_clock_and_loses_no_event() {
        let old = [FAR_US, FAR_US + 5];
        let new: Vec<i64> = (0..20).map(|i| 3 * i).collect();
        let times = [&old[..], &new].concat();
        assert_eq!(reset(&times), (vec![old.to_vec(), new.clone()], 0, 0));
        let (clocks, _, held) = reset(&times[..2 + CONFIRMING - 1]);
        assert_eq!((clocks, held), (vec![old.to_vec()], CONFIRMING - 1));
    }

    #[test]
    fn late_events_within_the_window_are_not_a_restart() {
        let times: Vec<i64> = (0..100).map(|i| 1000 + i - WINDOW_US * (i % 2)).collect();
        assert_eq!(reset(&times), (vec![times.clone()], 0, 0));
    }

    #[test]
    fn a_late_packet_is_late_and_keeps_its_place() {
        let times = [&[1000][..], &[10; CONFIRMING - 1], &[1001, 1002]].concat();
        assert_eq!(reset(&times), (vec![times.clone()], 0, 0));
    }

    #[test]
    fn events_of_two_clocks_that_alternate_are_no_restart() {
        let times: Vec<i64> = (0..100).map(|i| i + FAR_US * (i % 2)).collect();
        let (clocks, outliers, held) = reset(&times);
        assert_eq!((clocks.len(), outliers, held), (1, 49, 1));
    }

    #[test]
    fn a_single_stamp_far_ahead_is_dropped_and_the_clock_goes_on() {
        assert_eq!(reset(&[0, 1, FAR_US, 2, 3]), (vec![vec![0, 1, 2, 3]], 1, 0));
        assert_eq!(reset(&[0, i64::MAX, 2, i64::MAX, 3]), (vec![vec![0, 2, 3]], 2, 0));
        // Two of them far from each other do not confirm each other.
        assert_eq!(reset(&[0, FAR_US, 3 * FAR_US, 2, 3]), (vec![vec![0, 2, 3]], 2, 0));
    }

    #[test]
    fn the_second_event_after_a_long_silence_brings_the_first() {
        assert_eq!(reset(&[0, FAR_US]), (vec![vec![0]], 0, 1));
        assert_eq!(reset(&[0, FAR_US, FAR_US + 1]), (vec![vec![0, FAR_US, FAR_US + 1]], 0, 0));
        assert_eq!(reset(&[0, MAX_SILENCE_US]), (vec![vec![0, MAX_SILENCE_US]], 0, 0));
    }

    #[test]
    fn an_advance_of_the_clock_brings_an_event_after_a_long_silence() {
        let mut watch = ClockWatch::new(RestartPolicy::Reset, SENSOR, WINDOW_US);
        let event = Event::new(FAR_US, 1, 2, true);
        assert!(watch.decide(event, Some(0)).is_some_and(|decision| !decision.passes));
        assert!(watch.advance(10, Some(0)).taken.events().is_empty());
        assert_eq!(watch.advance(FAR_US, Some(0)).taken.events(), [event]);
        assert!(watch.held().is_empty());
    }

    #[test]
    fn a_leftover_far_ahead_at_the_start_costs_a_restart_and_no_event() {
        let new: Vec<i64> = (0..9).collect();
        let times = [&[FAR_US][..], &new].concat();
        assert_eq!(reset(&times), (vec![vec![FAR_US], new], 0, 0));
    }

    #[test]
    fn a_clock_that_cannot_hold_both_times_begins_anew() {
        let times = [i64::MIN, i64::MAX - 1, i64::MAX];
        assert_eq!(reset(&times), (vec![vec![i64::MIN], vec![i64::MAX - 1, i64::MAX]], 0, 0));
    }

    #[test]
    fn what_is_not_confirmed_at_the_end_is_late_or_an_outlier() {
        let mut watch = ClockWatch::new(RestartPolicy::Reset, SENSOR, WINDOW_US);
        let (back, ahead) = (Event::new(-FAR_US, 0, 0, true), Event::new(FAR_US, 0, 0, true));
        let _ = watch.decide(back, Some(0));
        let end = watch.end(Some(0));
        assert_eq!((end.taken.events(), end.outliers), (&[back][..], 0));
        let _ = watch.decide(ahead, Some(0));
        let end = watch.end(Some(0));
        assert_eq!((end.taken.events().len(), end.outliers, watch.held().len()), (0, 1, 0));
    }

    #[test]
    fn what_one_watch_held_another_can_hold_and_nothing_else() {
        let event = |t_us| Event::new(t_us, 0, 0, true);
        let mut watch = ClockWatch::new(RestartPolicy::Reset, SENSOR, WINDOW_US);
        let back = [0, 1, 2].map(event);
        assert!(watch.hold(&back, Some(1000)) && watch.held() == back);
        assert!(watch.hold(&[event(FAR_US)], Some(1000)));
        for refused in [vec![950], vec![FAR_US, FAR_US], vec![0; CONFIRMING], vec![0, FAR_US]] {
            let events: Vec<Event> = refused.into_iter().map(event).collect();
            assert!(!watch.hold(&events, Some(1000)) && watch.held().is_empty(), "{events:?}");
        }
        assert!(!watch.hold(&back, None));
        assert!(!ClockWatch::new(RestartPolicy::Keep, SENSOR, WINDOW_US).hold(&back, Some(1000)));
    }

    #[test]
    fn with_keep_every_event_passes_at_once() {
        let times = [FAR_US, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 * FAR_US];
        assert_eq!(clocks(RestartPolicy::Keep, &times), (vec![times.to_vec()], 0, 0));
    }
}
