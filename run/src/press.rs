//! What a network should say about the embedded recording, a simulated press and release.
//!
//! Enters: nothing. Leaves: times of the press, and the angles of the plane that the dome is
//! pressed on. `run/assets/README.md` says how it was made.

use crate::error::Result;
use crate::source::embedded;

const TRUTH: &str = include_str!("../assets/dome_press.csv");

/// The press.
pub struct Press {
    /// Time of the first event, in microseconds.
    pub first_us: i64,
    /// Time of the contact, in microseconds.
    pub contact_us: i64,
    /// Time when the dome is pressed deepest, in microseconds. It is then held and lifted.
    pub end_us: i64,
    /// Angles of the plane about x and y in radians. They are those of the whole press.
    pub angles: [f64; 2],
}

impl Press {
    /// The embedded press.
    ///
    /// # Errors
    /// Never: a test reads it.
    pub fn embedded() -> Result<Self> {
        let rows = truth();
        let touched = rows.iter().position(|row| row[1] > 0.0).unwrap_or(0);
        let deepest = rows.iter().map(|row| row[1]).fold(0.0, f64::max);
        let end = rows.iter().position(|row| row[1] >= deepest).unwrap_or(0);
        Ok(Self {
            first_us: embedded()?.events.first().map_or(0, |event| event.t_us),
            contact_us: rows[touched.saturating_sub(1)][0] as i64,
            end_us: rows[end][0] as i64,
            angles: [rows[end][2], rows[end][3]],
        })
    }
}

/// Time in microseconds, depth in mm, roll and pitch in radians.
pub(crate) fn truth() -> Vec<[f64; 4]> {
    let number = |text: &str| text.parse().expect("the file has numbers");
    let row = |line: &str| {
        let mut values = line.split(',').map(number);
        std::array::from_fn(|_| values.next().expect("a line has four values"))
    };
    TRUTH.lines().skip(1).map(row).collect()
}
