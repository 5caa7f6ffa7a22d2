//! The 3 x 3 convolutions of the frame networks, with random weights and activations.

use std::hint::black_box;
use std::time::Duration;

use meissner_kernels::{Conv3x3, ConvParts, FeatureMap, Isa, Region, View};
use meissner_models::random::Random;

use crate::timing::median_ns;

/// Shortest batch of calls that is timed.
pub const SHORTEST: Duration = Duration::from_millis(10);

/// A layer's sizes.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Network.
    pub network: &'static str,
    /// Channels of each input map.
    pub inputs: &'static [usize],
    /// Output channels.
    pub outputs: usize,
    /// Rows.
    pub height: usize,
    /// Pixels in a row.
    pub width: usize,
}

const fn shape(
    network: &'static str,
    inputs: &'static [usize],
    outputs: usize,
    height: usize,
    width: usize,
) -> Shape {
    Shape { network, inputs, outputs, height, width }
}

/// The layers.
pub const SHAPES: [Shape; 19] = [
    shape("canf", &[3], 32, 240, 320),
    shape("canf", &[32], 32, 240, 320),
    shape("canf", &[32], 64, 120, 160),
    shape("canf", &[64], 64, 120, 160),
    shape("canf", &[64], 128, 60, 80),
    shape("canf", &[128], 128, 60, 80),
    shape("canf", &[128], 256, 30, 40),
    shape("canf", &[256], 256, 30, 40),
    // The decoder reads a concatenation.
    shape("canf up", &[128, 128], 128, 60, 80),
    shape("canf up", &[64, 64], 64, 120, 160),
    shape("canf up", &[32, 32], 32, 240, 320),
    shape("event-frame-cnn", &[1], 32, 260, 346),
    shape("event-frame-cnn", &[32], 32, 130, 173),
    shape("event-frame-cnn", &[32], 128, 65, 86),
    shape("event-frame-cnn", &[128], 128, 32, 43),
    shape("event-frame-cnn", &[128], 256, 16, 21),
    // Of a convolutional LSTM: input and state.
    shape("slip", &[32, 32], 128, 12, 11),
    shape("slip", &[64], 128, 12, 11),
    shape("slip", &[1, 32], 128, 12, 11),
];

/// A layer's parameters and inputs.
#[derive(Clone, Debug)]
pub struct Case {
    /// For reports.
    pub name: String,
    /// Parameters, with bias and rectifier.
    pub parts: ConvParts,
    /// One map or two.
    pub inputs: Vec<FeatureMap>,
}

impl Shape {
    /// Numbers for these sizes.
    ///
    /// # Panics
    /// If the sizes make no map.
    pub fn case(&self) -> Case {
        let Self { network, inputs, outputs, height, width } = *self;
        let mut random = Random::new((height * outputs) as u64);
        let channels: usize = inputs.iter().sum();
        let parts = ConvParts {
            inputs: inputs.to_vec(),
            outputs,
            weight: random.values(outputs * channels * 9, (1.0 / channels as f32).sqrt()),
            bias: Some(random.values(outputs, 0.1)),
            norm: None,
            relu: true,
        };
        let mut map = |&c: &usize| {
            let values = random.values(height * width * c, 1.0);
            FeatureMap::from_pixels([height, width, c], 1, &values).expect("the shape is a map's")
        };
        let from: Vec<String> = inputs.iter().map(ToString::to_string).collect();
        let name = format!("{network} {}->{outputs} {height}x{width}", from.join("+"));
        Case { name, parts, inputs: inputs.iter().map(&mut map).collect() }
    }
}

impl Case {
    /// A map for the outputs.
    ///
    /// # Panics
    /// If the sizes make no map.
    pub fn out(&self) -> FeatureMap {
        let (height, width) = (self.inputs[0].height(), self.inputs[0].width());
        FeatureMap::zeros(height, width, self.parts.outputs, 1).expect("the shape is a map's")
    }

    /// Median nanoseconds of the direct kernel, which writes `out`.
    ///
    /// # Panics
    /// If the kernel refuses the case.
    pub fn direct_ns(&self, isa: Isa, out: &mut FeatureMap) -> f64 {
        let conv = Conv3x3::new(&self.parts).expect("the case's parameters fit");
        let inputs: Vec<View<'_>> = self.inputs.iter().map(FeatureMap::view).collect();
        let region = Region::all(out.height(), out.width());
        median_ns(SHORTEST, || {
            conv.run(isa, &inputs, region, black_box(&mut *out).band()).expect("the case's maps fit");
        })
    }

    /// Products of the direct convolution.
    pub fn multiply_adds(&self) -> usize {
        self.parts.weight.len() * self.inputs[0].height() * self.inputs[0].width()
    }
}
