//! Compiles checked parts of a frame network: shapes, kernels, and the buffer of each value.

use std::iter;

use meissner_kernels::{
    Activation, Conv1x1, Conv3x3, ConvParts, Dense, KernelError, Kn2rowConv3x3, Lstm, LstmParts,
    PlanarConv3x3, PlanarConvLstm, PooledConv3x3, Squash, SqueezeExcite, TransposedConv2x2, WinogradConv3x3,
};

use super::network::{
    Convolution, FrameLayer, FrameLayerKind, FrameNetworkParts, FrameShape, fingerprint_of,
};
use super::shapes::{check_shape, output_shape, with};
use super::unlikeness::{FrameStatistics, TrainingFrames};
use crate::EngineError;
use crate::error::misfit;

/// Images are stored as planes if no image of the network has more channels than this.
const PLANAR_CHANNELS: usize = 4;

/// A network of layers over images and vectors, ready to run.
#[derive(Clone, Debug)]
pub struct FrameNetwork {
    pub(super) name: String,
    pub(super) units: Vec<CompiledLayer>,
    /// Shape and storage of the frame, then of each layer's output.
    pub(super) values: Vec<Value>,
    pub(super) buffers: Vec<FrameShape>,
    pub(super) planar: bool,
    pub(super) fingerprint: u64,
    training: Option<TrainingFrames>,
}

/// A value: the frame, or a layer's output.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    pub(super) shape: FrameShape,
    /// The buffer that stores it, starting at channel `first`.
    pub(super) buffer: usize,
    pub(super) first: usize,
}

#[derive(Clone, Debug)]
pub(super) struct CompiledLayer {
    pub(super) name: String,
    pub(super) from: usize,
    pub(super) with: Option<usize>,
    pub(super) kernel: Kernel,
    /// Whether it runs for every frame, and not only when a prediction is read.
    pub(super) eager: bool,
    pub(super) multiply_adds: u64,
}

impl CompiledLayer {
    pub(super) fn reads(&self) -> impl Iterator<Item = usize> + use<> {
        iter::once(self.from).chain(self.with)
    }
}

#[derive(Clone, Debug)]
pub(super) enum Kernel {
    Conv3(Box<Conv3x3>),
    /// Fused with the next 2 x 2 maximum, whose own layer only passes on changes.
    PooledConv(Box<PooledConv3x3>),
    Winograd(Box<WinogradConv3x3>),
    Kn2row(Box<Kn2rowConv3x3>),
    Conv1(Box<Conv1x1>),
    UpConv(Box<TransposedConv2x2>),
    PlanarConv(Box<PlanarConv3x3>),
    MaxPool,
    AveragePool(usize),
    GlobalAverage,
    Sum,
    /// Only passes on changes: a concatenation whose images are in its buffer already, or the
    /// pooling of a fused convolution.
    Alias,
    /// Copies two vectors into one: the second starts within a lane, where no layer can write.
    Append,
    SqueezeExcite(Box<SqueezeExcite>),
    ConvLstm(Box<ConvLstm>),
    PlanarConvLstm(Box<PlanarConvLstm>),
    Lstm(Box<Lstm>),
    Delay(usize),
    Flatten,
    Dense(Box<Dense>),
}

/// A convolutional LSTM over a map with channels last.
#[derive(Clone, Debug)]
pub(super) struct ConvLstm {
    pub(super) gates: Conv3x3,
    pub(super) hidden: usize,
    /// Peepholes of i, f and o, each (pixels, hidden).
    pub(super) peepholes: Option<[Vec<f32>; 3]>,
    pub(super) squash: Squash,
}

