//! How much frames differ from those of a training.
//!
//! Input: frames. Output: features of the newest frames and, by a [`TrainingFrames`], how unlike
//! they are to those of the training: the distance of `gaussian.rs`. Sums are in f64, from scratch
//! for each frame, in the order of its values; the sums of several frames are added again for each
//! prediction. No value of a prediction depends on this.

use super::shape::FrameShape;
use crate::gaussian::{Gaussian, MAX_FEATURES};

/// Number of frames that count for a network that remembers earlier frames: a single frame of few
/// events contains little information.
const WINDOW: usize = 16;

/// Cells of an image along each side.
const CELLS: usize = 4;

/// Maximum number of channels that are described one by one.
const CHANNELS: usize = 3;

/// Number of values that are skipped together if all of them are zero.
const RUN: usize = 16;

/// The features of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameFeatures {
    /// Features of an image. For each channel or, if there are more than three, for all together:
    /// mean of the pixels' sums, and roots of the sum of squares and of squared differences along
    /// the rows. For two channels: the cosine between their pixels. Root of the sum of squares in
    /// each of 4 x 4 cells.
    Image,
    /// Squares of the values at these indices, which ascend.
    Values(Vec<usize>),
}

impl FrameFeatures {
    /// Number of features of frames of `shape`; `None` if they are not images, or have no value at
    /// an index.
    fn count(&self, shape: FrameShape) -> Option<usize> {
        if shape.values() == 0 {
            return None;
        }
        match (self, shape) {
            (Self::Image, FrameShape::Image { channels, .. }) => {
                let groups = groups(channels);
                Some(3 * groups + groups * (groups - 1) / 2 + CELLS * CELLS)
            }
            (Self::Values(places), shape) => {
                let ascend = places.is_sorted_by(|a, b| a < b);
                let lie = places.last().is_some_and(|&last| last < shape.values());
                (ascend && lie && places.len() <= MAX_FEATURES).then_some(places.len())
            }
            (Self::Image, FrameShape::Vector(_)) => None,
        }
    }
}

/// Number of channels that are described one by one.
fn groups(channels: usize) -> usize {
    if channels <= CHANNELS { channels } else { 1 }
}

/// The features of the newest frames.
#[derive(Clone, Debug)]
pub struct FrameStatistics {
    of: FrameFeatures,
    shape: FrameShape,
    features: usize,
    /// Number of frames that count.
    window: usize,
    /// The sums of these frames; those of frame n are in row n modulo `window`.
    sums: Vec<f64>,
    /// Frames since the last reset.
    frames: u64,
}

impl FrameStatistics {
    /// The state before the first frame of `shape`. If the network remembers earlier frames
    /// ([`super::FrameNetwork::has_state`]), 16 frames count for [`FrameFeatures::Image`], else
    /// only the newest. `None` if such frames do not have these features.
    pub fn new(of: &FrameFeatures, shape: FrameShape, remembers: bool) -> Option<Self> {
        let features = of.count(shape)?;
        let window = if remembers && *of == FrameFeatures::Image { WINDOW } else { 1 };
        Some(Self { of: of.clone(), shape, features, window, sums: vec![0.0; window * features], frames: 0 })
    }

    /// Takes the next frame. O(values), of which zeros cost little.
    ///
    /// # Panics
    /// For another number of values.
    pub fn push(&mut self, frame: &[f32]) {
        assert_eq!(frame.len(), self.shape.values(), "a frame of {}", self.shape);
        let row = (self.frames % self.window as u64) as usize;
        let sums = &mut self.sums[row * self.features..][..self.features];
        match &self.of {
            FrameFeatures::Image => {
                sums.fill(0.0);
                add_image(frame, self.shape.sides(), sums);
            }
            FrameFeatures::Values(places) => {
                for (sum, &place) in sums.iter_mut().zip(places) {
                    *sum = f64::from(frame[place]) * f64::from(frame[place]);
                }
            }
        }
        self.frames += 1;
    }

    /// Forgets all frames.
    pub fn reset(&mut self) {
        self.sums.fill(0.0);
        self.frames = 0;
    }

    /// The features after the last frame; before the first, those of a frame of zeros.
    pub fn features(&self) -> Vec<f64> {
        let mut features = [0.0; MAX_FEATURES];
        self.write(&mut features).to_vec()
    }

    fn write<'a>(&self, features: &'a mut [f64; MAX_FEATURES]) -> &'a [f64] {
        let features = &mut features[..self.features];
        let count = self.frames.clamp(1, self.window as u64) as usize;
        for row in self.sums.chunks_exact(self.features).take(count) {
            features.iter_mut().zip(row).for_each(|(to, sum)| *to += sum);
        }
        features.iter_mut().for_each(|sum| *sum /= count as f64);
        if self.of == FrameFeatures::Image {
            let groups = groups(self.shape.sides()[0]);
            let [squares, rest] = [groups, 2 * groups];
            let pairs = (1..groups).flat_map(|a| (0..a).map(move |b| [a, b]));
            for (at, [a, b]) in (rest..).zip(pairs) {
                let both = features[squares + a] * features[squares + b];
                features[at] = if both > 0.0 { features[at] / both.sqrt() } else { 0.0 };
            }
            let cosines = groups * (groups - 1) / 2;
            features[squares..rest].iter_mut().for_each(|sum| *sum = sum.sqrt());
            features[rest + cosines..].iter_mut().for_each(|sum| *sum = sum.sqrt());
        }
        features
    }

    /// Whether `other` describes the same frames by the same features.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (&self.of, self.shape, self.window) == (&other.of, other.shape, other.window)
    }

    /// The sums of the frames that count, row by row.
    pub(super) fn sums(&self) -> &[f64] {
        &self.sums[..self.frames.min(self.window as u64) as usize * self.features]
    }

    /// Sets the state after `frames` frames with these [sums](Self::sums). If the number of sums
    /// differs, as for a network without statistics of its training, all frames count as equal to
    /// `newest`.
    pub(super) fn set(&mut self, frames: u64, sums: &[f64], newest: impl FnOnce() -> Vec<f32>) {
        self.reset();
        let expected = frames.min(self.window as u64) as usize * self.features;
        if sums.len() == expected {
            self.sums[..expected].copy_from_slice(sums);
        } else {
            let newest = newest();
            (0..self.window).for_each(|_| self.push(&newest));
        }
        self.frames = frames;
    }

    /// Maximum number of sums of a state.
    pub(super) const MAX_SUMS: usize = WINDOW * MAX_FEATURES;

    /// Bytes of the sums.
    pub(super) fn bytes(&self) -> usize {
        self.sums.len() * size_of::<f64>()
    }
}

