//! What tells networks, weights and data from others: FNV-1a, 64 bits. Not for those who mean harm.

use std::hash::Hasher;

use fnv::FnvHasher;
use meissner_engine::Event;
use meissner_models::Weights;

/// Bytes so far.
pub(super) struct Fingerprint(FnvHasher);

impl Fingerprint {
    pub(super) fn new() -> Self {
        Self(FnvHasher::default())
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    /// A text, with its length, so that two texts are not one.
    pub(super) fn text(&mut self, text: &str) {
        self.bytes(&(text.len() as u64).to_le_bytes());
        self.bytes(text.as_bytes());
    }

    pub(super) fn floats(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.bytes(&value.to_bits().to_le_bytes()));
    }

    pub(super) fn events(&mut self, events: &[Event]) {
        self.bytes(&(events.len() as u64).to_le_bytes());
        for event in events {
            self.bytes(&event.t_us.to_le_bytes());
            self.bytes(&event.x.to_le_bytes());
            self.bytes(&event.y.to_le_bytes());
            self.bytes(&[u8::from(event.on)]);
        }
    }

    /// Tensors by name; remarks do not count.
    pub(super) fn weights(&mut self, weights: &Weights) {
        for (name, tensor) in weights.iter() {
            self.text(name);
            tensor.shape().iter().for_each(|&side| self.bytes(&(side as u64).to_le_bytes()));
            self.floats(tensor.values().unwrap_or_default());
        }
    }

    /// 16 digits.
    pub(super) fn finish(self) -> String {
        format!("{:016x}", self.0.finish())
    }
}

#[cfg(test)]
mod tests {
    use super::Fingerprint;

    #[test]
    fn texts_are_told_apart_from_their_parts() {
        let of = |texts: &[&str]| {
            let mut fingerprint = Fingerprint::new();
            texts.iter().for_each(|text| fingerprint.text(text));
            fingerprint.finish()
        };
        assert_ne!(of(&["ab", "c"]), of(&["a", "bc"]));
    }
}
