//! The plants of closed loops: what a controller moves, as a sensor sees it.
//!
//! Enters: what the controller does, and time. Leaves: what the sensor sees, and what is true, to
//! judge the controller by. Equal input and an equal seed give equal output.
//!
//! | plant | moved by | seen by |
//! |---|---|---|
//! | [`Fingertip`]: a soft dome on a [`Wrist`] taps a tilted [`Surface`] | the target of the wrist, in any process: [`WristTarget`], [`FingertipState`] | an event camera |
//! | [`BallOnGel`]: a ball is pressed into a gel and rolls on it | motions | a camera of pictures |

mod ball;
mod datagrams;
mod fingertip;
mod tap;

pub use ball::{BallContact, BallOnGel, ball_depth_mm};
pub use datagrams::{FingertipState, WristTarget};
pub use fingertip::{FINGERTIP_SENSOR, Fingertip, TICK_US, presses};
pub use tap::Wrist;
pub use tap::{COURSE, Surface};
pub use tap::{DEPTH_MM, Phase, TAP_US, depth_mm};

/// Angles about x and y in radians: roll and pitch. They are small, so they are added and
/// subtracted like vectors.
pub type Angles = [f64; 2];

/// The size of `angles` together: the tilt, in radians.
pub fn tilt([roll, pitch]: Angles) -> f64 {
    libm::sqrt(roll * roll + pitch * pitch)
}
