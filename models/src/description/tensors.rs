//! The tensors that a network needs, found in weights.
//!
//! Input: names, shapes and [`Weights`]. Output: values, or every tensor that does not fit. Batch
//! norm is one product and one sum per channel, in f64:
//!
//! ```text
//! scale = gamma / sqrt(var + 1e-5),   shift = beta - mean scale
//! ```

use std::collections::BTreeMap;

use super::problem::{ProblemKind, Problems};
use crate::error::{Lookalikes, TensorProblem, TensorProblemKind};
use crate::weights::names::Names;
use crate::{ModelError, Weights};

/// The term that batch norm adds to a variance.
const EPSILON: f64 = 1e-5;

/// Maximum number of values of one tensor: 256 MiB of f32.
pub(super) const MAX_TENSOR: usize = 1 << 26;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Needed {
    pub(crate) name: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) role: Role,
    /// Its content and its axes, for people who write weights.
    pub(crate) meaning: &'static str,
}

/// The role of a tensor in its layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    /// Factors of products that are summed.
    Weight {
        /// Number of products in a sum.
        inputs: usize,
    },
    /// A factor of a product that is not summed.
    Scale,
    /// Terms of a sum.
    Shift,
    /// Running mean.
    Mean,
    /// Running variance.
    Variance {
        /// Its centre if weights are drawn.
        about: f64,
    },
}

impl Needed {
    pub(crate) fn values(&self) -> usize {
        self.shape.iter().product()
    }

    /// Number of trained values; running statistics are not trained.
    pub(crate) fn parameters(&self) -> usize {
        match self.role {
            Role::Mean | Role::Variance { .. } => 0,
            Role::Weight { .. } | Role::Scale | Role::Shift => self.values(),
        }
    }
}

/// The tensors of a layer, listed in the order of their use.
pub(crate) struct Listing<'l> {
    prefix: &'l str,
    needed: Vec<Needed>,
}

impl<'l> Listing<'l> {
    /// An empty list for a layer whose tensors have names with this prefix.
    pub(crate) fn new(prefix: &'l str) -> Self {
        Self { prefix, needed: Vec::new() }
    }

    fn add(&mut self, prefix: &str, part: &str, shape: &[usize], role: Role, meaning: &'static str) {
        let name = format!("{prefix}.{part}");
        self.needed.push(Needed { name, shape: shape.to_vec(), role, meaning });
    }

    /// Factors of products, of which `inputs` enter a sum.
    pub(crate) fn weight(&mut self, part: &str, shape: &[usize], inputs: usize, meaning: &'static str) {
        self.add(self.prefix, part, shape, Role::Weight { inputs }, meaning);
    }

    /// Terms of sums.
    pub(crate) fn shift(&mut self, part: &str, shape: &[usize], meaning: &'static str) {
        self.add(self.prefix, part, shape, Role::Shift, meaning);
    }

    /// Batch norm over `channels` with its own prefix; running variances are drawn around `about`.
    pub(crate) fn norm(&mut self, prefix: &str, channels: usize, about: f64) {
        const VARIANCE: &str = "batch norm's running variance, to which 1e-5 is added: (channel)";
        let shape = [channels];
        self.add(prefix, "weight", &shape, Role::Scale, "batch norm's gamma: (channel)");
        self.add(prefix, "bias", &shape, Role::Shift, "batch norm's beta: (channel)");
        self.add(prefix, "running_mean", &shape, Role::Mean, "batch norm's running mean: (channel)");
        self.add(prefix, "running_var", &shape, Role::Variance { about }, VARIANCE);
    }

    pub(crate) fn needed(self) -> Vec<Needed> {
        self.needed
    }
}

