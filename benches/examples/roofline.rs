//! Where each kernel stands between the machine's limits, all measured in one run:
//! `cargo run --release -p meissner-benches --example roofline [-- --json] [--all-isas]`.

use std::hint::black_box;
use std::time::Duration;

use meissner_benches::cost::Cost;
use meissner_benches::kernel_cases::{denses, splines};
use meissner_benches::peak::{BUFFERS, Bandwidth, Peak};
use meissner_benches::timing::median_ns;
use meissner_benches::{networks, streams};
use meissner_kernels::{Isa, SplineScratch};
use serde_json::{Value, json};

const SAMPLES: usize = 9;
const SHORTEST: Duration = Duration::from_millis(4);

/// A kernel's figures.
struct Line {
    network: String,
    layer: String,
    shape: String,
    degree: f64,
    rows: usize,
    /// Of all rows.
    cost: Cost,
    /// Of all rows.
    ns: f64,
}

fn main() {
    let mut as_json = false;
    let mut isas = vec![Isa::best()];
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--json" => as_json = true,
            "--all-isas" => isas = Isa::available(),
            _ => {
                eprintln!("usage: roofline [--json] [--all-isas]");
                std::process::exit(2);
            }
        }
    }
    let window = streams::window();
    let mut reports = Vec::new();
    for isa in isas {
        let peak = Peak::measure(isa);
        let bandwidths = BUFFERS.map(|buffer| Bandwidth::measure(isa, buffer));
        let mut lines = Vec::new();
        for network in networks::INCREMENTAL {
            for case in splines(network, &window) {
                case.check(isa);
                let (mut scratch, mut out) = (SplineScratch::default(), case.out());
                let ns = median_ns(SAMPLES, SHORTEST, || case.run(isa, &mut scratch, black_box(&mut out)));
                lines.push(Line {
                    network: case.network.clone(),
                    layer: case.layer.clone(),
                    shape: case.shape(),
                    degree: case.degree,
                    rows: case.rows(),
                    cost: case.cost(),
                    ns,
                });
            }
        }
        for case in denses() {
            case.check(isa);
            let mut out = case.out();
            let ns = median_ns(SAMPLES, SHORTEST, || case.run(isa, black_box(&mut out)));
            let (shape, cost) = (case.shape(), case.cost);
            lines.push(Line {
                network: case.network,
                layer: case.layer,
                shape,
                degree: 0.0,
                rows: 1,
                cost,
                ns,
            });
        }
        if as_json {
            reports.push(report(&window.name, &peak, &bandwidths, &lines));
        } else {
            print(&window.name, &peak, &bandwidths, &lines);
        }
    }
    if as_json {
        println!("{:#}", Value::from(reports));
    }
}

impl Line {
    /// Of one row.
    fn ns_row(&self) -> f64 {
        self.ns / self.rows as f64
    }

    fn gflops(&self) -> f64 {
        self.cost.gflops(self.ns)
    }

    /// Nanoseconds below which no row by itself can be: operations at the peak, or bytes at the first cache's speed.
    /// Rows that share weights in registers move fewer bytes.
    fn floor_ns(&self, peak: &Peak, cache: &Bandwidth) -> f64 {
        let rows = self.rows as f64;
        (self.cost.flops() as f64 / peak.gflops).max(self.cost.bytes as f64 / cache.gb_s) / rows
    }
}

fn print(window: &str, peak: &Peak, bandwidths: &[Bandwidth], lines: &[Line]) {
    println!("{}, one thread; graphs of a window of {window}", peak.isa.name());
    println!("  measured peak, product then sum in registers: {:.1} GFLOP/s", peak.gflops);
    for b in bandwidths {
        println!("  measured reads, buffer of {:>6} KiB: {:.1} GB/s", b.buffer >> 10, b.gb_s);
    }
    println!(
        "\n{:<16} {:<7} {:<15} {:>6} {:>8} {:>8} {:>8} {:>8} {:>8} {:>6}",
        "network",
        "layer",
        "shape",
        "degree",
        "mul-adds",
        "bytes",
        "floor ns",
        "ns a row",
        "GFLOP/s",
        "% peak"
    );
    for line in lines {
        println!(
            "{:<16} {:<7} {:<15} {:>6.1} {:>8} {:>8} {:>8.1} {:>8.1} {:>8.1} {:>6.1}",
            line.network,
            line.layer,
            line.shape,
            line.degree,
            line.cost.multiply_adds / line.rows,
            line.cost.bytes / line.rows,
            line.floor_ns(peak, &bandwidths[0]),
            line.ns_row(),
            line.gflops(),
            peak.percent(line.gflops()),
        );
    }
    println!();
}

fn report(window: &str, peak: &Peak, bandwidths: &[Bandwidth], lines: &[Line]) -> Value {
    let kernels = lines.iter().map(|line| {
        json!({
            "network": line.network,
            "layer": line.layer,
            "shape": line.shape,
            "degree": line.degree,
            "rows": line.rows,
            "multiply_adds_a_row": line.cost.multiply_adds / line.rows,
            "bytes_a_row": line.cost.bytes / line.rows,
            "floor_ns_a_row": line.floor_ns(peak, &bandwidths[0]),
            "ns_a_row": line.ns_row(),
            "gflops": line.gflops(),
            "percent_of_peak": peak.percent(line.gflops()),
        })
    });
    json!({
        "window": window,
        "isa": peak.isa.name(),
        "peak_gflops": peak.gflops,
        "reads": bandwidths.iter().map(|b| json!({"bytes": b.buffer, "gb_s": b.gb_s})).collect::<Vec<_>>(),
        "kernels": kernels.collect::<Vec<_>>(),
    })
}
