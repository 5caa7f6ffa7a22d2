//! Storage of layer values.

use meissner_kernels::{FeatureMap, KernelError, Matrix, Planes};

use super::changes::Changes;
use super::network::FrameShape;

/// Number of values that are compared together: most of a frame of events stays zero.
const RUN: usize = 16;

/// Shapes are checked when a network is made.
const KIND: &str = "a value is stored as its layer reads and writes it";

/// The values of one layer, or of several layers that write to adjacent channels.
#[derive(Clone, Debug)]
pub(super) enum Buffer {
    /// The values are in another buffer, or taken out while a layer writes them.
    Away,
    Vector(Matrix),
    Map(FeatureMap),
    Planes(Planes),
}

impl Buffer {
    pub(super) fn zeros(shape: FrameShape, planar: bool) -> Result<Self, KernelError> {
        Ok(match shape {
            FrameShape::Vector(values) => Self::Vector(Matrix::zeros(1, values)),
            FrameShape::Image { channels, height, width } if planar => {
                Self::Planes(Planes::zeros(channels, height, width))
            }
            FrameShape::Image { channels, height, width } => {
                Self::Map(FeatureMap::zeros(height, width, channels, 1)?)
            }
        })
    }

    pub(super) fn vector(&self) -> &Matrix {
        let Self::Vector(values) = self else { unreachable!("{KIND}") };
        values
    }

    pub(super) fn vector_mut(&mut self) -> &mut Matrix {
        let Self::Vector(values) = self else { unreachable!("{KIND}") };
        values
    }

    pub(super) fn map(&self) -> &FeatureMap {
        let Self::Map(map) = self else { unreachable!("{KIND}") };
        map
    }

    pub(super) fn map_mut(&mut self) -> &mut FeatureMap {
        let Self::Map(map) = self else { unreachable!("{KIND}") };
        map
    }

    pub(super) fn planes(&self) -> &Planes {
        let Self::Planes(planes) = self else { unreachable!("{KIND}") };
        planes
    }

    pub(super) fn planes_mut(&mut self) -> &mut Planes {
        let Self::Planes(planes) = self else { unreachable!("{KIND}") };
        planes
    }

    pub(super) fn has_nan(&self) -> bool {
        match self {
            Self::Away => false,
            Self::Vector(values) => values.slice(0).iter().any(|v| v.is_nan()),
            Self::Map(map) => (0..map.height())
                .any(|y| (0..map.width()).any(|x| map.pixel(y, x).iter().any(|v| v.is_nan()))),
            Self::Planes(planes) => planes.values().any(f32::is_nan),
        }
    }

    /// Writes channels `first..first + channels` to `out`, (channels, height, width).
    pub(super) fn flatten(&self, first: usize, channels: usize, out: &mut [f32]) {
        match self {
            Self::Away => unreachable!("a value that is read is there"),
            Self::Vector(values) => out.copy_from_slice(values.slice(0)),
            Self::Map(map) => {
                let (height, width) = (map.height(), map.width());
                for y in 0..height {
                    for x in 0..width {
                        let pixel = &map.pixel(y, x)[first..first + channels];
                        for (c, &value) in pixel.iter().enumerate() {
                            out[(c * height + y) * width + x] = value;
                        }
                    }
                }
            }
            Self::Planes(planes) => {
                for (i, row) in out.chunks_exact_mut(planes.width()).enumerate() {
                    row.copy_from_slice(planes.row(i / planes.height(), i % planes.height()));
                }
            }
        }
    }

    /// Overwrites all values with those of `frame`, (channels, height, width).
    pub(super) fn fill_from(&mut self, frame: &[f32]) {
        match self {
            Self::Away => unreachable!("no layer is at work between frames"),
            Self::Vector(values) => values.slice_mut(0).copy_from_slice(frame),
            Self::Planes(planes) => planes.set(frame),
            Self::Map(map) => {
                let (height, width, channels) = (map.height(), map.width(), map.channels());
                for y in 0..height {
                    for (x, pixel) in map.row_mut(y).chunks_exact_mut(channels).enumerate() {
                        for (c, value) in pixel.iter_mut().enumerate() {
                            *value = frame[(c * height + y) * width + x];
                        }
                    }
                }
            }
        }
    }