/// Reports layers that would read one tensor; a layer has a name, a line and its tensors.
pub(super) fn report_shared<'l>(
    layers: impl Iterator<Item = (&'l str, usize, Vec<Needed>)>,
    problems: &mut Problems,
) {
    let mut by_line: Vec<_> = layers.filter(|(layer, ..)| !layer.is_empty()).collect();
    by_line.sort_by_key(|(_, line, _)| *line);
    let mut first: BTreeMap<String, &str> = BTreeMap::new();
    for (layer, line, tensors) in by_line {
        for Needed { name, .. } in tensors {
            let other = *first.entry(name.clone()).or_insert(layer);
            // Layers with the same name were already reported, and therefore share their tensors.
            if other != layer {
                let kind = ProblemKind::SharedTensor { tensor: name, other: other.to_owned() };
                problems.add(line, Some(layer), kind);
                break;
            }
        }
    }
}

/// Names in `weights` that `network` does not read, in order.
pub(super) fn unused(network: &str, needed: &[Needed], weights: &Weights) -> Result<Vec<String>, ModelError> {
    let names = names(network, needed, weights)?;
    let used = names.used();
    Ok(weights.names().filter(|name| !used.contains(name)).map(str::to_owned).collect())
}

fn names(network: &str, needed: &[Needed], weights: &Weights) -> Result<Names, ModelError> {
    let needed: Vec<&str> = needed.iter().map(|tensor| &*tensor.name).collect();
    Names::find(network, &needed, weights)
}

/// Finds tensors of the expected shape, and notes tensors that do not fit.
pub(crate) struct Tensors<'a> {
    network: &'a str,
    weights: &'a Weights,
    names: Names,
    problems: Vec<TensorProblem>,
}

impl<'a> Tensors<'a> {
    /// The tensors of `network`, which needs `needed`.
    pub(crate) fn new(network: &'a str, needed: &[Needed], weights: &'a Weights) -> Result<Self, ModelError> {
        let names = names(network, needed, weights)?;
        Ok(Self { network, weights, names, problems: Vec::new() })
    }

    /// `parts`, unless a tensor did not fit.
    pub(super) fn finish<T>(mut self, parts: Option<T>) -> Result<T, ModelError> {
        if let Some(parts) = parts.filter(|_| self.problems.is_empty()) {
            return Ok(parts);
        }
        self.find_lookalikes();
        Err(ModelError::Weights { network: self.network.to_owned(), problems: self.problems })
    }

    /// Names the possible tensors for each missing one: floats that no layer reads.
    fn find_lookalikes(&mut self) {
        let used = self.names.used();
        let mut left: BTreeMap<Vec<usize>, Vec<(&str, &[usize])>> = BTreeMap::new();
        for (name, tensor) in
            self.weights.iter().filter(|(name, tensor)| tensor.values().is_some() && !used.contains(name))
        {
            left.entry(sorted(tensor.shape())).or_default().push((name, tensor.shape()));
        }
        // By shape, because many missing tensors may have the shape of many others.
        let mut found: BTreeMap<Vec<usize>, [Lookalikes; 2]> = BTreeMap::new();
        for problem in &mut self.problems {
            let TensorProblemKind::Missing { expected, same, transposed } = &mut problem.kind else {
                continue;
            };
            let expected: &[usize] = expected;
            let of_shape = found.entry(expected.to_vec()).or_insert_with(|| {
                let alike = left.get(&sorted(expected)).map_or(&[][..], Vec::as_slice);
                [true, false].map(|equal| {
                    // Old versions of torch_geometric store the weight of the root transposed.
                    let fits = |name: &str, shape: &[usize]| {
                        shape == expected && name.rsplit('.').next() != Some("root")
                    };
                    let alike = alike.iter().filter(|(name, shape)| fits(name, shape) == equal);
                    Lookalikes::of(alike.map(|(name, _)| *name))
                })
            });
            [*same, *transposed] = of_shape.clone();
        }
    }

    /// Notes that the tensor `name` does not fit.
    fn refuse(&mut self, name: &str, kind: TensorProblemKind) {
        let in_file = self.names.held(name).filter(|held| *held != name).map(str::to_owned);
        self.problems.push(TensorProblem { tensor: name.to_owned(), in_file, kind });
    }

