//! The warnings of the program, as warnings of Python.

use std::ffi::CString;

use meissner::{EventCounters, Sensor, models};
use meissner_run::losses::{InputLosses, LossReason};
use meissner_run::provenance::ModelCard;
use pyo3::prelude::*;

use crate::arrays::sides;
use crate::description::Description;
use crate::error::{Failure, Outcome};

/// Warns once for each reason for which an engine has lost more than a hundredth of its events.
#[derive(Clone, Debug, Default)]
pub(crate) struct Losses {
    told: Vec<LossReason>,
}

impl Losses {
    pub(crate) fn look(&mut self, py: Python<'_>, events: EventCounters, sensor: Sensor) -> Outcome<()> {
        for loss in InputLosses::of_events(events, sensor).warn("events") {
            if !self.told.contains(&loss.reason) {
                self.told.push(loss.reason);
                warn(py, &loss.message)?;
            }
        }
        Ok(())
    }
}

/// Warns if `weights` were trained on another input than this network gets.
pub(crate) fn of_network(
    py: Python<'_>,
    description: &Description,
    weights: &models::Weights,
    window: Option<(i64, usize)>,
    sensor: Option<Sensor>,
) -> Outcome<()> {
    let card = ModelCard::new(&description.any, weights, "weights".to_owned());
    let card = card.map_err(|error| Failure::Refused("WeightsError", error.to_string()))?.running(0, window);
    let sensor = sensor.map(sides).map(<[u16; 2]>::from);
    card.warnings(sensor).iter().try_for_each(|text| warn(py, text))
}

fn warn(py: Python<'_>, text: &str) -> Outcome<()> {
    let category = py.import("meissner._errors")?.getattr("MeissnerWarning")?;
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    Ok(PyErr::warn(py, &category, &text, 1)?)
}
