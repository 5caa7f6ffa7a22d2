//! The plants of closed loops: objects that a controller moves, as a sensor sees them.
//!
//! Input: the actions of the controller, and time. Output: the sensor's data, and the truth to
//! judge the controller. Equal input and an equal seed give equal output.
//!
//! - [`Fingertip`]: a soft dome on a [`Wrist`] taps a tilted [`Surface`], seen by an event camera;
//!   a controller in any process moves it by the target of the wrist ([`WristTarget`],
//!   [`FingertipState`]);
//! - [`BallOnGel`]: a ball is pressed into a gel and rolls on it, seen by a camera of pictures; a
//!   controller moves it by motions.
//!
//! The times of a tap fit the networks for contact angles. They were trained on presses of 90 to
//! 200 ms that begin at rest, and read the events of the last 150 ms: at the end of the hold these
//! events are of this press alone, because the phases between two contacts are longer.

mod ball;
mod datagrams;
mod fingertip;

pub use ball::{BallContact, BallOnGel, ball_depth_mm};
pub use datagrams::{FingertipState, WristTarget};
pub use fingertip::{FINGERTIP_SENSOR, Fingertip, TICK_US, presses};

/// Roll and pitch in radians, about x and y. They are small, so they are added like vectors.
pub type Angles = [f64; 2];

/// The size of `angles` together: the tilt, in radians.
pub fn tilt([roll, pitch]: Angles) -> f64 {
    libm::sqrt(roll * roll + pitch * pitch)
}

/// A phase of the fingertip's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// In the air; the wrist is braked.
    Approach = 0,
    /// The depth rises.
    Press = 1,
    /// The depth is constant: the moment to read a prediction.
    Hold = 2,
    /// The depth falls.
    Lift = 3,
    /// In the air; the wrist turns.
    Free = 4,
}

/// Phases in order with their durations in microseconds.
const PHASES: [(Phase, i64); 5] = [
    (Phase::Approach, 100_000),
    (Phase::Press, 120_000),
    (Phase::Hold, 30_000),
    (Phase::Lift, 120_000),
    (Phase::Free, 430_000),
];

/// Duration of a tap in microseconds: 0.8 s.
pub const TAP_US: i64 = PHASES[0].1 + PHASES[1].1 + PHASES[2].1 + PHASES[3].1 + PHASES[4].1;

/// Depth to which the dome is pressed, in millimetres.
pub const DEPTH_MM: f64 = 10.0;

impl Phase {
    /// The phase at `t_us` since the start of the first tap, and its share that has passed.
    pub fn at(t_us: i64) -> (Self, f64) {
        let mut within = t_us.rem_euclid(TAP_US);
        for (phase, duration) in PHASES {
            if within < duration {
                return (phase, within as f64 / duration as f64);
            }
            within -= duration;
        }
        unreachable!("the rest is less than the sum")
    }

    /// The phase of a number in a datagram.
    pub fn of(number: u32) -> Option<Self> {
        PHASES.map(|(phase, _)| phase).into_iter().find(|&phase| phase as u32 == number)
    }

    /// Whether markers move.
    pub fn moves(self) -> bool {
        matches!(self, Self::Press | Self::Lift)
    }
}

/// Depth in millimetres at `t_us`, with a smooth start and end.
pub fn depth_mm(t_us: i64) -> f64 {
    let smooth = |share: f64| share * share * (3.0 - 2.0 * share);
    DEPTH_MM
        * match Phase::at(t_us) {
            (Phase::Approach | Phase::Free, _) => 0.0,
            (Phase::Press, share) => smooth(share),
            (Phase::Hold, _) => 1.0,
            (Phase::Lift, share) => 1.0 - smooth(share),
        }
}

/// The tilt of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// Always the same angles, in radians.
    Fixed(Angles),
    /// The course of [`COURSE`].
    Course,
}

/// Number of a tap, and roll and pitch in degrees from this tap on: two jumps, then a slow turn,
/// whose taps lie on a line between the last two entries.
pub const COURSE: [(u32, Angles); 4] =
    [(0, [4.0, -3.0]), (6, [-1.5, 2.5]), (12, [2.0, 5.0]), (24, [-4.0, 0.0])];

impl Surface {
    /// Roll and pitch of the plane at a tap, in radians.
    pub fn at(&self, tap: u32) -> Angles {
        let degrees = match *self {
            Self::Fixed(angles) => return angles,
            Self::Course => {
                let [.., (from, start), (to, end)] = COURSE;
                if tap < from {
                    COURSE.iter().rev().find(|(first, _)| *first <= tap).map_or(start, |(_, angles)| *angles)
                } else {
                    let share = f64::from(tap.min(to) - from) / f64::from(to - from);
                    [0, 1].map(|axis| start[axis] + share * (end[axis] - start[axis]))
                }
            }
        };
        degrees.map(f64::to_radians)
    }
}

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
    /// The direction of the wrist.
    pub fn angles(&self) -> Angles {
        self.angles
    }

    /// Sets the target, within range. An angle that is not finite is ignored.
    pub fn aim(&mut self, target: Angles) {
        for (own, angle) in self.target.iter_mut().zip(target).filter(|(_, angle)| angle.is_finite()) {
            *own = angle.clamp(-MAX_ANGLE, MAX_ANGLE);
        }
    }

    /// Turns for `seconds`, which should be short compared with the lag.
    pub fn turn(&mut self, seconds: f64) {
        for (angle, target) in self.angles.iter_mut().zip(self.target) {
            *angle += ((target - *angle) / LAG_S).clamp(-MAX_SPEED, MAX_SPEED) * seconds;
        }
    }
}
