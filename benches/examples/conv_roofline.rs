//! The convolutions of the frame networks against the machine's limits, direct and by Winograd's tiles:
//! `cargo run --release -p meissner-benches --example conv_roofline [-- --json] [--all-isas]`.

use std::hint::black_box;

use meissner_benches::answers::Deviation;
use meissner_benches::conv_cases::{Case, SHAPES, SHORTEST};
use meissner_benches::peak::Peak;
use meissner_benches::report::{Column, Digits, rooflines};
use meissner_benches::timing::median_ns;
use meissner_kernels::{ConvScratch, FeatureMap, Isa, Region, View, WinogradConv3x3, WinogradTile};
use serde_json::{Value, json};

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
    let direct_ns = case.direct_ns(peak.isa, &mut direct_out);
    let gflops = |ns: f64| 2.0 * case.multiply_adds() as f64 / ns;
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
        let ns = median_ns(SHORTEST, || {
            conv.run(peak.isa, &views, region, black_box(&mut out).band(), &mut scratch)
                .expect("the case's maps fit");
        });
        line[format!("{name}_ns")] = json!(ns);
        line[format!("{name}_us")] = json!(ns / 1e3);
        line[format!("{name}_gflops")] = json!(gflops(ns));
        line[format!("{name}_times_as_fast")] = json!(direct_ns / ns);
        line[format!("{name}_error")] = json!(Deviation::between_maps(&direct_out, &out).max);
    }
    line
}
