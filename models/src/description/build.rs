//! A network from a description and weights.
//!
//! Enters: a checked [`Description`] and [`Weights`]. Leaves: a [`Network`], or every tensor that
//! does not fit. Batch norm becomes one product and one sum, rounded once.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameLayer as Part, FrameNetwork, FrameNetworkParts};
use meissner_engine::{Block, DenseLayer, EngineError, Level, Network, NetworkParts, Pooling, Readout};
use meissner_kernels::{Dense, KernelError};

use super::layer::{Layer, LayerKind};
use super::tensors::Tensors;
use super::{Description, frames};
use crate::error::ModelError;
use crate::weights::Weights;

impl Description {
    /// The network with `weights`, whose names may all carry one further prefix such as "module.".
    ///
    /// # Errors
    /// [`ModelError::Weights`] with every tensor that is missing, of another shape or type, or not
    /// computable; [`ModelError::Ambiguous`] for several prefixes; [`ModelError::Preparation`] for
    /// weights trained on other graphs ([`Self::preparation`]); [`ModelError::Engine`] only if the
    /// engine's bounds are narrower than the description's.
    pub fn network(&self, weights: &Weights) -> Result<Network, ModelError> {
        self.check_preparation(weights)?;
        self.network_ignoring_preparation(weights)
    }

    /// As [`Self::network`], whatever graphs the weights were trained on: predictions then are not
    /// what they were trained for.
    ///
    /// # Errors
    /// As [`Self::network`], without [`ModelError::Preparation`].
    pub fn network_ignoring_preparation(&self, weights: &Weights) -> Result<Network, ModelError> {
        let mut tensors = Tensors::new(&self.name, &self.needed(), weights)?;
        let parts = self.parts(&mut tensors)?;
        Ok(Network::new(tensors.finish(parts)?)?)
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
                LayerKind::Block { .. } => match block(layer, tensors)? {
                    Some(block) => levels[layer.level.unwrap_or(0)].blocks.push(block),
                    None => whole = false,
                },
                LayerKind::Pool { cell, position, scale } => {
                    let (name, from, position) = (layer.name.clone(), layer.reads, *position);
                    poolings.push(Pooling { name, from, cell: cell.cell, time: cell.time, position });
                    levels.push(Level { scale: *scale, blocks: Vec::new() });
                }
                &LayerKind::Readout { columns, rows, aggregation, times } => {
                    let (from, by_time) = (layer.reads, times > 1);
                    readout = Some(Readout { from, columns, rows, aggregation, by_time });
                    segments = Some(layer.inputs);
                }
                LayerKind::Dense { .. } => {
                    // The readout's cells are padded to whole lanes each; a dense layer's values
                    // are one segment.
                    let segment = segments.take().unwrap_or(layer.inputs);
                    match dense_layer(layer, segment, tensors)? {
                        Some(built) => dense.push(built),
                        None => whole = false,
                    }
                }
            }
        }
        let head = frames::parts(&self.head, tensors);
        let (Some(readout), Some(head)) = (readout.filter(|_| whole), head) else { return Ok(None) };
        let events = levels.remove(0);
        Ok(Some(NetworkParts {
            name: self.name.clone(),
            span_us: self.span_us,
            capacity: self.capacity,
            graph: self.graph,
            normalisation: self.normalisation,
            place: self.place,
            events,
            pooled: poolings.into_iter().zip(levels).collect(),
            readout,
            dense,
            head: self.head_of(head)?,
        }))
    }

    /// The head that consists of `layers`, if there is one.
    fn head_of(&self, layers: Vec<Part>) -> Result<Option<Arc<FrameNetwork>>, ModelError> {
        // The first layer of a head always reads the image.
        let Some(first) = self.head.first() else { return Ok(None) };
        let parts = FrameNetworkParts { name: self.name.clone(), input: first.input, layers };
        // An event changes one cell of the image.
        Ok(Some(Arc::new(FrameNetwork::new(parts, Convolution::Kn2row)?)))
    }
}

fn refused(layer: &Layer, source: KernelError) -> ModelError {
    EngineError::Layer { layer: layer.name.clone(), source }.into()
}

fn block(layer: &Layer, tensors: &mut Tensors<'_>) -> Result<Option<Block>, ModelError> {
    let LayerKind::Block { conv, norm, .. } = &layer.kind else { return Ok(None) };
    let Some(mut values) = tensors.all(&layer.tensors()) else { return Ok(None) };
    let folded = norm.then(|| tensors.norm(&layer.tensor("norm"), layer.outputs).map(|norm| norm.rounded()));
    if let Some(None) = folded {
        return Ok(None);
    }
    let conv = conv
        .build((layer.inputs, layer.outputs), &mut values, folded.flatten())
        .map_err(|source| refused(layer, source))?;
    Ok(Some(Block { name: layer.name.clone(), input: layer.reads, skip: layer.adds, conv }))
}

fn dense_layer(
    layer: &Layer,
    segment: usize,
    tensors: &mut Tensors<'_>,
) -> Result<Option<DenseLayer>, ModelError> {
    let LayerKind::Dense { bias, activation } = layer.kind else { return Ok(None) };
    let Some(mut values) = tensors.all(&layer.tensors()) else { return Ok(None) };
    let (weight, bias) = (values.take(), bias.then(|| values.take()));
    let dense = Dense::new(layer.inputs / segment, segment, layer.outputs, weight, bias, activation)
        .map_err(|source| refused(layer, source))?;
    Ok(Some(DenseLayer { name: layer.name.clone(), dense }))
}
