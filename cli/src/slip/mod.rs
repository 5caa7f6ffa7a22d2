//! What `prepare slip` and `eval slip` share: the data set, and the windows that a network reads.

mod data;

pub(crate) use data::SlipData;
