//! When the dome touches the plane: the phases of a tap, which repeats.
//!
//! Enters: a time. Leaves: phase and depth.
//!
//! The times fit the networks for contact angles. They were trained on presses of 90 to 200 ms that
//! begin at rest, and read the events of the last 150 ms: at the end of the hold they are those of
//! this press alone, because the phases between two contacts are longer than the window.

/// What the fingertip does.
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
pub const TAP_US: i64 = {
    let (mut sum, mut i) = (0, 0);
    while i < PHASES.len() {
        sum += PHASES[i].1;
        i += 1;
    }
    sum
};

/// How deep the dome is pressed, in millimetres.
pub const DEPTH_MM: f64 = 10.0;

impl Phase {
    /// The phase at `t_us` microseconds after the start of the first tap, and its share that has
    /// passed.
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
