//! Descriptions of frame networks: a TOML file, checked into layers over images and vectors.
//!
//! Input: text. Output: a [`FrameDescription`], or every inconsistency with its line. The file has
//! a table `[input]` instead of `[graph]` (`docs/network-files.md`).

mod file;
mod layer;
mod shapes;
mod source;

use meissner_engine::filters::FilterRule;
use meissner_engine::frames::{FrameLayer as Part, FrameLayerKind as Kind, FrameNetworkParts, FrameShape};
use meissner_kernels::Activation;
use serde::Serialize;

use crate::description::document::{EVENT_NETWORK, FRAME_NETWORK, INPUT, output};
use crate::description::filters;
use crate::description::problem::ProblemKind;
use crate::description::references::Scope;
use crate::description::table::{self, NAME, Table};
use crate::description::tensors::{Needed, Tensors, Values, report_shared};
use crate::error::ModelError;
use crate::weights::Weights;

pub(super) use file::read_head;
pub(crate) use layer::{FRAME, serialize_shape};
pub use layer::{FrameKind, FrameLayer};
pub(super) use shapes::{Stack, check, extent, fits};
pub use source::{CropPlace, FrameSource, PictureSettings, Readings, SignedTiming};

/// A checked description of a frame network.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameDescription {
    name: String,
    #[serde(serialize_with = "serialize_shape")]
    input: FrameShape,
    source: FrameSource,
    #[serde(serialize_with = "filters::serialize", skip_serializing_if = "Vec::is_empty")]
    filters: Vec<FilterRule>,
    layers: Vec<FrameLayer>,
    outputs: Vec<String>,
    units: Vec<String>,
}

impl FrameDescription {
    /// Checks the file whose table is `root`.
    pub(super) fn check(mut root: Table<'_, '_>) -> Option<Self> {
        if root.line_of(INPUT).is_none()
            && let Some(line) = root.line_of("graph")
        {
            root.report(line, ProblemKind::Family { expected: FRAME_NETWORK, found: EVENT_NETWORK });
            return None;
        }
        let mut name = String::new();
        if let Some(mut table) = root.table("network", "a table with the network's name") {
            name = table.value("name", NAME, None, table::name);
            table.finish();
        }
        let input = root.table(INPUT, "a table with a frame's shape and source");
        let (shape, source) = input.map_or((None, None), file::read);
        let filters = file::read_filters(&mut root, source.as_ref());
        let output = output(&mut root);
        let layers = file::read_layers(&mut root);
        let problems = root.finish();
        let stack = Stack {
            layers: &layers,
            scope: Scope { input: FRAME, second: "with", place: "in this file", above: true },
            shape,
            state: true,
            names: output.names.as_ref(),
            by_channel: true,
        };
        let layers = check(stack, problems);
        report_shared(layers.iter().map(|layer| (&*layer.name, layer.line, layer.tensors())), problems);
        let (outputs, units) = (output.names?.value, output.units);
        Some(Self { name, input: shape?, source: source?, filters, layers, outputs, units })
    }

    /// Name, for reports.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Shape of a frame.
    pub fn input(&self) -> FrameShape {
        self.input
    }

    /// The source of the frames.
    pub fn source(&self) -> &FrameSource {
        &self.source
    }

    /// The filters of the events from which frames are made, in the order in which events pass
    /// them.
    pub fn filters(&self) -> &[FilterRule] {
        &self.filters
    }

    /// The layers, each after the layers that it reads; the last one predicts.
    pub fn layers(&self) -> &[FrameLayer] {
        &self.layers
    }

    /// Shape of the prediction.
    pub fn output(&self) -> FrameShape {
        self.layers.last().map_or(self.input, |layer| layer.output)
    }

    /// Names of the predicted values or of a predicted image's channels, and their units.
    pub fn outputs(&self) -> (&[String], &[String]) {
        (&self.outputs, &self.units)
    }

    /// Number of trained parameters: weights, biases, and the two of batch norm, without its
    /// running statistics.
    pub fn parameters(&self) -> usize {
        self.layers.iter().map(|layer| layer.parameters).sum()
    }

    /// Number of multiply-adds of weights with values for one frame.
    pub fn multiply_adds(&self) -> usize {
        self.layers.iter().map(|layer| layer.multiply_adds).sum()
    }

    /// Number of values that it keeps from frame to frame.
    pub fn state(&self) -> usize {
        self.layers.iter().map(|layer| layer.state).sum()
    }

    pub(crate) fn needed(&self) -> Vec<Needed> {
        self.layers.iter().flat_map(FrameLayer::tensors).collect()
    }
}

impl FrameDescription {
    /// The network with `weights`. Their names may differ according to the habits of `PyTorch`,
    /// which `docs/weights-from-pytorch.md` lists.
    ///
    /// # Errors
    /// [`ModelError::Weights`] with every tensor that is missing, of another shape or type, or not
    /// computable; [`ModelError::Ambiguous`] and [`ModelError::Doubled`] for names that fit more
    /// than one way; [`ModelError::Map`] for names of a map that the network does not read;
    /// [`ModelError::Preparation`] for weights trained on other frames ([`Self::preparation`]);
    /// [`ModelError::Metadata`] for an invalid `training_windows`.
    pub fn network_parts(&self, weights: &Weights) -> Result<FrameNetworkParts, ModelError> {
        self.check_preparation(weights)?;
        self.network_parts_regardless(weights)
    }

