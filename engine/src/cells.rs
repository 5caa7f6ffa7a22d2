//! The fixed grid of a pooling: cells of events and of cells below, and positions of cells.
//!
//! Cells are ordered by (t, y, x). There are as many slots as a window can occupy at once, and
//! cells in time reuse them cyclically.

use crate::network::{Pooling, Position};
use crate::{Fraction, Sensor};

/// Index of a pooled cell along x, y and t.
pub(crate) type CellIndex = [i64; 3];

pub(crate) type Key = [i64; 3];

pub(crate) fn key([x, y, t]: CellIndex) -> Key {
    [t, y, x]
}

#[derive(Clone, Debug)]
pub(crate) struct CellGrid {
    pooling: Pooling,
    columns: usize,
    rows: usize,
    /// Number of cells along t that a window can occupy at once.
    times: usize,
    /// Lengths in spans; their sum is the range in time of the nodes of the level below.
    spread: Vec<Fraction>,
    sensor: Sensor,
    span_us: i64,
    /// Cell of each pixel column and of each pixel row.
    of_x: Vec<u32>,
    of_y: Vec<u32>,
}

impl CellGrid {
    /// `below` is the grid of the level below, if that is a pooled level.
    pub(crate) fn new(pooling: Pooling, below: Option<&Self>, sensor: Sensor, span_us: i64) -> Self {
        let [x, y] = pooling.cell;
        // A cell contains centres of cells below, up to half such a cell from their members, so the
        // range in time grows by one cell of each level below.
        let mut spread = below.map_or(vec![Fraction::ONE], |below| below.spread.clone());
        spread.extend(below.and_then(|below| below.pooling.time));
        // A closed interval at most n cells long touches at most n + 1 cells.
        let times = pooling.time.map_or(1, |size| {
            let lengths = spread.iter().map(|length| length.cells_of(size));
            lengths.fold(1, usize::saturating_add)
        });
        let table = |extent: u16, size: Fraction| {
            (0..extent).map(|p| size.cell(p.into(), extent.into()) as u32).collect()
        };
        let (of_x, of_y) = (table(sensor.width, x), table(sensor.height, y));
        Self { columns: x.cells(), rows: y.cells(), times, spread, pooling, sensor, span_us, of_x, of_y }
    }

    /// Bytes allocated, without the struct itself.
    pub(crate) fn bytes(&self) -> usize {
        self.pooling.name.capacity()
            + (self.of_x.capacity() + self.of_y.capacity()) * size_of::<u32>()
            + self.spread.capacity() * size_of::<Fraction>()
    }

    pub(crate) fn position(&self) -> Position {
        self.pooling.position
    }

    /// Number of slots: cells of the plane, times the cells in time of a window. Saturates.
    pub(crate) fn slots(&self) -> usize {
        self.columns.saturating_mul(self.rows).saturating_mul(self.times)
    }

    /// Cell of an event at pixel (`x`, `y`) and `t` microseconds after the epoch, in integers.
    pub(crate) fn of_event(&self, x: u16, y: u16, t: i64) -> CellIndex {
        let t = self.pooling.time.map_or(0, |size| size.cell(t.into(), self.span_us.into()) as i64);
        [self.of_x[usize::from(x)].into(), self.of_y[usize::from(y)].into(), t]
    }

    /// Cell that contains the centre of cell `index` of the level below, in integers.
    pub(crate) fn of_cell(&self, below: &Self, index: CellIndex) -> CellIndex {
        let axis = |i: i64, inner: Fraction, outer: Fraction| {
            let centre = (2 * i128::from(i) + 1) * i128::from(inner.numerator());
            outer.cell(centre, 2 * i128::from(inner.denominator())) as i64
        };
        let time = match (below.pooling.time, self.pooling.time) {
            (Some(inner), Some(outer)) => axis(index[2], inner, outer),
            _ => 0,
        };
        // A centre beyond the sensor's edge belongs to the last cell.
        let [x, y] = [0, 1].map(|d| axis(index[d], below.pooling.cell[d], self.pooling.cell[d]));
        [x.min(self.columns as i64 - 1), y.min(self.rows as i64 - 1), time]
    }

    pub(crate) fn slot(&self, [x, y, t]: CellIndex) -> u32 {
        let t = t as usize % self.times;
        ((t * self.rows + y as usize) * self.columns + x as usize) as u32
    }

    /// Centre of a cell in fractions of sensor and span; mid-span without cells in time.
    pub(crate) fn centre(&self, index: CellIndex) -> [f64; 3] {
        let [x, y] = self.pooling.cell;
        let t = self.pooling.time.map_or(0.5, |size| size.centre(index[2]));
        [x.centre(index[0]), y.centre(index[1]), t]
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct EventSums {
    count: i64,
    x: i64,
    y: i64,
    t: i128,
}

impl EventSums {
    pub(crate) fn add(&mut self, x: u16, y: u16, t: i64) {
        self.count += 1;
        self.x += i64::from(x);
        self.y += i64::from(y);
        self.t += i128::from(t);
    }

    pub(crate) fn subtract(&mut self, x: u16, y: u16, t: i64) {
        self.count -= 1;
        self.x -= i64::from(x);
        self.y -= i64::from(y);
        self.t -= i128::from(t);
    }

    /// Mean position, as fractions of sensor and span: one division of exact sums per axis.
    pub(crate) fn mean(&self, grid: &CellGrid) -> [f64; 3] {
        let share = |sum: f64, extent: i64| sum / (i128::from(self.count) * i128::from(extent)) as f64;
        [
            share(self.x as f64, grid.sensor.width.into()),
            share(self.y as f64, grid.sensor.height.into()),
            share(self.t as f64, grid.span_us),
        ]
    }
}

/// Mean of positions, summed in the given order.
pub(crate) fn mean_position(positions: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for p in positions {
        sum = [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]];
        count += 1.0;
    }
    sum.map(|s| s / count)
}
