//! The plot of `bench --svg`: the latencies of all events, and of the events in each phase.

use meissner_plot::{Distribution, LatencyCurve, Panel, page};
use meissner_run::bench::EventReport;
use meissner_run::latency::Latency;
use meissner_run::text::grouped;

use crate::text::file_name;

/// The plot as SVG text.
pub(super) fn svg(report: &EventReport) -> String {
    let (all, phases) = (&report.latency_us, &report.phases);
    let [idle, burst] = [&phases.idle, &phases.burst].map(|phase| &phase.latency_us.push_predict);
    let mut curves =
        vec![("push", &all.push), ("predict", &all.predict), ("push + predict", &all.push_predict)];
    // If all events are in one phase, its curve is that of all events.
    if idle.count() > 0 && burst.count() > 0 {
        curves.extend([("push + predict, idle", idle), ("push + predict, burst", burst)]);
    }
    let curve = |(i, (name, latency)): (usize, (&str, &Latency))| LatencyCurve {
        name: name.to_owned(),
        dashed: i >= 3,
        points: latency.longer(),
    };
    let curves = curves.into_iter().enumerate().map(curve).filter(|curve| !curve.points.is_empty()).collect();
    let input = &report.input;
    let passes = if input.passes > 1 { format!(" x {} passes", input.passes) } else { String::new() };
    let about = format!(
        "{}: {} events{passes}\n{} predictions, {} kernels",
        file_name(&input.header.input.name),
        grouped(input.events),
        grouped(report.predictions),
        input.isa
    );
    page(
        &format!("Latency of {}", input.card.network.name),
        &about,
        &[vec![Panel::Distribution(Distribution { curves })]],
    )
}
