//! Finds the points that can be among the nearest: a filter in f32 before the exact order.
//!
//! ```text
//! e(i) = ((x(i) - x)^2 w_x + (y(i) - y)^2 w_y) + (t(i) - t)^2 w_t              each rounded
//! T    = the first bound g (L + l S), l = 0..16, with at least `most` e(i) <= T    g guessed
//! ```
//!
//! It finds the points with e(i) <= T (1 + 2^-18). If differences are exact and nothing underflows,
//! e(i) is within 1 +- 2^-21 of the exact value, so the `most` nearest points by exact distance are
//! found, with all points as near as the last of them.

use crate::isa::{Isa, Simd, Task, Vector};
use crate::lanes::{LANES, Wide};

const TOGETHER: usize = 2 * LANES;
/// Largest number of points that are sorted: as many as two vectors hold.
const ORDERED: usize = 2 * TOGETHER;
/// The bits of a distance that are replaced by its index among the found points.
const PLACE: u32 = ORDERED as u32 - 1;
/// Factor on a bound that allows for rounding.
const GENEROUS: f32 = 1.0 + 1.0 / 262_144.0;
const BOUNDS: usize = 16;
/// L.
const FIRST: f32 = 0.4;
/// S.
const STEP: f32 = 0.08;
/// L + 15 S, slightly rounded up.
const MAX: f32 = 1.61;

/// Finds points near a position; owns the working space.
#[derive(Clone, Debug)]
pub struct Nearby {
    weights: [f32; 3],
    distances: Vec<Wide>,
    found: Vec<u32>,
}

impl Nearby {
    /// The number of points must be a multiple of this.
    pub const TOGETHER: usize = TOGETHER;
    /// Largest ratio of a bound to the guess.
    pub const MAX_BOUND: f32 = MAX;

    /// A search with weights w of the squared differences along x, y and t.
    pub fn new(weights: [f32; 3]) -> Self {
        Self { weights, distances: Vec::new(), found: Vec::new() }
    }

    /// Indices of the found `points` except `except`: up to 32 by (e rounded down to 18 bits, later
    /// index first), more ascending. `None` for fewer than `most` within the last bound.
    ///
    /// `points` are x, y and t, padded to a multiple of [`Self::TOGETHER`] at infinity; O(points).
    ///
    /// # Panics
    /// If the lengths differ or are not such a multiple, or there is no point `except`.
    pub fn find(
        &mut self,
        isa: Isa,
        points: [&[f32]; 3],
        place: [f32; 3],
        except: usize,
        most: usize,
        guess: f32,
    ) -> Option<&[u32]> {
        isa.run(Find { nearby: self, points, place, except, most, guess }).then_some(&self.found)
    }
}

struct Find<'a> {
    nearby: &'a mut Nearby,
    points: [&'a [f32]; 3],
    place: [f32; 3],
    except: usize,
    most: usize,
    guess: f32,
}

impl Task for Find<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let Self { nearby: Nearby { weights, distances, found }, points, place, except, most, guess } = self;
        found.clear();
        let vectors = points[0].len() / TOGETHER;
        distances.resize(distances.len().max(vectors), Wide::ZERO);
        let distances = &mut distances[..vectors];
        squared(simd, points, place, *weights, distances);
        distances[except / TOGETHER].0[except % TOGETHER] = f32::INFINITY;
        let Some(bound) = first_bound(simd, distances, most, guess) else { return false };
        let bound = S::V16::splat(simd, bound * GENEROUS);
        let mut keys = [Wide([f32::INFINITY; TOGETHER]); ORDERED / TOGETHER];
        for (chunk, four) in distances.chunks(64 / TOGETHER).enumerate() {
            let mut bits = 0;
            for (v, e) in four.iter().enumerate() {
                bits |= u64::from(S::V16::load(simd, e).at_most(bound)) << (v * TOGETHER);
            }
            while bits != 0 {
                let i = bits.trailing_zeros();
                bits &= bits - 1;
                // If there are more points than are sorted, keys are not used.
                let at = found.len() % ORDERED;
                let e = four[i as usize / TOGETHER].0[i as usize % TOGETHER];
                keys[at / TOGETHER].0[at % TOGETHER] = key(e, at);
                found.push(64 * chunk as u32 + i);
            }
        }
        if found.len() <= ORDERED {
            order(simd, &keys, found);
        }
        true
    }
}

/// e rounded down to 18 bits, then its index: keys are distinct, and later points come first.
#[inline(always)]
fn key(e: f32, place: usize) -> f32 {
    f32::from_bits((e.to_bits() & !PLACE) | (PLACE - place as u32))
}

#[inline(always)]
fn squared<S: Simd>(simd: S, points: [&[f32]; 3], place: [f32; 3], weights: [f32; 3], out: &mut [Wide]) {
    let [(x, []), (y, []), (t, [])] = points.map(|p| p.as_chunks::<TOGETHER>()) else {
        panic!("points must come in multiples of {TOGETHER}");
    };
    assert!(
        x.len() == out.len() && y.len() == out.len() && t.len() == out.len(),
        "points must have x, y and t"
    );
    let place = place.map(|p| S::V16::splat(simd, p));
    let weights = weights.map(|w| S::V16::splat(simd, w));
    for (((out, x), y), t) in out.iter_mut().zip(x).zip(y).zip(t) {
        let [dx, dy, dt] = [
            S::V16::load_slice(simd, x).sub(place[0]),
            S::V16::load_slice(simd, y).sub(place[1]),
            S::V16::load_slice(simd, t).sub(place[2]),
        ];
        let plane = dx.mul(dx).mul(weights[0]).add(dy.mul(dy).mul(weights[1]));
        plane.add(dt.mul(dt).mul(weights[2])).store(out);
    }
}

#[inline(always)]
fn bound(guess: f32, index: usize) -> f32 {
    guess * (FIRST + STEP * index as f32)
}

/// Whether at least `most` of the distances are at most `bound`.
#[inline(always)]
fn holds<S: Simd>(simd: S, distances: &[Wide], most: usize, bound: f32) -> bool {
    let bound = S::V16::splat(simd, bound);
    let mut within = 0;
    for e in distances {
        within += S::V16::load(simd, e).at_most(bound).count_ones();
    }
    within as usize >= most
}

/// The first bound that at least `most` of the distances satisfy.
#[inline(always)]
fn first_bound<S: Simd>(simd: S, distances: &[Wide], most: usize, guess: f32) -> Option<f32> {
    let (mut index, mut half) = (0, BOUNDS / 2);
    while half > 0 {
        index += if holds(simd, distances, most, bound(guess, index + half - 1)) { 0 } else { half };
        half /= 2;
    }
    let bound = bound(guess, index);
    (index + 1 < BOUNDS || holds(simd, distances, most, bound)).then_some(bound)
}

/// Sorts `found`, which has at most as many entries as there are keys, by the keys.
#[inline(always)]
fn order<S: Simd>(simd: S, keys: &[Wide; ORDERED / TOGETHER], found: &mut [u32]) {
    let [low, high] = [S::V16::load(simd, &keys[0]), S::V16::load(simd, &keys[1])];
    let mut ordered = [0; ORDERED];
    for (at, &i) in found.iter().enumerate() {
        let key = S::V16::splat(simd, keys[at / TOGETHER].0[at % TOGETHER]);
        let rank = (low.at_most(key) | high.at_most(key) << TOGETHER).count_ones() - 1;
        ordered[rank as usize] = i;
    }
    found.copy_from_slice(&ordered[..found.len()]);
}
