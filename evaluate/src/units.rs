//! Units of quantities, as descriptions and tables of labels spell them.

/// Degrees in a radian.
pub(crate) const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// The factor from the unit `from` to the unit `to`; `None` if they cannot be compared.
pub(crate) fn factor(from: &str, to: &str) -> Option<f64> {
    match (from, to) {
        (from, to) if from == to => Some(1.0),
        ("rad", "deg") => Some(DEGREES),
        ("deg", "rad") => Some(1.0 / DEGREES),
        _ => None,
    }
}
