//! Kernels on every instruction set against their scalar twins.

mod against_naive;
mod cells_against_naive;
mod frames;
mod frames_against_naive;
mod nearby_against_naive;
mod replace_against_naive;
mod sizes;
