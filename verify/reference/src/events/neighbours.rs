//! The event level: neighbourhoods by comparing all pairs in the contract's order (smaller d2 first, then the later event),
//! d2 = ((dx / width)^2 + (dy / height)^2) + (dt / span)^2 from integer differences.

use std::ops::Range;

use meissner_engine::{Candidates, Event, Fraction, Stream};

use super::{EventReference, ReferenceLevel};
use crate::convolution::Edge;

/// Rows, edges and input of the event level.
pub(super) fn level(reference: &EventReference, stream: Stream<'_>) -> ReferenceLevel {
    let parts = reference.network.parts();
    let oldest = stream.now_us.saturating_sub(parts.span_us);
    let in_time = stream.events.iter().take_while(|e| e.t_us < oldest).count();
    let first = in_time.max(stream.events.len().saturating_sub(parts.capacity));
    // Events that have left the window are still inputs of rows that read them on arrival.
    let start = if parts.graph.is_frozen() { 0 } else { first };
    let events = &stream.events[start..];
    let extents =
        [f64::from(reference.sensor.width), f64::from(reference.sensor.height), parts.span_us as f64];
    let scaled = |integers: [i64; 3]| [0, 1, 2].map(|d| integers[d] as f64 / extents[d]);
    let difference = |source: &Event, reader: &Event| {
        let [x, y] = [(source.x, reader.x), (source.y, reader.y)].map(|(a, b)| i64::from(a) - i64::from(b));
        scaled([x, y, source.t_us - reader.t_us])
    };
    let neighbourhood = |i: usize| -> Vec<Edge> {
        let mut found: Vec<(f64, usize)> = candidates(reference, events, i)
            .filter(|&j| j != i)
            .map(|j| {
                let [x, y, t] = difference(&events[j], &events[i]);
                ((x * x + y * y) + t * t, j)
            })
            .filter(|(d2, _)| *d2 <= parts.graph.reach.limit())
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        found.truncate(parts.graph.reach.most());
        let edge =
            |(_, j): (f64, usize)| Edge::new(j, difference(&events[j], &events[i]), parts.events.scale);
        found.into_iter().map(edge).collect()
    };
    let position = |e: &Event| scaled([e.x.into(), e.y.into(), e.t_us - stream.epoch_us]);
    ReferenceLevel {
        edges: (0..events.len()).map(neighbourhood).collect(),
        features: vec![events.iter().map(|e| input(reference, e)).collect()],
        positions: events.iter().map(position).collect(),
        cells: Vec::new(),
        first: first - start,
    }
}

/// The input features of `event`.
fn input(reference: &EventReference, event: &Event) -> Vec<f64> {
    let mut row = vec![if event.on { 1.0 } else { -1.0 }];
    if let Some([x, y]) = reference.network.parts().place {
        // The cell of a pixel is found in integers; the pixel's centre can lie beyond its end.
        let along = |pixel: u16, extent: u16, size: Fraction| {
            let [n, d] = [size.numerator(), size.denominator()].map(u64::from);
            let (length, start) = (u64::from(extent) * n, u64::from(pixel) * d);
            let within = (start - start / length * length) as f64 + 0.5 * d as f64;
            2.0 * within / length as f64 - 1.0
        };
        row.push(along(event.x, reference.sensor.width, x));
        row.push(along(event.y, reference.sensor.height, y));
    }
    row
}

/// Range of event indices that event `i` may read from; it may include `i`.
fn candidates(reference: &EventReference, events: &[Event], i: usize) -> Range<usize> {
    let parts = reference.network.parts();
    match parts.graph.candidates {
        Candidates::All => 0..events.len(),
        Candidates::Past(_) if !parts.graph.is_frozen() => 0..i,
        Candidates::Past(_) => {
            // The window at the event's arrival, after evictions.
            let oldest = events[i].t_us.saturating_sub(parts.span_us);
            let in_time = events[..i].iter().take_while(|e| e.t_us < oldest).count();
            in_time.max((i + 1).saturating_sub(parts.capacity))..i
        }
    }
}
