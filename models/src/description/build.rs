//! A network from a description and weights.
//!
//! Enters: a checked [`Description`] and [`Weights`]. Leaves: the engine's [`Network`], or every tensor that does not fit.
//! Batch norm with running statistics is folded into one product and one sum, in f64, rounded once:
//!
//! ```text
//! scale = gamma / sqrt(var + 1e-5),   shift = beta - mean scale
//! ```

use std::collections::BTreeSet;

use meissner_engine::{Block, DenseLayer, EngineError, Level, Network, NetworkParts, Pooling, Readout};
use meissner_kernels::{Dense, KernelError, SplineConv, SplineParts};

use super::{Description, Layer, LayerKind};
use crate::error::{TensorProblem, TensorProblemKind, TensorProblems};
use crate::{ModelError, Weights};

/// What batch norm adds to a variance.
const EPSILON: f64 = 1e-5;

impl Description {
    /// The network with `weights`, whose names may all carry one further prefix such as "module.".
    ///
    /// # Errors
    /// [`ModelError::Weights`] with every tensor that is missing, has another shape or type, or values that cannot be
    /// computed with; [`ModelError::Ambiguous`] where several prefixes would do; [`ModelError::Engine`] never, unless the
    /// engine's bounds are narrower than the description's.
    pub fn network(&self, weights: &Weights) -> Result<Network, ModelError> {
        let prefix = self.prefix(weights)?;
        let mut tensors = Tensors { weights, prefix, problems: Vec::new() };
        let parts = self.parts(&mut tensors)?;
        match parts {
            Some(parts) if tensors.problems.is_empty() => Ok(Network::new(parts)?),
            _ => Err(ModelError::Weights {
                network: self.name.clone(),
                problems: TensorProblems(tensors.problems),
            }),
        }
    }

    /// Names in `weights` that [`Self::network`] does not read, in order.
    ///
    /// # Errors
    /// [`ModelError::Ambiguous`] as [`Self::network`].
    pub fn unused_tensors(&self, weights: &Weights) -> Result<Vec<String>, ModelError> {
        let prefix = self.prefix(weights)?;
        let used: BTreeSet<String> = self.needed().map(|t| format!("{prefix}{}", t.name)).collect();
        Ok(weights.names().filter(|&name| !used.contains(name)).map(str::to_owned).collect())
    }

    /// What stands before every name: nothing where all are there as they are, else the one prefix under which all are,
    /// else the one under which most are.
    fn prefix(&self, weights: &Weights) -> Result<String, ModelError> {
        let needed: Vec<String> = self.needed().map(|tensor| tensor.name).collect();
        let mut prefixes = BTreeSet::from([String::new()]);
        for name in weights.names() {
            for needed in &needed {
                if let Some(prefix) = name.strip_suffix(needed.as_str()).filter(|p| p.ends_with('.')) {
                    prefixes.insert(prefix.to_owned());
                }
            }
        }
        let held = |prefix: &str| {
            needed.iter().filter(|name| weights.get(&format!("{prefix}{name}")).is_some()).count()
        };
        if held("") == needed.len() {
            return Ok(String::new());
        }
        let whole: Vec<String> = prefixes.iter().filter(|p| held(p) == needed.len()).cloned().collect();
        match &whole[..] {
            // Of equals the shortest: names without a prefix are what a reader expects to be told about.
            [] => {
                Ok(prefixes.into_iter().max_by_key(|p| (held(p), usize::MAX - p.len())).unwrap_or_default())
            }
            [prefix] => Ok(prefix.clone()),
            _ => Err(ModelError::Ambiguous { network: self.name.clone(), prefixes: whole }),
        }
    }

