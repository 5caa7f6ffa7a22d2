//! `meissner bench --sweep`: how the cost of an event grows.

use std::io::{self, Write};

use clap::ValueEnum;
use meissner_engine::Sensor;
use meissner_run::bench::{Curve, Point, Quantity, SweepOptions, SweepReport, sweep};
use meissner_run::model::{describe, description_text};
use meissner_run::text::grouped;

use super::BenchArgs;
use crate::error::CliError;
use crate::given::Given;
use crate::output;
use crate::progress::Progress;
use crate::text::{Table, cell, columns, duration, mebibytes};

/// Options that fit a sweep.
const FITTING: &[&str] = &["--sweep", "--network", "--sensor", "--limit", "--json"];
/// Pixels of the paper's sensor for contact angles.
const SENSOR: [u16; 2] = [346, 260];
/// Number of timed events for each value.
const EVENTS: u64 = 2000;

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum QuantityArg {
    /// Events in the window, 1,000 to 100,000.
    Window,
    /// Events a second, 10,000 to 10 million.
    Rate,
    /// Neighbours of an event, 4 to 32.
    Neighbours,
    /// Channels of every block, half to four times.
    Channels,
    /// Pixels of the sensor, 10,000 to a million.
    Sensor,
}

impl QuantityArg {
    fn quantity(self) -> Quantity {
        match self {
            Self::Window => Quantity::Window,
            Self::Rate => Quantity::Rate,
            Self::Neighbours => Quantity::Neighbours,
            Self::Channels => Quantity::Channels,
            Self::Sensor => Quantity::Sensor,
        }
    }
}

/// Measures the network of `args` along `quantities`, or along all if there are none.
pub(super) fn run(args: &BenchArgs, quantities: &[QuantityArg], given: &Given) -> Result<(), CliError> {
    if let Some(option) = given.beyond(FITTING) {
        return Err(CliError::usage(option, "no such option with --sweep, which draws its events", option));
    }
    let network = args.input.network();
    let text = description_text(network, describe(network)?.1)?;
    let mut all: Vec<_> = quantities.iter().map(|quantity| quantity.quantity()).collect();
    if all.is_empty() {
        all.extend(Quantity::ALL);
    }
    let events = args.input.limit.unwrap_or(EVENTS);
    let options = SweepOptions {
        quantities: all,
        sensor: args.input.read.sensor.unwrap_or_else(|| Sensor::new(SENSOR[0], SENSOR[1])),
        events: usize::try_from(events).unwrap_or(usize::MAX),
        seed: 0,
    };
    if events == 0 {
        return Err(CliError::usage("--limit", "at least 1 event to time", "0"));
    }
    let progress = Progress::busy({
        let network = network.to_owned();
        move || format!("measuring {network}")
    });
    let report = sweep(&text, &options)?;
    progress.finish();
    output::print(args.format.json, &report, |out| write(out, network, &report))
}

fn write(out: &mut impl Write, network: &str, report: &SweepReport) -> io::Result<()> {
    writeln!(out, "network      {network}, weights drawn, {} kernels", report.isa)?;
    writeln!(
        out,
        "stream       uniform: {} events in the window, {} a second, where not varied",
        grouped(report.window as u64),
        grouped(report.rate_events_per_s.round() as u64)
    )?;
    writeln!(out, "measured     {} events for each value", grouped(report.events as u64))?;
    report.curves.iter().try_for_each(|curve| write_curve(out, curve))
}

fn write_curve(out: &mut impl Write, curve: &Curve) -> io::Result<()> {
    writeln!(out)?;
    let title = curve.quantity.title();
    let mut table = Table::new(&columns(&format!("{title} | p50 | p99 | rows | memory")));
    for point in &curve.points {
        let Point { value, latency_us, rows_per_event, state_bytes, .. } = point;
        let times = [latency_us.quantiles.p50, latency_us.quantiles.p99].map(duration);
        let rows = format!("{rows_per_event:.1}");
        table.row([shown(*value)].into_iter().chain(times).chain([rows, mebibytes(*state_bytes)]));
    }
    let slopes = curve.slopes;
    let powers = [slopes.p50, slopes.p99, slopes.rows, slopes.state_bytes];
    let powers = powers.map(|slope| cell(slope, |slope| format!("{slope:.2}")));
    table.row(["grows with the power".to_owned()].into_iter().chain(powers));
    table.write(out)?;
    let behind = curve.behind_at.map(|value| ("slower than the stream", value));
    let late = curve.late_at.map(|value| ("p99 above 1 ms", value));
    for (what, value) in behind.into_iter().chain(late) {
        writeln!(out, "  {what} from {} on", shown(value))?;
    }
    Ok(())
}

/// A value of a quantity.
fn shown(value: f64) -> String {
    if value.fract() == 0.0 { grouped(value as u64) } else { value.to_string() }
}
