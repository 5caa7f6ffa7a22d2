//! Convolutions of images on which the transforms of Winograd's tiles lose most: values that cancel, and that span many
//! magnitudes.

use meissner_engine::frames::{Convolution, FrameLayerKind, FrameNetworkParts, FrameShape};
use meissner_kernels::WinogradTile;
use meissner_kernels::random::Random;

use super::Prepared;
use super::frames::{FrameRun, Frames, layer};
use super::result::Expect;

const CHANNELS: usize = 8;
const HEIGHT: usize = 14;
const WIDTH: usize = 18;
/// Frames of a case: each differs from the one before in some pixels, so that others are skipped.
const FRAMES: u64 = 12;

/// The algorithms.
pub(super) const CONVOLUTIONS: [Convolution; 3] = [
    Convolution::Direct,
    Convolution::Winograd(WinogradTile::Two),
    Convolution::Winograd(WinogradTile::Four),
];

/// Images, and weights of two layers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Images {
    pub(super) name: &'static str,
    frames: Frames,
    /// Largest weight of the first layer.
    weight: f32,
    /// Whether its weights of each kernel sum to nothing, so that an even image becomes 0.
    edges: bool,
    /// Whether tiles of four overflow.
    overflows: bool,
    /// Largest relative error of each algorithm.
    within: [f64; 3],
}

/// Sets a few pixels anew; the whole image with the first frame.
fn some(step: u64, random: &mut Random, frame: &mut [f32], value: impl Fn(usize, &mut Random) -> f32) {
    if step == 0 {
        for (i, pixel) in frame.iter_mut().enumerate() {
            *pixel = value(i, random);
        }
    }
    for _ in 0..5 {
        let i = random.below(frame.len() as u64) as usize;
        frame[i] = value(i, random);
    }
}

/// 1 and -1 in turn, over rows and columns.
fn checkerboard(i: usize) -> f32 {
    if (i / WIDTH + i % WIDTH).is_multiple_of(2) { 1.0 } else { -1.0 }
}

const ORDINARY: Images = Images {
    name: "ordinary",
    frames: |step, random, frame| some(step, random, frame, |_, random| random.symmetric()),
    weight: 0.3,
    edges: false,
    overflows: false,
    within: [1e-5, 1e-5, 1e-4],
};

/// All of them.
pub(super) const IMAGES: &[Images] = &[
    ORDINARY,
    Images {
        name: "checkerboard of 1e4 over 1e-3",
        frames: |step, random, frame| {
            some(step, random, frame, |i, random| 1e4 * checkerboard(i) + 1e-3 * random.symmetric());
        },
        ..ORDINARY
    },
    Images {
        name: "even image of 1e4 under edge filters",
        frames: |step, random, frame| some(step, random, frame, |_, random| 1e4 + 1e-1 * random.symmetric()),
        edges: true,
        ..ORDINARY
    },
    Images {
        name: "1e-3 and 1e3 mixed",
        frames: |step, random, frame| {
            some(step, random, frame, |_, random| {
                random.symmetric() * if random.below(2) == 0 { 1e3 } else { 1e-3 }
            });
        },
        ..ORDINARY
    },
    Images {
        name: "one pixel of 1e30 among ones",
        frames: |step, random, frame| {
            some(step, random, frame, |i, random| if i == 700 { 1e30 } else { random.symmetric() });
        },
        ..ORDINARY
    },
    Images {
        name: "denormal pixels",
        frames: |step, random, frame| some(step, random, frame, |_, random| 1e-40 * random.symmetric()),
        within: [1e-3, 1e-3, 2e-2],
        ..ORDINARY
    },
    Images {
        name: "pixels of 3e37",
        frames: |step, random, frame| some(step, random, frame, |i, _| 3e37 * checkerboard(i)),
        weight: 0.02,
        overflows: true,
        ..ORDINARY
    },
];

/// `images`, convolved as [`CONVOLUTIONS`] has it at `index`.
pub(super) fn prepare(images: &Images, index: usize) -> Prepared {
    let overflows = images.overflows && index == 2;
    Prepared {
        run: Box::new(run(images, CONVOLUTIONS[index])),
        expect: if overflows { Expect::Overflow } else { Expect::Finite },
        within: images.within[index],
        ordinary: Box::new(run(&ORDINARY, CONVOLUTIONS[index])),
    }
}

fn run(images: &Images, convolution: Convolution) -> FrameRun {
    let mut random = Random::new(3);
    let mut conv = |inputs: usize, channels: usize, scale: f32, edges: bool| {
        let mut weight = random.values(channels * inputs * 9, scale);
        if edges {
            for kernel in weight.chunks_exact_mut(9) {
                // The middle is minus the sum of the others, rounded to 2^-10, so that the sum of all is exactly 0.
                kernel.iter_mut().for_each(|w| *w = (*w * 1024.0).round() / 1024.0);
                kernel[4] -= kernel.iter().sum::<f32>();
            }
        }
        FrameLayerKind::Conv { kernel: 3, channels, weight, bias: None, relu: false }
    };
    let layers = vec![
        layer("conv1", 0, conv(CHANNELS, CHANNELS, images.weight, images.edges)),
        layer("conv2", 1, conv(CHANNELS, 2, 0.2, false)),
    ];
    let input = FrameShape::Image { channels: CHANNELS, height: HEIGHT, width: WIDTH };
    let parts = FrameNetworkParts { name: "two convolutions".to_owned(), input, layers };
    FrameRun { parts, convolution, frames: images.frames, steps: FRAMES }
}
