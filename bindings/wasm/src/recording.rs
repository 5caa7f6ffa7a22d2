//! The events of a file.

use meissner_engine::{Event, Sensor};
use wasm_bindgen::prelude::*;

use crate::thrown;

/// The events of a recording, as arrays.
#[wasm_bindgen]
pub struct Recording {
    format: String,
    sensor: Sensor,
    events: Vec<Event>,
}

impl Recording {
    /// The content of a file in any format. If it does not name its sensor, the smallest one that
    /// contains its events is used.
    pub(crate) fn of(bytes: &[u8]) -> Result<Self, meissner_io::IoError> {
        let recording = meissner_io::decode(bytes)?;
        let largest = |of: fn(&Event) -> u16| {
            recording.events.iter().map(of).max().map_or(1, |largest| largest.saturating_add(1))
        };
        let sensor = recording
            .sensor
            .unwrap_or_else(|| Sensor::new(largest(|event| event.x), largest(|event| event.y)));
        Ok(Self { format: recording.format.to_string(), sensor, events: recording.events })
    }

    pub(crate) fn sensor(&self) -> Sensor {
        self.sensor
    }

    pub(crate) fn into_events(self) -> Vec<Event> {
        self.events
    }
}

#[wasm_bindgen]
impl Recording {
    /// The events of the content of a file, in any format that the program reads, also packed with
    /// gzip or zip. Its events may step back in time, as in the file.
    ///
    /// # Errors
    /// The bytes are not a recording, or a damaged one; the message has the location.
    #[wasm_bindgen(constructor)]
    pub fn new(bytes: &[u8]) -> Result<Self, JsError> {
        Self::of(bytes).map_err(thrown)
    }

    /// The name of the format.
    #[wasm_bindgen(getter)]
    pub fn format(&self) -> String {
        self.format.clone()
    }

    /// Columns of the sensor.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> u16 {
        self.sensor.width
    }

    /// Rows of the sensor.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> u16 {
        self.sensor.height
    }

    /// Number of events.
    #[wasm_bindgen(getter)]
    pub fn length(&self) -> usize {
        self.events.len()
    }

    /// Times in microseconds.
    #[wasm_bindgen(getter)]
    pub fn t_us(&self) -> Vec<f64> {
        self.events.iter().map(|event| event.t_us as f64).collect()
    }

    /// Columns of the events.
    #[wasm_bindgen(getter)]
    pub fn x(&self) -> Vec<u16> {
        self.events.iter().map(|event| event.x).collect()
    }

    /// Rows of the events.
    #[wasm_bindgen(getter)]
    pub fn y(&self) -> Vec<u16> {
        self.events.iter().map(|event| event.y).collect()
    }

    /// 1 if it became brighter, else 0.
    #[wasm_bindgen(getter)]
    pub fn on(&self) -> Vec<u8> {
        self.events.iter().map(|event| u8::from(event.on)).collect()
    }
}
