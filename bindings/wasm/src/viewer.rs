//! The session behind the page.

use meissner_view::{Input, Session, Shipped, Truth};
use wasm_bindgen::prelude::*;

use crate::press;
use crate::recording::Recording;
use crate::thrown;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = performance, js_name = now)]
    fn now_ms() -> f64;
}

/// A recording and a network, as the page plays them: commands in, frames out.
#[wasm_bindgen]
pub struct Viewer(Session);

#[wasm_bindgen]
impl Viewer {
    /// The content of a file called `name`, with the network called `network`.
    ///
    /// # Errors
    /// The bytes are not a recording, or the network does not run over its sensor.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, bytes: &[u8], network: &str) -> Result<Self, JsError> {
        Self::of(name, Recording::of(bytes).map_err(thrown)?, Truth::default(), network)
    }

    /// The embedded press.
    ///
    /// # Errors
    /// The network does not run over its sensor.
    pub fn press(network: &str) -> Result<Self, JsError> {
        Self::of(press::NAME, press::press(), press::truth(), network)
    }

    fn of(name: &str, recording: Recording, truth: Truth, network: &str) -> Result<Self, JsError> {
        let (name, sensor) = (name.to_owned(), recording.sensor());
        let input = Input { name, sensor, events: recording.into_events(), truth, ..Input::default() };
        let session = Session::new(input, Box::new(Shipped), network, || 1e3 * now_ms());
        Ok(Self(session.map_err(thrown)?))
    }

    /// Carries out a command, in JSON.
    ///
    /// # Errors
    /// It is not a command, or it cannot be carried out.
    pub fn command(&mut self, text: &str) -> Result<(), JsError> {
        self.0.command(text).map_err(thrown)
    }

    /// Continues for about this time, and returns a frame if there is anything new to show.
    pub fn step(&mut self, budget_us: f64) -> Option<Vec<u8>> {
        self.0.step(budget_us)
    }

    /// Counts changes of [`Self::facts`].
    #[wasm_bindgen(getter, js_name = factsVersion)]
    pub fn facts_version(&self) -> f64 {
        self.0.facts_version() as f64
    }

    /// Facts for frames: the recording, the network and its layers. A page needs them before its
    /// first frame, and after each change.
    pub fn facts(&self) -> Vec<u8> {
        self.0.facts()
    }
}
