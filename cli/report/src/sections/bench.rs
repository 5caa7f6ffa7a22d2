//! Benchmarks: latency, work, stages, deadlines, of networks over events and over frames.

use meissner_plot::{Panel, Scale, Series, Style};
use serde_json::Value;

use super::layers;
use crate::json::{list, number, quantiles, text};
use crate::parts::{Section, Table, bars, plane};
use crate::read::Outcome;
use crate::words::{bytes, count, percent, time};

/// Timed calls, with the name in tables: for events, and for frames.
const OF_EVENTS: &[(&str, &str)] =
    &[("push", "event"), ("predict", "prediction"), ("push_predict", "event with prediction")];
const OF_FRAMES: &[(&str, &str)] = &[
    ("frame", "making a frame"),
    ("push", "frame"),
    ("predict", "prediction"),
    ("push_predict", "frame with prediction"),
];

/// The section of a benchmark.
pub(crate) fn section(outcome: &Outcome, object: &Value) -> Section {
    let mut section = Section::default();
    let name = outcome.network().unwrap_or("The network");
    if object.get("ways").is_some() {
        comparison(&mut section, name, object);
        return section;
    }
    let of_frames = object.get("skipping");
    // The timed item, and the object with its times.
    let (timed, measured) = of_frames.map_or(("an event", object), |skipping| ("a frame", skipping));
    let latency = |quantile: &str| number(measured, &format!("latency_us/push_predict/{quantile}"));
    if let (Some(p50), Some(p99)) = (latency("p50"), latency("p99")) {
        section.answer.push(format!(
            "{name} takes {} for {timed} with its prediction at the median, {} at 99 %.",
            time(p50),
            time(p99)
        ));
    }
    deadline(&mut section, object);
    if let Some(everything) = object.get("everything") {
        let [fast, slow] = [measured, everything].map(|of| number(of, "compute_s"));
        if let (Some(fast), Some(slow)) = (fast.filter(|&s| s > 0.0), slow) {
            let times = crate::words::number(slow / fast);
            section.answer.push(format!("To skip what did not change makes it {times} times as fast."));
        }
    }
    for (quantile, shown) in [("p50", "median"), ("p99", "99 %"), ("p999", "99.9 %"), ("max", "longest")] {
        section.figure(&format!("{timed} with its prediction, {shown} (us)"), latency(quantile));
    }
    section.figure("events/s", number(object, "events_per_s"));
    section.figure("frames/s", number(measured, "frames_per_s"));
    section.figure("sustained events/s", number(object, "deadline/sustained/events_per_s"));
    section.figure("rows for an event", number(object, "work/rows_per_event"));
    section.figure("multiply-adds for an event", number(object, "work/multiply_adds_per_event"));
    section.figure("multiply-adds for a frame", number(object, "multiply_adds_per_frame"));
    section.times =
        quantiles(measured, "latency_us/push_predict").map(|of| (format!("{timed} with its prediction"), of));
    let names = if of_frames.is_some() { OF_FRAMES } else { OF_EVENTS };
    let mut rows = calls(measured, names, "");
    let everything = object.get("everything");
    rows.extend(everything.into_iter().flat_map(|of| calls(of, &names[3..], ", all of it")));
    let phases = ["idle", "burst"].map(|phase| {
        let path = format!("phases/{phase}/latency_us/push_predict");
        quantiles(object, &path).map(|of| (format!("while {phase}"), of))
    });
    // A single phase equals the whole.
    if let [Some(idle), Some(burst)] = phases {
        rows.extend([idle, burst]);
    }
    section.latencies("How long one call takes. The line goes from the median to the longest.", rows);
    stages(&mut section, object);
    layers::skips(&mut section, object);
    if of_frames.is_some() {
        layers::pixels(&mut section, list(measured, "layers"));
    }
    work(&mut section, object);
    bins(&mut section, object);
    memory(&mut section, object);
    section
}

fn calls(of: &Value, names: &[(&str, &str)], more: &str) -> Vec<(String, Vec<f64>)> {
    let call = |(key, name): &(&str, &str)| {
        Some((format!("{name}{more}"), quantiles(of, &format!("latency_us/{key}"))?))
    };
    names.iter().filter_map(call).collect()
}

fn deadline(section: &mut Section, object: &Value) {
    let Some(deadline) = object.get("deadline") else { return };
    let found = |key: &str| number(deadline, key);
    if let Some(load) = found("load").filter(|&load| load > 0.0) {
        let holds = if load < 1.0 { "keeps up with" } else { "is slower than" };
        section
            .answer
            .push(format!("It {holds} this recording: its work takes {} % of the time.", percent(load)));
        section.figure("times as fast as the input", Some(1.0 / load));
    }
    if let (Some(missed), Some(periods), Some(period)) =
        (found("missed"), found("periods"), found("period_us"))
    {
        section.answer.push(format!(
            "{} of {} deadlines of {} were missed.",
            count(missed),
            count(periods),
            time(period)
        ));
        section.figure("deadlines missed (%)", Some(100.0 * missed / periods.max(1.0)));
    }
}

