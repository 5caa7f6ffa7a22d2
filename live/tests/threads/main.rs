//! Two threads and a worker, with engines that stand still, are slow, fail, or are real.
#![forbid(unsafe_code)]

mod deadlines;
mod fake;
mod fleet;
mod frames;
mod overload;
mod recorded;
