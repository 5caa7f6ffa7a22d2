//! Runs and plays: the predictions of the network over time, and their cost.

use meissner_plot::{Panel, Scale, Series, Style};
use serde_json::Value;

use super::layers;
use crate::decimated::Decimated;
use crate::json::{list, number, quantiles, text};
use crate::parts::{Section, Table, bars, plane, predicted};
use crate::read::Outcome;
use crate::stream::{Along, Named, Stream, Valued};
use crate::words::{count, counted, file_name, percent, time};

/// Maximum number of lines of a picture; the lines with the highest values are shown.
const MAX_SERIES: usize = 6;

/// Timed calls: the key and its meaning.
const CALLS: [(&str, &str); 10] = [
    ("push", "event"),
    ("predict", "prediction"),
    ("prepare", "preparing a frame"),
    ("decision", "decision"),
    ("arrival", "from arrival to prediction"),
    ("event", "from an event to its report"),
    ("age", "age of a report"),
    ("waited", "waiting for a report"),
    ("behind", "events not covered"),
    ("push_predict", "event with prediction"),
];

/// The section of a run or a play.
pub(crate) fn section(outcome: &Outcome, of: &Stream) -> Section {
    let mut section = Section::default();
    let summary = of.summary.as_ref();
    answer(&mut section, outcome, of);
    values(&mut section, of);
    for value in of.values.iter().take(MAX_SERIES) {
        let what = ("along the stream", value.errors.1);
        predicted(&mut section, &value.name, &value.unit, of.pairs(value), what);
    }
    classes(&mut section, of);
    let along = axis(of);
    let line = |line: &Decimated, name: &str, colour| Series::new(name, colour, Style::Line, line.points());
    if of.unlike.last().is_some() {
        let ends = of.unlike.points();
        let (first, last) = (ends.first().map_or(0.0, |end| end.0), ends.last().map_or(1.0, |end| end.0));
        let limit = Series::new("limit", 5, Style::Dashed, vec![(first, 1.0), (last, 1.0)]);
        let mut panel = plane(
            "How unlike the training the input is",
            [along, "distance"],
            vec![limit, line(&of.unlike, "", 3)],
        );
        panel.scale = Scale::FromZero;
        section.draw("Above the limit of 1, a prediction means little.", &Panel::Plane(panel));
    }
    if let Some(summary) = summary {
        let names = list(summary, "skips/layers").iter().map(|layer| text(layer, "name").unwrap_or("?"));
        rows(&mut section, of, &names.collect::<Vec<_>>());
        layers::skips(&mut section, summary);
        let calls = CALLS.iter().filter_map(|(key, name)| {
            Some(((*name).to_owned(), quantiles(summary, &format!("latency_us/{key}"))?))
        });
        let calls: Vec<(String, Vec<f64>)> = calls.collect();
        // A prediction for a frame costs more than its events, and a report of a play includes
        // them.
        let main = ["prediction", "from an event to its report"];
        section.times = main.iter().find_map(|main| calls.iter().find(|(name, _)| name == main)).cloned();
        section.latencies("How long one call takes. The line goes from the median to the longest.", calls);
    }
    if !of.times.is_empty() {
        let series = of.times.iter().enumerate().map(|(i, (name, times))| line(times, name, i));
        let mut panel = plane("Times along the stream", [along, "time (us)"], series.collect());
        panel.scale = Scale::FromZero;
        section.draw("Peaks of every moment are kept, however long the stream is.", &Panel::Plane(panel));
    }
    if of.nodes.last().is_some() {
        let mut panel = plane("Events in the window", [along, "events"], vec![line(&of.nodes, "", 2)]);
        panel.scale = Scale::FromZero;
        section.draw("How many events the predictions rest on.", &Panel::Plane(panel));
    }
    if let Some(summary) = summary {
        losses(&mut section, summary);
    }
    section
}

/// The title of the horizontal axis.
fn axis(of: &Stream) -> &'static str {
    match of.along {
        Along::Time => "time since the first prediction (ms)",
        Along::Number => "prediction",
    }
}

