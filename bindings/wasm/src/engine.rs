//! An engine over events.

use meissner_engine::{Event, Outcome, Sensor};
use meissner_models::{AnyDescription, Description, Weights};
use wasm_bindgen::prelude::*;

use crate::{refused, thrown};

/// Names of the networks whose weights the module contains.
#[wasm_bindgen]
pub fn networks() -> Vec<String> {
    AnyDescription::shipped_names()
        .filter(|name| Weights::left_out(name).is_none())
        .map(str::to_owned)
        .collect()
}

/// A network over events, with its window.
#[wasm_bindgen]
pub struct Engine {
    engine: meissner_engine::Engine,
    outputs: Vec<String>,
    units: Vec<String>,
    classes: bool,
}

#[wasm_bindgen]
impl Engine {
    /// The network `name` of the module over a sensor of these pixels.
    ///
    /// # Errors
    /// There is no such network, its weights are missing, or it does not run over such a sensor.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, width: u16, height: u16) -> Result<Self, JsError> {
        let description = Description::shipped(name)
            .ok_or_else(|| refused("network", networks().join(", "), format!("{name:?}")))?;
        if let Some(error) = Weights::left_out(name) {
            return Err(thrown(error));
        }
        let weights = Weights::shipped(name).ok_or_else(|| refused("weights", "those of a network", name))?;
        Self::of(&description, &weights, width, height)
    }

    /// A network of your own: the text of its description (TOML), and the bytes of its weights
    /// (safetensors, or a state dict of `PyTorch`).
    ///
    /// # Errors
    /// They cannot be read, or do not fit together or the sensor.
    #[wasm_bindgen(js_name = fromFiles)]
    pub fn from_files(description: &str, weights: &[u8], width: u16, height: u16) -> Result<Self, JsError> {
        let description = Description::parse(description).map_err(thrown)?;
        Self::of(&description, &Weights::from_bytes(weights).map_err(thrown)?, width, height)
    }

    fn of(description: &Description, weights: &Weights, width: u16, height: u16) -> Result<Self, JsError> {
        let network = description.network(weights).map_err(thrown)?;
        let engine = meissner_engine::Engine::new(network, Sensor::new(width, height)).map_err(thrown)?;
        let (outputs, units) = description.outputs();
        let classes = description.classes().is_some();
        Ok(Self { engine, outputs: outputs.to_vec(), units: units.to_vec(), classes })
    }

    /// Takes an event; returns whether it entered the window, or will once later events have
    /// decided.
    pub fn push(&mut self, t_us: f64, x: u16, y: u16, on: bool) -> bool {
        !matches!(self.engine.push(Event::new(t_us as i64, x, y, on)), Outcome::Dropped(_))
    }

    /// Takes events from arrays of one length; returns the number that entered the window.
    ///
    /// # Errors
    /// The arrays differ in length; no event is taken then.
    #[wasm_bindgen(js_name = pushArrays)]
    pub fn push_arrays(&mut self, t_us: &[f64], x: &[u16], y: &[u16], on: &[u8]) -> Result<usize, JsError> {
        Ok(self.engine.push_all(events(t_us, x, y, on)?))
    }

    /// Takes events as [`Self::push_arrays`] does, and predicts after each: returns the
    /// predictions, one after the other.
    ///
    /// # Errors
    /// The arrays differ in length, and no event is taken; a layer gave NaN.
    #[wasm_bindgen(js_name = predictEach)]
    pub fn predict_each(
        &mut self,
        t_us: &[f64],
        x: &[u16],
        y: &[u16],
        on: &[u8],
    ) -> Result<Vec<f32>, JsError> {
        let mut all = Vec::with_capacity(t_us.len() * self.outputs.len());
        for event in events(t_us, x, y, on)? {
            self.engine.push(event);
            all.extend_from_slice(self.engine.predict().map_err(thrown)?.values);
        }
        Ok(all)
    }

    /// Lets events expire that are too old at `t_us`.
    pub fn advance(&mut self, t_us: f64) {
        self.engine.advance(t_us as i64);
    }

    /// The prediction over the window: a value for each of `outputs`; logits for classes.
    ///
    /// # Errors
    /// A layer gave NaN.
    pub fn predict(&mut self) -> Result<Vec<f32>, JsError> {
        Ok(self.engine.predict().map_err(thrown)?.values.to_vec())
    }

    /// Names of the outputs.
    #[wasm_bindgen(getter)]
    pub fn outputs(&self) -> Vec<String> {
        self.outputs.clone()
    }

    /// The unit of each output; empty for classes.
    #[wasm_bindgen(getter)]
    pub fn units(&self) -> Vec<String> {
        self.units.clone()
    }

    /// Whether the outputs are logits of classes.
    #[wasm_bindgen(getter)]
    pub fn classes(&self) -> bool {
        self.classes
    }

    /// Events in the window.
    #[wasm_bindgen(getter)]
    pub fn nodes(&self) -> usize {
        self.engine.nodes()
    }

    /// The state as bytes, which [`Self::restore`] takes on any machine.
    pub fn snapshot(&self) -> Vec<u8> {
        self.engine.to_bytes()
    }

    /// Goes to a state of an engine with this network and sensor.
    ///
    /// # Errors
    /// The bytes are not such a state. The engine stays unchanged.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), JsError> {
        self.engine.restore_bytes(bytes).map_err(thrown)
    }

    /// Forgets all events.
    pub fn reset(&mut self) {
        self.engine.reset();
    }
}

/// The events of four arrays.
fn events<'a>(
    t_us: &'a [f64],
    x: &'a [u16],
    y: &'a [u16],
    on: &'a [u8],
) -> Result<impl Iterator<Item = Event> + 'a, JsError> {
    let lengths = [t_us.len(), x.len(), y.len(), on.len()];
    if lengths.iter().any(|&length| length != lengths[0]) {
        return Err(refused("events", "four arrays of one length", format!("{lengths:?}")));
    }
    let pixels = x.iter().zip(y).zip(on);
    Ok(t_us.iter().zip(pixels).map(|(&t, ((&x, &y), &on))| Event::new(t as i64, x, y, on != 0)))
}