impl FrameNetwork {
    /// Checks `parts` and packs their parameters.
    ///
    /// # Errors
    /// [`EngineError::Network`] for a layer that does not fit its input; [`EngineError::Layer`] for
    /// parameters that a kernel refuses.
    pub fn new(parts: FrameNetworkParts, convolution: Convolution) -> Result<Self, EngineError> {
        let FrameNetworkParts { name, input, layers, training } = parts;
        check_shape("frame", input)?;
        if layers.is_empty() {
            return Err(misfit("network", "layers", "at least one", "none"));
        }
        let mut shapes = vec![input];
        for (i, layer) in layers.iter().enumerate() {
            for read in [Some(layer.from), with(layer)].into_iter().flatten() {
                if read > i {
                    let expected = "the frame or a layer before it";
                    return Err(misfit(&layer.name, "input", expected, format!("value {read}")));
                }
            }
            let shape = output_shape(layer, &shapes)?;
            check_shape(&layer.name, shape)?;
            shapes.push(shape);
        }
        let planar = is_planar(&layers, &shapes);
        let (mut values, buffers) = places(&layers, &shapes)?;
        let mut units = Vec::with_capacity(layers.len());
        for (i, layer) in layers.iter().enumerate() {
            let (kernel, each) = kernel(layer, &shapes, planar, convolution)?;
            let multiply_adds = each * shapes[i + 1].pixels();
            let with = with(layer);
            units.push(CompiledLayer {
                name: layer.name.clone(),
                from: layer.from,
                with,
                kernel,
                eager: false,
                multiply_adds,
            });
        }
        if training.as_ref().is_some_and(|training| !training.fits(input)) {
            return Err(misfit("frame", "training", "features that such frames have", input));
        }
        fuse_poolings(&mut units, &mut values);
        mark_eager(&mut units);
        let fingerprint = fingerprint_of(&name, input, &layers, convolution);
        Ok(Self { name, units, values, buffers, planar, fingerprint, training })
    }

    /// Hash of structure, names and parameters, as [`crate::Network::fingerprint`].
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    pub(crate) fn identity(&self) -> (u64, &str) {
        (self.fingerprint, &self.name)
    }

    /// Name of the network.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Shape of a frame.
    pub fn input(&self) -> FrameShape {
        self.values[0].shape
    }

    /// Shape of the prediction.
    pub fn output(&self) -> FrameShape {
        self.values[self.units.len()].shape
    }

    /// Name of the frame (value 0) or of the layer that writes a value, for messages.
    pub(super) fn value_name(&self, value: usize) -> &str {
        value.checked_sub(1).map_or("frame", |unit| &self.units[unit].name)
    }

    /// Names of the layers, in order.
    pub fn layers(&self) -> impl Iterator<Item = &str> {
        self.units.iter().map(|unit| unit.name.as_str())
    }

    /// Statistics of the frames of its training, if known.
    pub fn training(&self) -> Option<&TrainingFrames> {
        self.training.as_ref()
    }

    pub(super) fn statistics(&self) -> Option<FrameStatistics> {
        self.training.as_ref()?.statistics(self.input(), self.has_state())
    }

    /// Whether a prediction depends on earlier frames than the last.
    pub fn has_state(&self) -> bool {
        self.units.iter().any(|unit| unit.eager)
    }

    /// Whether Winograd's algorithm is requested and applies to a 3 x 3 convolution of
    /// channels-last maps.
    pub fn has_winograd(&self) -> bool {
        self.units.iter().any(|unit| matches!(unit.kernel, Kernel::Winograd(_)))
    }

    /// Multiply-adds of one frame and one prediction if nothing is skipped.
    pub fn multiply_adds(&self) -> u64 {
        self.units.iter().map(|unit| unit.multiply_adds).sum()
    }
}

fn refused(layer: &FrameLayer) -> impl Fn(KernelError) -> EngineError + '_ {
    |source| EngineError::Layer { layer: layer.name.clone(), source }
}

/// Whether every image has few channels and every layer has a kernel for planes.
fn is_planar(layers: &[FrameLayer], shapes: &[FrameShape]) -> bool {
    use FrameLayerKind as Kind;
    let few = |shape: &FrameShape| match shape {
        FrameShape::Image { channels, .. } => *channels <= PLANAR_CHANNELS,
        FrameShape::Vector(_) => true,
    };
    shapes.iter().all(few)
        && layers.iter().all(|layer| match layer.kind {
            Kind::Concat { .. } => matches!(shapes[layer.from], FrameShape::Vector(_)),
            Kind::Conv { kernel: 1, .. }
            | Kind::UpConv { .. }
            | Kind::SqueezeExcite { .. }
            | Kind::GlobalAverage
            | Kind::ConvLstm { peepholes: Some(_), .. } => false,
            _ => true,
        })
}

