//! The names that columns of CSV and fields of npy go by, in lower case.

/// Time, in microseconds: names that say another unit are not here.
pub(crate) const TIME: &[&str] =
    &["t", "t_us", "ts", "ts_us", "time", "time_us", "timestamp", "timestamp_us"];
/// Column of the pixel.
pub(crate) const X: &[&str] = &["x"];
/// Row of the pixel.
pub(crate) const Y: &[&str] = &["y"];
/// Polarity.
pub(crate) const POLARITY: &[&str] = &["p", "pol", "polarity", "on"];
