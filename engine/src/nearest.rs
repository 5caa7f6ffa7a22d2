//! The nearest of many candidates.
//!
//! Candidates are collected, and the nearest are selected when the collection is nearly full. No
//! branch depends on a distance; in a sorted list, each candidate would wait for the one before.

use std::ops::Range;

use crate::memory::{FixedVec, Memory};
use crate::queues::NODES;

/// Room for [`FEW`] and [`SEVERAL`] candidates, selected by counting those before each.
const ROOM_FOR_FEW: usize = 32;
const ROOM_FOR_SEVERAL: usize = 64;
const FEW: usize = 8;
const SEVERAL: usize = 24;
const NONE: u32 = u32::MAX;

/// Entries without a candidate: distances beyond all others, all different.
const fn beyond<const ROOM: usize>() -> [f64; ROOM] {
    let (mut beyond, mut at) = ([0.0; ROOM], 0);
    while at < ROOM {
        beyond[at] = f64::MAX / (at + 2) as f64;
        at += 1;
    }
    beyond
}

/// The first `most` of the added candidates in the order (d2 ascending, then later arrival).
#[derive(Clone, Debug)]
pub(crate) struct Nearest {
    most: usize,
    d2: Vec<f64>,
    slots: Vec<u32>,
    len: usize,
    bound: f64,
    /// The last wanted candidate, at the bound's distance; [`NONE`] while there are fewer.
    last: u32,
    sorted: FixedVec<(f64, u32)>,
}
impl Nearest {
    pub(crate) fn new(most: usize, memory: &mut Memory) -> Self {
        let room = if most <= FEW {
            ROOM_FOR_FEW
        } else if most <= SEVERAL {
            ROOM_FOR_SEVERAL
        } else {
            2 * most + NODES
        };
        Self {
            most,
            d2: memory.copies(0.0, room),
            slots: memory.copies(0, room),
            len: 0,
            bound: 0.0,
            last: NONE,
            sorted: memory.room(room),
        }
    }

    /// Starts again, with candidates at a distance of at most `bound`.
    #[inline(always)]
    pub(crate) fn begin(&mut self, bound: f64) {
        (self.len, self.bound, self.last) = (0, bound, NONE);
    }

    /// No candidate beyond this distance is among the nearest.
    #[inline(always)]
    pub(crate) fn bound(&self) -> f64 {
        self.bound
    }

    /// Whether no candidate at `least` or beyond, the latest of them `latest`, can be among the
    /// nearest: of two candidates at the same distance, the later precedes. `arrival` as for
    /// [`Self::add_all`].
    #[inline(always)]
    pub(crate) fn excludes(
        &self,
        least: f64,
        latest: impl FnOnce() -> u32,
        arrival: impl Fn(u32) -> u32,
    ) -> bool {
        least > self.bound
            || least == self.bound && self.last != NONE && arrival(latest()) < arrival(self.last)
    }

    /// Adds the candidates of a block within the bound. `arrival`, larger for later slots, is
    /// called only at equal distances.
    #[inline(always)]
    pub(crate) fn add_all(
        &mut self,
        d2: &[f64; NODES],
        slots: &[u32; NODES],
        nodes: Range<usize>,
        arrival: impl Fn(u32) -> u32,
    ) {
        let (Some(d2), Some(slots)) = (d2.get(nodes.clone()), slots.get(nodes)) else { return };
        let at = self.len;
        let (to_d2, to_slots) = (&mut self.d2[at..at + NODES], &mut self.slots[at..at + NODES]);
        let mut taken = 0;
        for (&d2, &slot) in d2.iter().zip(slots) {
            (to_d2[taken % NODES], to_slots[taken % NODES]) = (d2, slot);
            taken += usize::from(d2 <= self.bound);
        }
        self.len += taken;
        if self.len + NODES > self.d2.len() {
            self.select(arrival);
        }
    }

    /// Adds a candidate if it is within the bound; `arrival` as for [`Self::add_all`].
    #[inline]
    pub(crate) fn add(&mut self, d2: f64, slot: u32, arrival: impl Fn(u32) -> u32) {
        if d2 <= self.bound {
            (self.d2[self.len], self.slots[self.len]) = (d2, slot);
            self.len += 1;
            if self.len + NODES > self.d2.len() {
                self.select(arrival);
            }
        }
    }

    /// Keeps the nearest, in order; [`Self::iter`] needs it. `arrival` as for [`Self::add_all`].
    #[inline(always)]
    pub(crate) fn select(&mut self, arrival: impl Fn(u32) -> u32) {
        let half = self.len <= self.d2.len() / 2;
        let selected = match self.d2.len() {
            ROOM_FOR_FEW if half => self.rank::<{ ROOM_FOR_FEW / 2 }>(),
            ROOM_FOR_FEW => self.rank::<ROOM_FOR_FEW>(),
            ROOM_FOR_SEVERAL if half => self.rank::<{ ROOM_FOR_SEVERAL / 2 }>(),
            ROOM_FOR_SEVERAL => self.rank::<ROOM_FOR_SEVERAL>(),
            _ => false,
        };
        if !selected {
            self.sort(arrival);
        }
        self.len = self.len.min(self.most);
        if self.len == self.most {
            self.bound = self.bound.min(self.d2[self.most - 1]);
            self.last = self.slots[self.most - 1];
        }
    }

    /// Sorts the first candidates, if no two of them are at the same distance.
    #[inline(always)]
    fn rank<const ROOM: usize>(&mut self) -> bool {
        let (Some(all), Some(slots)) =
            (self.d2.first_chunk_mut::<ROOM>(), self.slots.first_chunk_mut::<ROOM>())
        else {
            return false;
        };
        let len = self.len.min(ROOM);
        all[len..].copy_from_slice(&const { beyond::<ROOM>() }[len..]);
        let mut ranks = [0u64; ROOM];
        for &before in &all[..len] {
            for (rank, &d2) in ranks.iter_mut().zip(&*all) {
                *rank += u64::from(before < d2);
            }
        }
        let (mut ordered, mut ordered_slots) = ([0.0; ROOM], [NONE; ROOM]);
        for at in 0..len {
            let rank = ranks[at] as usize % ROOM;
            (ordered[rank], ordered_slots[rank]) = (all[at], slots[at]);
        }
        // Candidates at the same distance have the same rank, and no candidate has the next rank.
        let first = len.min(self.most + 1);
        let distinct = !ordered_slots[..first].contains(&NONE);
        if distinct {
            all[..first].copy_from_slice(&ordered[..first]);
            slots[..first].copy_from_slice(&ordered_slots[..first]);
        }
        distinct
    }

    #[cold]
    #[inline(never)]
    fn sort(&mut self, arrival: impl Fn(u32) -> u32) {
        let Self { d2, slots, sorted, len, .. } = self;
        sorted.clear();
        sorted.extend(d2.iter().copied().zip(slots.iter().copied()).take(*len));
        sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then_with(|| arrival(b.1).cmp(&arrival(a.1))));
        for (at, &candidate) in sorted.iter().enumerate() {
            (d2[at], slots[at]) = candidate;
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// d2 and slots of the selected candidates, in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (f64, u32)> + '_ {
        self.d2[..self.len].iter().copied().zip(self.slots[..self.len].iter().copied())
    }
}
