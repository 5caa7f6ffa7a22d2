//! Admission of events: the sensor's bounds, the clock, the epoch, the filters of a network.

use crate::filters::{Chain, EventFilter, FilterRule};
use crate::metric::Node;
use crate::restart::Decision;
use crate::{DropReason, EngineError, Event, EventCounters, Sensor};

/// How an event earlier than the newest time is handled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LatePolicy {
    /// It is dropped and counted.
    #[default]
    Drop,
    /// It enters with the newest time, and is counted.
    Clamp,
}

names!(LatePolicy { Drop => "drop", Clamp => "clamp" });

/// Admission check before the window. It keeps the clock: `now` never goes back.
#[derive(Clone, Debug)]
pub struct Admission {
    sensor: Sensor,
    late: LatePolicy,
    /// Epoch, and `now` relative to it.
    clock: Option<(i64, i64)>,
    filters: Chain,
    counters: EventCounters,
}

impl Admission {
    /// An admission check for `sensor` that has not seen an event.
    pub fn new(sensor: Sensor, late: LatePolicy) -> Self {
        Self { sensor, late, clock: None, filters: Chain::default(), counters: EventCounters::default() }
    }

    /// The same with another policy for late events.
    pub(crate) fn with_late(self, late: LatePolicy) -> Self {
        Self { late, ..self }
    }

    /// The same with the filters of `rules`, which drop events that would be admitted otherwise.
    /// They see only such events, at their admitted times; a dropped event does not advance the
    /// clock.
    ///
    /// # Errors
    /// As [`FilterRule::filter`].
    pub fn with_filters(self, rules: &[FilterRule]) -> Result<Self, EngineError> {
        Ok(Self { filters: Chain::of_rules(rules, self.sensor)?, ..self })
    }

    /// The filters.
    pub fn filters(&self) -> &Chain {
        &self.filters
    }

    /// The filters, to take over the state that others [remembered](Chain::remember).
    pub fn filters_mut(&mut self) -> &mut Chain {
        &mut self.filters
    }

    /// Counts so far.
    pub fn counters(&self) -> &EventCounters {
        &self.counters
    }

    /// Counts the events that `decision` drops, and a restart.
    pub fn count(&mut self, decision: &Decision) {
        self.counters.restarts += u64::from(decision.restarts);
        self.counters.outliers += decision.outliers;
        self.counters.pushed += decision.outliers;
    }

    pub(crate) fn counters_mut(&mut self) -> &mut EventCounters {
        &mut self.counters
    }

    /// Time of the first accepted event since the last reset.
    pub fn epoch_us(&self) -> Option<i64> {
        self.clock.map(|(epoch, _)| epoch)
    }

    /// Current time, on the events' own clock.
    pub fn now_us(&self) -> Option<i64> {
        self.clock.map(|(epoch, now)| epoch + now)
    }

    /// Current time, relative to the epoch.
    pub(crate) fn now(&self) -> i64 {
        self.clock.map_or(0, |(_, now)| now)
    }

    /// Admits `event` and returns it with its admitted time.
    ///
    /// # Errors
    /// The reason why it is dropped.
    pub fn admit(&mut self, event: Event) -> Result<Event, DropReason> {
        self.admit_node(event).map(|node| Event { t_us: self.epoch_us().unwrap_or(0) + node.t, ..event })
    }

    /// The time at which `event` would enter; `None` if it would be dropped.
    pub fn arrival_us(&self, event: Event) -> Option<i64> {
        let t_us = self.arrival(event).ok().map(|(epoch, t)| epoch.wrapping_add(t));
        t_us.filter(|&t_us| self.filters.passes(Event { t_us, ..event }))
    }

    /// The epoch, and the time relative to it, at which `event` would enter.
    #[inline]
    fn arrival(&self, event: Event) -> Result<(i64, i64), DropReason> {
        if !self.sensor.contains(event.x, event.y) {
            return Err(DropReason::OutsideSensor);
        }
        let (epoch, now) = self.clock.unwrap_or((event.t_us, 0));
        match event.t_us.checked_sub(epoch) {
            Some(t) if t >= now => Ok((epoch, t)),
            // The difference overflows: upwards if the epoch is before 0, else downwards (late).
            None if epoch < 0 => Err(DropReason::TimeOutOfRange),
            _ if self.late == LatePolicy::Clamp => Ok((epoch, now)),
            _ => Err(DropReason::Late),
        }
    }

    #[inline]
    pub(crate) fn admit_node(&mut self, event: Event) -> Result<Node, DropReason> {
        self.counters.pushed += 1;
        let (epoch, t) = match self.arrival(event) {
            Ok(arrival) => arrival,
            Err(reason) => {
                match reason {
                    DropReason::OutsideSensor => self.counters.outside_sensor += 1,
                    DropReason::TimeOutOfRange => self.counters.time_out_of_range += 1,
                    _ => self.counters.late += 1,
                }
                return Err(reason);
            }
        };
        let t_us = epoch.wrapping_add(t);
        if !self.filters.is_empty() && !self.filters.admit(Event { t_us, ..event }) {
            self.counters.filtered += 1;
            return Err(DropReason::Filtered);
        }
        self.counters.clamped += u64::from(t_us != event.t_us);
        self.counters.accepted += 1;
        self.clock = Some((epoch, t));
        Ok(Node::new(event, t))
    }

    /// Sets the epoch to `t_us` instead of to the first event's time; earlier events are late.
    pub(crate) fn begin(&mut self, t_us: i64) {
        self.clock = Some((t_us, 0));
    }

    /// Advances `now` to `t_us`. Earlier times, times before the first event, and times whose
    /// distance from the epoch does not fit 64 bits change nothing.
    pub fn advance(&mut self, t_us: i64) {
        if let Some((epoch, now)) = &mut self.clock {
            *now = t_us.checked_sub(*epoch).map_or(*now, |t| t.max(*now));
        }
    }

    /// Takes over the epoch and current time of another clock, not earlier. Counts and the filters'
    /// state are kept.
    pub fn resume(&mut self, epoch_us: i64, now_us: i64) {
        self.clock = Some((epoch_us, now_us.checked_sub(epoch_us).map_or(0, |t| t.max(0))));
    }

    /// Resets the clock and the filters; the next event sets a new epoch. Counts are kept.
    pub fn reset(&mut self) {
        self.clock = None;
        self.filters.reset();
    }
}
