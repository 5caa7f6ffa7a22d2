//! Output shapes of layers, and their errors.

use super::network::{FrameLayer, FrameLayerKind as Kind, FrameShape};
use crate::EngineError;
use crate::error::misfit;

/// Largest side and number of channels of an image.
const MAX: usize = 1 << 14;
const MAX_VALUES: usize = 1 << 28;
const MAX_DELAY: usize = 1 << 16;

pub(super) fn with(layer: &FrameLayer) -> Option<usize> {
    match layer.kind {
        Kind::Concat { with } => Some(with),
        _ => None,
    }
}

pub(super) fn check_shape(layer: &str, shape: FrameShape) -> Result<(), EngineError> {
    let sides = shape.sides();
    let long = matches!(shape, FrameShape::Image { .. }) && sides.iter().any(|&side| side > MAX);
    if sides.contains(&0) || long || shape.values() > MAX_VALUES {
        let expected = "at least 1 value, at most 16,384 a side and 2^28 in all";
        return Err(misfit(layer, "shape", expected, shape));
    }
    Ok(())
}

/// Output shape of `layer`; `shapes` are those of the frame and of all layers before it.
///
/// # Errors
/// [`EngineError::Network`] if the layer cannot read them.
pub fn output_shape(layer: &FrameLayer, shapes: &[FrameShape]) -> Result<FrameShape, EngineError> {
    let from = shapes[layer.from];
    let image = || match from {
        FrameShape::Image { channels, height, width } => Ok([channels, height, width]),
        FrameShape::Vector(_) => Err(misfit(&layer.name, "input", "an image", from)),
    };
    let vector = || match from {
        FrameShape::Vector(values) => Ok(values),
        FrameShape::Image { .. } => Err(misfit(&layer.name, "input", "a vector", from)),
    };
    let of = |channels: usize, height: usize, width: usize| FrameShape::Image { channels, height, width };
    Ok(match &layer.kind {
        Kind::Conv { kernel, channels, .. } => {
            let [_, height, width] = image()?;
            if !matches!(kernel, 1 | 3) {
                return Err(misfit(&layer.name, "kernel", "1 or 3", kernel));
            }
            of(*channels, height, width)
        }
        Kind::UpConv { channels, .. } => {
            let [_, height, width] = image()?;
            of(*channels, 2 * height, 2 * width)
        }
        Kind::MaxPool => {
            let [channels, height, width] = image()?;
            of(channels, height / 2, width / 2)
        }
        Kind::AveragePool { size } => {
            let [channels, height, width] = image()?;
            if *size == 0 {
                return Err(misfit(&layer.name, "size", "at least 1", 0));
            }
            of(channels, height / size, width / size)
        }
        Kind::GlobalAverage | Kind::Sum => FrameShape::Vector(image()?[0]),
        Kind::Concat { with } => {
            let (other, one) = match (shapes[*with], from) {
                (FrameShape::Vector(more), FrameShape::Vector(values)) => {
                    return Ok(FrameShape::Vector(values + more));
                }
                (other, FrameShape::Vector(_)) => (other, "a vector".to_owned()),
                (
                    FrameShape::Image { channels: more, height: h, width: w },
                    FrameShape::Image { channels, height, width },
                ) if [h, w] == [height, width] => return Ok(of(channels + more, height, width)),
                (other, FrameShape::Image { height, width, .. }) => {
                    (other, format!("an image of {height} x {width}"))
                }
            };
            let expected = format!("{one} beside {from}");
            return Err(misfit(&layer.name, "second input", expected, other));
        }
        Kind::SqueezeExcite { .. } => {
            image()?;
            from
        }
        Kind::ConvLstm { hidden, .. } => {
            let [_, height, width] = image()?;
            of(*hidden, height, width)
        }
        Kind::Lstm { hidden, .. } => {
            vector()?;
            FrameShape::Vector(*hidden)
        }
        Kind::Delay { frames } => {
            if *frames == 0 || *frames > MAX_DELAY {
                return Err(misfit(&layer.name, "frames", "1 to 65,536", frames));
            }
            FrameShape::Vector(vector()?.saturating_mul(*frames))
        }
        Kind::Flatten => {
            image()?;
            FrameShape::Vector(from.values())
        }
        Kind::Dense { outputs, .. } => {
            vector()?;
            FrameShape::Vector(*outputs)
        }
    })
}
