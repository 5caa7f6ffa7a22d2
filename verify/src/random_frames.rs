//! Random sequences of frames: mostly zero, often equal to the frame before or in part, sometimes all new.

use meissner_models::random::Random;

use crate::step::Step;

/// A random sequence of frames of `values` values each, between predictions, resets and returns of states.
pub(crate) fn random_frames(values: usize, random: &mut Random) -> Vec<Step<Vec<f32>>> {
    let mut frame = vec![0.0; values];
    let mut steps = Vec::new();
    for _ in 0..=random.below(12) {
        next_frame(&mut frame, random);
        steps.push(Step::Push(frame.clone()));
        match random.below(16) {
            0 => steps.push(Step::Reset),
            1 => steps.push(Step::Snapshot),
            2 => steps.push(Step::Bytes),
            3..12 => steps.push(Step::Predict),
            _ => {}
        }
    }
    steps
}

/// Turns `frame` into the next one.
pub(crate) fn next_frame(frame: &mut Vec<f32>, random: &mut Random) {
    match random.below(8) {
        0 => frame.fill(0.0),
        1 => *frame = random.values(frame.len(), 1.0),
        2 => {}
        changes => {
            for _ in 0..changes {
                let at = random.below(frame.len() as u64) as usize;
                frame[at] = if random.below(3) == 0 { 0.0 } else { random.symmetric() };
            }
        }
    }
}
