//! Weights drawn from a seed, for tests, latencies and examples. Their predictions have no meaning.
//!
//! Input: a description and a seed. Output: its tensors, with the same bits on every machine:
//! integers, additions, multiplications and square roots in f64, rounded once to f32.
//!
//! Each tensor has its own stream of [`Random`], seeded with the seed plus the FNV-1a hash of its
//! name, and does not depend on other tensors. A normal value is the sum of four uniform ones,
//! centred and scaled to variance 1 (Irwin-Hall). Weights have variance 2 / inputs (He et al.
//! 2015): a spline convolution's inputs are its channels, because an edge's basis sums to 1; those
//! of `PointNet` include the offset. Running variances are drawn around the expected one, so that
//! activations neither explode nor vanish.

use std::hash::Hasher;

use fnv::FnvHasher;

use crate::description::Role;
use crate::weights::card::DRAWN_BY;
use crate::weights::{Tensor, Weights};
use meissner_kernels::random::Random;

/// A description whose tensors can be drawn.
pub trait Drawable: Needs {}

impl<T: Needs> Drawable for T {}

pub(crate) use sealed::Needs;

mod sealed {
    use crate::description::Needed;

    #[expect(private_interfaces, reason = "the trait cannot be named outside")]
    pub trait Needs {
        fn network_name(&self) -> &str;

        fn needed_tensors(&self) -> Vec<Needed>;
    }
}

/// Draws the tensors that `description` needs.
///
/// # Panics
/// Never: every tensor is drawn in the size of its shape.
pub fn draw(description: &impl Drawable, seed: u64) -> Weights {
    Weights::new(description.needed_tensors().into_iter().map(|needed| {
        let mut stream = Random::new(seed.wrapping_add(hash(&needed.name)));
        let values = (0..needed.values()).map(|_| value(needed.role, &mut stream) as f32).collect();
        let tensor = Tensor::new(needed.shape, values).expect("as many values as the shape has");
        (needed.name, tensor)
    }))
}

/// A safetensors file of weights [drawn](draw()) from `seed`, with a card that states this. Equal
/// descriptions and seeds give equal bytes.
pub fn drawn_file(description: &impl Drawable, seed: u64) -> Vec<u8> {
    let entries = [
        ("about", format!("drawn, untrained, seed {seed}")),
        ("network", description.network_name().to_owned()),
        ("generator", DRAWN_BY.to_owned()),
    ];
    draw(description, seed).to_safetensors(&entries.map(|(key, value)| (key.to_owned(), value)).into())
}

fn value(role: Role, stream: &mut Random) -> f64 {
    let (low, high) = match role {
        Role::Weight { inputs } => return (2.0 / inputs as f64).sqrt() * normal(stream),
        Role::Scale => (0.8, 1.2),
        Role::Variance { about } => (0.4 * about, 1.6 * about),
        Role::Mean | Role::Shift => (-0.1, 0.1),
    };
    low + (high - low) * stream.uniform()
}

/// FNV-1a, 64 bits.
pub(crate) fn hash(text: &str) -> u64 {
    let mut hasher = FnvHasher::default();
    hasher.write(text.as_bytes());
    hasher.finish()
}

/// Mean 0, variance 1, within +-2 sqrt 3.
pub(crate) fn normal(random: &mut Random) -> f64 {
    let sum = (random.uniform() + random.uniform()) + (random.uniform() + random.uniform());
    (sum - 2.0) * 3.0_f64.sqrt()
}
