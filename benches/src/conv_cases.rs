//! The 3 x 3 convolutions of the frame networks, with random weights and activations.

use std::hint::black_box;
use std::time::Duration;

use meissner_kernels::{Conv3x3, ConvParts, FeatureMap, Isa, Region, View};
use meissner_models::random::Random;

use crate::timing::median_ns;

/// Shortest batch of calls that is timed.
pub const SHORTEST: Duration = Duration::from_millis(10);

/// A layer: network, channels of each input map, output channels, rows, pixels in a row.
pub type Shape = (&'static str, &'static [usize], usize, usize, usize);

/// The layers.
pub const SHAPES: [Shape; 19] = [
    ("canf", &[3], 32, 240, 320),
    ("canf", &[32], 32, 240, 320),
    ("canf", &[32], 64, 120, 160),
    ("canf", &[64], 64, 120, 160),
    ("canf", &[64], 128, 60, 80),
    ("canf", &[128], 128, 60, 80),
    ("canf", &[128], 256, 30, 40),
    ("canf", &[256], 256, 30, 40),
    // The decoder reads a concatenation.
    ("canf up", &[128, 128], 128, 60, 80),
    ("canf up", &[64, 64], 64, 120, 160),
    ("canf up", &[32, 32], 32, 240, 320),
    ("event-frame-cnn", &[1], 32, 260, 346),
    ("event-frame-cnn", &[32], 32, 130, 173),
    ("event-frame-cnn", &[32], 128, 65, 86),
    ("event-frame-cnn", &[128], 128, 32, 43),
    ("event-frame-cnn", &[128], 256, 16, 21),
    // Of a convolutional LSTM: input and state.
    ("slip", &[32, 32], 128, 12, 11),
    ("slip", &[64], 128, 12, 11),
    ("slip", &[1, 32], 128, 12, 11),
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

impl Case {
    /// Numbers for the sizes of a layer.
    ///
    /// # Panics
    /// If the sizes make no map.
    pub fn new((network, inputs, outputs, height, width): Shape) -> Self {
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
        Self { name, parts, inputs: inputs.iter().map(&mut map).collect() }
    }

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
