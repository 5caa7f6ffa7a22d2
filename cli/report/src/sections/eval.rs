//! Evaluations on labelled data: classes over time and by set, and the events that filters pass.

use meissner_plot::{AccuracyCurve, Bar, Bars, Curves, Matrix, Panel};
use serde_json::Value;

use crate::json::{counts, list, number, numbers, quantiles, text, texts};
use crate::parts::{Section, Table, shares};
use crate::words::{count, counted, number as shown, percent};

/// The section of an evaluation by `command`.
pub(crate) fn section(command: &str, object: &Value) -> Section {
    let mut section = Section::default();
    match command {
        "eval slip" => slip(&mut section, object),
        "eval filters" => filters(&mut section, object),
        _ => events(&mut section, object),
    }
    work(&mut section, object);
    section
}

/// The networks with their names.
pub(super) fn networks(object: &Value) -> impl Iterator<Item = (&str, &Value)> {
    list(object, "networks").iter().map(|of| (text(of, "network/name").unwrap_or("?"), of))
}

/// The mean of a figure, followed by its standard deviation if there is one.
pub(super) fn spread(value: &Value, path: &str, factor: f64) -> String {
    let Some(mean) = number(value, &format!("{path}/mean")) else { return String::new() };
    let std = number(value, &format!("{path}/std"));
    let std = std.map(|std| format!(" \u{b1} {}", shown(factor * std))).unwrap_or_default();
    format!("{}{std}", shown(factor * mean))
}

/// Adds a confusion matrix.
fn matrix(section: &mut Section, title: String, about: String, classes: &[&str], found: Vec<Vec<u64>>) {
    if !found.is_empty() && found.len() == classes.len() {
        section.draw(
            "Rows are true classes, columns predicted ones, in percent of the row.",
            &Panel::Matrix(Matrix { title, about, classes, counts: found }),
        );
    }
}

/// Digits, objects, containers, letters: a class over time.
fn events(section: &mut Section, object: &Value) {
    let classes = texts(object, "classes");
    let times: Vec<f64> = numbers(object, "times_us").into_iter().map(|t_us| t_us / 1e3).collect();
    let mut rows = Vec::new();
    for (protocol, title) in [("test", "split test"), ("cross_validation", "cross-validation")] {
        let mut curves = Vec::new();
        let mut matrices = Vec::new();
        for (colour, (name, of)) in networks(object).enumerate() {
            let Some(judged) = of.get(protocol).filter(|judged| !judged.is_null()) else { continue };
            let accuracy = number(judged, "accuracy/mean").unwrap_or(f64::NAN);
            let recordings = number(judged, "recordings").unwrap_or(0.0);
            let ends = numbers(judged, "interval_95");
            let interval = match ends.as_slice() {
                [low, high] => format!("{} to {} %", percent(*low), percent(*high)),
                _ => String::new(),
            };
            section.answer.push(format!(
                "{name} is right about {} % of {} ({title}; 95 %: {interval}).",
                percent(accuracy),
                counted(recordings, "recording", "recordings")
            ));
            section.figure(&format!("{name}, {title}: right (%)"), Some(100.0 * accuracy));
            let settled = number(judged, "settled_us").map_or_else(|| "never".to_owned(), crate::words::time);
            rows.push(vec![
                format!("{name}, {title}"),
                count(recordings),
                spread(judged, "accuracy", 100.0),
                interval,
                settled,
            ]);
            let at = list(judged, "accuracy_at").iter().map(|at| number(at, "mean").unwrap_or(f64::NAN));
            let band = list(judged, "interval_95_at").iter().map(|ends| {
                let end = |i: usize| ends.get(i).and_then(Value::as_f64).unwrap_or(f64::NAN);
                (end(0), end(1))
            });
            curves.push(AccuracyCurve {
                name: name.to_owned(),
                colour,
                accuracy: at.collect(),
                interval: band.collect(),
            });
            matrices.push((format!("{name}, {title}"), counts(judged, "confusion")));
        }
        if curves.is_empty() {
            continue;
        }
        let panel = Curves {
            title: format!("Accuracy against time, {title}"),
            about: "bands: 95 % intervals".to_owned(),
            time_title: format!("time since {} (ms)", text(object, "since").unwrap_or("the first event")),
            times: times.clone(),
            chance: 1.0 / classes.len().max(1) as f64,
            compact: true,
            curves,
        };
        section
            .draw("How many answers are right, by how long the recording has lasted.", &Panel::Curves(panel));
        for (title, found) in matrices {
            matrix(section, title, "at the end of a recording".to_owned(), &classes, found);
        }
    }
    let headings = ["network", "recordings", "right (%)", "95 %", "median settling time"];
    section.table(Table::new("At the end of a recording", &headings, rows));
}

