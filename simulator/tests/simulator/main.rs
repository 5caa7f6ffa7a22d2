//! Behaviour of the simulator: the camera against its equations and against measured noise, and
//! markers.

mod camera;
mod gel;
mod grasp;
mod markers;
mod membrane;
mod noise;
mod picture;
mod plants;
mod table;
