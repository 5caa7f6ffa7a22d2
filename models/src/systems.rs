//! The parts of a system around a network: from the sensor's values to the input, and from the
//! output to the values that a controller reads.

pub mod contact_area;
pub mod slip;

use thiserror::Error;

/// A network predicts other classes or values than those of a task.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("network {network}: expected the outputs {expected}, found {found}")]
#[non_exhaustive]
pub struct OutputsError {
    /// Name of the network.
    pub network: String,
    /// Names of the classes.
    pub expected: String,
    /// Names of its outputs.
    pub found: String,
}

/// `Ok` if the `outputs` of `network` are `classes`.
///
/// # Errors
/// [`OutputsError`] if they differ.
pub fn check_outputs(network: &str, outputs: &[String], classes: &[&str]) -> Result<(), OutputsError> {
    if outputs == classes {
        return Ok(());
    }
    let (expected, found) = (classes.join(", "), outputs.join(", "));
    Err(OutputsError { network: network.to_owned(), expected, found })
}

pub mod digits {
    //! Handwritten digits in front of a moving event camera (N-MNIST, 34 x 34 pixels): 10 classes.
    //!
    //! - [`CLASSES`]: the digits, in the order of a network's outputs; [`SENSOR`]: the pixels,
    //! - [`trained_as`]: the network whose weights a network uses.

    use meissner_engine::Sensor;

    /// Names of the classes, in the order of their indices.
    pub const CLASSES: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];

    /// The sensor of all recordings.
    pub const SENSOR: Sensor = Sensor { width: 34, height: 34 };

    /// Networks that use the weights of another network, and that network.
    const SHARED_WEIGHTS: &[(&str, &str)] = &[("digits-frozen", "digits-past")];

    /// The network with which the weights of `network` were trained: itself, or one that shares
    /// them.
    pub fn trained_as(network: &str) -> &str {
        SHARED_WEIGHTS.iter().find(|(name, _)| *name == network).map_or(network, |(_, trained)| trained)
    }
}

pub mod touch {
    //! Objects and containers in a gripper under a tactile skin with 39 taxels (`NeuTouch`).
    //!
    //! - [`OBJECTS`], [`CONTAINERS`]: the classes, in the order of outputs; the data contain their
    //!   numbers.
    //! - [`SENSOR`]: the pixels, steps of 0.05 mm.

    use meissner_engine::Sensor;

    /// Names of the objects, in the order of their indices.
    pub const OBJECTS: [&str; 36] = [
        "0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13", "14", "15", "16", "17",
        "18", "19", "20", "21", "22", "23", "24", "25", "26", "27", "28", "29", "30", "31", "32", "33", "34",
        "35",
    ];

    /// Names of the containers, each with five fillings, in the order of their indices.
    pub const CONTAINERS: [&str; 20] = {
        let mut names = [""; 20];
        let mut i = 0;
        while i < names.len() {
            names[i] = OBJECTS[i];
            i += 1;
        }
        names
    };

    /// The sensor of all recordings.
    pub const SENSOR: Sensor = Sensor { width: 241, height: 357 };
}

pub mod letters {
    //! Letters of braille under an event skin with 8 x 10 taxels (`NUSkin`): 27 classes.
    //!
    //! - [`CLASSES`]: the letters and a blank, in the order of a network's outputs.
    //! - [`SENSOR`]: a pixel for each taxel.

    use meissner_engine::Sensor;

    /// Names of the letters, in the order of their indices.
    pub const CLASSES: [&str; 27] = [
        "A", "B", "C", "D", "E", "F", "G", "H", "I", "J", "K", "L", "M", "N", "O", "P", "Q", "R", "S", "T",
        "U", "V", "W", "X", "Y", "Z", "space",
    ];

    /// The sensor of all recordings.
    pub const SENSOR: Sensor = Sensor { width: 10, height: 8 };
}

#[cfg(test)]
mod tests {
    mod contact;
    mod slip;
}
