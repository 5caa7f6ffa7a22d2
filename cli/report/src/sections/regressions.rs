//! Evaluations of predicted quantities: angles of presses, forces of grasps, contacts in pictures.

use meissner_plot::{Panel, Scale, Series, Style};
use serde_json::Value;

use super::eval::{cell, doubts, networks, spread, work};
use crate::json::{list, number, numbers, pairs, text};
use crate::parts::{Section, Table, bars, plane, predicted};
use crate::words::{count, counted, file_name, number as shown, percent, shown_unit};

/// The section of an evaluation of quantities by `command`.
pub(crate) fn section(command: &str, object: &Value) -> Section {
    let mut section = Section::default();
    match command {
        "eval angle" => angle(&mut section, object),
        "eval force" => force(&mut section, object),
        _ => area(&mut section, object),
    }
    work(&mut section, object);
    section
}

/// Angles, or other quantities at the end of presses.
fn angle(section: &mut Section, object: &Value) {
    let times: Vec<f64> = numbers(object, "times_us").into_iter().map(|t_us| t_us / 1e3).collect();
    let mut series: Vec<(String, Series)> = Vec::new();
    let (mut rows, mut dots) = (Vec::new(), Vec::new());
    for (name, of) in networks(object) {
        let Some(figures) = of.get("figures").filter(|figures| !figures.is_null()) else { continue };
        let count_of = number(figures, "presses").unwrap_or(0.0);
        let presses = counted(count_of, "press", "presses");
        let all = figures.get("angles").filter(|angles| !angles.is_null());
        for (i, output) in list(figures, "outputs").iter().chain(all).enumerate() {
            let (what, unit) =
                (text(output, "name").unwrap_or("?"), text(output, "unit").unwrap_or_default());
            let (unit, _) = shown_unit(unit);
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
            // The figures of all angles together have no pairs.
            if let Some(of) = list(of, "pairs").get(i) {
                dots.push((format!("{name}, {what}"), unit.to_owned(), pairs(of), count_of));
            }
        }
        if let Some(share) = number(figures, "settled_share") {
            section.answer.push(format!(
                "In half of the presses its angles stay within 1 degree from {} % of the press on.",
                percent(share)
            ));
            section.figure(&format!("{name}: settled (% of a press)"), Some(100.0 * share));
        }
    }
    let mut units: Vec<String> = series.iter().map(|(unit, _)| unit.clone()).collect();
    units.sort_unstable();
    units.dedup();
    for unit in units {
        let shown = series.iter().filter(|(of, _)| *of == unit).map(|(_, series)| series.clone());
        let axes = ["time since contact (ms)", &format!("error ({unit})")];
        let mut panel = plane("Mean absolute error against time", axes, shown.collect());
        panel.scale = Scale::FromZero;
        section.draw("After the end of a press its last error stands.", &Panel::Plane(panel));
    }
    for (title, unit, points, all) in dots {
        predicted(section, &title, &unit, points, ("at the end of each press of the first training", all));
    }
    let headings =
        ["at the end of a press", "unit", "mean absolute error", "std", "with the latency of this machine"];
    section.table(Table::new("Errors", &headings, rows));
    doubts(
        section,
        networks(object).filter_map(|(name, of)| Some((name.to_owned(), of.get("figures")?))).collect(),
    );
}

/// Forces of grasps.
fn force(section: &mut Section, object: &Value) {
    let (mut rows, mut errors, mut dots, mut newest) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut touched = Vec::new();
    let variance = number(object, "data/variance");
    for (name, of) in networks(object) {
        let Some(figures) = of.get("figures").filter(|figures| !figures.is_null()) else { continue };
        for part in list(figures, "parts") {
            let what = text(part, "part").unwrap_or("?");
            let frames = number(part, "frames").unwrap_or(0.0);
            let [mae, mse] =
                ["mae", "mse"].map(|key| number(part, &format!("{key}/mean")).unwrap_or(f64::NAN));
            if what == "all" {
                let constant = variance.map_or_else(String::new, |variance| {
                    format!("; always to say the mean force has {} N^2", shown(variance))
                });
                section.answer.push(format!(
                    "{name} is off by {} N over {}, in the mean. Its mean squared error is {} N^2{constant}.",
                    shown(mae),
                    counted(frames, "frame", "frames"),
                    shown(mse),
                ));
                section.figure(&format!("{name}: error (N)"), Some(mae));
                section.figure(&format!("{name}: squared error (N^2)"), Some(mse));
                dots.push((name, pairs(of.get("pairs").unwrap_or(&Value::Null)), frames));
            }
            errors.push((format!("{name}, {what}"), mae));
        }
        rows.extend(list(figures, "parts").iter().map(|part| force_cells(name, part)));
        touched.extend(list(figures, "contact").iter().map(|part| force_cells(name, part)));
        newest.push(vec![name.to_owned(), spread(figures, "newest", 1.0)]);
    }
    section.draw(
        "By phase of the grasp and by bolt.",
        &Panel::Parts(bars("Mean absolute error", "error (N)", errors)),
    );
    for (name, points, all) in dots {
        predicted(
            section,
            &format!("{name}, force"),
            "N",
            points,
            ("at the end of each frame of the first training", all),
        );
    }
    let headings = [
        "network, part",
        "frames",
        "mean absolute error (N)",
        "std over recordings",
        "mean squared error (N^2)",
        "std over recordings",
        "time warping (N)",
        "Bhattacharyya",
    ];
    section.table(Table::new("Errors by phase and by bolt", &headings, rows));
    section.table(Table::new("The same of the frames whose force is not 0", &headings, touched));
    let headings = ["network", "squared error (N^2)"];
    section.table(Table::new("The newest prediction at each millisecond", &headings, newest));
    doubts(
        section,
        networks(object).filter_map(|(name, of)| Some((name.to_owned(), of.get("figures")?))).collect(),
    );
}

