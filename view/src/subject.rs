//! The engine that a session runs, and the items that it takes one by one.

use meissner_engine::Event;

use crate::error::ViewError;
use crate::facts::{ComparedLayer, Facts, Info};
use crate::frame::{Bytes, FrameWriter};
use crate::networks::Chosen;

/// An input of an engine: an event, a picture, a reading.
pub trait Item {
    /// Initial speed of a recording.
    const SPEED: f64;
    /// Initial number of items between two states to return to.
    const APART: usize;

    /// Its time in microseconds.
    fn t_us(&self) -> i64;

    /// Maximum number of such items in a live history; older ones are forgotten in halves.
    fn kept(&self) -> usize;
}

impl Item for Event {
    // Events come within milliseconds, and people are to watch them.
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
    /// The items that it takes.
    type Item: Item;
    /// The sensor of the items.
    type Sensor;

    /// An engine before the first item.
    ///
    /// # Errors
    /// The engine refuses the network or the sensor.
    fn new(chosen: &Chosen<Self::Network>, sensor: &Self::Sensor) -> Result<Self, ViewError>;

    /// Gets the first item of the input, which it may never take because a cursor may begin
    /// elsewhere.
    fn learn(&mut self, _first: &Self::Item) {}

    /// Takes over the knowledge about the input from the previous engine, which had another
    /// network.
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

    /// Index of the first of `items` on which the state after all of them depends; `None`: it may
    /// depend on all items.
    fn depends_from(&self, items: &[Self::Item]) -> Option<usize>;

    /// The state as bytes, if it depends on all items.
    fn state(&self) -> Option<Vec<u8>>;

    /// Returns to a state, and reads a prediction.
    ///
    /// # Errors
    /// The bytes are not a state of this engine.
    fn restore(&mut self, state: &[u8]) -> Result<(), ViewError>;

    /// Compares with full recomputation over `items`, which are all taken items.
    ///
    /// # Errors
    /// Full recomputation failed.
    fn compare(&self, items: &[Self::Item]) -> Result<Vec<ComparedLayer>, ViewError>;

    /// Data that seldom changes.
    fn facts(input: &str, sensor: &Self::Sensor, name: &str, chosen: &Chosen<Self::Network>) -> Facts;

    /// Small values that change.
    fn info(&self) -> Info;

    /// Number of events in the window, or of frames that count.
    fn nodes(&self) -> usize;

    /// Writes the data to show after `items`, which are all taken items.
    fn write(&self, items: &[Self::Item], to: &mut FrameWriter);

    /// Writes the section WORK.
    fn work(&self, to: &mut Bytes<'_>);
}
