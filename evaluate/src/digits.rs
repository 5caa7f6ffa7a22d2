//! Digits in front of a moving event camera (N-MNIST): the data set, and the trainings of its
//! networks.

use std::path::Path;

use meissner_io::IoError;
use meissner_io::datasets::EventDataset;
use meissner_models::Description;
use meissner_models::systems::digits::{CLASSES, SENSOR, trained_as};

use crate::error::EvaluateError;
use crate::events::{EventSet, EventTask};
use crate::trainings::Task;

/// The task of digits.
#[derive(Clone, Copy, Debug)]
pub struct Digits;

impl Task for Digits {
    type Description = Description;
    const PREFIX: &'static str = "digits-";

    fn describe(network: &str) -> Result<(Description, bool), EvaluateError> {
        Self::SET.describe(network)
    }

    fn name(description: &Description) -> &str {
        description.name()
    }

    fn trained_as(network: &str) -> &str {
        trained_as(network)
    }
}

impl EventTask for Digits {
    const SET: EventSet = EventSet {
        task: "digits",
        command: "eval digits",
        name: "N-MNIST",
        sensor: SENSOR,
        classes: &CLASSES,
    };

    fn recordings(folder: &Path) -> Result<EventDataset, IoError> {
        EventDataset::nmnist(folder)
    }
}
