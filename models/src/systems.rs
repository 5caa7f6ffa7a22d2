//! What surrounds a network in its system: from the sensor's values to the input, and from the
//! output to what a controller reads.

pub mod contact_area;
pub mod digits;
pub mod slip;
pub mod touch;

use thiserror::Error;

/// A network predicts other classes or values than those of a task.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("network {network}: expected the outputs {expected}, found {found}")]
#[non_exhaustive]
pub struct OutputsError {
    /// Name of the network.
    pub network: String,
    /// Names of the classes.
    pub expected: String,
    /// Names of its outputs.
    pub found: String,
}

/// `Ok` where the `outputs` of `network` are `classes`.
///
/// # Errors
/// [`OutputsError`] where they are something else.
pub fn check_outputs(network: &str, outputs: &[String], classes: &[&str]) -> Result<(), OutputsError> {
    if outputs == classes {
        return Ok(());
    }
    let (expected, found) = (classes.join(", "), outputs.join(", "));
    Err(OutputsError { network: network.to_owned(), expected, found })
}

#[cfg(test)]
mod tests {
    mod contact;
    mod slip;
}
