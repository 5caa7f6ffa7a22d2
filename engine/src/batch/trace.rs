//! Input and output of a batch: streams of events, activations.

use std::ops::Range;

use meissner_kernels::{GraphRow, Lanes, Matrix, Neighbour, Portable, add, clear_negative_zero, maximum};

use crate::{EngineError, Event, Sensor};

/// In-edges of consecutive rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edges {
    pub(super) start: Vec<usize>,
    pub(super) list: Vec<Neighbour>,
    /// Offset of each in-edge, if a block reads offsets.
    pub(super) offsets: Vec<[f32; 3]>,
}

impl Edges {
    /// Appends a row with its in-edges.
    pub fn push(&mut self, row: impl IntoIterator<Item = Neighbour>) {
        self.start.push(self.list.len());
        self.list.extend(row);
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.start.len()
    }

    /// In-edges of `row`, in neighbourhood order.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, row: usize) -> &[Neighbour] {
        &self.list[self.span(row)]
    }

    /// Offset of each in-edge of `row`, in neighbourhood order; empty if no block reads offsets.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn offsets(&self, row: usize) -> &[[f32; 3]] {
        self.offsets.get(self.span(row)).unwrap_or_default()
    }

    fn span(&self, row: usize) -> Range<usize> {
        self.start[row]..self.start.get(row + 1).copied().unwrap_or(self.list.len())
    }

    /// Inputs of a block for `row`: its in-edges, its `own` input, and the `skip` input.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn read<'a>(&'a self, row: usize, own: &'a [Lanes], skip: Option<&'a [Lanes]>) -> GraphRow<'a> {
        GraphRow { neighbours: self.row(row), offsets: self.offsets(row), own, skip, ..GraphRow::default() }
    }
}

/// One level, computed from scratch.
#[derive(Clone, Debug)]
pub struct LevelTrace {
    /// Neighbourhood of each row.
    pub edges: Edges,
    /// The level's input, then the output of each block.
    pub features: Vec<Matrix>,
    /// Position of each row: fractions of sensor and span, time from the epoch; in f32 and from the
    /// window's first event with [`Normalisation::PerGraph`](crate::Normalisation::PerGraph).
    pub positions: Vec<[f64; 3]>,
    /// Index of each row's cell along x, y and t; empty at the event level.
    pub cells: Vec<[i64; 3]>,
    /// Rows of the level below that each row pools, ascending; empty at the event level.
    pub members: Vec<Vec<usize>>,
    /// First row that is in the window; earlier rows are needed for `frozen` in-edges.
    pub first: usize,
}

/// All activations of a batch.
#[derive(Clone, Debug)]
pub struct Trace {
    /// The event level, then one per pooling.
    pub levels: Vec<LevelTrace>,
    /// (cells, channels).
    pub readout: Matrix,
    /// Outputs of the last dense layer.
    pub prediction: Vec<f32>,
}

/// Channel-wise sum of rows: within each part of time in order, then over the parts.
pub(super) fn sum_of(features: &Matrix, rows: &[usize], part: impl Fn(usize) -> i64, out: &mut [Lanes]) {
    out.fill(Lanes::ZERO);
    let mut sum = vec![Lanes::ZERO; out.len()];
    for rows in rows.chunk_by(|&a, &b| part(a) == part(b)) {
        sum.fill(Lanes::ZERO);
        rows.iter().for_each(|&row| add(&mut sum, features.row(row)));
        add(out, &sum);
    }
}

/// Channel-wise maximum over some rows.
pub(super) fn maximum_of(features: &Matrix, rows: &[usize], out: &mut [Lanes]) {
    out.fill(Lanes::splat(f32::NEG_INFINITY));
    maximum(Portable, out, rows.iter().map(|&row| features.row(row)));
    clear_negative_zero(out);
}

/// The input of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Stream<'a> {
    /// Accepted events in order of arrival. For `frozen` in-edges, all events since the last reset;
    /// otherwise at least those in the window.
    pub events: &'a [Event],
    /// Time of the first event since the reset.
    pub epoch_us: i64,
    /// Current time: that of the last event, or of a later `advance`.
    pub now_us: i64,
}

impl<'a> Stream<'a> {
    /// A stream of all events since a reset, at the time of the last one.
    pub fn new(events: &'a [Event]) -> Self {
        let time = |event: Option<&Event>| event.map_or(0, |e| e.t_us);
        Self { events, epoch_us: time(events.first()), now_us: time(events.last()) }
    }

    /// Refuses streams that no engine on `sensor` accepts. O(events).
    pub(super) fn check(&self, sensor: Sensor) -> Result<(), EngineError> {
        let Self { events, epoch_us, now_us } = *self;
        let ([first, ..], [.., last]) = (events, events) else { return Ok(()) };
        if let Some((i, event)) = events.iter().enumerate().find(|(_, e)| !sensor.contains(e.x, e.y)) {
            let expected = format!("a pixel of {sensor}");
            return Err(refused("pixel", expected, format!("({}, {}) of event {i}", event.x, event.y)));
        }
        if let Some(i) = (1..events.len()).find(|&i| events[i].t_us < events[i - 1].t_us) {
            let [before, after] = [i - 1, i].map(|i| events[i].t_us);
            return Err(refused(
                "times",
                "none to descend",
                format!("{after} us after {before} us at event {i}"),
            ));
        }
        if first.t_us < epoch_us {
            return Err(refused("first event", format!("not before the epoch, {epoch_us} us"), first.t_us));
        }
        if last.t_us > now_us {
            return Err(refused(
                "newest time",
                format!("not before the last event, {} us", last.t_us),
                now_us,
            ));
        }
        if now_us.checked_sub(epoch_us).is_none() {
            let expected = format!("at most 2^63 - 1 us after the epoch, {epoch_us} us");
            return Err(refused("newest time", expected, now_us));
        }
        Ok(())
    }
}

fn refused(what: &'static str, expected: impl ToString, found: impl ToString) -> EngineError {
    EngineError::Stream { what, expected: expected.to_string(), found: found.to_string() }
}
