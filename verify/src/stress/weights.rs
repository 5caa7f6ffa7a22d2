//! Weights that strain the arithmetic, under an ordinary stream.

use std::collections::BTreeMap;
use std::sync::Arc;

use meissner_engine::{Level, Network, NetworkParts};
use meissner_kernels::Dense;
use meissner_models::{Tensor, Weights};
use meissner_reference::BatchNorm;

use super::events::EventCase;
use super::result::{Expect, Size, WITHIN};
use super::streams::{self, ordinary};
use crate::error::VerifyError;

/// The networks whose weights are changed.
pub(super) const NETWORKS: [&str; 2] = ["graphres", "tactigraph-past"];
/// The constant that batch norm adds to a variance.
const EPSILON: f64 = 1e-5;

/// A change of weights.
#[derive(Clone, Copy, Debug)]
enum Change {
    /// Weights of every block times this.
    Blocks(f32),
    /// Weights of every block times this, and neither biases nor shifts nor dense biases.
    BlocksAlone(f32),
    /// Weights of the first block times this, and neither biases nor shifts nor dense biases.
    FirstAlone(f32),
    /// Weights of the dense layers times this.
    Dense(f32),
    /// Running variances.
    Variance(f32),
}

/// A change, and its expected result.
#[derive(Clone, Copy, Debug)]
pub(super) struct Altered {
    pub(super) name: &'static str,
    change: Change,
    expect: Expect,
    within: f64,
}

const fn altered(name: &'static str, change: Change) -> Altered {
    Altered { name, change, expect: Expect::Finite, within: WITHIN }
}

/// All changes.
pub(super) const ALTERED: &[Altered] = &[
    altered("weights x 1e-6", Change::Blocks(1e-6)),
    altered("weights x 1e-6, nothing added", Change::BlocksAlone(1e-6)),
    altered("weights x 1e3", Change::Blocks(1e3)),
    Altered { expect: Expect::Overflow, ..altered("weights x 1e6", Change::Blocks(1e6)) },
    altered("dense weights x 1e6", Change::Dense(1e6)),
    Altered { expect: Expect::Overflow, ..altered("dense weights x 3e38", Change::Dense(3e38)) },
    altered("denormal weights", Change::Blocks(1e-39)),
    // Of 24 bits, 20 are left near 1e-39.
    Altered { within: 1e-3, ..altered("denormal activations", Change::FirstAlone(1e-39)) },
    altered("variances of 0", Change::Variance(0.0)),
    altered("variances of 1e-30", Change::Variance(1e-30)),
    altered("variances of 1.2e-38", Change::Variance(f32::MIN_POSITIVE)),
    altered("denormal variances", Change::Variance(1e-45)),
];

/// `altered` in the shipped network `name`.
pub(super) fn case(altered: &Altered, name: &str, size: Size) -> Result<EventCase, VerifyError> {
    let weights = streams::weights(name)?;
    let shipped = streams::network(name, &weights)?;
    let (changed, norms) = match altered.change {
        Change::Variance(variance) => with_variance(name, &weights, variance)?,
        _ => (changed(&shipped, altered.change)?, BTreeMap::new()),
    };
    let ordinary = ordinary(shipped, size);
    let mut run = ordinary.clone();
    run.network = Arc::new(changed);
    let (expect, within) = (altered.expect, altered.within);
    Ok(EventCase { group: "weights", name: altered.name, run, norms, expect, within, ordinary })
}

/// `network` with other weights.
fn changed(network: &Network, change: Change) -> Result<Network, VerifyError> {
    let mut parts: NetworkParts = network.parts().clone();
    let mut place = 0;
    let levels = std::iter::once(&mut parts.events).chain(parts.pooled.iter_mut().map(|(_, level)| level));
    for Level { blocks, .. } in levels {
        for block in blocks {
            let (weights, added) = factors(change, place == 0);
            block.conv = block.conv.scaled(weights, added).map_err(|source| {
                meissner_engine::EngineError::Layer { layer: block.name.clone(), source }
            })?;
            place += 1;
        }
    }
    let (factor, add) = match change {
        Change::Dense(factor) => (factor, 1.0),
        Change::BlocksAlone(_) | Change::FirstAlone(_) => (1.0, 0.0),
        _ => (1.0, 1.0),
    };
    for layer in &mut parts.dense {
        let dense = &layer.dense;
        let (weight, bias) = (scaled(&dense.weight(), factor), scaled(dense.bias(), add));
        let segments = dense.inputs() / dense.channels();
        let activation = dense.activation();
        layer.dense =
            Dense::new(segments, dense.channels(), dense.outputs(), &weight, Some(&bias), activation)
                .map_err(|source| meissner_engine::EngineError::Layer {
                    layer: layer.name.clone(),
                    source,
                })?;
    }
    Ok(Network::new(parts)?)
}

fn scaled(values: &[f32], factor: f32) -> Vec<f32> {
    values.iter().map(|v| v * factor).collect()
}

/// What weights of a block, and what it adds, are multiplied by; whether it is the `first` one.
fn factors(change: Change, first: bool) -> (f32, f32) {
    match change {
        Change::Blocks(factor) => (factor, 1.0),
        Change::BlocksAlone(factor) => (factor, 0.0),
        Change::FirstAlone(factor) => (if first { factor } else { 1.0 }, 0.0),
        Change::Dense(_) | Change::Variance(_) => (1.0, 1.0),
    }
}

/// The shipped network `name` with all running variances `variance`, and its batch norms as they are before they are folded.
fn with_variance(
    name: &str,
    weights: &Weights,
    variance: f32,
) -> Result<(Network, BTreeMap<String, BatchNorm>), VerifyError> {
    let tensors = weights.iter().map(|(name, tensor)| {
        let changed = tensor
            .values()
            .filter(|_| name.ends_with("running_var"))
            .and_then(|values| Tensor::new(tensor.shape().to_vec(), vec![variance; values.len()]));
        (name.to_owned(), changed.unwrap_or_else(|| tensor.clone()))
    });
    let weights = Weights::new(tensors);
    let network = streams::network(name, &weights)?;
    let blocks = (0..network.levels()).flat_map(|l| &network.level(l).blocks);
    let mut norms = BTreeMap::new();
    for (i, block) in blocks.enumerate() {
        // The shipped networks count their blocks through all levels.
        let values = |part: &str| {
            let tensor = weights.get(&format!("blocks.{i}.norm.{part}"));
            tensor.and_then(Tensor::values).map(<[f32]>::to_vec)
        };
        let parts = [values("weight"), values("bias"), values("running_mean"), values("running_var")];
        if let [Some(gamma), Some(beta), Some(mean), Some(variance)] = parts {
            norms.insert(block.name.clone(), BatchNorm { gamma, beta, mean, variance, epsilon: EPSILON });
        }
    }
    Ok((network, norms))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_batch_norm_of_the_shipped_networks_is_found() {
        for name in NETWORKS {
            let weights = streams::weights(name).expect("it is shipped");
            let (network, norms) = with_variance(name, &weights, 0.0).expect("it fits");
            let blocks: usize = (0..network.levels()).map(|l| network.level(l).blocks.len()).sum();
            assert_eq!(norms.len(), blocks, "{name}");
        }
    }
}