fn slip(section: &mut Section, object: &Value) {
    let classes = texts(object, "classes");
    let mut sets: Vec<&str> = Vec::new();
    for set in networks(object).flat_map(|(_, of)| list(of, "sets")).filter_map(|set| text(set, "set")) {
        if !sets.contains(&set) {
            sets.push(set);
        }
    }
    let on = |of: &'_ Value, name: &str| -> Option<Value> {
        list(of, "sets").iter().find(|set| text(set, "set") == Some(name)).cloned()
    };
    let series = networks(object).map(|(name, of)| {
        let bar = |set: &&str| {
            let found = on(of, set)?;
            Some(Bar { mean: number(&found, "accuracy/mean")?, std: number(&found, "accuracy/std") })
        };
        (name.to_owned(), sets.iter().map(bar).collect())
    });
    let references = list(object, "references").iter().filter_map(|other| {
        let share = |set: &&str| number(other, &format!("accuracy/{set}"));
        Some((format!("{} (reference)", text(other, "name")?), sets.iter().map(share).collect()))
    });
    let panel = Bars {
        groups: sets.iter().map(|&set| set.to_owned()).collect(),
        series: series.collect(),
        references: references.collect(),
        y_title: "accuracy (%)".to_owned(),
        note: "Basic was trained on".to_owned(),
    };
    let others = list(object, "references").iter();
    let others = others.filter_map(|other| {
        let (name, about) = (text(other, "name")?, text(other, "about")?);
        Some(format!("{name}: {about}."))
    });
    let caption = std::iter::once("Right windows by set of objects.".to_owned()).chain(others);
    section.draw(caption.collect::<Vec<_>>().join(" "), &Panel::Bars(panel));
    let (mut rows, mut validated, mut unlike) = (Vec::new(), Vec::new(), Vec::new());
    for (name, of) in networks(object) {
        let mut unseen = Vec::new();
        for set in list(of, "sets") {
            let (title, windows) = (text(set, "set").unwrap_or("?"), number(set, "windows").unwrap_or(0.0));
            let accuracy = number(set, "accuracy/mean").unwrap_or(f64::NAN);
            let is_trained = set.get("trained_on").and_then(Value::as_bool) == Some(true);
            if !is_trained {
                unseen.push(format!("{} % ({title})", percent(accuracy)));
                section.figure(&format!("{name}, {title}: right (%)"), Some(100.0 * accuracy));
            }
            let trained = if is_trained { " (trained on)" } else { "" };
            let cells = SCORES.map(|(key, _)| spread(set, key, 100.0));
            let first = [format!("{name}, {title}{trained}"), count(windows), cell(set, "trainings")];
            rows.push(first.into_iter().chain(cells).collect());
            unlike.push((format!("{name}, {title}{trained}"), set));
            matrix(
                section,
                format!("{name}, {title}{trained}"),
                counted(windows, "window", "windows"),
                &classes,
                counts(set, "confusion"),
            );
        }
        if !unseen.is_empty() {
            let unseen = unseen.join(", ");
            section.answer.push(format!("{name} is right about {unseen} of the windows of unseen objects."));
        }
        for validation in list(of, "cross_validation") {
            let cells = SCORES.map(|(key, _)| spread(validation, key, 100.0));
            let scheme = format!("{name}, by {}", text(validation, "scheme").unwrap_or("?"));
            let first = [scheme, cell(validation, "windows"), cell(validation, "trainings")];
            validated.push(first.into_iter().chain(cells).collect());
        }
    }
    for other in list(object, "references") {
        for set in &sets {
            let Some(share) = number(other, &format!("accuracy/{set}")) else { continue };
            let name = format!("{}, {set} (reference)", text(other, "name").unwrap_or("?"));
            let empty = std::iter::repeat_n(String::new(), 3);
            let cells = [name, String::new(), String::new(), shown(100.0 * share)];
            rows.push(cells.into_iter().chain(empty).collect());
        }
    }
    let headings = |first| -> Vec<&str> {
        [first, "windows", "trainings"].into_iter().chain(SCORES.map(|(_, heading)| heading)).collect()
    };
    let about =
        "By set: mean over the trainings and its deviation; precision, recall and F1 over the classes";
    section.table(Table::new(about, &headings("network, set"), rows));
    section.table(Table::new("Cross-validation on Basic", &headings("network, scheme"), validated));
    doubts(section, unlike);
}

