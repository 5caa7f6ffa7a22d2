//! The parts of its state that an engine shows: the window, its graph, its rows, and the computed
//! rows.
//!
//! Input: a state. Output: copies in a batch's order. No push or prediction calls these methods;
//! each method allocates its result.

use meissner_kernels::Neighbour;

use super::Engine;
use crate::Event;
use crate::counters::ComputedRow;
#[cfg(doc)]
use crate::network::Network;

impl Engine {
    /// Events of the window from oldest to newest, with their accepted times.
    pub fn events(&self) -> Vec<Event> {
        let epoch = self.admission.epoch_us().unwrap_or(0);
        let nodes = self.step.window.slots().map(|slot| self.step.window.node(slot));
        nodes.map(|n| Event::new(epoch + n.t, n.x, n.y, n.on)).collect()
    }

    /// Rows of a feature of a level (see [`Network`]) as of the last prediction, in a batch's
    /// order: events by arrival, cells by (t, y, x).
    ///
    /// # Panics
    /// If there is no such level or feature.
    pub fn feature(&self, level: usize, feature: usize) -> Vec<Vec<f32>> {
        let matrix = self.step.activations[level].feature(feature);
        self.step.rows(level).iter().map(|&row| matrix.values(row as usize).collect()).collect()
    }

    /// Index of the cell of each row of a pooled level along x, y and t, as in [`Engine::feature`];
    /// empty for the event level. Times count from the epoch, in cells.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn cells(&self, level: usize) -> Vec<[i64; 3]> {
        let Some(level) = level.checked_sub(1) else { return Vec::new() };
        let graph = &self.step.pooled[level];
        graph.cells().into_iter().map(|cell| graph.index(cell)).collect()
    }

    /// Readout of the last prediction: (times x cells, channels), newest grid first.
    pub fn readout(&self) -> Vec<Vec<f32>> {
        let readout = self.step.readout();
        (0..readout.rows()).map(|cell| readout.values(cell).collect()).collect()
    }

    /// Values of the last prediction; computes nothing. Empty before the first one, and if it was
    /// not a number.
    pub fn last_prediction(&self) -> &[f32] {
        self.step.prediction().unwrap_or_default()
    }

    /// Rows of each of [`Network::layers`] that were computed for the last prediction or since, and
    /// are still present, ascending. Empty without [`Options::record_rows`](crate::Options).
    ///
    /// Between two predictions, at most as many are recorded as the level has rows. O(recorded
    /// rows) for the event level, O(cells) for a pooled one.
    pub fn computed_rows(&self) -> Vec<Vec<ComputedRow>> {
        let mut layers = self.log.layers.iter();
        let mut out = Vec::with_capacity(self.log.layers.len());
        for level in 0..self.network.levels() {
            let place = self.place_of_slot(level);
            for log in layers.by_ref().take(self.network.layers_of(level)) {
                let rows = log.rows.as_ref().map_or(&[][..], |rows| &rows[..]);
                let present = rows.iter().filter_map(|&(slot, changed)| Some((place(slot)?, changed)));
                let mut rows: Vec<_> = present.map(|(row, changed)| ComputedRow { row, changed }).collect();
                rows.sort_unstable();
                // A row that was computed twice has changed if one computation changed it.
                rows.dedup_by(|next, row| {
                    next.row == row.row && {
                        row.changed |= next.changed;
                        true
                    }
                });
                out.push(rows);
            }
        }
        out
    }

    /// The index of a slot's row in its level; `None` for a slot that is free now.
    fn place_of_slot(&self, level: usize) -> impl Fn(u32) -> Option<usize> + '_ {
        let window = &self.step.window;
        let mut cells: Vec<(u32, usize)> = Vec::new();
        if level > 0 {
            cells = self.step.rows(level).into_iter().zip(0..).collect();
            cells.sort_unstable();
        }
        move |slot| match level {
            0 => Some(window.age_rank(slot) as usize).filter(|&place| place < window.len()),
            _ => cells.binary_search_by_key(&slot, |(cell, _)| *cell).ok().map(|at| cells[at].1),
        }
    }

    /// The indices of [`Self::computed_rows`].
    #[doc(hidden)]
    pub fn recomputed(&self) -> Vec<Vec<usize>> {
        let layers = self.computed_rows().into_iter();
        layers.map(|rows| rows.into_iter().map(|row| row.row).collect()).collect()
    }

    /// Neighbourhood of the event at `index` from the oldest, in order: indices in the window and
    /// attributes, without neighbours that have left.
    ///
    /// # Panics
    /// If there is no such event.
    pub fn neighbourhood(&self, index: usize) -> Vec<Neighbour> {
        let window = &self.step.window;
        assert!(index < window.len(), "the window has that many events");
        let slot = window.slot_of(index as u32);
        let edges = self.step.graph.present(window, slot);
        edges.map(|n| Neighbour { row: window.age_rank(n.row), ..n }).collect()
    }
}
