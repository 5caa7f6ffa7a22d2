//! Messages between fingertip and controller, in addition to the events.
//!
//! Events go to the controller as records of 16 bytes (`meissner_io::record`). The controller sends
//! its target to the fingertip once per cycle. The fingertip sends its state once per millisecond
//! to the sender of the newest target. Least significant byte first:
//!
//! | bytes of a target | value |
//! |---|---|
//! | 0-7 | number of the cycle, u64: an older one is ignored |
//! | 8-15, 16-23 | roll, pitch of the wrist in radians, f64 |
//!
//! | bytes of a state | value |
//! |---|---|
//! | 0-7 | time in microseconds, i64: the clock of the events |
//! | 8-15 | depth in millimetres, f64 |
//! | 16-23, 24-31 | roll, pitch of the wrist in radians, f64 |
//! | 32-35 | phase, u32: 0 approach, 1 press, 2 hold, 3 lift, 4 free |
//! | 36-39 | number of the tap, u32 |

use super::{Angles, Phase};

/// The target direction of the wrist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WristTarget {
    /// Number of the controller's cycle.
    pub cycle: u64,
    /// Roll and pitch in radians.
    pub angles: Angles,
}

/// The fingertip's knowledge of itself, without the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FingertipState {
    /// Time in microseconds, on the clock of the events.
    pub t_us: i64,
    /// Depth of the dome in millimetres.
    pub depth_mm: f64,
    /// Roll and pitch of the wrist in radians.
    pub wrist: Angles,
    /// Its phase.
    pub phase: Phase,
    /// Number of the tap, from 0.
    pub tap: u32,
}

impl Default for FingertipState {
    fn default() -> Self {
        Self { t_us: 0, depth_mm: 0.0, wrist: [0.0; 2], phase: Phase::Approach, tap: 0 }
    }
}

impl WristTarget {
    /// Bytes of a datagram.
    pub const BYTES: usize = 24;

    /// Its bytes.
    pub fn bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; WristTarget::BYTES];
        bytes[..8].copy_from_slice(&self.cycle.to_le_bytes());
        for (place, angle) in bytes[8..].chunks_exact_mut(8).zip(self.angles) {
            place.copy_from_slice(&angle.to_le_bytes());
        }
        bytes
    }

    /// The target in `bytes`; `None` for another length.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        Some(Self { cycle: u64::from_le_bytes(part(bytes, 0)), angles: [8, 16].map(|at| float(bytes, at)) })
    }
}

impl FingertipState {
    /// Bytes of a datagram.
    pub const BYTES: usize = 40;

    /// Its bytes.
    pub fn bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; FingertipState::BYTES];
        bytes[..8].copy_from_slice(&self.t_us.to_le_bytes());
        let floats = [self.depth_mm, self.wrist[0], self.wrist[1]];
        for (place, value) in bytes[8..32].chunks_exact_mut(8).zip(floats) {
            place.copy_from_slice(&value.to_le_bytes());
        }
        bytes[32..36].copy_from_slice(&(self.phase as u32).to_le_bytes());
        bytes[36..].copy_from_slice(&self.tap.to_le_bytes());
        bytes
    }

    /// The state in `bytes`; `None` for another length or an unknown phase.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        Some(Self {
            t_us: i64::from_le_bytes(part(bytes, 0)),
            depth_mm: float(bytes, 8),
            wrist: [16, 24].map(|at| float(bytes, at)),
            phase: Phase::of(u32::from_le_bytes(part(bytes, 32)))?,
            tap: u32::from_le_bytes(part(bytes, 36)),
        })
    }
}

fn float(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(part(bytes, at))
}

fn part<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes[at..at + N].try_into().expect("the length is N")
}
