//! Objects and containers in a gripper, felt by a tactile skin with 39 taxels (`NeuTouch`).
//!
//! - [`OBJECTS`], [`CONTAINERS`]: the classes, in the order of outputs; the data number them.
//! - [`SENSOR`]: the pixels, steps of 0.05 mm.

use meissner_engine::Sensor;

/// Names of the objects, in the order of their indices.
pub const OBJECTS: [&str; 36] = [
    "0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13", "14", "15", "16", "17", "18",
    "19", "20", "21", "22", "23", "24", "25", "26", "27", "28", "29", "30", "31", "32", "33", "34", "35",
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
