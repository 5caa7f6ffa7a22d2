//! Signed frames of one channel: the input of the contact-angle paper's event-frame network.
//!
//! Enters: events. Leaves: frames of shape (1, height, width); a pixel is the sum of its events' polarities (+1 for ON,
//! -1 for OFF), or the polarity of its latest event, and 0 where it has none. Sums are integers.

mod consecutive;
mod sliding;

pub use consecutive::SignedWindows;
pub use sliding::SlidingSigned;

use crate::representations::consecutive::Rule;

/// What a pixel shows of its events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SignedRule {
    /// The sum of their polarities.
    #[default]
    Sum,
    /// The polarity of the one that arrived last.
    Latest,
}

impl From<SignedRule> for Rule {
    fn from(rule: SignedRule) -> Self {
        match rule {
            SignedRule::Sum => Self::Sum,
            SignedRule::Latest => Self::Latest,
        }
    }
}
