//! Direction of slip from readings of 24 electrodes.

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::representations::{ELECTRODES, TactileForm, TactileWindow};
use meissner_io::ElectrodeSettings;
use meissner_models::{FrameDescription, FrameSource, Weights};
use wasm_bindgen::prelude::*;

use crate::{refused, thrown};

/// A network over windows of readings.
#[wasm_bindgen]
pub struct Electrodes {
    engine: FrameEngine,
    window: TactileWindow,
    classes: Vec<String>,
}

#[wasm_bindgen]
impl Electrodes {
    /// The network `name` of the module, such as "slip-best".
    ///
    /// # Errors
    /// The module has no such network over electrodes.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str) -> Result<Self, JsError> {
        let unknown =
            || refused("network", "a network over electrodes, such as slip-best", format!("{name:?}"));
        let description = FrameDescription::shipped(name).ok_or_else(unknown)?;
        if let Some(error) = Weights::left_out(name) {
            return Err(thrown(error));
        }
        let weights = Weights::shipped(name).ok_or_else(unknown)?;
        let (readings, form) = match *description.source() {
            FrameSource::TactileImage(readings) => (readings, TactileForm::Image),
            FrameSource::Electrodes(readings) => (readings, TactileForm::Reading),
            _ => return Err(unknown()),
        };
        let window = TactileWindow::new(readings.steps, readings.sampling, readings.scaling, form);
        let parts = description.network_parts(&weights).map_err(thrown)?;
        let network = FrameNetwork::new(parts, Convolution::Direct).map_err(thrown)?;
        Ok(Self {
            engine: FrameEngine::new(network).map_err(thrown)?,
            window: window.map_err(thrown)?,
            classes: description.outputs().0.to_vec(),
        })
    }

    /// Takes the values e1 to e24 of a reading, in the sensor's counts; returns the logits of the
    /// window, if the reading completes one.
    ///
    /// # Errors
    /// There are not 24 finite values.
    pub fn push(&mut self, values: &[f32]) -> Result<Option<Vec<f32>>, JsError> {
        let reading: &[f32; ELECTRODES] = values
            .try_into()
            .map_err(|_| refused("reading", format!("{ELECTRODES} values"), values.len()))?;
        let Some(sequence) = self.window.push(reading).map_err(thrown)? else { return Ok(None) };
        self.engine.reset();
        self.engine.push_slice(sequence.values).map_err(thrown)?;
        Ok(Some(self.engine.predict().map_err(thrown)?.values.to_vec()))
    }

    /// Forgets all readings.
    pub fn reset(&mut self) {
        self.window.reset();
        self.engine.reset();
    }

    /// Names of the classes, in the order of the logits.
    #[wasm_bindgen(getter)]
    pub fn classes(&self) -> Vec<String> {
        self.classes.clone()
    }

    /// The readings of a text (CSV with a header): 24 values each, one after the other. A line
    /// without a reading is left out.
    ///
    /// # Errors
    /// The text has no header of electrodes.
    pub fn decode(text: &[u8]) -> Result<Vec<f32>, JsError> {
        let mut readings = meissner_io::Electrodes::new(text, ElectrodeSettings::default());
        let (mut values, mut refused) = (Vec::new(), None);
        for reading in readings.by_ref() {
            match reading {
                Ok(reading) => values.extend_from_slice(&reading.values),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        match refused {
            Some(error) if values.is_empty() => Err(thrown(error)),
            _ => Ok(values),
        }
    }
}
