//! Publishes events in slices.

use std::time::Instant;

use meissner_engine::{Event, Sensor};
use meissner_packets::PacketError;
use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

use crate::channel::{Channel, Sender};
use crate::wire::{EventRecord, SLICE, SliceHeader};

/// The name of the service for the events of `name`.
pub fn events_of(name: &str) -> String {
    format!("{name}/events")
}

/// The name of the service for the predictions of `name`.
pub fn predictions_of(name: &str) -> String {
    format!("{name}/predictions")
}

/// Nanoseconds of `CLOCK_MONOTONIC`, which is the same for all processes of a host.
pub fn now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // It counts from the start of the machine: 584 years fit.
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// A sensor's driver, from the view of the other processes.
#[derive(Debug)]
pub struct Driver {
    sender: Sender<EventRecord, SliceHeader>,
    /// The header of the next slice.
    next: SliceHeader,
}

/// Counts of published data.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Published {
    /// Number of the run.
    pub run: u64,
    /// Events.
    pub events: u64,
    /// Slices with events.
    pub slices: u64,
}

impl Driver {
    /// A driver for the events of `sensor` under this name.
    ///
    /// # Errors
    /// The service cannot be opened, or another driver has it.
    pub fn new(name: &str, sensor: Sensor) -> Result<Self, PacketError> {
        let sender = Channel::open(&events_of(name))?.sender(SLICE)?;
        let Sensor { width, height } = sensor;
        Ok(Self { sender, next: SliceHeader { run: now_ns(), width, height, ..SliceHeader::default() } })
    }

    /// Publishes `events`, the first of which was due at `due`, in slices of at most [`SLICE`].
    ///
    /// # Errors
    /// As [`Sender::publish`].
    pub fn publish(&mut self, events: &[Event], due: Instant) -> Result<(), PacketError> {
        let due_ns = now_ns().saturating_sub(due.elapsed().as_nanos() as u64);
        for slice in events.chunks(SLICE) {
            let header = SliceHeader { due_ns, published_ns: now_ns(), ..self.next };
            self.sender.publish(header, slice.len(), |index| slice[index].into())?;
            self.next.sequence += 1;
            self.next.first_event += slice.len() as u64;
        }
        Ok(())
    }

    /// Tells the subscribers that the run is over.
    ///
    /// # Errors
    /// As [`Sender::publish`].
    pub fn end(self) -> Result<Published, PacketError> {
        let now = now_ns();
        let header = SliceHeader { due_ns: now, published_ns: now, end: 1, ..self.next };
        self.sender.publish(header, 0, |_| unreachable!("it has no events"))?;
        let SliceHeader { run, sequence: slices, first_event: events, .. } = self.next;
        Ok(Published { run, events, slices })
    }

    /// Number of subscribers.
    pub fn subscribers(&self) -> usize {
        self.sender.subscribers()
    }
}
