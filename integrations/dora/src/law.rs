//! The law of the controller: from predicted angles to a turn.
//!
//! A network for contact angles predicts by which roll and pitch the touched plane is tilted. Turning the fingertip by that levels it. The law
//! turns by a share of the prediction, so that errors of single predictions are averaged, and by no more than a limit in one command.

/// A proportional law with a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Law {
    /// Share of the predicted angle, for each command.
    pub(crate) gain: f64,
    /// Largest turn of a command in radians, in each direction.
    pub(crate) limit: f64,
}

impl Law {
    /// The turn in radians about x and y for a prediction of roll and pitch in radians. Without two finite values there is no turn.
    pub(crate) fn turn(&self, predicted: &[f32]) -> [f64; 2] {
        let turn = |angle: f32| (self.gain * f64::from(angle)).clamp(-self.limit, self.limit);
        match *predicted {
            [roll, pitch] if roll.is_finite() && pitch.is_finite() => [turn(roll), turn(pitch)],
            _ => [0.0; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Law;

    #[test]
    fn a_turn_is_a_share_of_the_prediction_within_the_limit() {
        let law = Law { gain: 0.5, limit: 0.1 };
        assert_eq!(law.turn(&[0.125, -0.0625]), [0.0625, -0.03125]);
        assert_eq!(law.turn(&[7.0, -7.0]), [0.1, -0.1]);
    }

    #[test]
    fn what_is_no_pair_of_angles_turns_nothing() {
        let law = Law { gain: 0.5, limit: 0.1 };
        for predicted in [&[][..], &[0.1], &[0.1, 0.1, 0.1], &[f32::NAN, 0.1], &[0.1, f32::INFINITY]] {
            assert_eq!(law.turn(predicted), [0.0; 2]);
        }
    }
}
