//! Evaluations on labelled data: classes over time and by set, errors of presses, forces, areas.

use meissner_plot::{AccuracyCurve, Bar, Bars, Curves, Matrix, Panel, Series, Style};
use serde_json::Value;

use crate::json::{counts, list, number, numbers, quantiles, text, texts};
use crate::parts::{Section, Table, bars, plane, shares};
use crate::words::{count, counted, number as shown, percent};

/// The section of an evaluation by `command`.
pub(crate) fn section(command: &str, object: &Value) -> Section {
    let mut section = Section::default();
    match command {
        "eval slip" => slip(&mut section, object),
        "eval angle" => angle(&mut section, object),
        "eval force" => force(&mut section, object),
        "eval area" => area(&mut section, object),
        "eval filters" => filters(&mut section, object),
        _ => events(&mut section, object),
    }
    work(&mut section, object);
    section
}

/// The networks with their names.
fn networks(object: &Value) -> impl Iterator<Item = (&str, &Value)> {
    list(object, "networks").iter().map(|of| (text(of, "network/name").unwrap_or("?"), of))
}

/// The mean of a figure, and its standard deviation behind it where there is one.
fn spread(value: &Value, path: &str, factor: f64) -> String {
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

/// Digits, objects, containers, letters: a class along time.
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
                [low, high] => format!("{} to {}", percent(*low), percent(*high)),
                _ => String::new(),
            };
            section.answer.push(format!(
                "{name} is right about {} of {} ({title}; 95 %: {interval}).",
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
    section.draw("Right windows by set of objects.", &Panel::Bars(panel));
    let mut rows = Vec::new();
    for (name, of) in networks(object) {
        let mut unseen = Vec::new();
        for set in list(of, "sets") {
            let (title, windows) = (text(set, "set").unwrap_or("?"), number(set, "windows").unwrap_or(0.0));
            let accuracy = number(set, "accuracy/mean").unwrap_or(f64::NAN);
            let is_trained = set.get("trained_on").and_then(Value::as_bool) == Some(true);
            if !is_trained {
                unseen.push(format!("{} ({title})", percent(accuracy)));
                section.figure(&format!("{name}, {title}: right (%)"), Some(100.0 * accuracy));
            }
            let trained = if is_trained { " (trained on)" } else { "" };
            let cells = ["accuracy", "precision", "recall", "f1"].map(|key| spread(set, key, 100.0));
            rows.push(
                [format!("{name}, {title}{trained}"), count(windows)].into_iter().chain(cells).collect(),
            );
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
    }
    let headings = ["network, set", "windows", "accuracy (%)", "precision (%)", "recall (%)", "F1 (%)"];
    section.table(Table::new("By set", &headings, rows));
}

fn angle(section: &mut Section, object: &Value) {
    let times: Vec<f64> = numbers(object, "times_us").into_iter().map(|t_us| t_us / 1e3).collect();
    let mut series: Vec<(String, Series)> = Vec::new();
    let mut rows = Vec::new();
    for (name, of) in networks(object) {
        let Some(figures) = of.get("figures").filter(|figures| !figures.is_null()) else { continue };
        let presses = counted(number(figures, "presses").unwrap_or(0.0), "press", "presses");
        let all = figures.get("angles").filter(|angles| !angles.is_null());
        for output in list(figures, "outputs").iter().chain(all) {
            let (what, unit) =
                (text(output, "name").unwrap_or("?"), text(output, "unit").unwrap_or_default());
            let (unit, _) = crate::words::shown_unit(unit);
            let error = number(output, "mean_absolute/mean").unwrap_or(f64::NAN);
            let is_main = all.is_none() || text(output, "name") == all.and_then(|all| text(all, "name"));
            if is_main {
                section.answer.push(format!(
                    "{name} is off by {} {unit} in {what} at the end of {presses}, in the mean.",
                    shown(error)
                ));
                section.figure(&format!("{name}: error of {what} ({unit})"), Some(error));
            }
            rows.push(vec![
                format!("{name}, {what}"),
                unit.to_owned(),
                spread(output, "mean_absolute", 1.0),
                spread(output, "std", 1.0),
                spread(output, "newest", 1.0),
            ]);
            let at = list(output, "mean_absolute_at").iter().map(|at| number(at, "mean").unwrap_or(f64::NAN));
            let points = times.iter().copied().zip(at).collect();
            let colour = series.iter().filter(|(of, _)| of == unit).count();
            series
                .push((unit.to_owned(), Series::new(format!("{name}, {what}"), colour, Style::Line, points)));
        }
    }
    let mut units: Vec<String> = series.iter().map(|(unit, _)| unit.clone()).collect();
    units.sort_unstable();
    units.dedup();
    for unit in units {
        let shown = series.iter().filter(|(of, _)| *of == unit).map(|(_, series)| series.clone());
        let axes = ["time since contact (ms)", &format!("error ({unit})")];
        let mut panel = plane("Mean absolute error against time", axes, shown.collect());
        panel.from_zero = true;
        section.draw("After the end of a press its last error stands.", &Panel::Plane(panel));
    }
    let headings =
        ["at the end of a press", "unit", "mean absolute error", "std", "with the latency of this machine"];
    section.table(Table::new("Errors", &headings, rows));
    let doubts = networks(object).filter_map(|(name, of)| {
        let found = |key: &str| number(of, &format!("figures/doubts/{key}"));
        let (bad, seen) = (found("bad")?, found("bad_unlike")?);
        Some(vec![
            name.to_owned(),
            count(found("predictions")?),
            count(found("unlike")?),
            count(bad),
            count(seen),
        ])
    });
    let headings = ["network", "predictions", "unlike the training", "bad", "bad and unlike"];
    section.table(Table::new("Doubts since contact", &headings, doubts.collect()));
}

fn force(section: &mut Section, object: &Value) {
    let mut rows = Vec::new();
    let mut errors = Vec::new();
    for (name, of) in networks(object) {
        for part in list(of, "figures/parts") {
            let what = text(part, "part").unwrap_or("?");
            let mae = number(part, "mae/mean").unwrap_or(f64::NAN);
            if what == "all" {
                let frames = counted(number(part, "frames").unwrap_or(0.0), "frame", "frames");
                section.answer.push(format!("{name} is off by {} N over {frames}, in the mean.", shown(mae)));
                section.figure(&format!("{name}: error (N)"), Some(mae));
            }
            errors.push((format!("{name}, {what}"), mae));
            rows.push(vec![
                format!("{name}, {what}"),
                count(number(part, "frames").unwrap_or(0.0)),
                spread(part, "mae", 1.0),
                spread(part, "mse", 1.0),
            ]);
        }
    }
    section.draw(
        "By phase of the grasp and by bolt.",
        &Panel::Parts(bars("Mean absolute error", "error (N)", errors)),
    );
    let headings = ["network, part", "frames", "mean absolute error (N)", "mean squared error (N^2)"];
    section.table(Table::new("Errors", &headings, rows));
}

fn area(section: &mut Section, object: &Value) {
    let files: Vec<&str> = list(object, "data").iter().map(|of| text(of, "file").unwrap_or("?")).collect();
    let mut rows = Vec::new();
    let mut ious = Vec::new();
    for (name, of) in networks(object) {
        for training in list(of, "trainings") {
            for (set, file) in list(training, "sets").iter().zip(&files) {
                let file = crate::words::file_name(file);
                let mean = |key: &str| number(set, &format!("{key}/mean"));
                let pictures = counted(number(set, "pictures").unwrap_or(0.0), "picture", "pictures");
                if let Some(iou) = mean("iou") {
                    let force = mean("force_n")
                        .map(|force| format!(" and a force that is off by {} N", shown(force)));
                    section.answer.push(format!(
                        "{name} finds the contact in {pictures} of {file} with an IoU of {}{}.",
                        shown(iou),
                        force.unwrap_or_default()
                    ));
                    section.figure(&format!("{name}, {file}: IoU"), Some(iou));
                    ious.push((format!("{name}, {file}"), iou));
                }
                let cells = ["iou", "force_n", "centroid_mm", "area_mm2"].map(|key| spread(set, key, 1.0));
                rows.push(std::iter::once(format!("{name}, {file}")).chain(cells).collect());
                let kinds = set.get("kinds").and_then(Value::as_object).into_iter().flatten();
                rows.extend(kinds.map(|(kind, of)| {
                    let cells = ["iou", "force_n"].map(|key| spread(of, key, 1.0));
                    let empty = [String::new(), String::new()];
                    std::iter::once(format!("{name}, {kind}")).chain(cells).chain(empty).collect()
                }));
            }
        }
    }
    section.draw(
        "How much of predicted and true contact is common to both.",
        &Panel::Parts(bars("Intersection over union", "IoU", ious)),
    );
    let headings = ["network, pictures", "IoU", "force (N)", "centroid (mm)", "area (mm2)"];
    section.table(Table::new("Errors", &headings, rows));
}

fn filters(section: &mut Section, object: &Value) {
    let causes = list(object, "causes");
    let found = |cause: &Value| {
        let (events, passed) = (number(cause, "events")?, number(cause, "passed")?);
        Some((text(cause, "cause")?.to_owned(), events, passed))
    };
    let causes: Vec<(String, f64, f64)> = causes.iter().filter_map(found).collect();
    for (cause, events, passed) in &causes {
        section.answer.push(format!("{} of the events by {cause} pass.", percent(passed / events.max(1.0))));
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
    section.table(Table::new("Events", &["cause", "events", "passed", "share"], cells.collect()));
}

/// Times and work of predictions, where they were measured.
fn work(section: &mut Section, object: &Value) {
    let mut times = Vec::new();
    let mut rows = Vec::new();
    for (name, of) in networks(object) {
        let Some(work) = of.get("figures").and_then(|figures| figures.get("work")) else { continue };
        times.extend(quantiles(work, "update_us").map(|of| (name.to_owned(), of)));
        let cell = |key: &str| number(work, key).map_or_else(String::new, count);
        rows.push(vec![
            name.to_owned(),
            cell("events"),
            cell("predictions"),
            cell("rows"),
            cell("multiply_adds"),
        ]);
    }
    section.times = times.first().cloned();
    section.latencies(
        "A prediction with the events since the one before it, on the machine that judged.",
        times,
    );
    section.table(Table::new("Work", &["network", "events", "predictions", "rows", "multiply-adds"], rows));
}
