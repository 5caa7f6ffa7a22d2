//! Kernels on every instruction set against their scalar twins.

mod against_naive;
mod cells_against_naive;
mod floats;
mod frames_against_naive;
mod naive;
mod promises;
mod rows_against_naive;
