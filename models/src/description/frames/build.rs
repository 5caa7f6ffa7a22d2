//! The engine's frame network from a description and weights.
//!
//! Enters: a checked [`FrameDescription`] and [`Weights`]. Leaves: [`FrameNetworkParts`], or every
//! tensor that does not fit. Batch norm is folded and an LSTM's biases are added in f64:
//!
//! ```text
//! W' = W scale,   b' = b scale + shift
//! ```

use meissner_engine::frames::{FrameLayer as Part, FrameLayerKind as Kind, FrameNetworkParts, FrameShape};
use meissner_kernels::Activation;

use super::FrameDescription;
use super::layer::{FrameKind, FrameLayer};
use crate::description::tensors::{Tensors, Values};
use crate::error::ModelError;
use crate::weights::Weights;

impl FrameDescription {
    /// The network with `weights`, whose names may all carry one further prefix such as "module.".
    ///
    /// # Errors
    /// [`ModelError::Weights`] with every tensor that is missing, of another shape or type, or not
    /// computable; [`ModelError::Ambiguous`] for several prefixes; [`ModelError::Preparation`] for
    /// weights trained on other frames ([`Self::preparation`]).
    pub fn network_parts(&self, weights: &Weights) -> Result<FrameNetworkParts, ModelError> {
        self.check_preparation(weights)?;
        self.network_parts_regardless(weights)
    }

    /// As [`Self::network_parts`], whatever the weights say about the frames of their training.
    ///
    /// # Errors
    /// As [`Self::network_parts`], without [`ModelError::Preparation`].
    pub fn network_parts_regardless(&self, weights: &Weights) -> Result<FrameNetworkParts, ModelError> {
        let mut tensors = Tensors::new(&self.name, &self.needed(), weights)?;
        let layers = parts(&self.layers, &mut tensors);
        let layers = tensors.finish(layers)?;
        Ok(FrameNetworkParts { name: self.name.clone(), input: self.input, layers })
    }
}

/// The engine's layers; `None` where a tensor does not fit.
pub(in crate::description) fn parts(layers: &[FrameLayer], tensors: &mut Tensors<'_>) -> Option<Vec<Part>> {
    // Every layer is read before any is missed, so that every tensor that does not fit is noted.
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

/// Weight and bias of `outputs` rows, with batch norm in them where there is any.
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
