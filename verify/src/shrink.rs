//! Smaller streams with a difference: steps are dropped, times and pixels become round.
//!
//! Delta debugging (Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing
//! input"): ever smaller parts are left out as long as the rest still differs. Deterministic.

use meissner_engine::Event;

use crate::stream::Step;

/// Maximum number of streams that are tried.
const TRIES: usize = 4_000;
/// Maximum number of steps that are run, over all tries.
const STEPS: usize = 20_000_000;

/// An input that can be made simpler.
pub(crate) trait Shrink: Clone {
    /// Streams in which step `at` is simpler. Everything else is unchanged or shifted in time.
    fn simpler(steps: &[Step<Self>], at: usize) -> Vec<Vec<Step<Self>>>;
}

/// The smallest stream that was found from `steps` and `fails`. `fails` returns after how many
/// steps.
pub(crate) fn shrink<I: Shrink>(
    mut steps: Vec<Step<I>>,
    mut fails: impl FnMut(&[Step<I>]) -> Option<usize>,
) -> Vec<Step<I>> {
    let (mut tries, mut run) = (0, 0);
    let mut smaller = |mut candidate: Vec<Step<I>>| {
        (tries, run) = (tries + 1, run + candidate.len());
        let end = (tries <= TRIES && run <= STEPS).then(|| fails(&candidate)).flatten()?;
        candidate.truncate(end);
        Some(candidate)
    };
    loop {
        let before = steps.len();
        let mut size = before.div_ceil(2);
        while size > 0 {
            let mut at = 0;
            while at < steps.len() {
                let end = steps.len().min(at + size);
                match smaller([&steps[..at], &steps[end..]].concat()) {
                    Some(found) => steps = found,
                    None => at = end,
                }
            }
            size /= 2;
        }
        let mut simplified = false;
        let mut at = 0;
        while at < steps.len() {
            let found = I::simpler(&steps, at).into_iter().find_map(&mut smaller);
            simplified |= found.is_some();
            match found {
                Some(found) => steps = found,
                None => at += 1,
            }
        }
        if steps.len() == before && !simplified {
            return steps;
        }
    }
}

impl Step<Event> {
    fn time(&self) -> Option<i64> {
        match self {
            Self::Push(event) => Some(event.t_us),
            Self::Advance(t_us) => Some(*t_us),
            _ => None,
        }
    }
}

impl Shrink for Event {
    fn simpler(steps: &[Step<Self>], at: usize) -> Vec<Vec<Step<Self>>> {
        let mut out = Vec::new();
        if let Some(t) = steps[at].time() {
            let before = steps[..at].iter().rev().find_map(Step::time);
            // The distance from the step before; for the first, from 0.
            let gap = i128::from(t) - i128::from(before.unwrap_or(0));
            let power = 10i128.pow(gap.unsigned_abs().checked_ilog10().unwrap_or(0));
            for shorter in [0, gap / power * power, gap / 2] {
                if shorter.abs() >= gap.abs() {
                    continue;
                }
                let mut candidate = steps.to_vec();
                for step in &mut candidate[at..] {
                    if let Step::Push(Event { t_us, .. }) | Step::Advance(t_us) = step {
                        *t_us = (i128::from(*t_us) - (gap - shorter)).clamp(i64::MIN.into(), i64::MAX.into())
                            as i64;
                    }
                }
                out.push(candidate);
            }
        }
        if let Step::Push(event) = steps[at] {
            let pixels = [(0, event.y), (event.x, 0), (event.x / 2, event.y), (event.x, event.y / 2)];
            let moved = pixels.into_iter().map(|(x, y)| Event { x, y, ..event });
            let simpler = moved.chain([Event { on: false, ..event }]).filter(|&simpler| simpler != event);
            out.extend(simpler.map(|event| with(steps, at, Step::Push(event))));
        }
        out
    }
}

impl Shrink for Vec<f32> {
    fn simpler(steps: &[Step<Self>], at: usize) -> Vec<Vec<Step<Self>>> {
        let Step::Push(frame) = &steps[at] else { return Vec::new() };
        let set: Vec<usize> = (0..frame.len()).filter(|&i| frame[i] != 0.0).collect();
        let (first, second) = set.split_at(set.len() / 2);
        let zeroed =
            [&set[..], first, second].into_iter().filter(|places| !places.is_empty()).map(|places| {
                let mut frame = frame.clone();
                places.iter().for_each(|&i| frame[i] = 0.0);
                frame
            });
        let is_round = set.iter().all(|&i| frame[i] == 1.0);
        let rounded = (!is_round).then(|| frame.iter().map(|&v| f32::from(v != 0.0)).collect());
        zeroed.chain(rounded).map(|frame| with(steps, at, Step::Push(frame))).collect()
    }
}

/// `steps` with another step at `at`.
fn with<I: Clone>(steps: &[Step<I>], at: usize, step: Step<I>) -> Vec<Step<I>> {
    let mut steps = steps.to_vec();
    steps[at] = step;
    steps
}
