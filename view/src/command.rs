//! The commands of a page: one JSON object for each.

use serde::Deserialize;

/// A command, as `{"do": "seek", "t_us": 120000}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Go on from the cursor; from the start, if it is at the end.
    Play,
    /// Stop at the cursor. Live events are still taken into the history.
    Pause,
    /// Go to a time in microseconds from the first event: after the last event up to this time.
    Seek {
        /// The time.
        t_us: f64,
    },
    /// Go to just after this number of events.
    SeekEvent {
        /// The number.
        event: f64,
    },
    /// Go some events forward, or back.
    Step {
        /// Number of events; negative goes back.
        events: f64,
    },
    /// Play so many times as fast as the input; live input is followed at any speed.
    Speed {
        /// The factor, above 0.
        times: f64,
    },
    /// Use another network, from the same cursor.
    Network {
        /// Its name.
        name: String,
    },
    /// Start or stop to compare every row with full recomputation, at the cursor.
    Compare {
        /// Whether to compare.
        on: bool,
    },
    /// Show one of several sensors in detail.
    Select {
        /// Its number, from 0.
        sensor: usize,
    },
    /// A page has opened: it needs a frame although nothing has changed.
    Show,
}