fn answer(section: &mut Section, outcome: &Outcome, of: &Stream) {
    let name = outcome.network().unwrap_or("The network");
    let input = file_name(outcome.input());
    let made = counted(of.predictions as f64, "prediction", "predictions");
    let summary = of.summary.as_ref();
    let found = |key: &str| summary.and_then(|summary| number(summary, key));
    let said = last(of);
    section.answer.push(match &said {
        Some(said) => format!("{name} made {made} from {input}; the last one is {said}."),
        None => format!("{name} made {made} from {input}."),
    });
    let errors = of.values.iter().filter(|value| value.errors.1 > 0.0).map(|value| {
        let mean = value.errors.0 / value.errors.1;
        section.figures.push((format!("mean error of {} ({})", value.name, value.unit), mean));
        format!("{} {} in {}", crate::words::number(mean), value.unit, value.name)
    });
    let errors: Vec<String> = errors.collect();
    if !errors.is_empty() {
        section.answer.push(format!("Against the truth it is off by {} in the mean.", errors.join(", ")));
    }
    if let Some(speed) = found("real_time") {
        let holds =
            if speed >= 1.0 { "It keeps up with the input" } else { "It does not keep up with the input" };
        section.answer.push(format!("{holds}: {} times as fast as it came.", crate::words::number(speed)));
    }
    if let (Some(due), Some(late)) = (found("reports/due"), found("reports/past_deadline")) {
        section.answer.push(format!(
            "{} of {} came after their deadline.",
            count(late),
            counted(due, "report", "reports")
        ));
        section.figure("reports past the deadline", Some(late));
    }
    if let Some(unlike) = found("unlike_training").filter(|&unlike| unlike > 0.0) {
        let share = percent(unlike / (of.predictions.max(1)) as f64);
        section.answer.push(format!("{share} % of the predictions rest on input unlike the training's."));
    }
    for (name, key) in [
        ("events", "events"),
        ("predictions", "predictions"),
        ("events/s", "events_per_s"),
        ("frames/s", "frames_per_s"),
        ("times as fast as the input", "real_time"),
    ] {
        section.figure(name, found(key));
    }
    for (key, name) in CALLS {
        for (quantile, shown) in [("p50", "median"), ("p99", "99 %")] {
            section.figure(&format!("{name}, {shown} (us)"), found(&format!("latency_us/{key}/{quantile}")));
        }
    }
    section.figure("predictions unlike the training", found("unlike_training"));
}

/// The last prediction in words.
fn last(of: &Stream) -> Option<String> {
    if let Some(class) = of.last_decision.as_ref().or(of.last_class.as_ref()) {
        return Some(class.clone());
    }
    let said = of.values.iter().filter_map(|value| {
        let (_, last) = value.line.last()?;
        let name = if of.values.len() > 1 { format!("{} ", value.name) } else { String::new() };
        Some(format!("{name}{last:.2} {}", value.unit))
    });
    let said: Vec<String> = said.take(4).collect();
    (!said.is_empty()).then(|| said.join(", "))
}

/// A picture for each unit, of the values and their truth.
fn values(section: &mut Section, of: &Stream) {
    let mut units: Vec<&str> = of.values.iter().map(|value| value.unit.as_str()).collect();
    units.dedup();
    units.sort_unstable();
    units.dedup();
    for unit in units {
        let shown: Vec<&Valued> =
            of.values.iter().filter(|value| value.unit == unit).take(MAX_SERIES).collect();
        let mut series = Vec::new();
        for (i, value) in shown.iter().enumerate() {
            series.push(Series::new(value.name.clone(), i, Style::Line, value.line.points()));
            if value.truth.last().is_some() {
                let name = format!("{}, true", value.name);
                series.push(Series::new(name, i, Style::Dashed, value.truth.points()));
            }
        }
        let has_truth = shown.iter().any(|value| value.truth.last().is_some());
        let caption = if has_truth {
            "Predictions as lines, the truth dashed."
        } else {
            "Predictions along the stream."
        };
        let title = if unit.is_empty() { "value".to_owned() } else { format!("value ({unit})") };
        section.draw(caption, &Panel::Plane(plane("Predictions", [axis(of), &title], series)));
    }
}