    /// Stores `frame` and marks the pixels that differ; returns whether any does.
    pub(super) fn store(&mut self, frame: &[f32], changed: &mut Changes) -> bool {
        let mut any = false;
        match self {
            Self::Away => unreachable!("no layer is at work between frames"),
            Self::Vector(values) => {
                let values = values.slice_mut(0);
                any = values.iter().zip(frame).any(|(a, b)| a.to_bits() != b.to_bits());
                values.copy_from_slice(frame);
            }
            Self::Planes(planes) => {
                let (height, width) = (planes.height(), planes.width());
                for (i, new) in frame.chunks_exact(width).enumerate() {
                    let row = planes.row_mut(i / height, i % height);
                    let mut store = |first: usize, old: &mut [f32], new: &[f32]| {
                        for (x, (old, &new)) in (first..).zip(old.iter_mut().zip(new)) {
                            if old.to_bits() != new.to_bits() {
                                any = true;
                                changed.set(i % height, x);
                                *old = new;
                            }
                        }
                    };
                    let (old_runs, old_rest) = row[..width].as_chunks_mut::<RUN>();
                    let (new_runs, new_rest) = new.as_chunks::<RUN>();
                    for (run, (old, new)) in old_runs.iter_mut().zip(new_runs).enumerate() {
                        let differ = |bits, (a, b): (&f32, &f32)| bits | (a.to_bits() ^ b.to_bits());
                        if old.iter().zip(new).fold(0, differ) != 0 {
                            store(run * RUN, old, new);
                        }
                    }
                    store(new_runs.len() * RUN, old_rest, new_rest);
                }
            }
            Self::Map(map) => {
                let (height, width, channels) = (map.height(), map.width(), map.channels());
                for y in 0..height {
                    let row = map.row_mut(y);
                    for c in 0..channels {
                        let new = &frame[(c * height + y) * width..][..width];
                        for (x, (pixel, &new)) in row.chunks_exact_mut(channels).zip(new).enumerate() {
                            if pixel[c].to_bits() != new.to_bits() {
                                pixel[c] = new;
                                changed.set(y, x);
                                any = true;
                            }
                        }
                    }
                }
            }
        }
        any
    }

    /// Stores `values` in a pixel from channel `first` on, marks it if they differ, and returns
    /// whether they do.
    pub(super) fn store_pixel(
        &mut self,
        (y, x): (usize, usize),
        first: usize,
        values: &[f32],
        changed: &mut Changes,
    ) -> bool {
        let any = match self {
            Self::Away | Self::Vector(_) => unreachable!("{KIND}"),
            Self::Map(map) => {
                let pixel = &mut map.pixel_mut(y, x)[first..][..values.len()];
                let any = pixel.iter().zip(values).any(|(a, b)| a.to_bits() != b.to_bits());
                pixel.copy_from_slice(values);
                any
            }
            Self::Planes(planes) => {
                let mut any = false;
                for (c, &value) in values.iter().enumerate() {
                    let old = std::mem::replace(&mut planes.row_mut(first + c, y)[x], value);
                    any |= old.to_bits() != value.to_bits();
                }
                any
            }
        };
        if any {
            changed.set(y, x);
        }
        any
    }

    /// Marks the pixels of an image that are not +0.
    pub(super) fn mark_nonzero(&self, marked: &mut Changes) {
        match self {
            Self::Planes(planes) => {
                for channel in 0..planes.channels() {
                    for y in 0..planes.height() {
                        for (x, value) in planes.row(channel, y).iter().enumerate() {
                            if value.to_bits() != 0 {
                                marked.set(y, x);
                            }
                        }
                    }
                }
            }
            Self::Map(map) => {
                for y in 0..map.height() {
                    for x in 0..map.width() {
                        if map.pixel(y, x).iter().any(|v| v.to_bits() != 0) {
                            marked.set(y, x);
                        }
                    }
                }
            }
            _ => {}
        }
    }

    pub(super) fn clear(&mut self) {
        match self {
            Self::Away => {}
            Self::Vector(values) => values.slice_mut(0).fill(0.0),
            Self::Map(map) => map.clear(),
            Self::Planes(planes) => planes.clear(),
        }
    }
}
