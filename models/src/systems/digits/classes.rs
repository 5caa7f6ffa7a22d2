//! The digits, and the networks that tell them.

use meissner_engine::Sensor;

use super::DigitsError;
use crate::Description;

/// Names of the classes, in the order of their indices.
pub const CLASSES: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// The pixels that all recordings have.
pub const SENSOR: Sensor = Sensor { width: 34, height: 34 };

/// Networks that run with the weights of another one, and that other one.
const SHARED_WEIGHTS: &[(&str, &str)] = &[("digits-frozen", "digits-past")];

/// The network that the weights of `network` were trained as: itself, or the one that it shares them with.
pub fn trained_as(network: &str) -> &str {
    SHARED_WEIGHTS.iter().find(|(name, _)| *name == network).map_or(network, |(_, trained)| trained)
}

/// `Ok` where `description` predicts [`CLASSES`].
///
/// # Errors
/// [`DigitsError::Outputs`] where it predicts something else.
pub fn check(description: &Description) -> Result<(), DigitsError> {
    let (names, _) = description.outputs();
    if names.iter().map(String::as_str).eq(CLASSES) {
        return Ok(());
    }
    Err(DigitsError::Outputs {
        network: description.name().to_owned(),
        expected: CLASSES.join(", "),
        found: names.join(", "),
    })
}

#[cfg(test)]
mod tests {
    use super::{check, trained_as};
    use crate::Description;

    #[test]
    fn a_network_that_tells_no_digits_is_refused_with_its_outputs() {
        let network = Description::shipped("tactigraph").unwrap();
        let error = check(&network).unwrap_err().to_string();
        assert!(error.contains("tactigraph") && error.contains("roll, pitch"), "{error}");
    }

    #[test]
    fn the_frozen_network_is_the_one_over_the_past() {
        assert_eq!(
            ["digits-frozen", "digits-past", "own"].map(trained_as),
            ["digits-past", "digits-past", "own"]
        );
    }
}
