//! Run time against error.

use meissner_plot::{Errors, Panel, Setting, TradeOff};
use serde_json::Value;

use crate::json::{at, list, number, text};
use crate::parts::{Section, Table};
use crate::words;

/// Kinds of errors: the kind in the JSON, its title, and the factor of an error.
const KINDS: [(&str, &str, Errors, f64); 4] = [
    ("wrong_answers", "wrong answers (%)", Errors::Percentages, 100.0),
    ("one_minus_iou", "1 - IoU (%)", Errors::Percentages, 100.0),
    ("squared_force", "squared error (N^2)", Errors::Quantities, 1.0),
    ("absolute_force", "absolute error (N)", Errors::Quantities, 1.0),
];

/// The section of a study.
pub(crate) fn section(object: &Value) -> Section {
    let mut section = Section::default();
    // A sentence for each network.
    let words = text(object, "words").unwrap_or_default();
    section.answer.extend(words.split_inclusive(". ").map(|sentence| sentence.trim().to_owned()));
    let networks = list(object, "networks");
    let first = networks.first().map_or(&[][..], |network| list(network, "settings"));
    let compares_tasks = text(object, "compared") == Some("task_error");
    let kind = first.iter().flat_map(|setting| list(setting, "task")).find_map(|task| text(task, "kind"));
    let kind = KINDS.iter().find(|(key, ..)| compares_tasks && Some(*key) == kind);
    let (title, errors, factor) = kind
        .map_or(("relative RMS error", Errors::Differences, 1.0), |&(_, title, errors, factor)| {
            (title, errors, factor)
        });
    let time_title = format!("time per {} (us)", text(object, "unit").unwrap_or("input"));
    let names: Vec<String> =
        networks.iter().map(|network| text(network, "network").unwrap_or("?").to_owned()).collect();
    let mut points = Vec::new();
    let mut rows = Vec::new();
    for (i, network) in networks.iter().enumerate() {
        for setting in list(network, "settings") {
            let found = |key: &str| number(setting, key);
            let (Some(time), Some(error)) = (found("us"), found("error")) else { continue };
            let name = text(setting, "setting").unwrap_or("?");
            let on_front = at(setting, "on_front").and_then(Value::as_bool) == Some(true);
            let interval = list(setting, "interval_95");
            let interval = interval.first().zip(interval.get(1));
            let interval =
                interval.and_then(|(low, high)| Some((factor * low.as_f64()?, factor * high.as_f64()?)));
            let of = if names.len() > 1 { format!("{}, ", names[i]) } else { String::new() };
            let shown = if error == 0.0 {
                "0".to_owned()
            } else if factor * error < 1e-3 {
                format!("{:.1e}", factor * error)
            } else {
                words::number(factor * error)
            };
            points.push(Setting {
                network: i,
                time,
                error: factor * error,
                interval,
                on_front,
                label: (on_front || name == "exact").then(|| format!("{of}{name}")),
                tooltip: format!(
                    "{}, {name}: {time_title} {}, {title} {shown}",
                    names[i],
                    words::number(time)
                ),
            });
            let speed = found("speed_up").map_or_else(String::new, words::number);
            let front = if on_front { "yes" } else { "" };
            rows.push(vec![
                format!("{}, {name}", names[i]),
                words::number(time),
                speed,
                shown,
                front.to_owned(),
            ]);
        }
    }
    let fastest = points.iter().map(|point| point.time).fold(f64::INFINITY, f64::min);
    section.figure(&time_title.replace("time", "fastest time"), Some(fastest));
    let least = points.iter().map(|point| point.error).fold(f64::INFINITY, f64::min);
    section.figure(&format!("least {title}"), Some(least));
    let about = if kind.is_some() { "bars: 95 % interval" } else { "against the exact outputs" }.to_owned();
    let panel = TradeOff {
        time_title: time_title.clone(),
        error_title: title.to_owned(),
        about,
        errors,
        networks: names,
        points,
    };
    section.draw("Each point is a setting. Left is faster, lower is better.", &Panel::TradeOff(panel));
    let headings = ["setting", time_title.as_str(), "times as fast as exact", title, "on the front"];
    section.table(Table::new("Settings", &headings, rows));
    section
}
