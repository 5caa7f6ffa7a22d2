//! The input features of an event: its polarity and, if asked for, its place in a grid's cells.
//!
//! A row depends on the event alone and never changes.

use meissner_kernels::Lanes;

use crate::memory::Memory;
use crate::metric::Node;
use crate::{Event, Fraction, Sensor};

/// Channels of the input: the polarity, and the place along x and y.
pub(crate) fn channels(place: Option<[Fraction; 2]>) -> usize {
    if place.is_some() { 3 } else { 1 }
}

/// The input features of `event`, without tables.
pub(crate) fn of_event(event: &Event, place: Option<[Fraction; 2]>, sensor: Sensor) -> Vec<f32> {
    let mut row = vec![polarity(event.on)];
    if let Some([x, y]) = place {
        row.extend([x.place(event.x, sensor.width), y.place(event.y, sensor.height)]);
    }
    row
}

/// +1 if the brightness rose, -1 if it fell.
fn polarity(on: bool) -> f32 {
    if on { 1.0 } else { -1.0 }
}

/// Makes input rows. Places come from tables, with the bits of computed ones.
#[derive(Clone, Debug)]
pub(crate) struct Input {
    /// Of each pixel column and of each pixel row; empty without places.
    of_x: Vec<f32>,
    of_y: Vec<f32>,
}

impl Input {
    pub(crate) fn new(place: Option<[Fraction; 2]>, sensor: Sensor, memory: &mut Memory) -> Self {
        let mut table = |size: Option<Fraction>, extent: u16| match size {
            Some(size) => memory.values(extent.into(), |pixel| size.place(pixel as u16, extent)),
            None => Vec::new(),
        };
        let [x, y] = place.map_or([None; 2], |cell| cell.map(Some));
        Self { of_x: table(x, sensor.width), of_y: table(y, sensor.height) }
    }

    /// The input row of `node`.
    #[inline]
    pub(crate) fn row(&self, node: Node) -> Lanes {
        let mut lanes = Lanes::ZERO;
        lanes.0[0] = polarity(node.on);
        if !self.of_x.is_empty() {
            lanes.0[1] = self.of_x[usize::from(node.x)];
            lanes.0[2] = self.of_y[usize::from(node.y)];
        }
        lanes
    }
}
