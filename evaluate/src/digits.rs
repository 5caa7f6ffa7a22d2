//! Digits in front of a moving event camera (N-MNIST): the data set, and the trainings of its networks.

use std::path::Path;

use meissner_io::datasets::NmnistDataset;
use meissner_models::Description;
use meissner_models::systems::digits::{CLASSES, SENSOR, check, trained_as};
use meissner_pipeline::model::describe;

use crate::error::{EvaluateError, TrainingError};
use crate::events::{EventData, EventSet, EventTask};
use crate::trainings::HeldOut;
use crate::trainings::{Metadata, Task};

/// The task of digits.
#[derive(Clone, Copy, Debug)]
pub struct Digits;

impl Task for Digits {
    type Description = Description;
    const PREFIX: &'static str = "digits-";

    fn describe(network: &str) -> Result<(Description, bool), EvaluateError> {
        let (description, shipped) = describe(network)?;
        check(&description)?;
        Ok((description, shipped))
    }

    fn name(description: &Description) -> &str {
        description.name()
    }

    fn trained_as(network: &str) -> &str {
        trained_as(network)
    }

    /// The recordings that a fold held out; a whole training must have left out the split test.
    fn held_out(metadata: Metadata<'_>) -> Result<Option<HeldOut>, TrainingError> {
        if metadata.0.contains_key("held_out") {
            let expected = "with a JSON list of recordings, such as [\"train/3/00123\"]";
            return metadata.recordings(expected).map(Some);
        }
        if metadata.0.get("trained_on").is_some_and(|split| split == "train") {
            return Ok(None);
        }
        let expected = "\"train\", or \"held_out\" with a JSON list of recordings,";
        Err(metadata.refused("trained_on", expected))
    }
}

impl EventTask for Digits {
    fn read(folder: &Path) -> Result<EventData, EvaluateError> {
        let set = EventSet {
            task: "digits",
            command: "eval digits",
            name: "N-MNIST",
            sensor: SENSOR,
            classes: &CLASSES,
        };
        let NmnistDataset { recordings, passed_over } = NmnistDataset::read(folder)?;
        Ok(EventData::new(set, folder, recordings, &passed_over))
    }
}
