//! Two threads and a worker: engines that stand still, are slow, fail, or are real.
#![forbid(unsafe_code)]

mod deadlines;
mod fake;
mod fleet;
mod frames;
mod overload;
mod recorded;
