//! Soaks: whether promises hold over a long time, and whether times and memory stay constant.

use meissner_plot::{Panel, Scale, Series, Style};
use serde_json::Value;

use crate::json::{list, number, quantiles, texts};
use crate::parts::{Section, Table, plane};
use crate::read::Outcome;
use crate::words::{bytes, count, counted, number as shown, time};

/// The section of a soak.
pub(crate) fn section(outcome: &Outcome, object: &Value) -> Section {
    let mut section = Section::default();
    let name = outcome.network().unwrap_or("The network");
    let events = number(object, "events").unwrap_or(0.0);
    let broken = texts(object, "broken");
    let checkpoints = list(object, "checkpoints");
    section.answer.push(if broken.is_empty() {
        format!("{name} kept every promise over {}.", counted(events, "event", "events"))
    } else {
        let promises = counted(broken.len() as f64, "promise", "promises");
        format!("{name} broke {promises} over {}.", counted(events, "event", "events"))
    });
    section.answer.extend(broken.iter().map(|&text| format!("Broken: {text}.")));
    let equal =
        checkpoints.iter().filter(|at| at.get("equal").and_then(Value::as_bool) == Some(true)).count();
    section.answer.push(format!(
        "At {} of {} it was equal to full recomputation bit for bit.",
        count(equal as f64),
        counted(checkpoints.len() as f64, "checkpoint", "checkpoints")
    ));
    if let Some(growth) = number(object, "memory/growth_percent") {
        section.answer.push(format!("Its memory grew by {} %.", shown(growth)));
        section.figure("growth of memory (%)", Some(growth));
    }
    section.figure("events", Some(events));
    section.figure("broken promises", Some(broken.len() as f64));
    section.figure("last to first median of a push", number(object, "ratio/push/p50"));
    let along = |path: &str, factor: f64, name: &str, colour| {
        let point = |at: &Value| Some((number(at, "events")?, factor * number(at, path)?));
        Series::new(name, colour, Style::Line, checkpoints.iter().filter_map(point).collect())
    };
    let mut draw = |title: &str, y: &str, caption: &str, series: Vec<Series>| {
        if series.iter().any(|series| !series.points.is_empty()) {
            let mut panel = plane(title, ["events", y], series);
            panel.scale = Scale::FromZero;
            section.draw(caption, &Panel::Plane(panel));
        }
    };
    let medians = vec![
        along("latency_us/push/p50", 1.0, "event", 0),
        along("latency_us/predict/p50", 1.0, "prediction", 1),
    ];
    draw("Median latency", "latency (us)", "At each checkpoint, since the one before.", medians);
    let slow = vec![
        along("latency_us/push/p99", 1.0, "event", 0),
        along("latency_us/predict/p99", 1.0, "prediction", 1),
    ];
    draw("Latency at 99 %", "latency (us)", "Other programs of the machine show here first.", slow);
    let memory =
        vec![along("resident_bytes", 1e-6, "of the process", 2), along("live_bytes", 1e-6, "allocated", 3)];
    draw("Memory", "MB", "A leak would rise without end.", memory);
    draw("Events in the window", "events", "At the checkpoints.", vec![along("nodes", 1.0, "", 2)]);
    let mut rows = Vec::new();
    for (part, name) in [("first", "first tenth"), ("last", "last tenth")] {
        for (call, what) in [("push", "event"), ("predict", "prediction")] {
            let found = quantiles(object, &format!("{part}/latency_us/{call}"));
            rows.extend(found.map(|found| (format!("{what}, {name}"), found)));
        }
    }
    section.times = rows.iter().find(|(name, _)| name.starts_with("event, last")).cloned();
    section.latencies("The first and the last tenth of the checkpoints.", rows);
    let disturbances = object.get("disturbances").and_then(Value::as_object).into_iter().flatten();
    let rows =
        disturbances.map(|(name, found)| vec![name.replace('_', " "), count(found.as_f64().unwrap_or(0.0))]);
    section.table(Table::new("Disturbances", &["", "count"], rows.collect()));
    let rows = [
        ("time", number(object, "seconds").map(|s| time(s * 1e6))),
        ("most memory of the process", number(object, "peak_resident_bytes").map(bytes)),
    ];
    let rows = rows.into_iter().filter_map(|(name, value)| Some(vec![name.to_owned(), value?]));
    section.table(Table::new("The run", &["", ""], rows.collect()));
    section
}
