//! Where the convolutions of the frame networks stand between the machine's limits, direct and by Winograd's tiles:
//! `cargo run --release -p meissner-benches --example conv_roofline [-- --json] [--all-isas]`.

use std::hint::black_box;
use std::time::Duration;

use meissner_benches::conv_cases::{Case, SHAPES};
use meissner_benches::peak::Peak;
use meissner_benches::timing::median_ns;
use meissner_kernels::{Conv3x3, ConvScratch, FeatureMap, Isa, Region, View, WinogradConv3x3, WinogradTile};
use serde_json::{Value, json};

const SAMPLES: usize = 9;
const SHORTEST: Duration = Duration::from_millis(10);

/// A layer's figures.
struct Line {
    name: String,
    /// Direct, 2 x 2 tiles, 4 x 4 tiles.
    ns: [f64; 3],
    /// Of the tiles: largest difference from the direct result over its largest magnitude.
    errors: [f32; 2],
    gflops: [f64; 3],
}

fn main() {
    let mut as_json = false;
    let mut isas = vec![Isa::best()];
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--json" => as_json = true,
            // Without vectors of fused products, the portable path takes minutes.
            "--all-isas" => {
                isas = Isa::available().into_iter().filter(|isa| isa.name() != "portable").collect();
            }
            _ => {
                eprintln!("usage: conv_roofline [--json] [--all-isas]");
                std::process::exit(2);
            }
        }
    }
    let mut reports = Vec::new();
    for isa in isas {
        let peak = Peak::measure(isa);
        let lines: Vec<Line> = SHAPES.iter().map(|shape| measure(isa, &shape.case())).collect();
        if as_json {
            reports.push(report(&peak, &lines));
        } else {
            print(&peak, &lines);
        }
    }
    if as_json {
        println!("{:#}", Value::from(reports));
    }
}

fn measure(isa: Isa, case: &Case) -> Line {
    let views: Vec<View<'_>> = case.inputs.iter().map(FeatureMap::view).collect();
    let (mut direct_out, mut out) = (case.out(), case.out());
    let region = Region::all(out.height(), out.width());
    let direct = Conv3x3::new(&case.parts).expect("the case's parameters fit");
    let direct_ns = median_ns(SAMPLES, SHORTEST, || {
        direct.run(isa, &views, region, black_box(&mut direct_out).band()).expect("the case's maps fit");
    });
    let [two, four] = [WinogradTile::Two, WinogradTile::Four].map(|tile| {
        let conv = WinogradConv3x3::new(&case.parts, tile).expect("the case's parameters fit");
        let mut scratch = ConvScratch::default();
        let ns = median_ns(SAMPLES, SHORTEST, || {
            conv.run(isa, &views, region, black_box(&mut out).band(), &mut scratch)
                .expect("the case's maps fit");
        });
        (ns, error(&direct_out, &out))
    });
    let ns = [direct_ns, two.0, four.0];
    let gflops = ns.map(|ns| 2.0 * case.multiply_adds() as f64 / ns);
    Line { name: case.name.clone(), ns, errors: [two.1, four.1], gflops }
}

/// Largest difference over the largest magnitude.
fn error(expected: &FeatureMap, found: &FeatureMap) -> f32 {
    let (mut difference, mut magnitude) = (0.0f32, 0.0f32);
    for y in 0..expected.height() {
        for x in 0..expected.width() {
            for (a, b) in expected.pixel(y, x).iter().zip(found.pixel(y, x)) {
                difference = difference.max((a - b).abs());
                magnitude = magnitude.max(a.abs());
            }
        }
    }
    difference / magnitude
}

fn print(peak: &Peak, lines: &[Line]) {
    println!("{}, one thread", peak.isa.name());
    println!("  measured peak, product then sum in registers: {:.1} GFLOP/s", peak.gflops);
    println!("  GFLOP/s of tiles count the direct convolution's operations\n");
    println!(
        "{:<36} {:>9} {:>7} {:>6}   {:>9} {:>7} {:>5} {:>8}   {:>9} {:>7} {:>5} {:>8}",
        "layer",
        "direct us",
        "GFLOP/s",
        "% peak",
        "F(2,3) us",
        "GFLOP/s",
        "x",
        "error",
        "F(4,3) us",
        "GFLOP/s",
        "x",
        "error"
    );
    for Line { name, ns, errors, gflops } in lines {
        print!("{name:<36} {:>9.1} {:>7.1} {:>6.1}", ns[0] / 1e3, gflops[0], peak.percent(gflops[0]));
        for i in 1..3 {
            let (times, error) = (ns[0] / ns[i], errors[i - 1]);
            print!("   {:>9.1} {:>7.1} {times:>5.2} {error:>8.1e}", ns[i] / 1e3, gflops[i]);
        }
        println!();
    }
    println!();
}

fn report(peak: &Peak, lines: &[Line]) -> Value {
    let layers = lines.iter().map(|line| {
        json!({
            "layer": line.name,
            "direct_ns": line.ns[0],
            "direct_gflops": line.gflops[0],
            "direct_percent_of_peak": peak.percent(line.gflops[0]),
            "winograd_2_ns": line.ns[1],
            "winograd_2_error": line.errors[0],
            "winograd_4_ns": line.ns[2],
            "winograd_4_error": line.errors[1],
        })
    });
    json!({
        "isa": peak.isa.name(),
        "peak_gflops": peak.gflops,
        "layers": layers.collect::<Vec<_>>(),
    })
}
