//! What a session runs: an engine, and the items that it takes one by one.

use meissner_engine::Event;

use crate::error::ViewError;
use crate::facts::{ComparedLayer, Facts, Info};
use crate::frame::{Bytes, FrameWriter};
use crate::networks::Chosen;

/// Something that an engine takes: an event, a picture, a reading.
pub trait Item {
    /// Speed of a recording at first.
    const SPEED: f64;
    /// Items between two states to return to, at first.
    const APART: usize;

    /// Its time in microseconds.
    fn t_us(&self) -> i64;

    /// A live history has so many like it at most; older ones are forgotten in halves.
    fn kept(&self) -> usize;
}

impl Item for Event {
    // Events come in milliseconds, and are to be watched.
    const SPEED: f64 = 0.1;
    const APART: usize = 8192;

    fn t_us(&self) -> i64 {
        self.t_us
    }

    fn kept(&self) -> usize {
        1 << 21
    }
}

/// A prediction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen<'a> {
    /// A value for each of [`Chosen::outputs`].
    pub values: &'a [f32],
    /// How unlike the input is to that of the training, if that is known.
    pub unlike: Option<f32>,
}

/// An engine that a session runs over items of a sensor.
pub trait Subject: Sized {
    /// Its networks.
    type Network;
    /// What it takes.
    type Item: Item;
    /// Where items come from.
    type Sensor;

    /// An engine before the first item.
    ///
    /// # Errors
    /// The engine refuses the network or the sensor.
    fn new(chosen: &Chosen<Self::Network>, sensor: &Self::Sensor) -> Result<Self, ViewError>;

    /// Learns the first item of the input, which it may never take: a cursor may begin elsewhere.
    fn learn(&mut self, _first: &Self::Item) {}

    /// Takes over what the engine before it, with another network, knows about the input.
    fn inherit(&mut self, _other: &Self) {}

    /// Returns to before the first item.
    ///
    /// # Errors
    /// As [`Self::new`].
    fn begin(&mut self) -> Result<(), ViewError>;

    /// Takes `items`, at least one, and reads a prediction; `None` if none is due.
    ///
    /// # Errors
    /// An item does not fit, or a prediction is not finite.
    fn take(&mut self, items: &[Self::Item]) -> Result<Option<Seen<'_>>, ViewError>;

    /// The first of `items` on which the state after all of them depends; `None`: it may depend on
    /// all items.
    fn depends_from(&self, items: &[Self::Item]) -> Option<usize>;

    /// The state as bytes, where it depends on all items.
    fn state(&self) -> Option<Vec<u8>>;

    /// Returns to a state, and reads a prediction.
    ///
    /// # Errors
    /// The bytes are no state of it.
    fn restore(&mut self, state: &[u8]) -> Result<(), ViewError>;

    /// Compares with full recomputation over `items`, which are all that were taken.
    ///
    /// # Errors
    /// Full recomputation failed.
    fn compare(&self, items: &[Self::Item]) -> Result<Vec<ComparedLayer>, ViewError>;

    /// What seldom changes.
    fn facts(input: &str, sensor: &Self::Sensor, name: &str, chosen: &Chosen<Self::Network>) -> Facts;

    /// What changes and is small.
    fn info(&self) -> Info;

    /// Events in the window, or frames that count.
    fn nodes(&self) -> usize;

    /// Writes what it shows after `items`, which are all that were taken.
    fn write(&self, items: &[Self::Item], to: &mut FrameWriter);

    /// Writes the section WORK.
    fn work(&self, to: &mut Bytes<'_>);
}
