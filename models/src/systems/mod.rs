//! What surrounds a network in the system that it serves: the sensor's numbers into the network's input, the
//! network's output into what a controller reads.

pub mod contact_area;
pub mod digits;
pub mod slip;