/// Storage of each value: a buffer of its own, or some channels of a concatenated image.
fn places(
    layers: &[FrameLayer],
    shapes: &[FrameShape],
) -> Result<(Vec<Value>, Vec<FrameShape>), EngineError> {
    let mut values: Vec<Value> =
        shapes.iter().enumerate().map(|(buffer, &shape)| Value { shape, buffer, first: 0 }).collect();
    for (i, layer) in layers.iter().enumerate().rev() {
        let Some(with) = with(layer) else { continue };
        let into = values[i + 1];
        let FrameShape::Image { channels, .. } = shapes[layer.from] else { continue };
        for (part, first) in [(layer.from, 0), (with, channels)] {
            // A value is stored once: an input here is not the frame and not in another
            // concatenation.
            let writer = part.checked_sub(1).map(|w| &layers[w]);
            let free = values[part].buffer == part
                && layer.from != with
                && writer.is_some_and(|w| {
                    // Its writer must not read from the buffer that it would write to.
                    values[w.from].buffer != into.buffer && !matches!(w.kind, FrameLayerKind::ConvLstm { .. })
                });
            if !free {
                let expected = "two layers of their own, each part of one concatenation";
                return Err(misfit(
                    &layer.name,
                    "inputs",
                    expected,
                    format!("values {} and {with}", layer.from),
                ));
            }
            values[part] = Value { buffer: into.buffer, first: into.first + first, ..values[part] };
        }
    }
    Ok((values, shapes.to_vec()))
}

/// Kernel of a layer, and multiply-adds of one output pixel or of the vector.
fn kernel(
    layer: &FrameLayer,
    shapes: &[FrameShape],
    planar: bool,
    convolution: Convolution,
) -> Result<(Kernel, u64), EngineError> {
    use FrameLayerKind as Kind;
    let from = shapes[layer.from];
    let [channels, height, width] = from.sides();
    let refused = refused(layer);
    let conv =
        |inputs: Vec<usize>, outputs: usize, weight: &[f32], bias: Option<&[f32]>, relu: bool| ConvParts {
            inputs,
            outputs,
            weight: weight.to_vec(),
            bias: bias.map(<[f32]>::to_vec),
            norm: None,
            relu,
        };
    Ok(match &layer.kind {
        Kind::Conv { kernel: 3, channels: outputs, weight, bias, relu } if planar => {
            let conv = PlanarConv3x3::new([channels, 0], *outputs, weight, bias.as_deref(), *relu);
            (Kernel::PlanarConv(Box::new(conv.map_err(refused)?)), (9 * channels * outputs) as u64)
        }
        Kind::Conv { kernel, channels: outputs, weight, bias, relu } => {
            let parts = conv(vec![channels], *outputs, weight, bias.as_deref(), *relu);
            let each = (kernel * kernel * channels * outputs) as u64;
            let kernel = match (*kernel, convolution) {
                (3, Convolution::Winograd(tile)) => {
                    Kernel::Winograd(Box::new(WinogradConv3x3::new(&parts, tile).map_err(refused)?))
                }
                (3, Convolution::Kn2row) if *outputs <= Kn2rowConv3x3::MAX_OUTPUTS => {
                    Kernel::Kn2row(Box::new(Kn2rowConv3x3::new(&parts).map_err(refused)?))
                }
                (3, _) => Kernel::Conv3(Box::new(Conv3x3::new(&parts).map_err(refused)?)),
                _ => Kernel::Conv1(Box::new(Conv1x1::new(&parts).map_err(refused)?)),
            };
            (kernel, each)
        }
        Kind::UpConv { channels: outputs, weight, bias } => {
            let conv =
                TransposedConv2x2::new(&conv(vec![channels], *outputs, weight, bias.as_deref(), false));
            (Kernel::UpConv(Box::new(conv.map_err(refused)?)), (channels * outputs) as u64)
        }
        Kind::MaxPool => (Kernel::MaxPool, 0),
        Kind::AveragePool { size } => (Kernel::AveragePool(*size), 0),
        Kind::GlobalAverage => (Kernel::GlobalAverage, 0),
        Kind::Sum => (Kernel::Sum, 0),
        Kind::Concat { .. } => match from {
            FrameShape::Image { .. } => (Kernel::Alias, 0),
            FrameShape::Vector(_) => (Kernel::Append, 0),
        },
        Kind::SqueezeExcite { reduced, down, up } => {
            let squeeze = SqueezeExcite::new(channels, *reduced, down, up).map_err(refused)?;
            (Kernel::SqueezeExcite(Box::new(squeeze)), channels as u64)
        }
        Kind::ConvLstm { hidden, weight, bias, peepholes, activation } => {
            let squash = squash(layer, *activation)?;
            let each = (9 * (channels + hidden) * 4 * hidden) as u64;
            if planar {
                let lstm = PlanarConvLstm::new(channels, *hidden, weight, Some(bias), squash);
                return Ok((Kernel::PlanarConvLstm(Box::new(lstm.map_err(refused)?)), each));
            }
            let parts = conv(vec![channels, *hidden], 4 * hidden, weight, Some(bias), false);
            let gates = Conv3x3::new(&parts).map_err(refused)?;
            let pixels = height * width;
            let peepholes = match peepholes {
                Some(weight)
                    if weight.len() == 3 * hidden * pixels && weight.iter().all(|w| w.is_finite()) =>
                {
                    let of = |gate: usize| {
                        let weight = &weight[gate * hidden * pixels..];
                        (0..pixels).flat_map(|p| (0..*hidden).map(move |c| weight[c * pixels + p])).collect()
                    };
                    Some([of(0), of(1), of(2)])
                }
                Some(weight) => {
                    let expected = format!("{} finite values", 3 * hidden * pixels);
                    return Err(misfit(&layer.name, "peepholes", expected, weight.len()));
                }
                None => None,
            };
            (Kernel::ConvLstm(Box::new(ConvLstm { gates, hidden: *hidden, peepholes, squash })), each)
        }
        Kind::Lstm { hidden, weight_ih, weight_hh, bias } => {
            let parts = LstmParts {
                inputs: channels,
                hidden: *hidden,
                weight_ih,
                weight_hh,
                bias_ih: Some(bias),
                bias_hh: None,
                squash: Squash::Tanh,
            };
            let lstm = Lstm::new(&parts).map_err(refused)?;
            (Kernel::Lstm(Box::new(lstm)), (4 * hidden * (channels + hidden)) as u64)
        }
        Kind::Delay { frames } => (Kernel::Delay(*frames), 0),
        Kind::Flatten => (Kernel::Flatten, 0),
        Kind::Dense { outputs, weight, bias, activation } => {
            let dense = Dense::new(1, channels, *outputs, weight, bias.as_deref(), *activation);
            (Kernel::Dense(Box::new(dense.map_err(refused)?)), (channels * outputs) as u64)
        }
    })
}

