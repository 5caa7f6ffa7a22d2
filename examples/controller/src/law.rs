//! The law of levelling: from the predicted angle of the contact to the target of the wrist.
//!
//! Enters: the state of the fingertip, a prediction. Leaves: the target, which does not change outside of holds.
//!
//! While a press is held, the wrist is braked, and a prediction for all events of the press is the angle by which the dome must still be
//! turned. So the target is `wrist + GAIN prediction`, again in each cycle: the last one before the lift counts. A prediction that is stale
//! or lacks events is an angle of a part of the press, and the law turns by that.

use crate::Angles;
use crate::datagrams::State;
use crate::tap::Phase;

/// Share of the predicted angle by which the wrist is turned. Below 1, so that the errors of single predictions are averaged.
pub const GAIN: f64 = 0.8;

/// The law, and its last target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Levelling {
    target: Angles,
}

impl Levelling {
    /// The target of the wrist in radians, from the fingertip's newest state and a prediction of roll and pitch in radians. A prediction
    /// without two values changes nothing.
    pub fn target(&mut self, state: &State, predicted: &[f32]) -> Angles {
        if let (Phase::Hold, &[roll, pitch]) = (state.phase, predicted) {
            self.target = [state.wrist[0] + GAIN * f64::from(roll), state.wrist[1] + GAIN * f64::from(pitch)];
        }
        self.target
    }
}

#[cfg(test)]
mod tests {
    use super::{GAIN, Levelling};
    use crate::datagrams::State;
    use crate::tap::Phase;

    #[test]
    fn the_target_moves_in_holds_only_and_not_with_the_number_of_cycles() {
        let mut law = Levelling::default();
        let mut state = State { phase: Phase::Press, wrist: [0.1, -0.1], ..State::default() };
        assert_eq!(law.target(&state, &[0.5, 0.5]), [0.0, 0.0]);
        state.phase = Phase::Hold;
        for _ in 0..3 {
            assert_eq!(law.target(&state, &[0.5, 0.25]), [0.1 + GAIN * 0.5, -0.1 + GAIN * 0.25]);
        }
        state.phase = Phase::Lift;
        assert_eq!(law.target(&state, &[0.0, 0.0]), [0.1 + GAIN * 0.5, -0.1 + GAIN * 0.25]);
    }
}