/// The scores of classes: keys and headings.
const SCORES: [(&str, &str); 4] = [
    ("accuracy", "accuracy (%)"),
    ("precision", "precision (%)"),
    ("recall", "recall (%)"),
    ("f1", "F1 (%)"),
];

/// A count, if there is one.
pub(super) fn cell(value: &Value, path: &str) -> String {
    number(value, path).map_or_else(String::new, count)
}

/// Adds a table of predictions for input unlike the training's, for each pair of a name and judged
/// predictions.
pub(super) fn doubts(section: &mut Section, judged: Vec<(String, &Value)>) {
    let row = |(name, of): (String, &Value)| {
        let found = |key: &str| number(of, &format!("doubts/{key}"));
        let keys = ["predictions", "unlike", "bad", "bad_unlike"];
        let cells = keys.iter().map(|key| found(key).map(count)).collect::<Option<Vec<_>>>()?;
        Some(std::iter::once(name).chain(cells).collect())
    };
    let rows = judged.into_iter().filter_map(row).collect();
    let headings = ["", "predictions", "unlike the training", "bad", "bad and unlike"];
    section.table(Table::new("Doubts", &headings, rows));
}

fn filters(section: &mut Section, object: &Value) {
    let causes = list(object, "causes");
    let found = |cause: &Value| {
        let (events, passed) = (number(cause, "events")?, number(cause, "passed")?);
        Some((text(cause, "cause")?.to_owned(), events, passed))
    };
    let causes: Vec<(String, f64, f64)> = causes.iter().filter_map(found).collect();
    for (cause, events, passed) in &causes {
        section
            .answer
            .push(format!("{} % of the events by {cause} pass.", percent(passed / events.max(1.0))));
        section.figure(&format!("{cause}: passed (%)"), Some(100.0 * passed / events.max(1.0)));
    }
    let rows = causes
        .iter()
        .map(|(cause, events, passed)| (cause.clone(), vec![*passed, (events - passed).max(0.0)]));
    let panel = shares(
        "What the filters pass",
        "share of the events (%)",
        &[("passed", 0), ("dropped", 5)],
        rows.collect(),
    );
    section.draw("By what caused an event.", &Panel::Parts(panel));
    let cells = causes.iter().map(|(cause, events, passed)| {
        vec![cause.clone(), count(*events), count(*passed), percent(passed / events.max(1.0))]
    });
    section.table(Table::new("Events", &["cause", "events", "passed", "share (%)"], cells.collect()));
}

/// Times and work of predictions, if they were measured.
pub(super) fn work(section: &mut Section, object: &Value) {
    let mut times = Vec::new();
    let mut rows = Vec::new();
    for (name, of) in networks(object) {
        let Some(work) = of.get("figures").and_then(|figures| figures.get("work")) else { continue };
        times.extend(quantiles(work, "update_us").map(|of| (name.to_owned(), of)));
        let cells = ["events", "predictions", "rows", "multiply_adds"].map(|key| cell(work, key));
        rows.push(std::iter::once(name.to_owned()).chain(cells).collect());
    }
    section.times = times.first().cloned();
    section.latencies(
        "A prediction with the events since the one before it, on the machine that judged.",
        times,
    );
    section.table(Table::new("Work", &["network", "events", "predictions", "rows", "multiply-adds"], rows));
}