fn squash(layer: &FrameLayer, activation: Activation) -> Result<Squash, EngineError> {
    match activation {
        Activation::Tanh => Ok(Squash::Tanh),
        Activation::Sigmoid => Ok(Squash::Sigmoid),
        other => Err(misfit(&layer.name, "activation", "tanh or sigmoid", format!("{other:?}"))),
    }
}

/// Fuses a convolution with the pooling that is its only reader: the map between them is never
/// written.
fn fuse_poolings(units: &mut [CompiledLayer], values: &mut [Value]) {
    for i in 1..units.len() {
        let Some(conv) = units[i].from.checked_sub(1) else { continue };
        let read_by = |unit: &CompiledLayer| unit.from == conv + 1 || unit.with == Some(conv + 1);
        let alone = units.iter().filter(|unit| read_by(unit)).count() == 1;
        let own = values[conv + 1].buffer == conv + 1;
        if alone
            && own
            && matches!((&units[conv].kernel, &units[i].kernel), (Kernel::Conv3(_), Kernel::MaxPool))
        {
            let Kernel::Conv3(kernel) = std::mem::replace(&mut units[conv].kernel, Kernel::Alias) else {
                continue;
            };
            units[i].kernel = Kernel::PooledConv(Box::new(PooledConv3x3::new(*kernel)));
            // The pooling's new input.
            let Value { buffer, first, .. } = values[units[conv].from];
            values[conv + 1] = Value { buffer, first, ..values[conv + 1] };
        }
    }
}

/// Marks the layers on which a state depends: they run for every frame.
fn mark_eager(units: &mut [CompiledLayer]) {
    for i in (0..units.len()).rev() {
        let keeps_state = matches!(
            units[i].kernel,
            Kernel::ConvLstm(_) | Kernel::PlanarConvLstm(_) | Kernel::Lstm(_) | Kernel::Delay(_)
        );
        if keeps_state || units[i].eager {
            units[i].eager = true;
            for read in units[i].reads() {
                if let Some(writer) = read.checked_sub(1) {
                    units[writer].eager = true;
                }
            }
        }
    }
}
