//! Direction of slip from the readings of a tactile array: what stands behind the network.
//!
//! - [`DecisionFilter`]: the classes of one window after the other into a decision that stands until others agree.

mod decision;

pub use decision::{Decision, DecisionError, DecisionFilter};
