//! Fingerprints of networks, weights and data: FNV-1a with 64 bits (Fowler, Noll and Vo 1991). They
//! do not withstand forgery.

use std::hash::Hasher;

use fnv::FnvHasher;
use meissner_engine::Event;
use meissner_models::Weights;

/// The fingerprint of everything that was added, in order.
#[derive(Default)]
pub struct Fingerprint(FnvHasher);

impl Fingerprint {
    /// Adds bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    /// Adds a text with its length, so that two texts differ from their concatenation.
    pub fn text(&mut self, text: &str) {
        self.bytes(&(text.len() as u64).to_le_bytes());
        self.bytes(text.as_bytes());
    }

    /// Adds the bits of values.
    pub fn floats(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.bytes(&value.to_bits().to_le_bytes()));
    }

    /// Adds events with their number.
    pub fn events(&mut self, events: &[Event]) {
        self.bytes(&(events.len() as u64).to_le_bytes());
        for event in events {
            self.bytes(&event.t_us.to_le_bytes());
            self.bytes(&event.x.to_le_bytes());
            self.bytes(&event.y.to_le_bytes());
            self.bytes(&[u8::from(event.on)]);
        }
    }

    /// Adds all tensors by name, without the metadata.
    pub fn weights(&mut self, weights: &Weights) {
        for (name, tensor) in weights.iter() {
            self.text(name);
            tensor.shape().iter().for_each(|&side| self.bytes(&(side as u64).to_le_bytes()));
            self.floats(tensor.values().unwrap_or_default());
        }
    }

    /// The fingerprint, as 16 hexadecimal digits.
    pub fn finish(self) -> String {
        format!("{:016x}", self.0.finish())
    }
}