    /// As [`Self::network_parts`], whatever the weights state about the frames of their training.
    ///
    /// # Errors
    /// As [`Self::network_parts`], without [`ModelError::Preparation`].
    pub fn network_parts_regardless(&self, weights: &Weights) -> Result<FrameNetworkParts, ModelError> {
        let mut tensors = Tensors::new(&self.name, &self.needed(), weights)?;
        let layers = parts(&self.layers, &mut tensors);
        let layers = tensors.finish(layers)?;
        let training = weights.training_frames(self.input)?;
        Ok(FrameNetworkParts { name: self.name.clone(), input: self.input, layers, training })
    }
}

/// The engine's layers; `None` if a tensor does not fit. Batch norm is folded, W' = W scale and
/// b' = b scale + shift, and an LSTM's biases are added in f64, rounded once.
pub(in crate::description) fn parts(layers: &[FrameLayer], tensors: &mut Tensors<'_>) -> Option<Vec<Part>> {
    // Reads every layer even if one does not fit, so that every tensor that does not fit is noted.
    let parts: Vec<Option<Part>> = layers.iter().map(|layer| part(layer, tensors)).collect();
    parts.into_iter().collect()
}

fn part(layer: &FrameLayer, tensors: &mut Tensors<'_>) -> Option<Part> {
    let mut values = tensors.all(&layer.tensors())?;
    let kind = match layer.kind {
        FrameKind::Conv { channels, kernel, bias, ref norm, activation } => {
            let (weight, bias) = normed(layer, channels, bias, norm.as_deref(), &mut values, tensors)?;
            Kind::Conv { kernel, channels, weight, bias, relu: activation == Activation::Relu }
        }
        FrameKind::UpConv { channels, bias } => {
            Kind::UpConv { channels, weight: values.take().to_vec(), bias: values.take_if(bias) }
        }
        FrameKind::MaxPool => Kind::MaxPool,
        FrameKind::AveragePool { size } => Kind::AveragePool { size },
        FrameKind::GlobalAverage => Kind::GlobalAverage,
        FrameKind::Sum => Kind::Sum,
        FrameKind::Concat { .. } => Kind::Concat { with: layer.joins? },
        FrameKind::SqueezeExcite { reduction } => {
            let FrameShape::Image { channels, .. } = layer.input else { return None };
            let (down, up) = (values.take().to_vec(), values.take().to_vec());
            Kind::SqueezeExcite { reduced: channels / reduction, down, up }
        }
        FrameKind::ConvLstm { hidden, peepholes, activation } => {
            let (weight, bias) = (values.take().to_vec(), values.take().to_vec());
            let peepholes = values.take_if(peepholes);
            Kind::ConvLstm { hidden, weight, bias, peepholes, activation }
        }
        FrameKind::Lstm { hidden, layer: number } => {
            let (weight_ih, weight_hh) = (values.take().to_vec(), values.take().to_vec());
            let name = layer.tensor(&format!("bias_ih_l{number}"));
            let both = values.take().iter().zip(values.take()).map(|(&a, &b)| f64::from(a) + f64::from(b));
            let bias: Option<Vec<f32>> =
                both.enumerate().map(|(i, sum)| tensors.folded(&name, "bias", i, sum)).collect();
            Kind::Lstm { hidden, weight_ih, weight_hh, bias: bias? }
        }
        FrameKind::Delay { frames } => Kind::Delay { frames },
        FrameKind::Flatten => Kind::Flatten,
        FrameKind::Dense { outputs, bias, ref norm, activation } => {
            let (weight, bias) = normed(layer, outputs, bias, norm.as_deref(), &mut values, tensors)?;
            Kind::Dense { outputs, weight, bias, activation }
        }
    };
    Some(Part { name: layer.name.clone(), from: layer.reads, kind })
}

/// Weight and bias of `outputs` rows, including batch norm if there is any.
fn normed(
    layer: &FrameLayer,
    outputs: usize,
    bias: bool,
    norm: Option<&str>,
    values: &mut Values<'_>,
    tensors: &mut Tensors<'_>,
) -> Option<(Vec<f32>, Option<Vec<f32>>)> {
    let (weight, bias) = (values.take(), bias.then(|| values.take()));
    let Some(norm) = norm else { return Some((weight.to_vec(), bias.map(<[f32]>::to_vec))) };
    let norm = tensors.norm(norm, outputs)?;
    let (name, inputs) = (layer.tensor("weight"), weight.len() / outputs);
    let mut folded = (Vec::with_capacity(weight.len()), Vec::with_capacity(outputs));
    for (o, row) in weight.chunks_exact(inputs).enumerate() {
        let (scale, shift) = (norm.scales[o], norm.shifts[o]);
        for &w in row {
            folded.0.push(tensors.folded(&name, "weight", o, f64::from(w) * scale)?);
        }
        let b = bias.map_or(0.0, |bias| f64::from(bias[o]));
        folded.1.push(tensors.folded(&name, "bias", o, b * scale + shift)?);
    }
    Some((folded.0, Some(folded.1)))
}
