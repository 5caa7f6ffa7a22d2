//! Weights that strain the arithmetic, under an ordinary stream.

use std::collections::BTreeMap;
use std::sync::Arc;

use meissner_engine::{DenseLayer, EngineError, Network, NetworkParts};
use meissner_kernels::Dense;
use meissner_models::{Tensor, Weights};
use meissner_reference::BatchNorm;

use super::events::{self, EventRun};
use super::{Expect, Prepared, Size, WITHIN};
use crate::error::VerifyError;

/// The networks whose weights are changed.
pub(crate) const NETWORKS: [&str; 2] = ["graphres", "tactigraph-past"];
/// The constant that batch norm adds to a variance.
const EPSILON: f64 = 1e-5;

/// A change of weights, by factors, and its expected result.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Altered {
    pub(crate) name: &'static str,
    /// Factors of the weights of the first block, and of all others.
    blocks: [f32; 2],
    /// Factor of the weights of the dense layers.
    dense: f32,
    /// Factor of biases and shifts, also those of the dense layers.
    added: f32,
    /// Replaces all running variances.
    variance: Option<f32>,
    expect: Expect,
    within: f64,
}

const NONE: Altered = Altered {
    name: "",
    blocks: [1.0; 2],
    dense: 1.0,
    added: 1.0,
    variance: None,
    expect: Expect::Finite,
    within: WITHIN,
};

/// All changes.
pub(crate) const ALTERED: &[Altered] = &[
    Altered { name: "weights x 1e-6", blocks: [1e-6; 2], ..NONE },
    Altered { name: "weights x 1e-6, nothing added", blocks: [1e-6; 2], added: 0.0, ..NONE },
    Altered { name: "weights x 1e3", blocks: [1e3; 2], ..NONE },
    Altered { name: "weights x 1e15", blocks: [1e15; 2], expect: Expect::Overflow, ..NONE },
    Altered { name: "dense weights x 1e6", dense: 1e6, ..NONE },
    // Trained dense weights are small: alone, even this factor leaves some predictions finite.
    Altered {
        name: "weights x 10, dense x 3e38",
        blocks: [10.0; 2],
        dense: 3e38,
        expect: Expect::Overflow,
        ..NONE
    },
    Altered { name: "denormal weights", blocks: [1e-39; 2], ..NONE },
    // Near 1e-39, 20 of 24 bits are left.
    Altered { name: "denormal activations", blocks: [1e-39, 1.0], added: 0.0, within: 1e-3, ..NONE },
    Altered { name: "variances of 0", variance: Some(0.0), ..NONE },
    Altered { name: "variances of 1e-30", variance: Some(1e-30), ..NONE },
    Altered { name: "variances of 1.2e-38", variance: Some(f32::MIN_POSITIVE), ..NONE },
    Altered { name: "denormal variances", variance: Some(1e-45), ..NONE },
];

/// `altered` in the shipped network `name`.
pub(crate) fn prepare(altered: &Altered, name: &str, size: Size) -> Result<Prepared, VerifyError> {
    let weights = events::weights(name)?;
    let shipped = events::network(name, &weights)?;
    let (changed, norms) = match altered.variance {
        Some(variance) => with_variance(name, &weights, variance)?,
        None => (scaled_network(&shipped, altered)?, BTreeMap::new()),
    };
    let ordinary = events::ordinary(shipped, size);
    let run = EventRun { network: Arc::new(changed), norms, ..ordinary.clone() };
    let (expect, within) = (altered.expect, altered.within);
    Ok(Prepared { run: Box::new(run), expect, within, ordinary: Box::new(ordinary) })
}

/// `network` with the factors of `altered`.
fn scaled_network(network: &Network, altered: &Altered) -> Result<Network, EngineError> {
    let mut parts: NetworkParts = network.parts().clone();
    let mut factor = altered.blocks[0];
    let levels = std::iter::once(&mut parts.events).chain(parts.pooled.iter_mut().map(|(_, level)| level));
    for block in levels.flat_map(|level| &mut level.blocks) {
        let conv = block.conv.scaled(factor, altered.added);
        block.conv = conv.map_err(|source| EngineError::Layer { layer: block.name.clone(), source })?;
        factor = altered.blocks[1];
    }
    for DenseLayer { name, dense } in &mut parts.dense {
        let (weight, bias) = (scaled(&dense.weight(), altered.dense), scaled(dense.bias(), altered.added));
        let segments = dense.inputs() / dense.channels();
        *dense =
            Dense::new(segments, dense.channels(), dense.outputs(), &weight, Some(&bias), dense.activation())
                .map_err(|source| EngineError::Layer { layer: name.clone(), source })?;
    }
    Network::new(parts)
}

fn scaled(values: &[f32], factor: f32) -> Vec<f32> {
    values.iter().map(|v| v * factor).collect()
}

/// The shipped network with all running variances `variance`, and its norms before folding.
pub(crate) fn with_variance(
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
    let network = events::network(name, &weights)?;
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
