//! The simulated actuator: a wrist that turns the dome about two axes.
//!
//! Enters: a target, time that passes. Leaves: the angles. Each axis follows its target with a lag
//! of first order and a limit of speed: `d angle / dt = clamp((target - angle) / lag, -speed,
//! speed)`.

use super::Angles;

/// Time constant in seconds.
const LAG_S: f64 = 0.015;
/// Greatest speed of an axis, in radians per second.
const MAX_SPEED: f64 = 2.0;
/// Greatest angle of an axis, in radians.
const MAX_ANGLE: f64 = 0.35;

/// A wrist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrist {
    angles: Angles,
    target: Angles,
}

impl Wrist {
    /// Where it points.
    pub fn angles(&self) -> Angles {
        self.angles
    }

    /// Sets the target. An angle that is not finite is ignored, and one out of range is moved to
    /// its end.
    pub fn aim(&mut self, target: Angles) {
        for (own, angle) in self.target.iter_mut().zip(target).filter(|(_, angle)| angle.is_finite()) {
            *own = angle.clamp(-MAX_ANGLE, MAX_ANGLE);
        }
    }

    /// Turns for `seconds`, which should be short beside the lag.
    pub fn turn(&mut self, seconds: f64) {
        for (angle, target) in self.angles.iter_mut().zip(self.target) {
            *angle += ((target - *angle) / LAG_S).clamp(-MAX_SPEED, MAX_SPEED) * seconds;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{MAX_ANGLE, MAX_SPEED, Wrist};

    #[test]
    fn a_wrist_turns_no_faster_than_its_limit_and_arrives() {
        let mut wrist = Wrist::default();
        wrist.aim([0.14, f64::NAN]);
        let mut before = 0.0;
        for _ in 0..130 {
            wrist.turn(0.001);
            let [roll, pitch] = wrist.angles();
            assert!(roll - before <= MAX_SPEED * 0.001 + 1e-12 && pitch == 0.0);
            before = roll;
        }
        assert!((before - 0.14).abs() < 0.002, "{before}");
        wrist.aim([9.0, -9.0]);
        (0..1000).for_each(|_| wrist.turn(0.001));
        assert!((wrist.angles()[0] - MAX_ANGLE).abs() < 1e-6 && (wrist.angles()[1] + MAX_ANGLE).abs() < 1e-6);
    }
}
