//! Kernels on every instruction set against their scalar twins, and the functions that they are
//! made of.

mod against_naive;
mod cells_against_naive;
mod floats;
mod frames_against_naive;
mod naive;
mod primitives;
mod promises;
mod rows_against_naive;
mod values;
