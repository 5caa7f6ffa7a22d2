//! Outputs of networks as they are reported.

use meissner_models::AnyDescription;

/// An output as it is reported.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quantity {
    pub(crate) name: String,
    pub(crate) unit: String,
    /// A value times this is in `unit`.
    pub(crate) scale: f64,
}

impl Quantity {
    /// The outputs of `description`: angles in radians are reported in degrees.
    pub(crate) fn of(description: &AnyDescription) -> Vec<Self> {
        let (names, units) = description.outputs();
        let quantity = |(name, unit): (&String, &String)| match unit.as_str() {
            "rad" => Self { name: name.clone(), unit: "deg".to_owned(), scale: 180.0 / std::f64::consts::PI },
            unit => Self { name: name.clone(), unit: unit.to_owned(), scale: 1.0 },
        };
        names.iter().zip(units).map(quantity).collect()
    }

    pub(crate) fn is_angle(&self) -> bool {
        self.unit == "deg"
    }
}
