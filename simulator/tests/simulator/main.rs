//! Behaviour of the simulator: the camera against its equations and against measured noise, and
//! markers.

mod camera;
mod dome;
mod gel;
mod grasp;
mod picture;
mod plants;