    /// `None` where a tensor does not fit.
    fn parts(&self, tensors: &mut Tensors<'_>) -> Result<Option<NetworkParts>, ModelError> {
        let mut levels = vec![Level { scale: self.scale, blocks: Vec::new() }];
        let mut poolings = Vec::new();
        let mut readout = None;
        let mut segments = None;
        let mut dense = Vec::new();
        let mut whole = true;
        for layer in &self.layers {
            match &layer.kind {
                LayerKind::Spline { .. } => match spline(layer, tensors)? {
                    Some(block) => levels[layer.level.unwrap_or(0)].blocks.push(block),
                    None => whole = false,
                },
                LayerKind::Pool { cell, position, scale } => {
                    let (name, from) = (layer.name.clone(), layer.reads);
                    poolings.push(Pooling {
                        name,
                        from,
                        cell: cell.cell,
                        time: cell.time,
                        position: *position,
                    });
                    levels.push(Level { scale: *scale, blocks: Vec::new() });
                }
                LayerKind::Readout { columns, rows } => {
                    readout = Some(Readout { from: layer.reads, columns: *columns, rows: *rows });
                    segments = Some(layer.inputs);
                }
                LayerKind::Dense { .. } => {
                    // The readout's cells lie one after the other, each padded to whole lanes; a dense layer's values
                    // are one segment.
                    let segment = segments.take().unwrap_or(layer.inputs);
                    match dense_layer(layer, segment, tensors)? {
                        Some(built) => dense.push(built),
                        None => whole = false,
                    }
                }
            }
        }
        let Some(readout) = readout.filter(|_| whole) else { return Ok(None) };
        let events = levels.remove(0);
        Ok(Some(NetworkParts {
            name: self.name.clone(),
            span_us: self.span_us,
            capacity: self.capacity,
            graph: self.graph,
            normalisation: self.normalisation,
            events,
            pooled: poolings.into_iter().zip(levels).collect(),
            readout,
            dense,
        }))
    }
}

fn refused(layer: &Layer, source: KernelError) -> ModelError {
    EngineError::Layer { layer: layer.name.clone(), source }.into()
}

fn spline(layer: &Layer, tensors: &mut Tensors<'_>) -> Result<Option<Block>, ModelError> {
    let LayerKind::Spline { kernel, root, bias, norm, elu, .. } = layer.kind else { return Ok(None) };
    let (inputs, outputs) = (layer.inputs, layer.outputs);
    let weight = tensors.get(&layer.tensor("conv.weight"), &[kernel.iter().product(), inputs, outputs]);
    let root = root.then(|| tensors.get(&layer.tensor("conv.lin.weight"), &[outputs, inputs]));
    let bias = bias.then(|| tensors.get(&layer.tensor("conv.bias"), &[outputs]));
    let norm = norm.then(|| tensors.norm(layer));
    let present = [&root, &bias].into_iter().all(|t| !matches!(t, Some(None))) && !matches!(norm, Some(None));
    let Some(weight) = weight.filter(|_| present) else { return Ok(None) };
    let owned = |values: Option<Option<&[f32]>>| values.flatten().map(<[f32]>::to_vec);
    let parts = SplineParts {
        inputs,
        outputs,
        kernel,
        weight: weight.to_vec(),
        root: owned(root),
        bias: owned(bias),
        norm: norm.flatten(),
        elu,
    };
    let conv = SplineConv::new(&parts).map_err(|e| refused(layer, e))?;
    Ok(Some(Block { name: layer.name.clone(), input: layer.reads, skip: layer.adds, conv }))
}

fn dense_layer(
    layer: &Layer,
    segment: usize,
    tensors: &mut Tensors<'_>,
) -> Result<Option<DenseLayer>, ModelError> {
    let LayerKind::Dense { bias, activation } = layer.kind else { return Ok(None) };
    let (inputs, outputs) = (layer.inputs, layer.outputs);
    let weight = tensors.get(&layer.tensor("weight"), &[outputs, inputs]);
    let bias = bias.then(|| tensors.get(&layer.tensor("bias"), &[outputs]));
    let Some(weight) = weight.filter(|_| !matches!(bias, Some(None))) else { return Ok(None) };
    let dense = Dense::new(inputs / segment, segment, outputs, weight, bias.flatten(), activation)
        .map_err(|e| refused(layer, e))?;
    Ok(Some(DenseLayer { name: layer.name.clone(), dense }))
}

/// Gives tensors of the expected shape, and notes those that do not fit.
struct Tensors<'a> {
    weights: &'a Weights,
    prefix: String,
    problems: Vec<TensorProblem>,
}

