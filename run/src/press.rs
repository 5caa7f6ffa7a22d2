//! The true values for the embedded recording, a simulated press and release.
//!
//! Output: times of the press, and the angles of the plane that the dome is pressed on.
//! `run/assets/README.md` describes how the recording was made.

use crate::error::Result;
use crate::source::{EMBEDDED_NAME, embedded};

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
    /// The name of the embedded recording in headers.
    pub const INPUT: &str = EMBEDDED_NAME;

    /// The embedded press.
    ///
    /// # Errors
    /// Never: a test reads it.
    pub fn embedded() -> Result<Self> {
        let rows = truth();
        let touched = rows.iter().position(|(_, [depth, ..])| *depth > 0.0).unwrap_or(0);
        let deepest = rows.iter().map(|(_, [depth, ..])| *depth).fold(0.0, f64::max);
        let end = rows.iter().position(|(_, [depth, ..])| *depth >= deepest).unwrap_or(0);
        Ok(Self {
            first_us: embedded()?.events.first().map_or(0, |event| event.t_us),
            contact_us: rows[touched.saturating_sub(1)].0,
            end_us: rows[end].0,
            angles: [rows[end].1[1], rows[end].1[2]],
        })
    }
}

/// The true values of the embedded recording over time, by name, such as `roll_rad`. Angles are NaN
/// before the contact and after the release: no event can show them.
pub fn truth_over_time() -> (Vec<String>, Vec<(i64, Vec<f64>)>) {
    let names = TRUTH_NAMES.map(str::to_owned).to_vec();
    let row = |(t_us, [depth, angles @ ..]): Truth| {
        let angles = angles.map(|angle| if depth > 0.0 { angle } else { f64::NAN });
        (t_us, [[depth].as_slice(), &angles].concat())
    };
    (names, truth().into_iter().map(row).collect())
}

/// The true values at a time in microseconds.
pub(crate) type Truth = (i64, [f64; 3]);

/// The names of the true values, with their units.
pub(crate) const TRUTH_NAMES: [&str; 3] = ["depth_mm", "roll_rad", "pitch_rad"];

/// The true values, in order of time.
pub(crate) fn truth() -> Vec<Truth> {
    let row = |line: &str| {
        let mut values = line.split(',').map(|text| text.parse().expect("the file has numbers"));
        let mut next = || values.next().expect("a line has four values");
        let t_us: f64 = next();
        (t_us as i64, std::array::from_fn(|_| next()))
    };
    TRUTH.lines().skip(1).map(row).collect()
}
