//! What surrounds a network in the system that it serves: from the values of the sensor to the input of the network, and
//! from the output of the network to the quantities that a controller reads.

pub mod contact_area;
pub mod digits;
pub mod slip;
