//! The convolutions of the frame networks, direct and by Winograd's tiles, against the machine's
//! limits:
//! `cargo run --release -p meissner-benches --example conv_roofline [-- --json] [--all-isas]`.

use std::hint::black_box;
use std::time::Duration;

use meissner_benches::peak::Peak;
use meissner_benches::report::{Column, Digits, rooflines};
use meissner_benches::timing::{median_ns, relative_error};
use meissner_kernels::random::Random;
use meissner_kernels::{
    Conv3x3, ConvParts, ConvScratch, FeatureMap, Isa, Region, View, WinogradConv3x3, WinogradTile,
};
use serde_json::{Value, json};

/// Shortest batch of calls that is timed.
const MIN: Duration = Duration::from_millis(10);

/// A layer: network, channels of each input map, output channels, rows, pixels in a row.
type Shape = (&'static str, &'static [usize], usize, usize, usize);

/// The layers.
const SHAPES: [Shape; 19] = [
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
    // Input and state of a convolutional LSTM.
    ("slip", &[32, 32], 128, 12, 11),
    ("slip", &[64], 128, 12, 11),
    ("slip", &[1, 32], 128, 12, 11),
];

const COLUMNS: [Column; 12] = [
    ("layer", "layer", Digits::Fixed(0)),
    ("direct_us", "direct us", Digits::Fixed(1)),
    ("direct_gflops", "GFLOP/s", Digits::Fixed(1)),
    ("direct_percent_of_peak", "% peak", Digits::Fixed(1)),
    ("winograd_2_us", "F(2,3) us", Digits::Fixed(1)),
    ("winograd_2_gflops", "GFLOP/s", Digits::Fixed(1)),
    ("winograd_2_times_as_fast", "x", Digits::Fixed(2)),
    ("winograd_2_error", "error", Digits::Exponent),
    ("winograd_4_us", "F(4,3) us", Digits::Fixed(1)),
    ("winograd_4_gflops", "GFLOP/s", Digits::Fixed(1)),
    ("winograd_4_times_as_fast", "x", Digits::Fixed(2)),
    ("winograd_4_error", "error", Digits::Exponent),
];

fn main() {
    // Without vectors of fused products, the portable path takes minutes.
    let fast = Isa::available().into_iter().filter(|isa| isa.name() != "portable").collect();
    let note = |_: &Value| "  GFLOP/s of tiles count the direct convolution's operations\n".to_owned();
    rooflines(
        "conv_roofline",
        fast,
        "layers",
        &COLUMNS,
        note,
        |peak| json!({ "layers": SHAPES.map(|shape| measure(peak, &Case::new(shape))).to_vec() }),
    );
}

fn measure(peak: &Peak, case: &Case) -> Value {
    let views: Vec<View<'_>> = case.inputs.iter().map(FeatureMap::view).collect();
    let (mut direct_out, mut out) = (case.out(), case.out());
    let region = Region::all(out.height(), out.width());
    let direct = Conv3x3::new(&case.parts).expect("the case's parameters fit");
    let direct_ns = median_ns(MIN, || {
        direct.run(peak.isa, &views, region, black_box(&mut direct_out).band()).expect("the case's maps fit");
    });
    let multiply_adds = case.parts.weight.len() * out.height() * out.width();
    let gflops = |ns: f64| 2.0 * multiply_adds as f64 / ns;
    let mut line = json!({
        "layer": case.name,
        "direct_ns": direct_ns,
        "direct_us": direct_ns / 1e3,
        "direct_gflops": gflops(direct_ns),
        "direct_percent_of_peak": peak.percent(gflops(direct_ns)),
    });
    for (name, tile) in [("winograd_2", WinogradTile::Two), ("winograd_4", WinogradTile::Four)] {
        let conv = WinogradConv3x3::new(&case.parts, tile).expect("the case's parameters fit");
        let mut scratch = ConvScratch::default();
        let ns = median_ns(MIN, || {
            conv.run(peak.isa, &views, region, black_box(&mut out).band(), &mut scratch)
                .expect("the case's maps fit");
        });
        line[format!("{name}_ns")] = json!(ns);
        line[format!("{name}_us")] = json!(ns / 1e3);
        line[format!("{name}_gflops")] = json!(gflops(ns));
        line[format!("{name}_times_as_fast")] = json!(direct_ns / ns);
        line[format!("{name}_error")] = json!(relative_error(values(&direct_out), values(&out)));
    }
    line
}

/// The values of a map, without its margins.
fn values(map: &FeatureMap) -> impl Iterator<Item = &f32> {
    (0..map.height()).flat_map(move |y| (0..map.width()).flat_map(move |x| map.pixel(y, x)))
}

/// A layer's parameters and inputs.
struct Case {
    /// For reports.
    name: String,
    /// Parameters, with bias and rectifier.
    parts: ConvParts,
    /// One map or two.
    inputs: Vec<FeatureMap>,
}

impl Case {
    /// Numbers for the sizes of a layer.
    fn new((network, inputs, outputs, height, width): Shape) -> Self {
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
    fn out(&self) -> FeatureMap {
        let (height, width) = (self.inputs[0].height(), self.inputs[0].width());
        FeatureMap::zeros(height, width, self.parts.outputs, 1).expect("the shape is a map's")
    }
}
