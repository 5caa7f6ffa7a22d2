//! The plane that the dome taps.
//!
//! Enters: the number of a tap. Leaves: the angles of the plane, which do not change during a tap.

use super::Angles;

/// How the plane is tilted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// Always the same angles, in radians.
    Fixed(Angles),
    /// The course of [`COURSE`].
    Course,
}

/// Number of a tap, and roll and pitch in degrees from it on: two jumps, then a slow turn, whose
/// taps lie on a line between the last two.
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
