//! Each kernel against the machine's limits, all measured in one run:
//! `cargo run --release -p meissner-benches --example roofline [-- --json] [--all-isas]`.

use std::hint::black_box;
use std::time::Duration;

use meissner_benches::kernel_cases::{denses, splines};
use meissner_benches::peak::{BUFFERS, Bandwidth, Peak};
use meissner_benches::report::{Column, Digits, rooflines};
use meissner_benches::streams::Recording;
use meissner_benches::timing::median_ns;
use meissner_benches::{networks, streams};
use meissner_kernels::{Isa, SplineScratch};
use serde_json::{Value, json};

const MIN: Duration = Duration::from_millis(4);

const COLUMNS: [Column; 10] = [
    ("network", "network", Digits::Fixed(0)),
    ("layer", "layer", Digits::Fixed(0)),
    ("shape", "shape", Digits::Fixed(0)),
    ("degree", "degree", Digits::Fixed(1)),
    ("multiply_adds_a_row", "mul-adds", Digits::Fixed(0)),
    ("bytes_a_row", "bytes", Digits::Fixed(0)),
    ("floor_ns_a_row", "floor ns", Digits::Fixed(1)),
    ("ns_a_row", "ns a row", Digits::Fixed(1)),
    ("gflops", "GFLOP/s", Digits::Fixed(1)),
    ("percent_of_peak", "% peak", Digits::Fixed(1)),
];

fn main() {
    let window = streams::window();
    rooflines("roofline", Isa::available(), "kernels", &COLUMNS, note, |peak| measure(&window, peak));
}

/// The window and the caches' speeds.
fn note(report: &Value) -> String {
    let reads = report["reads"].as_array().into_iter().flatten().map(|read| {
        let kib = read["bytes"].as_u64().unwrap_or(0) >> 10;
        format!(
            "  measured reads, buffer of {kib:>6} KiB: {:.1} GB/s\n",
            read["gb_s"].as_f64().unwrap_or(0.0)
        )
    });
    format!("  graphs of a window of {}\n{}", report["window"], reads.collect::<String>())
}

fn measure(window: &Recording, peak: &Peak) -> Value {
    let isa = peak.isa;
    let reads = BUFFERS.map(|buffer| Bandwidth::measure(isa, buffer));
    let splines = networks::INCREMENTAL.iter().flat_map(|network| splines(network, window));
    let kernels = splines.chain(denses()).map(|case| {
        case.check(isa);
        let (mut scratch, mut out) = (SplineScratch::default(), case.out());
        let ns = median_ns(MIN, || case.run(isa, &mut scratch, black_box(&mut out)));
        let (cost, rows) = (case.cost, case.rows);
        // No row is faster than its operations at the peak, or its bytes at the first cache's
        // speed.
        let floor_ns = (cost.flops() as f64 / peak.gflops).max(cost.bytes as f64 / reads[0].gb_s);
        json!({
            "network": case.network,
            "layer": case.layer,
            "shape": case.shape,
            "degree": case.degree,
            "rows": rows,
            "multiply_adds_a_row": cost.multiply_adds / rows,
            "bytes_a_row": cost.bytes / rows,
            "floor_ns_a_row": floor_ns / rows as f64,
            "ns_a_row": ns / rows as f64,
            "gflops": cost.gflops(ns),
            "percent_of_peak": peak.percent(cost.gflops(ns)),
        })
    });
    let kernels: Vec<Value> = kernels.collect();
    let reads: Vec<Value> = reads.iter().map(|r| json!({"bytes": r.buffer, "gb_s": r.gb_s})).collect();
    json!({ "window": window.name, "reads": reads, "kernels": kernels })
}
