//! Fingerprints of networks and files: FNV-1a with 64 bits (Fowler, Noll and Vo 1991).
//!
//! Inputs of equal length that differ in one word always differ in fingerprint: each step is a
//! bijection. Others collide with probability 2^-64; deliberate collisions are not resisted.

use meissner_kernels::Activation;

const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Fingerprint(u64);

impl Fingerprint {
    pub(crate) fn new() -> Self {
        Self(OFFSET)
    }

    /// Adds one word of one to eight bytes.
    #[inline]
    pub(crate) fn word(&mut self, word: u64) {
        self.0 = (self.0 ^ word).wrapping_mul(PRIME);
    }

    pub(crate) fn size(&mut self, size: usize) {
        self.word(size as u64);
    }

    pub(crate) fn sizes(&mut self, sizes: impl IntoIterator<Item = usize>) {
        sizes.into_iter().for_each(|size| self.size(size));
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.size(text.len());
        text.bytes().for_each(|byte| self.word(byte.into()));
    }

    /// Adds the number of values, and their bits.
    pub(crate) fn values(&mut self, values: &[f32]) {
        self.size(values.len());
        values.iter().for_each(|value| self.word(value.to_bits().into()));
    }

    pub(crate) fn finish(self) -> u64 {
        self.0
    }
}

pub(crate) fn activation_code(activation: Activation) -> usize {
    match activation {
        Activation::Identity => 0,
        Activation::Relu => 1,
        Activation::Elu => 2,
        Activation::Sigmoid => 3,
        Activation::Tanh => 4,
    }
}

pub(crate) fn of_bytes(bytes: &[u8]) -> u64 {
    let mut fingerprint = Fingerprint::new();
    bytes.iter().for_each(|&byte| fingerprint.word(byte.into()));
    fingerprint.finish()
}
