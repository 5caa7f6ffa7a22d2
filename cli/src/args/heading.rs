//! Headings of the help. Each is given to every option by itself: a heading of a group of arguments would go on over
//! those that follow the group.

pub(crate) const INPUT: &str = "Input";
pub(crate) const NETWORK: &str = "Network";
pub(crate) const PREDICTIONS: &str = "Predictions";
pub(crate) const QUEUE: &str = "Queue";
pub(crate) const MEASUREMENT: &str = "Measurement";
pub(crate) const STATE: &str = "State";
pub(crate) const FRAMES: &str = "Frame networks";
pub(crate) const ELECTRODES: &str = "Electrodes";
pub(crate) const APPROXIMATIONS: &str = "Approximations";
pub(crate) const OUTPUT: &str = "Output";