/// The row of a network's errors on a part of the frames.
fn force_cells(name: &str, part: &Value) -> Vec<String> {
    let what = format!("{name}, {}", text(part, "part").unwrap_or("?"));
    let figures = ["mae", "mae_std", "mse", "mse_std", "time_warping", "bhattacharyya"];
    let cells = figures.map(|key| spread(part, key, 1.0));
    [what, count(number(part, "frames").unwrap_or(0.0))].into_iter().chain(cells).collect()
}

/// Contacts in pictures: area, force, middle.
fn area(section: &mut Section, object: &Value) {
    let data = list(object, "data");
    let file = |of: &Value| file_name(text(of, "file").unwrap_or("?")).to_owned();
    let (mut rows, mut kinds, mut ious, mut dots) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut unlike = Vec::new();
    for (network, of) in networks(object) {
        let trainings = list(of, "trainings");
        for training in trainings {
            let name = match (trainings, number(training, "seed")) {
                ([_], _) | (_, None) => network.to_owned(),
                (_, Some(seed)) => format!("{network}, seed {seed}"),
            };
            for (set, file) in list(training, "sets").iter().zip(data.iter().map(file)) {
                let mean = |key: &str| number(set, &format!("{key}/mean"));
                let title = format!("{name}, {file}");
                let taken = number(set, "pictures").unwrap_or(0.0);
                let pictures = counted(taken, "picture", "pictures");
                if let Some(iou) = mean("iou") {
                    let force = mean("force_n")
                        .map(|force| format!(" and a force that is off by {} N", shown(force)));
                    section.answer.push(format!(
                        "{name} finds the contact in {pictures} of {file} with an IoU of {}{}.",
                        shown(iou),
                        force.unwrap_or_default()
                    ));
                    section.figure(&format!("{title}: IoU"), Some(iou));
                    section.figure(&format!("{title}: force (N)"), mean("force_n"));
                    ious.push((title.clone(), iou));
                }
                let cells = MEASURES.map(|(key, _)| spread(set, key, 1.0));
                let cost = number(set, "multiply_adds").map_or_else(String::new, |n| count(n / 1e6));
                let time = number(set, "update_us").map_or_else(String::new, crate::words::time);
                let first = [title.clone(), count(taken)];
                rows.push(first.into_iter().chain(cells).chain([cost, time]).collect());
                let of_kinds = set.get("kinds").and_then(Value::as_object).into_iter().flatten();
                kinds.extend(of_kinds.map(|(kind, of)| {
                    let cells = ["iou", "force_n"].map(|key| spread(of, key, 1.0));
                    let first = [format!("{title}, {kind}"), cell(of, "pictures")];
                    first.into_iter().chain(cells).collect()
                }));
                dots.push((title.clone(), pairs(set.get("pairs").unwrap_or(&Value::Null)), taken));
                unlike.push((title, set));
            }
        }
    }
    for of in data {
        for (key, name, limit, unit) in
            [("difference", "image difference", " above ", ""), ("stereo", "stereo", ", deeper than ", " mm")]
        {
            let Some(iou) = number(of, &format!("{key}/iou/mean")) else { continue };
            let threshold = number(of, &format!("{key}/threshold")).map_or_else(String::new, shown);
            let cells = MEASURES.map(|(measure, _)| spread(of, &format!("{key}/{measure}"), 1.0));
            ious.push((format!("{name}, {}", file(of)), iou));
            let empty = [String::new(), String::new()];
            let name = format!("{name}{limit}{threshold}{unit}, {}", file(of));
            rows.push([name, cell(of, "pictures")].into_iter().chain(cells).chain(empty).collect());
        }
    }
    section.draw(
        "How much of predicted and true contact is common to both.",
        &Panel::Parts(bars("Intersection over union", "IoU", ious)),
    );
    for (title, points, all) in dots {
        predicted(section, &title, "N", points, ("the total force of each picture", all));
    }
    let headings = ["network, pictures", "pictures"].into_iter().chain(MEASURES.map(|(_, heading)| heading));
    let headings: Vec<&str> = headings.chain(["multiply-adds (million)", "time of a picture"]).collect();
    let about = "Errors: mean over the pictures and its deviation";
    section.table(Table::new(about, &headings, rows));
    let headings = ["network, pictures, indenter", "pictures", "IoU", "force (N)"];
    section.table(Table::new("By indenter", &headings, kinds));
    doubts(section, unlike);
}

/// Figures of contacts: keys and headings.
const MEASURES: [(&str, &str); 5] = [
    ("iou", "IoU"),
    ("iou_even", "even IoU"),
    ("force_n", "force (N)"),
    ("centroid_mm", "centroid (mm)"),
    ("area_mm2", "area (mm2)"),
];