/// Adds the sums of an image to `sums`: of the values of each channel, of squares, of products of
/// two channels, of squared differences, of squares in cells.
///
/// Every sum adds in the order of the values in `frame`. Zeros change no sum and are skipped.
fn add_image(frame: &[f32], [channels, height, width]: [usize; 3], sums: &mut [f64]) {
    let groups = groups(channels);
    let (values, sums) = sums.split_at_mut(groups);
    let (squares, sums) = sums.split_at_mut(groups);
    let (products, sums) = sums.split_at_mut(groups * (groups - 1) / 2);
    let (differences, cells) = sums.split_at_mut(groups);
    // The first column of each cell after the first cell.
    let begins: [usize; CELLS - 1] = std::array::from_fn(|cell| ((cell + 1) * width).div_ceil(CELLS));
    for channel in 0..channels {
        let group = if groups == channels { channel } else { 0 };
        for y in 0..height {
            let start = (channel * height + y) * width;
            let line = &frame[start..start + width];
            let cells = &mut cells[y * CELLS / height * CELLS..][..CELLS];
            let mut add = |first: usize, run: &[f32]| {
                for (x, &value) in (first..).zip(run) {
                    if value == 0.0 {
                        continue;
                    }
                    let v = f64::from(value);
                    values[group] += v;
                    squares[group] += v * v;
                    cells[begins.iter().filter(|&&begin| x >= begin).count()] += v * v;
                    if x > 0 {
                        let step = v - f64::from(line[x - 1]);
                        differences[group] += step * step;
                    }
                    if x + 1 < width && line[x + 1] == 0.0 {
                        differences[group] += v * v;
                    }
                    for other in (0..channel).filter(|_| groups == channels) {
                        let there = frame[start + x - (channel - other) * height * width];
                        products[channel * (channel - 1) / 2 + other] += v * f64::from(there);
                    }
                }
            };
            let (runs, rest) = line.as_chunks::<RUN>();
            for (i, run) in runs.iter().enumerate() {
                // Branch-free, so that it vectorises.
                if run.iter().fold(0, |bits, value| bits | value.to_bits()) != 0 {
                    add(i * RUN, run);
                }
            }
            add(runs.len() * RUN, rest);
        }
    }
}

/// Statistics of the frames of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingFrames {
    of: FrameFeatures,
    gaussian: Gaussian,
}

impl TrainingFrames {
    /// The statistics of a training with these [features](FrameStatistics::features) of frames, all
    /// `of` the same kind. `None` if there are fewer frames than twice the number of features, plus
    /// two. O(frames log frames).
    pub fn of(of: FrameFeatures, frames: &[Vec<f64>]) -> Option<Self> {
        let features = frames.first()?.len();
        let is_one_kind = frames.iter().all(|frame| frame.len() == features);
        let gaussian = is_one_kind.then(|| Gaussian::of(features, frames)).flatten()?;
        Some(Self { of, gaussian })
    }

    /// The kind of features, their mean, and the rows of the factor of their covariance, as
    /// [`crate::TrainingWindows::parts`].
    pub fn parts(&self) -> (&FrameFeatures, &[f64], &[Vec<f64>]) {
        let (mean, factor) = self.gaussian.parts();
        (&self.of, mean, factor)
    }

    /// The statistics with these [parts](Self::parts). `None` as
    /// [`crate::TrainingWindows::from_parts`], and for more than 64 features.
    pub fn from_parts(of: FrameFeatures, mean: &[f64], factor: Vec<Vec<f64>>) -> Option<Self> {
        Some(Self { of, gaussian: Gaussian::from_parts(mean, factor)? })
    }

    /// Whether frames of `shape` have these features.
    pub fn fits(&self, shape: FrameShape) -> bool {
        self.of.count(shape) == Some(self.gaussian.features())
    }

    /// Empty statistics for the frames of a network, which [fit](Self::fits).
    pub(super) fn statistics(&self, shape: FrameShape, remembers: bool) -> Option<FrameStatistics> {
        FrameStatistics::new(&self.of, shape, remembers)
    }

    /// The distance of these frames from those of the training, relative to the distance that 1 of
    /// 1,000 frames of the training exceeds: above 1, they are unlike the training's frames.
    /// O(features^2).
    pub fn unlikeness(&self, statistics: &FrameStatistics) -> f32 {
        let mut features = [0.0; MAX_FEATURES];
        let features = statistics.write(&mut features);
        self.gaussian.distance(|i| features.get(i).copied())
    }
}
