//! Handwritten digits in front of a moving event camera (N-MNIST, 34 x 34 pixels): 10 classes.
//!
//! - [`CLASSES`]: the digits, in the order of a network's outputs; [`SENSOR`]: the pixels,
//! - [`trained_as`]: the network whose weights a network runs with.

use meissner_engine::Sensor;

/// Names of the classes, in the order of their indices.
pub const CLASSES: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// The sensor of all recordings.
pub const SENSOR: Sensor = Sensor { width: 34, height: 34 };

/// Networks that run with the weights of another network, and that network.
const SHARED_WEIGHTS: &[(&str, &str)] = &[("digits-frozen", "digits-past")];

/// The network that the weights of `network` were trained as: itself, or one that shares them.
pub fn trained_as(network: &str) -> &str {
    SHARED_WEIGHTS.iter().find(|(name, _)| *name == network).map_or(network, |(_, trained)| trained)
}
