//! Checks that a network's parts fit together.
//!
//! Input: [`NetworkParts`]. Output: the channels of every feature, or the first error, by layer.

use super::parts::{Aggregation, Fraction, Level, NetworkParts, Pooling, Reach};
use crate::EngineError;
use crate::error::{in_range, misfit, option};
use crate::frames::FrameShape;
use crate::metric::input_channels;

pub(super) const MAX_SPAN_US: i64 = 1 << 40;
pub(super) const MAX_CAPACITY: usize = 1 << 24;
pub(super) const MAX_NEIGHBOURS: usize = 255;
pub(super) const MAX_CELLS: usize = 1 << 22;

/// Channels of each feature of each level of `parts`, which must fit together.
pub(super) fn channels(parts: &NetworkParts) -> Result<Vec<Vec<usize>>, EngineError> {
    in_range("span in microseconds", parts.span_us, 1, MAX_SPAN_US)?;
    in_range("capacity in events", parts.capacity as i64, 1, MAX_CAPACITY as i64)?;
    in_range("neighbours of a node", parts.graph.reach.most() as i64, 1, MAX_NEIGHBOURS as i64)?;
    if let Reach::Radius { r, .. } = parts.graph.reach
        && !(r.is_finite() && r > 0.0)
    {
        return Err(option("radius", "a finite number above 0", r));
    }
    let mut channels = vec![level_channels(&parts.events, input_channels(parts.place))?];
    let mut below: Option<&Pooling> = None;
    for (pooling, level) in &parts.pooled {
        let inputs = feature(&pooling.name, "pooled feature", &channels[channels.len() - 1], pooling.from)?;
        check_pooling(pooling, below, parts.span_us)?;
        channels.push(level_channels(level, inputs)?);
        below = Some(pooling);
    }
    let top = &channels[channels.len() - 1];
    let inputs = feature("readout", "read feature", top, parts.readout.from)?;
    let (columns, rows) = (parts.readout.columns, parts.readout.rows);
    if parts.readout.aggregation == Aggregation::Sum && !parts.pooled.is_empty() {
        return Err(misfit("readout", "poolings below a sum", 0, parts.pooled.len()));
    }
    let times = readout_times(parts)?;
    let cells = columns.saturating_mul(rows).saturating_mul(times);
    in_range("readout cells", i64::try_from(cells).unwrap_or(i64::MAX), 1, 1 << 16)?;
    after_readout(parts, inputs, times)?;
    Ok(channels)
}

/// Checks the dense layers or head over `channels` of the readout, in `times` copies of its grid.
fn after_readout(parts: &NetworkParts, channels: usize, times: usize) -> Result<(), EngineError> {
    let (columns, rows) = (parts.readout.columns, parts.readout.rows);
    let mut inputs = channels * columns * rows * times;
    for layer in &parts.dense {
        if layer.dense.inputs() != inputs {
            return Err(misfit(&layer.name, "inputs", inputs, layer.dense.inputs()));
        }
        inputs = layer.dense.outputs();
    }
    match &parts.head {
        None if parts.dense.is_empty() => return Err(misfit("readout", "dense layers", "at least 1", 0)),
        None => {}
        Some(_) if !parts.dense.is_empty() => {
            return Err(misfit("readout", "dense layers beside a head", 0, parts.dense.len()));
        }
        Some(head) => {
            let image = FrameShape::Image { channels: channels * times, height: rows, width: columns };
            if head.input() != image {
                return Err(misfit("readout", "image that the head reads", image, head.input()));
            }
            if head.has_state() {
                let expected = "none that remember frames: how often predictions are read must not matter";
                return Err(misfit("readout", "layers of the head", expected, "some"));
            }
        }
    }
    Ok(())
}

/// Number of cells of `size` that a window can occupy: a closed interval that starts anywhere in a
/// cell.
pub(super) fn times(size: Fraction) -> usize {
    size.cells() + 1
}

/// Number of copies of the readout's grid. A node's cell in time must be that of all its events.
fn readout_times(parts: &NetworkParts) -> Result<usize, EngineError> {
    if !parts.readout.by_time {
        return Ok(1);
    }
    let mut sizes = parts.pooled.iter().map(|(pooling, _)| pooling.time);
    let wrong =
        |found: &str| misfit("readout", "cells in time", "the same of every pooling, at least of one", found);
    let Some(Some(size)) = sizes.next() else { return Err(wrong("none")) };
    if sizes.all(|other| other == Some(size)) { Ok(times(size)) } else { Err(wrong("different ones")) }
}

/// Channels of feature `index`, which must exist.
fn feature(layer: &str, what: &'static str, channels: &[usize], index: usize) -> Result<usize, EngineError> {
    channels
        .get(index)
        .copied()
        .ok_or_else(|| misfit(layer, what, format!("below {}", channels.len()), index))
}

/// Checks the blocks of a level with `inputs` channels; returns the channels of its features.
fn level_channels(level: &Level, inputs: usize) -> Result<Vec<usize>, EngineError> {
    if !(level.scale.is_finite() && level.scale > 0.0) {
        return Err(option("edge-attribute scale", "a finite number above 0", level.scale));
    }
    let mut channels = vec![inputs];
    for block in &level.blocks {
        let read = feature(&block.name, "input feature", &channels, block.input)?;
        if read != block.conv.inputs() {
            return Err(misfit(&block.name, "input channels", read, block.conv.inputs()));
        }
        if let Some(skip) = block.skip {
            let added = feature(&block.name, "skip feature", &channels, skip)?;
            if added != block.conv.outputs() {
                return Err(misfit(&block.name, "channels of the skip", block.conv.outputs(), added));
            }
        }
        channels.push(block.conv.outputs());
    }
    Ok(channels)
}

fn check_pooling(pooling: &Pooling, below: Option<&Pooling>, span_us: i64) -> Result<(), EngineError> {
    let [x, y] = pooling.cell;
    let cells = x.cells().saturating_mul(y.cells());
    let times = pooling.time.map_or(1, |t| t.cells() + 1);
    if cells.saturating_mul(times) > MAX_CELLS {
        return Err(misfit(
            &pooling.name,
            "cells",
            format!("at most {MAX_CELLS}"),
            cells.saturating_mul(times),
        ));
    }
    if let Some(size) = pooling.time
        && i128::from(span_us) * i128::from(size.numerator()) < i128::from(size.denominator())
    {
        return Err(misfit(
            &pooling.name,
            "cells in time",
            "at least 1 us each",
            format!("{size} of {span_us} us"),
        ));
    }
    if pooling.time.is_some() && below.is_some_and(|below| below.time.is_none()) {
        let expected = "cells in time at the level below, or none here";
        return Err(misfit(&pooling.name, "cells in time", expected, "none below"));
    }
    Ok(())
}
