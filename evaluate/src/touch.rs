//! Objects and containers in a gripper, felt by a tactile skin (`NeuTouch`): the data sets, and the
//! trainings of their networks.

use std::path::Path;

use meissner_io::IoError;
use meissner_io::datasets::{EventDataset, NeutouchSet};
use meissner_models::Description;
use meissner_models::systems::touch::{CONTAINERS, OBJECTS, SENSOR};

use crate::error::EvaluateError;
use crate::events::{EventSet, EventTask};
use crate::trainings::Task;

/// The task of objects.
#[derive(Clone, Copy, Debug)]
pub struct TouchObjects;

/// The task of containers with fillings.
#[derive(Clone, Copy, Debug)]
pub struct TouchContainers;

impl Task for TouchObjects {
    type Description = Description;
    const PREFIX: &'static str = "touch-objects";

    fn describe(network: &str) -> Result<(Description, bool), EvaluateError> {
        Self::SET.describe(network)
    }

    fn name(description: &Description) -> &str {
        description.name()
    }
}

impl EventTask for TouchObjects {
    const SET: EventSet = EventSet {
        task: "touch objects",
        command: "eval touch objects",
        name: "NeuTouch",
        sensor: SENSOR,
        classes: &OBJECTS,
    };

    fn recordings(folder: &Path) -> Result<EventDataset, IoError> {
        EventDataset::neutouch(folder, NeutouchSet::Objects)
    }
}

impl Task for TouchContainers {
    type Description = Description;
    const PREFIX: &'static str = "touch-containers";

    fn describe(network: &str) -> Result<(Description, bool), EvaluateError> {
        Self::SET.describe(network)
    }

    fn name(description: &Description) -> &str {
        description.name()
    }
}

impl EventTask for TouchContainers {
    const SET: EventSet = EventSet {
        task: "touch containers",
        command: "eval touch containers",
        classes: &CONTAINERS,
        ..TouchObjects::SET
    };

    fn recordings(folder: &Path) -> Result<EventDataset, IoError> {
        EventDataset::neutouch(folder, NeutouchSet::Containers)
    }
}
