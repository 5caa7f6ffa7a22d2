//! Bytes as a network and a stream: the engine against the batch, bit for bit.

use meissner_engine::{Candidates, Event, GraphRule, Lifetime, Reach, Search, Sensor};
use meissner_verify::CheckedEngine;
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use meissner_verify::{Script, Step};

use crate::Verdict;

/// Maximum number of steps of a stream, and of comparisons: each comparison is a batch from
/// scratch.
const STEPS: usize = 120;
const COMPARISONS: usize = 12;

/// The event graph alone under pushes, `advance` and resets; neighbourhoods against all pairs.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn graph(bytes: &[u8]) -> Verdict {
    let mut choices = Choices::new(bytes);
    let shape = NetworkShape {
        graph: rule(&mut choices),
        span_us: i64::from(choices.u16()) + 1,
        capacity: choices.within(1, 48),
        place: None,
        blocks: vec![],
        pooled: vec![],
        from: 0,
        grid: [1, 1],
        dense: vec![1],
        head: None,
        seed: 1,
    };
    let sensor = Sensor::new(choices.within(1, 70) as u16, choices.within(1, 70) as u16);
    let mut checked = CheckedEngine::new(shape.build(), sensor, Search::Exhaustive);
    let mut now = choices.option(Choices::u64).unwrap_or(0) as i64;
    let mut comparisons = 0;
    for _ in 0..STEPS {
        if choices.is_empty() {
            break;
        }
        let (verb, step) = (choices.byte(), choices.byte());
        now = match step {
            0..200 => now.saturating_add(step.into()),
            200..230 => now.saturating_sub((step - 199).into()),
            230..250 => now.saturating_add(choices.u16().into()),
            250.. => choices.u64() as i64,
        };
        match verb {
            0..220 => {
                // A few pixels lie outside the sensor.
                let pixel = |choice: u8, side: u16| u16::from(choice) % (side + side.div_ceil(16));
                let (x, y) = (pixel(choices.byte(), sensor.width), pixel(choices.byte(), sensor.height));
                checked.push(Event::new(now, x, y, verb & 1 == 1));
            }
            220..235 => checked.advance(now),
            235..238 => checked.reset(),
            _ if comparisons < COMPARISONS => {
                comparisons += 1;
                assert_eq!(checked.compare(), Ok(()));
            }
            _ => {}
        }
    }
    assert_eq!(checked.compare(), Ok(()));
    assert_eq!(checked.compare_with(Search::Grid), Ok(()));
    Verdict::Accepted
}

/// A network of any kind under any interleaving of the engine's calls: every row of every layer.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn interleavings(bytes: &[u8]) -> Verdict {
    let mut choices = Choices::new(bytes);
    let mut shape = NetworkShape {
        graph: rule(&mut choices),
        span_us: 50 + i64::from(choices.u16()) % 2_000,
        capacity: choices.within(1, 40),
        place: None,
        blocks: choices.list(0, 3, block),
        pooled: choices.list(0, 2, pool),
        from: choices.within(0, 7),
        grid: [choices.within(1, 5), choices.within(1, 4)],
        dense: choices.list(1, 3, |choices| choices.within(1, 9)),
        head: choices.option(|choices| choices.within(1, 9)),
        seed: choices.byte().into(),
    };
    let sensor = Sensor::new(choices.within(1, 70) as u16, choices.within(1, 70) as u16);
    let origins = [0, 1_700_000_000_000_000, -77, i64::MIN / 2];
    let origin_us = origins[choices.within(0, 3)];
    shape.place = choices.flag().then_some([(1, 7), (3, 10)]);
    let mut comparisons = 0;
    let mut steps = Vec::new();
    while !choices.is_empty() && steps.len() < STEPS && comparisons < COMPARISONS {
        let step = relative(&mut choices);
        comparisons += usize::from(step.is_compared());
        steps.push(step);
    }
    let script = Script::new(sensor, origin_us, steps);
    let mut checked = CheckedEngine::new(shape.build(), sensor, Search::Exhaustive);
    assert_eq!(checked.run(&script), Ok(()));
    Verdict::Accepted
}

fn rule(choices: &mut Choices<'_>) -> GraphRule {
    let reach = if choices.flag() {
        Reach::Knn { k: choices.within(1, 24) }
    } else {
        Reach::Radius { r: 0.05 + f64::from(choices.byte()) / 160.0, max: choices.within(1, 24) }
    };
    let candidates =
        [Candidates::All, Candidates::Past(Lifetime::Window), Candidates::Past(Lifetime::Frozen)];
    GraphRule { reach, candidates: candidates[choices.within(0, 2)] }
}

fn block(choices: &mut Choices<'_>) -> BlockShape {
    let kernel = [choices.within(2, 4), choices.within(2, 4), choices.within(1, 4)];
    let extras = choices.byte();
    BlockShape {
        channels: choices.within(1, 9),
        conv: ConvolutionShape::of(extras >> 4 & 7, kernel),
        input: choices.within(0, 7),
        skip: choices.option(|choices| choices.within(0, 7)),
        extras: [0, 1, 2, 3].map(|bit| extras >> bit & 1 == 1),
    }
}

fn pool(choices: &mut Choices<'_>) -> PoolShape {
    let fraction =
        |choices: &mut Choices<'_>, n, d| (choices.within(1, n) as u32, choices.within(1, d) as u32);
    PoolShape {
        from: choices.within(0, 7),
        cell: [fraction(choices, 4, 9), fraction(choices, 4, 9)],
        time: choices.option(|choices| fraction(choices, 3, 7)),
        mean: choices.flag(),
        blocks: choices.list(0, 2, block),
    }
}

/// A step whose time counts from the step before.
fn relative(choices: &mut Choices<'_>) -> Step {
    match choices.byte() {
        0..200 => {
            let step = choices.byte();
            let dt = match step {
                0..180 => i64::from(step),
                180..200 => i64::from(step) - 200,
                200.. => i64::from(choices.u16()) % 1_500,
            };
            let (x, y) = (choices.byte().into(), choices.byte().into());
            Step::Push(Event::new(dt, x, y, choices.flag()))
        }
        200..215 => Step::Advance(i64::from(choices.u16()) % 3_000),
        215..218 => Step::Reset,
        218..222 => Step::Snapshot,
        222.. => Step::Predict,
    }
}

/// Bytes as choices, taken one after the other; after their end, zeros.
pub(crate) struct Choices<'a> {
    bytes: &'a [u8],
}

impl<'a> Choices<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.bytes.split_first() else { return 0 };
        self.bytes = rest;
        first
    }

    pub(crate) fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    pub(crate) fn u16(&mut self) -> u16 {
        u16::from_le_bytes([self.byte(), self.byte()])
    }

    pub(crate) fn u64(&mut self) -> u64 {
        (0..4).fold(0, |word, _| word << 16 | u64::from(self.u16()))
    }

    /// A number from `low` to `high`, from a byte.
    pub(crate) fn within(&mut self, low: usize, high: usize) -> usize {
        low + usize::from(self.byte()) % (high - low + 1)
    }

    pub(crate) fn option<T>(&mut self, some: impl FnOnce(&mut Self) -> T) -> Option<T> {
        if self.flag() { Some(some(self)) } else { None }
    }

    /// Up to `most` items.
    pub(crate) fn list<T>(&mut self, least: usize, most: usize, item: impl Fn(&mut Self) -> T) -> Vec<T> {
        (0..self.within(least, most)).map(|_| item(self)).collect()
    }
}