    /// The values of the tensor `name`, whose shape must be `expected`.
    fn get(&mut self, name: &str, expected: &[usize]) -> Option<&'a [f32]> {
        let weights = self.weights;
        let Some(tensor) = self.names.held(name).and_then(|held| weights.get(held)) else {
            let (same, transposed) = (Lookalikes::default(), Lookalikes::default());
            self.refuse(name, TensorProblemKind::Missing { expected: expected.to_vec(), same, transposed });
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

    /// The values of all tensors of a layer; `None` if one does not fit. Notes each tensor that
    /// does not fit.
    pub(super) fn all(&mut self, needed: &[Needed]) -> Option<Values<'a>> {
        let found: Vec<_> = needed.iter().map(|tensor| self.get(&tensor.name, &tensor.shape)).collect();
        found.into_iter().collect::<Option<Vec<_>>>().map(|found| Values(found.into_iter()))
    }

    /// Batch norm over `channels`, whose scales and shifts are within f32's range.
    pub(crate) fn norm(&mut self, prefix: &str, channels: usize) -> Option<Norm> {
        let mut part = |part: &str| self.get(&format!("{prefix}.{part}"), &[channels]);
        let parts = [part("weight"), part("bias"), part("running_mean"), part("running_var")];
        let [gamma, beta, mean, variance] = parts;
        if let Some((index, &value)) = variance.and_then(|v| v.iter().enumerate().find(|(_, v)| **v < 0.0)) {
            self.refuse(&format!("{prefix}.running_var"), TensorProblemKind::Variance { index, value });
            return None;
        }
        let (gamma, beta, mean, variance) = (gamma?, beta?, mean?, variance?);
        let mut norm = Norm { scales: Vec::new(), shifts: Vec::new() };
        for index in 0..channels {
            let scale = f64::from(gamma[index]) / (f64::from(variance[index]) + EPSILON).sqrt();
            let shift = f64::from(beta[index]) - f64::from(mean[index]) * scale;
            let weight = format!("{prefix}.weight");
            self.folded(&weight, "scale", index, scale)?;
            self.folded(&weight, "shift", index, shift)?;
            norm.scales.push(scale);
            norm.shifts.push(shift);
        }
        Some(norm)
    }

    /// `value` rounded to f32; notes the tensor `name` if the result is not finite.
    pub(super) fn folded(&mut self, name: &str, what: &'static str, index: usize, value: f64) -> Option<f32> {
        let rounded = value as f32;
        if rounded.is_finite() {
            return Some(rounded);
        }
        self.refuse(name, TensorProblemKind::Folded { what, index, value });
        None
    }
}

/// The sizes of `shape` in ascending order; they are the same for a transposed tensor.
fn sorted(shape: &[usize]) -> Vec<usize> {
    let mut sizes = shape.to_vec();
    sizes.sort_unstable();
    sizes
}

/// The values of a layer's tensors, in the order of their use.
pub(super) struct Values<'a>(std::vec::IntoIter<&'a [f32]>);

impl<'a> Values<'a> {
    /// The values of the next tensor.
    pub(super) fn take(&mut self) -> &'a [f32] {
        self.0.next().unwrap_or_default()
    }

    /// The values of the next tensor, if the layer has it.
    pub(super) fn take_if(&mut self, there: bool) -> Option<Vec<f32>> {
        there.then(|| self.take().to_vec())
    }
}

/// Batch norm as one product and one sum per channel.
#[derive(Clone, Debug)]
pub(crate) struct Norm {
    pub(super) scales: Vec<f64>,
    pub(super) shifts: Vec<f64>,
}

impl Norm {
    /// Products and sums, each rounded once.
    pub(crate) fn rounded(&self) -> (Vec<f32>, Vec<f32>) {
        let round = |values: &[f64]| values.iter().map(|&value| value as f32).collect();
        (round(&self.scales), round(&self.shifts))
    }
}