fn classes(section: &mut Section, of: &Stream) {
    if of.predicted.iter().all(|&count| count == 0) {
        return;
    }
    let highest = |line: &Decimated| line.highest().unwrap_or(0.0);
    let mut shown: Vec<&Named> = of.classes.iter().collect();
    shown.sort_by(|a, b| highest(&b.1).total_cmp(&highest(&a.1)));
    shown.truncate(MAX_SERIES);
    let series = shown.iter().enumerate().map(|(i, (name, line))| {
        let points = line.points().into_iter().map(|(x, share)| (x, 100.0 * share));
        Series::new(name.clone(), i, Style::Line, points.collect())
    });
    let mut panel = plane("Probability of the classes", [axis(of), "probability (%)"], series.collect());
    panel.scale = Scale::FromZero;
    let all = of.classes.len();
    let caption = if all > MAX_SERIES {
        format!("The {MAX_SERIES} classes of {all} that rise highest.")
    } else {
        "All classes.".to_owned()
    };
    section.draw(caption, &Panel::Plane(panel));
    let counted = of.classes.iter().zip(&of.predicted).filter(|(_, count)| **count > 0);
    let rows: Vec<(String, f64)> = counted.map(|((name, _), &count)| (name.clone(), count as f64)).collect();
    let cells = rows.iter().map(|(name, times)| {
        vec![name.clone(), count(*times), percent(times / of.predictions.max(1) as f64)]
    });
    let cells: Vec<Vec<String>> = cells.collect();
    section.draw(
        "How often each class was the most probable one.",
        &Panel::Parts(bars("Predicted classes", "predictions", rows)),
    );
    section.table(Table::new("Predicted classes", &["class", "predictions", "share (%)"], cells));
}

fn rows(section: &mut Section, of: &Stream, names: &[&str]) {
    if of.rows.is_empty() || of.rows.iter().all(|rows| rows.highest().unwrap_or(0.0) == 0.0) {
        return;
    }
    let name = |layer: usize| {
        names.get(layer).map_or_else(|| format!("layer {}", layer + 1), |&name| name.to_owned())
    };
    let mut shown: Vec<(String, &Decimated)> = Vec::new();
    for (layer, rows) in of.rows.iter().enumerate() {
        // Layers of one level compute the same rows: one line has all their names.
        match shown.iter_mut().find(|(_, other)| other.points() == rows.points()) {
            Some((names, _)) => *names = format!("{names}, {}", name(layer)),
            None => shown.push((name(layer), rows)),
        }
    }
    shown.sort_by(|a, b| b.1.highest().unwrap_or(0.0).total_cmp(&a.1.highest().unwrap_or(0.0)));
    shown.truncate(MAX_SERIES);
    let series = shown.into_iter().enumerate();
    let series = series.map(|(i, (name, rows))| Series::new(name, i, Style::Line, rows.points()));
    let mut panel = plane("Rows that were computed for a prediction", [axis(of), "rows"], series.collect());
    panel.scale = Scale::FromZero;
    section.draw("Layers that computed equally many rows share a line.", &Panel::Plane(panel));
}

/// A table of dropped and omitted input, and of warnings.
fn losses(section: &mut Section, summary: &Value) {
    let dropped = summary.get("dropped").and_then(Value::as_object).into_iter().flatten();
    let mut rows: Vec<Vec<String>> = dropped
        .filter_map(|(reason, count)| Some((reason, count.as_f64().filter(|&count| count > 0.0)?)))
        .map(|(reason, found)| vec![format!("dropped: {}", reason.replace('_', " ")), count(found)])
        .collect();
    for (key, name) in [
        ("lines_refused", "lines refused"),
        ("restarts", "restarts of the clock"),
        ("empty_frames_left_out", "empty frames left out"),
        ("pictures_late", "pictures that came late"),
        ("gaps", "gaps between readings"),
        ("values_out_of_range", "values out of range"),
    ] {
        if let Some(found) = number(summary, key).filter(|&found| found > 0.0) {
            rows.push(vec![name.to_owned(), count(found)]);
        }
    }
    let lost: f64 = summary
        .get("dropped")
        .and_then(Value::as_object)
        .into_iter()
        .flatten()
        .filter_map(|(_, count)| count.as_f64())
        .sum();
    section.figure("events dropped", Some(lost));
    section.table(Table::new("What was lost", &["", "count"], rows));
    if let Some(equal) = summary.get("verified").filter(|verified| !verified.is_null()) {
        let is_equal = equal.get("equal").and_then(Value::as_bool) == Some(true);
        section.answer.push(if is_equal {
            "The last prediction equals full recomputation bit for bit.".to_owned()
        } else {
            "The last prediction differs from full recomputation.".to_owned()
        });
    }
    if let Some(us) = number(summary, "drain_us") {
        section.table(Table::new(
            "The queue",
            &["", ""],
            [
                ("most events that waited", number(summary, "queue/high_water").map(count)),
                ("capacity", number(summary, "queue/capacity").map(count)),
                ("time until the rest was covered", Some(time(us))),
            ]
            .into_iter()
            .filter_map(|(name, value)| Some(vec![name.to_owned(), value?]))
            .collect(),
        ));
    }
}
