//! Neighbourhoods of a batch, straight from their definition: candidates, exact distances, a sort.

use std::ops::Range;

use super::neighbours::Lists;
use super::setup::{Batch, Places, Propose};
use crate::Event;
use crate::network::Candidates;

/// Range of event indices that event `i` may read from; it may include `i`.
pub(super) fn candidates(batch: &Batch, events: &[Event], i: usize) -> Range<usize> {
    let parts = batch.network.parts();
    match parts.graph.candidates {
        Candidates::All => 0..events.len(),
        Candidates::Past(_) if !parts.graph.is_frozen() => 0..i,
        Candidates::Past(_) => {
            // The window at the event's arrival, after evictions.
            let oldest = events[i].t_us.saturating_sub(parts.span_us);
            let in_time = events[..i].partition_point(|e| e.t_us < oldest);
            in_time.max((i + 1).saturating_sub(parts.capacity))..i
        }
    }
}

/// Neighbour indices of each event, by comparing it with every candidate.
pub(super) fn exhaustive(batch: &Batch, events: &[Event], extents: [f64; 3]) -> Lists {
    let mut lists = Lists::new(events.len(), 0);
    for i in 0..events.len() {
        lists.set(i as u32, first_of(batch, events, extents, i, candidates(batch, events, i)));
    }
    lists
}

/// Neighbour indices of each event, by comparing it with the candidates that `propose` gives.
pub(super) fn proposed(batch: &Batch, events: &[Event], extents: [f64; 3], propose: Propose) -> Lists {
    let position = |e: &Event| {
        let first_us = events.first().map_or(e.t_us, |first| first.t_us);
        [f64::from(e.x) / extents[0], f64::from(e.y) / extents[1], (e.t_us - first_us) as f64 / extents[2]]
    };
    let positions: Vec<[f64; 3]> = events.iter().map(position).collect();
    let candidates: Vec<Range<usize>> = (0..events.len()).map(|i| candidates(batch, events, i)).collect();
    let places =
        Places { positions: &positions, candidates: &candidates, reach: batch.network.parts().graph.reach };
    let mut lists = Lists::new(events.len(), 0);
    let mut i = 0;
    propose(&places, &mut |proposals| {
        let among = proposals.iter().map(|&j| j as usize).filter(|j| candidates[i].contains(j));
        lists.set(i as u32, first_of(batch, events, extents, i, among));
        i += 1;
    });
    assert_eq!(i, events.len(), "neighbours of every event must be proposed");
    lists
}

/// The first `most` of event `i`'s candidates in `among`: smaller distance, then later event.
fn first_of(
    batch: &Batch,
    events: &[Event],
    extents: [f64; 3],
    i: usize,
    among: impl Iterator<Item = usize>,
) -> impl Iterator<Item = u32> {
    let reach = batch.network.parts().graph.reach;
    let a = events[i];
    let mut found: Vec<(f64, usize)> = among
        .filter(|&j| j != i)
        .map(|j| {
            let b = events[j];
            let [x, y, t] = [
                f64::from(a.x.abs_diff(b.x)) / extents[0],
                f64::from(a.y.abs_diff(b.y)) / extents[1],
                (a.t_us - b.t_us) as f64 / extents[2],
            ];
            (x * x + y * y + t * t, j)
        })
        .filter(|&(d2, _)| d2 <= reach.limit())
        .collect();
    let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1));
    if found.len() > reach.most() {
        found.select_nth_unstable_by(reach.most(), order);
        found.truncate(reach.most());
    }
    found.sort_unstable_by(order);
    found.into_iter().map(|(_, j)| j as u32)
}
