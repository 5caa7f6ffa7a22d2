//! Which events enter, and at what time: the sensor's bounds, the clock, the epoch.

use std::fmt;

use crate::metric::Node;
use crate::{DropReason, Event, EventCounters, Sensor};

/// What happens to an event that is earlier than the newest time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LatePolicy {
    /// It is dropped and counted.
    #[default]
    Drop,
    /// It enters as if it had happened at the newest time, and is counted.
    Clamp,
}

impl LatePolicy {
    /// A short name, as in the program's reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Drop => "drop",
            Self::Clamp => "clamp",
        }
    }
}

impl fmt::Display for LatePolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What became of a pushed event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It is in the window.
    Accepted,
    /// It is not.
    Dropped(DropReason),
}

/// The gate before the window. It keeps time: `now` never goes back.
#[derive(Clone, Debug)]
pub struct Admission {
    sensor: Sensor,
    late: LatePolicy,
    /// Epoch, and `now` counted from it.
    clock: Option<(i64, i64)>,
    counters: EventCounters,
}

impl Admission {
    /// A gate for `sensor` that has not seen an event.
    pub fn new(sensor: Sensor, late: LatePolicy) -> Self {
        Self { sensor, late, clock: None, counters: EventCounters::default() }
    }

    /// The gate in a state that it was in: epoch, and time counted from it.
    pub(crate) fn resumed(
        sensor: Sensor,
        late: LatePolicy,
        clock: Option<(i64, i64)>,
        counters: EventCounters,
    ) -> Self {
        Self { sensor, late, clock, counters }
    }

    /// Counts so far.
    pub fn counters(&self) -> &EventCounters {
        &self.counters
    }

    pub(crate) fn counters_mut(&mut self) -> &mut EventCounters {
        &mut self.counters
    }

    /// The time of the first accepted event since the last reset.
    pub fn epoch_us(&self) -> Option<i64> {
        self.clock.map(|(epoch, _)| epoch)
    }

    /// The newest time, on the events' own clock.
    pub fn now_us(&self) -> Option<i64> {
        self.clock.map(|(epoch, now)| epoch + now)
    }

    /// The newest time, counted from the epoch.
    pub(crate) fn now(&self) -> i64 {
        self.clock.map_or(0, |(_, now)| now)
    }

    /// Lets `event` in, as it counts from now on, or says why not.
    ///
    /// # Errors
    /// The reason for which it is dropped.
    pub fn admit(&mut self, event: Event) -> Result<Event, DropReason> {
        self.admit_node(event).map(|node| Event { t_us: self.epoch_us().unwrap_or(0) + node.t, ..event })
    }

    pub(crate) fn admit_node(&mut self, event: Event) -> Result<Node, DropReason> {
        self.counters.pushed += 1;
        if !self.sensor.contains(event.x, event.y) {
            self.counters.outside_sensor += 1;
            return Err(DropReason::OutsideSensor);
        }
        let (epoch, now) = self.clock.unwrap_or((event.t_us, 0));
        let t = match event.t_us.checked_sub(epoch) {
            Some(t) if t >= now => t,
            // The difference overflows: upwards from an epoch before 0, or downwards, which is late like any other.
            None if epoch < 0 => {
                self.counters.time_out_of_range += 1;
                return Err(DropReason::TimeOutOfRange);
            }
            _ if self.late == LatePolicy::Clamp => {
                self.counters.clamped += 1;
                now
            }
            _ => {
                self.counters.late += 1;
                return Err(DropReason::Late);
            }
        };
        self.counters.accepted += 1;
        self.clock = Some((epoch, t));
        Ok(Node::new(event, t))
    }

    /// Makes `t_us` the epoch, where no event is to set it: what is earlier is late.
    pub(crate) fn begin(&mut self, t_us: i64) {
        self.clock = Some((t_us, 0));
    }

    /// Moves `now` on to `t_us`. Earlier times, any time before the first event, and times whose distance from the epoch
    /// does not fit 64 bits change nothing.
    pub fn advance(&mut self, t_us: i64) {
        if let Some((epoch, now)) = &mut self.clock {
            *now = t_us.checked_sub(*epoch).map_or(*now, |t| t.max(*now));
        }
    }

    /// Goes on with the clock of another gate: its epoch, and its newest time, which is not earlier. Counts stay.
    pub fn resume(&mut self, epoch_us: i64, now_us: i64) {
        self.clock = Some((epoch_us, now_us.checked_sub(epoch_us).map_or(0, |t| t.max(0))));
    }

    /// Forgets the clock; the next event sets a new epoch. Counts go on.
    pub fn reset(&mut self) {
        self.clock = None;
    }
}