impl<'a> Tensors<'a> {
    fn refuse(&mut self, tensor: String, kind: TensorProblemKind) {
        self.problems.push(TensorProblem { tensor, kind });
    }

    fn get(&mut self, name: &str, expected: &[usize]) -> Option<&'a [f32]> {
        let name = format!("{}{name}", self.prefix);
        let Some(tensor) = self.weights.get(&name) else {
            self.refuse(name, TensorProblemKind::Missing { expected: expected.to_vec() });
            return None;
        };
        if tensor.shape() != expected {
            let (expected, found) = (expected.to_vec(), tensor.shape().to_vec());
            self.refuse(name, TensorProblemKind::Shape { expected, found });
            return None;
        }
        let Some(values) = tensor.values() else {
            self.refuse(name, TensorProblemKind::Dtype { found: tensor.dtype().to_owned() });
            return None;
        };
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            self.refuse(name, TensorProblemKind::NotFinite { index, value: values[index] });
            return None;
        }
        Some(values)
    }

    /// Batch norm of a block as one product and one sum a channel.
    fn norm(&mut self, layer: &Layer) -> Option<(Vec<f32>, Vec<f32>)> {
        let shape = [layer.outputs];
        let gamma = self.get(&layer.tensor("norm.weight"), &shape);
        let beta = self.get(&layer.tensor("norm.bias"), &shape);
        let mean = self.get(&layer.tensor("norm.running_mean"), &shape);
        let variance = self.get(&layer.tensor("norm.running_var"), &shape);
        if let Some((index, &value)) = variance.and_then(|v| v.iter().enumerate().find(|(_, v)| **v < 0.0)) {
            let name = format!("{}{}", self.prefix, layer.tensor("norm.running_var"));
            self.refuse(name, TensorProblemKind::Variance { index, value });
            return None;
        }
        let (gamma, beta, mean, variance) = (gamma?, beta?, mean?, variance?);
        let (mut scales, mut shifts) = (Vec::new(), Vec::new());
        for index in 0..layer.outputs {
            let scale = f64::from(gamma[index]) / (f64::from(variance[index]) + EPSILON).sqrt();
            let shift = f64::from(beta[index]) - f64::from(mean[index]) * scale;
            for (what, value, folded) in [("scale", scale, &mut scales), ("shift", shift, &mut shifts)] {
                if !(value as f32).is_finite() {
                    let name = format!("{}{}", self.prefix, layer.tensor("norm.weight"));
                    self.refuse(name, TensorProblemKind::Folded { what, index, value });
                    return None;
                }
                folded.push(value as f32);
            }
        }
        Some((scales, shifts))
    }
}

#[cfg(test)]
mod tests {
    use super::Tensors;
    use crate::{Description, Tensor, Weights};

    #[test]
    fn batch_norm_is_folded_in_f64_and_rounded_once() {
        let description = Description::shipped("graphres").expect("shipped");
        let layer = &description.layers()[0];
        let value = |part: usize, channel: usize| 0.2 + 0.37 * part as f32 + 0.11 * channel as f32;
        let parts = ["weight", "bias", "running_mean", "running_var"];
        let weights = Weights::new(parts.iter().enumerate().map(|(part, name)| {
            let values = (0..8).map(|channel| value(part, channel)).collect();
            (format!("w.blocks.0.norm.{name}"), Tensor::new(vec![8], values).expect("eight values"))
        }));
        let mut tensors = Tensors { weights: &weights, prefix: "w.".to_owned(), problems: Vec::new() };
        let (scale, shift) = tensors.norm(layer).expect("all four tensors");
        let mut rounded_between = Vec::new();
        for channel in 0..8 {
            let [gamma, beta, mean, variance] = [0, 1, 2, 3].map(|part| value(part, channel));
            let exact = f64::from(gamma) / (f64::from(variance) + 1e-5).sqrt();
            assert_eq!(scale[channel], exact as f32);
            assert_eq!(shift[channel], (f64::from(beta) - f64::from(mean) * exact) as f32);
            rounded_between.push(beta - mean * (exact as f32));
        }
        assert_ne!(shift, rounded_between, "rounding in between gives other bits in some channel");
    }
}