fn stages(section: &mut Section, object: &Value) {
    let stage = |stage: &Value| {
        let us = number(stage, "us_per_event").filter(|&us| us > 0.0)?;
        Some((text(stage, "name")?.to_owned(), us, number(stage, "share").unwrap_or(0.0)))
    };
    let stages: Vec<(String, f64, f64)> = list(object, "stages").iter().filter_map(stage).collect();
    if stages.is_empty() {
        return;
    }
    let cells = stages.iter().map(|(name, us, share)| vec![name.clone(), time(*us), percent(*share)]);
    let table = Table::new("Stages", &["stage", "time for an event", "share (%)"], cells.collect());
    let rows = stages.into_iter().map(|(name, us, _)| (name, us)).collect();
    section.draw(
        "Mean time for an event, with a clock around each stage: the clocks make it slower than it is.",
        &Panel::Parts(bars("Where the time goes", "us for an event", rows)),
    );
    section.table(table);
}

fn work(section: &mut Section, object: &Value) {
    let row = |layer: &Value| {
        let cell = |key: &str| number(layer, key).map_or_else(String::new, crate::words::number);
        let name = text(layer, "name")?.to_owned();
        Some(vec![
            name,
            cell("rows_per_event"),
            cell("multiply_adds_per_row"),
            cell("multiply_adds_per_event"),
        ])
    };
    let rows = list(object, "work/layers").iter().filter_map(row).collect();
    let headings = ["layer", "rows for an event", "multiply-adds for a row", "multiply-adds for an event"];
    section.table(Table::new("Work", &headings, rows));
}

/// The work of periods by their number of events.
fn bins(section: &mut Section, object: &Value) {
    let bins = list(object, "deadline/bins");
    if bins.len() < 2 {
        return;
    }
    let line = |path: &str, name: &str, colour, style| {
        let point = |bin: &Value| Some((number(bin, "events_seen")?, number(bin, path)?));
        Series::new(name, colour, style, bins.iter().filter_map(point).collect())
    };
    let mut series =
        vec![line("work_us/p50", "median", 0, Style::Line), line("work_us/p99", "99 %", 1, Style::Line)];
    if let Some(period) = number(object, "deadline/period_us") {
        let ends: Vec<f64> = bins.iter().filter_map(|bin| number(bin, "events_seen")).collect();
        let (first, last) = (ends.first().copied(), ends.last().copied());
        let ends = first.into_iter().chain(last).map(|x| (x, period));
        series.push(Series::new("deadline", 5, Style::Dashed, ends.collect()));
    }
    let mut panel = plane("Work of a period", ["events in the period", "work (us)"], series);
    panel.scale = Scale::FromZero;
    section.draw(
        "Where a line crosses the deadline, events come faster than they can be taken.",
        &Panel::Plane(panel),
    );
}

fn memory(section: &mut Section, object: &Value) {
    let measured = object.get("skipping").unwrap_or(object);
    let state = number(measured, "state_bytes").or(number(object, "memory/state_bytes"));
    let peak = number(object, "peak_resident_bytes").or(number(object, "memory/peak_resident_bytes"));
    section.figure("bytes of the state", state);
    let rows = [("state of an engine", state), ("most memory of the process", peak)];
    let rows = rows.into_iter().filter_map(|(name, of)| Some(vec![name.to_owned(), bytes(of?)]));
    section.table(Table::new("Memory", &["", ""], rows.collect()));
}

/// A network over events beside a frame network.
fn comparison(section: &mut Section, name: &str, object: &Value) {
    let against = text(object, "against/network/name").unwrap_or("the frame network");
    let ways = [
        ("events", name.to_owned()),
        ("frames_everything", format!("{against}, all of it")),
        ("frames_skipping", format!("{against}, what changed")),
    ];
    let found = |key: &str, path: &str| number(object, &format!("ways/{key}/{path}"));
    if let (Some(events), Some(frames)) =
        (found("events", "compute_s"), found("frames_skipping", "compute_s"))
        && events > 0.0
    {
        let times = crate::words::number(frames / events);
        section
            .answer
            .push(format!("{against} computes {times} times as long as {name} over the same events."));
    }
    let rows = ways.iter().filter_map(|(key, name)| Some((name.clone(), found(key, "compute_s")?)));
    let rows: Vec<(String, f64)> = rows.collect();
    section.draw("All work between events and predictions.", &Panel::Parts(bars("Compute", "s", rows)));
    let times = ways
        .iter()
        .filter_map(|(key, name)| Some((name.clone(), quantiles(object, &format!("ways/{key}/moment_us"))?)));
    section.latencies("Work of a moment: its events and the prediction.", times.collect());
    let cells = ways.iter().map(|(key, name)| {
        let cell = |path: &str| found(key, path).map_or_else(String::new, crate::words::number);
        vec![name.clone(), cell("compute_s"), cell("predictions"), cell("multiply_adds"), cell("state_bytes")]
    });
    let headings = ["way", "compute (s)", "predictions", "multiply-adds", "bytes of the state"];
    section.table(Table::new("Comparison", &headings, cells.collect()));
}
