//! Values computed from nodes: squared distances, edge attributes, input rows.

use meissner_kernels::{Divisor, Lanes, Portable, Simd, attribute, offset};

use crate::memory::Memory;
use crate::{Event, Fraction, Sensor};

/// A node of the event graph: an event with its time relative to the epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Node {
    /// Microseconds since the epoch, not negative.
    pub(crate) t: i64,
    pub(crate) x: u16,
    pub(crate) y: u16,
    pub(crate) on: bool,
}

impl Node {
    pub(crate) fn new(event: Event, t: i64) -> Self {
        Self { t, x: event.x, y: event.y, on: event.on }
    }
}

/// d2 = ((dx / width)^2 + (dy / height)^2) + (dt / span)^2 in f64, and edge attributes. Terms of x
/// and y come from tables, with the same bits as computed terms.
#[derive(Clone, Debug)]
pub(crate) struct Metric {
    span: Divisor,
    extents: [Divisor; 2],
    scale: f32,
    /// (dx / width)^2 for dx = 0..width.
    x2: Vec<f64>,
    y2: Vec<f64>,
    /// Edge attribute for dx = 1 - width..width.
    ux: Vec<f32>,
    uy: Vec<f32>,
}

impl Metric {
    pub(crate) fn new(sensor: Sensor, span_us: i64, scale: f32, memory: &mut Memory) -> Self {
        let extents @ [width, height] = [sensor.width, sensor.height].map(usize::from);
        let mut squares = |extent| memory.values(extent, |d| square(d as f64 / extent as f64));
        let (x2, y2) = (squares(width), squares(height));
        let mut attributes = |extent| {
            let difference = |i: usize| i as f64 - (extent - 1) as f64;
            memory.values(2 * extent - 1, |i| attribute(difference(i) / extent as f64, scale))
        };
        let (ux, uy) = (attributes(width), attributes(height));
        let extents = extents.map(|extent| Divisor::new(extent as i64));
        Self { span: Divisor::new(span_us), extents, scale, x2, y2, ux, uy }
    }

    /// (dx / width)^2; infinite beyond the sensor.
    #[inline]
    pub(crate) fn x2(&self, dx: usize) -> f64 {
        self.x2.get(dx).copied().unwrap_or(f64::INFINITY)
    }

    /// (dy / height)^2; infinite beyond the sensor.
    #[inline]
    pub(crate) fn y2(&self, dy: usize) -> f64 {
        self.y2.get(dy).copied().unwrap_or(f64::INFINITY)
    }

    /// (dt / span)^2.
    #[inline(always)]
    pub(crate) fn t2<S: Simd>(&self, simd: S, dt: i64) -> f64 {
        square(self.span.divide(simd, exact(dt)))
    }

    /// (dx / width)^2 + (dy / height)^2, computed: for several nodes at once.
    #[inline(always)]
    pub(crate) fn plane2<S: Simd>(&self, simd: S, [dx, dy]: [u16; 2]) -> f64 {
        let [width, height] = self.extents;
        square(width.divide(simd, dx.into())) + square(height.divide(simd, dy.into()))
    }

    #[inline]
    pub(crate) fn distance2(&self, a: Node, b: Node) -> f64 {
        (self.x2(a.x.abs_diff(b.x) as usize) + self.y2(a.y.abs_diff(b.y) as usize))
            + self.t2(Portable, a.t - b.t)
    }

    #[inline]
    pub(crate) fn attributes(&self, source: Node, reader: Node) -> [f32; 3] {
        let at = |table: &[f32], source: u16, reader: u16| {
            let middle = table.len() / 2;
            table[middle + source as usize - reader as usize]
        };
        let t = attribute((source.t - reader.t) as f64 / self.span.value(), self.scale);
        [at(&self.ux, source.x, reader.x), at(&self.uy, source.y, reader.y), t]
    }

    #[inline]
    pub(crate) fn offsets(&self, source: Node, reader: Node) -> [f32; 3] {
        let along = |source: u16, reader: u16, d: usize| {
            offset(f64::from(i32::from(source) - i32::from(reader)) / self.extents[d].value(), self.scale)
        };
        let t = offset((source.t - reader.t) as f64 / self.span.value(), self.scale);
        [along(source.x, reader.x, 0), along(source.y, reader.y, 1), t]
    }
}

/// `dt` in f64, exact for |dt| < 2^51; no difference within a window reaches 2^48. Near 1.5 2^52
/// the low bits of an f64 are an integer: AVX2 has no conversion of vectors of i64.
#[inline(always)]
fn exact(dt: i64) -> f64 {
    const MIDDLE: f64 = 6_755_399_441_055_744.0;
    f64::from_bits(MIDDLE.to_bits().wrapping_add_signed(dt)) - MIDDLE
}

#[inline]
fn square(v: f64) -> f64 {
    v * v
}

/// Channels of the input: the polarity, and the place along x and y.
pub(crate) fn input_channels(place: Option<[Fraction; 2]>) -> usize {
    if place.is_some() { 3 } else { 1 }
}

/// The input features of `event`, without tables.
pub(crate) fn input_of(event: &Event, place: Option<[Fraction; 2]>, sensor: Sensor) -> Vec<f32> {
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

/// Makes input rows. Places come from tables, with the same bits as computed places.
#[derive(Clone, Debug)]
pub(crate) struct Input {
    /// Place of each pixel column and of each pixel row; empty if places are not an input.
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
