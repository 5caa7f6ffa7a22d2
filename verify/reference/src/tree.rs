//! Neighbours of a window from a k-d tree, which is independent of the engine's search.
//!
//! Input: rounded positions, and the range that each event may read from. Output: for each event,
//! its neighbours and a few more. Bounds are widened by more than the largest rounding error.

use std::num::NonZeroUsize;
use std::ops::Range;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use meissner_engine::{Places, Propose};

/// Number of events up to which all pairs are proposed, because a tree is not faster there.
const FEW: usize = 500;

/// Proposes neighbours for windows of any size: all pairs of a few events, else near events from a
/// k-d tree. O(n k log n) with k neighbours; more if few near events may be read.
pub const PROPOSE: Propose = by_size;

fn by_size(places: &Places<'_>, tell: &mut dyn FnMut(&[u32])) {
    if places.positions.len() > FEW {
        return from_tree(places, tell);
    }
    let all: Vec<u32> = (0..places.positions.len() as u32).collect();
    places.candidates.iter().for_each(|candidates| tell(&all[candidates.clone()]));
}

/// Proposes the neighbours that a k-d tree finds.
///
/// # Panics
/// If a position is not finite.
pub fn from_tree(places: &Places<'_>, tell: &mut dyn FnMut(&[u32])) {
    let Places { positions, candidates, reach } = *places;
    if positions.is_empty() {
        return;
    }
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(positions).expect("finite positions");
    let largest = positions.iter().flatten().fold(1.0_f64, |largest, p| largest.max(p.abs()));
    let mut near = Vec::new();
    for (i, (position, candidates)) in positions.iter().zip(candidates).enumerate() {
        near.clear();
        if let Some(bound) = bound(&tree, position, i, candidates, reach.most()) {
            let bound = widened(bound.min(reach.limit()), largest);
            let within = tree.query(position).within::<SquaredEuclidean<f64>>(bound).execute();
            let rows = within.iter().map(|found| found.item);
            near.extend(rows.filter(|&j| j as usize != i && candidates.contains(&(j as usize))));
        }
        tell(&near);
    }
}

/// Squared distance within which the first `most` candidates of event `i` lie; `None` without
/// candidates.
fn bound(
    tree: &ImmutableKdTree<f64, 3>,
    position: &[f64; 3],
    i: usize,
    candidates: &Range<usize>,
    most: usize,
) -> Option<f64> {
    let wanted = most.min(candidates.len() - usize::from(candidates.contains(&i)));
    if wanted == 0 {
        return None;
    }
    let mut asked = wanted + 1;
    // Some near events may not be read: search again for twice as many.
    loop {
        let most = NonZeroUsize::new(asked)?;
        let nearest = tree.query(position).nearest_n::<SquaredEuclidean<f64>>(most).execute();
        let mut distances: Vec<f64> = nearest
            .iter()
            .filter(|found| found.item as usize != i && candidates.contains(&(found.item as usize)))
            .map(|found| found.distance)
            .collect();
        if distances.len() >= wanted {
            distances.sort_unstable_by(f64::total_cmp);
            return Some(distances[wanted - 1]);
        }
        asked *= 2;
    }
}

/// Converts a bound of exact squared distances to one of rounded positions, all at most `largest`.
fn widened(bound: f64, largest: f64) -> f64 {
    // A coordinate is off by half a unit in the last place, a difference by more than twice that.
    let off = 8.0 * f64::EPSILON * largest;
    (bound.sqrt() + off).powi(2) * (1.0 + 1e-9)
}
