//! Verifications: whether results equal full recomputation, and their distance from the oracle in
//! f64 under stress.

use meissner_plot::{Panel, Parts, Quantiles};
use serde_json::Value;

use crate::json::{at, list, number, text, texts};
use crate::parts::{Section, Table, bars};
use crate::read::Outcome;
use crate::words::{count, counted, number as shown, time};

/// The section of a verification over streams.
pub(crate) fn section(outcome: &Outcome, object: &Value) -> Section {
    let mut section = Section::default();
    let name = outcome.network().unwrap_or("The network");
    let checks = list(object, "checks");
    let sum = |key: &str| checks.iter().filter_map(|check| number(check, key)).sum::<f64>();
    let [cases, inputs, comparisons, rows] = ["cases", "inputs", "comparisons", "rows"].map(sum);
    let mismatch = at(object, "mismatch");
    section.answer.push(match mismatch {
        None => format!(
            "{name} equals full recomputation bit for bit at {} over {}.",
            counted(comparisons, "comparison", "comparisons"),
            counted(cases, "stream", "streams")
        ),
        Some(found) => format!(
            "{name} differs from full recomputation in {}.",
            text(found, "name").unwrap_or("a stream")
        ),
    });
    if let Some(found) = mismatch {
        section.answer.extend(text(found, "difference").map(str::to_owned));
        let steps = number(found, "steps").unwrap_or(0.0);
        let file = text(found, "file").unwrap_or("?");
        section.answer.push(format!(
            "The shortest stream that differs has {}: {file}.",
            counted(steps, "step", "steps")
        ));
        if comparisons > 0.0 {
            section.answer.push(format!(
                "Before it, {} were equal.",
                counted(comparisons, "comparison", "comparisons")
            ));
        }
    }
    if rows > 0.0 {
        section.answer.push(format!(
            "Compared were {} of all layers after {}.",
            counted(rows, "row", "rows"),
            counted(inputs, "input", "inputs")
        ));
    }
    let refused = sum("refused");
    if refused > 0.0 {
        let refused = counted(refused, "comparison", "comparisons");
        section
            .answer
            .push(format!("At {refused} the same layer computed NaN on both sides, and both refused."));
    }
    for (name, value) in
        [("streams", cases), ("inputs", inputs), ("comparisons", comparisons), ("rows compared", rows)]
    {
        section.figure(name, Some(value));
    }
    section.figure("differences", Some(f64::from(u8::from(mismatch.is_some()))));
    let compared = checks.iter().map(|check| {
        let of = |key: &str| number(check, key).unwrap_or(0.0);
        let name = crate::words::file_name(text(check, "name").unwrap_or("?")).to_owned();
        (name, vec![of("comparisons") - of("refused"), of("refused")])
    });
    let compared: Vec<(String, Vec<f64>)> = compared.collect();
    if !compared.is_empty() {
        let parts = [("equal", 0), ("the same NaN on both sides", 1)];
        let parts = parts.map(|(part, colour)| (part.to_owned(), colour));
        section.draw(
            "At a comparison all rows of all layers and the prediction had the bits of a full recomputation.",
            &Panel::Parts(Parts {
                title: "What was compared".to_owned(),
                about: String::new(),
                parts: parts[..if refused > 0.0 { 2 } else { 1 }].to_vec(),
                x_title: "comparisons".to_owned(),
                shares: false,
                rows: compared,
            }),
        );
    }
    let row = |check: &Value| {
        let cells = ["cases", "inputs", "comparisons", "rows", "refused"];
        let cells = cells.map(|key| number(check, key).map_or_else(String::new, count));
        Some(std::iter::once(text(check, "name")?.to_owned()).chain(cells).collect())
    };
    let headings = ["equal", "streams", "inputs", "comparisons", "rows", "NaN on both sides"];
    section.table(Table::new(
        "Sources without a difference",
        &headings,
        checks.iter().filter_map(row).collect(),
    ));
    if let Some(found) = mismatch {
        let facts = [
            ("source", text(found, "name").map(str::to_owned)),
            ("minimal stream", text(found, "file").map(str::to_owned)),
            ("its steps", number(found, "steps").map(count)),
            ("inputs up to the difference", number(found, "input").map(count)),
            ("layer", text(found, "layer").map(str::to_owned)),
            ("row", number(found, "row").map(count)),
        ];
        let facts = facts.into_iter().filter_map(|(name, value)| Some(vec![name.to_owned(), value?]));
        section.table(Table::new("The difference", &["", ""], facts.collect()));
    }
    section
}

/// The name of a case or a function, with its network.
fn named(of: &Value) -> String {
    let parts = ["case", "network"].map(|key| text(of, key));
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The section of cases that strain the arithmetic.
pub(crate) fn stress(object: &Value) -> Section {
    let mut section = Section::default();
    let (cases, functions) = (list(object, "cases"), list(object, "functions"));
    let tested = [(cases.len(), "case", "cases"), (functions.len(), "function", "functions")];
    let tested = tested.iter().filter(|(many, ..)| *many > 0);
    let tested: Vec<String> = tested.map(|&(many, one, more)| counted(many as f64, one, more)).collect();
    let tested = tested.join(" and ");
    let broken: Vec<(String, &str)> = cases
        .iter()
        .map(|case| (named(case), case))
        .chain(functions.iter().map(|of| (text(of, "function").unwrap_or("?").to_owned(), of)))
        .flat_map(|(name, of)| texts(of, "broken").into_iter().map(move |broken| (name.clone(), broken)))
        .collect();
    section.answer.push(match broken.len() {
        0 => format!("Every promise held in {tested}."),
        many => {
            format!("{} in {tested}.", counted(many as f64, "promise was broken", "promises were broken"))
        }
    });
    section.answer.extend(broken.iter().map(|(name, broken)| format!("Broken by {name}: {broken}.")));
    let sum = |key: &str| cases.iter().filter_map(|case| number(case, key)).sum::<f64>();
    let (compared, different) = (sum("compared"), sum("different"));
    if compared > 0.0 {
        section.answer.push(format!(
            "{} of {} equal full recomputation bit for bit.",
            count(compared - different),
            counted(compared, "prediction", "predictions")
        ));
        section.figure("predictions that differ", Some(different));
    }
    // The case that comes nearest to its bound.
    let used = cases.iter().filter_map(|case| {
        let (error, within) = (number(case, "prediction/relative")?, number(case, "within")?);
        Some((error / within, error, within, case))
    });
    if let Some((_, error, within, case)) = used.max_by(|a, b| a.0.total_cmp(&b.0)) {
        section.answer.push(format!(
            "Nearest to its bound against f64 is {}: {} of the largest prediction, {} is promised.",
            named(case),
            short(error),
            short(within)
        ));
        section.figure("largest part of a bound against f64 (%)", Some(100.0 * error / within));
    }
    let ulps = |of: &Value| Some((number(of, "ulps")?, number(of, "bound")?));
    let worst = functions.iter().filter_map(|of| Some((ulps(of)?, text(of, "function")?)));
    if let Some(((error, bound), name)) = worst.max_by(|a, b| (a.0.0 / a.0.1).total_cmp(&(b.0.0 / b.0.1))) {
        section.answer.push(format!(
            "Of the elementary functions {name} is nearest to its bound: {} units in the last place, {} are promised.",
            shown(error),
            shown(bound)
        ));
    }
    section.figure("broken promises", Some(broken.len() as f64));
    let mut groups: Vec<&str> = cases.iter().filter_map(|case| text(case, "group")).collect();
    groups.dedup();
    for group in &groups {
        let of: Vec<&Value> = cases.iter().filter(|case| text(case, "group") == Some(group)).collect();
        conditions(&mut section, group, &of);
    }
    layers(&mut section, cases);
    let rows: Vec<(String, Vec<f64>)> = functions
        .iter()
        .filter_map(|of| {
            Some((text(of, "function")?.to_owned(), ulps(of).map(|(error, bound)| vec![error, bound])?))
        })
        .collect();
    let caption = "The largest error of each function over its inputs, and what is promised.";
    beside_bound(&mut section, "functions", "units in the last place", caption, rows);
    for group in &groups {
        let of = cases.iter().filter(|case| text(case, "group") == Some(group));
        section.table(Table::new(*group, &COLUMNS, of.map(row).collect()));
    }
    let rows = functions.iter().filter_map(|of| {
        let (error, bound) = ulps(of)?;
        let at = number(of, "at").map_or_else(String::new, |at| format!("{at:e}"));
        let inputs = number(of, "inputs").map_or_else(String::new, count);
        Some(vec![text(of, "function")?.to_owned(), inputs, shown(error), at, shown(bound)])
    });
    let headings = ["function", "inputs", "largest error (units in the last place)", "at", "promised"];
    section.table(Table::new("functions", &headings, rows.collect()));
    section
}

/// A small number with two digits.
fn short(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.1e}") }
}

/// Adds errors next to their bounds, one row for each.
fn beside_bound(
    section: &mut Section,
    title: &str,
    x_title: &str,
    caption: &str,
    rows: Vec<(String, Vec<f64>)>,
) {
    if rows.is_empty() {
        return;
    }
    section.draw(
        caption,
        &Panel::Quantiles(Quantiles {
            title: title.to_owned(),
            about: String::new(),
            x_title: x_title.to_owned(),
            quantiles: vec!["largest error", "promised"],
            rows,
        }),
    );
}

/// The largest error of each condition of a group over its networks, and how much longer it takes.
fn conditions(section: &mut Section, group: &str, cases: &[&Value]) {
    let mut errors: Vec<(String, Vec<f64>)> = Vec::new();
    let mut times: Vec<(String, f64)> = Vec::new();
    for case in cases {
        let name = text(case, "case").unwrap_or("?").to_owned();
        if let (Some(error), Some(within)) = (number(case, "prediction/relative"), number(case, "within")) {
            match errors.iter_mut().find(|(known, _)| *known == name) {
                // Bounds of networks may differ: the error nearest to its own bound is shown.
                Some((_, worst)) if error / within > worst[0] / worst[1] => *worst = vec![error, within],
                Some(_) => {}
                None => errors.push((name.clone(), vec![error, within])),
            }
        }
        if let Some(ratio) = number(case, "times_ordinary") {
            match times.iter_mut().find(|(known, _)| *known == name) {
                Some((_, worst)) => *worst = worst.max(ratio),
                None => times.push((name, ratio)),
            }
        }
    }
    let caption = "The largest error of a prediction against f64, as a part of the largest prediction, and what is \
                   promised. Of the networks of a condition, the one that is nearest to its bound. An error of 0 is at the \
                   left end. A condition that is to overflow has no row.";
    let title = format!("{group}: error by condition");
    beside_bound(section, &title, "relative error", caption, errors);
    if times.iter().any(|(_, ratio)| *ratio > 1.5) {
        section.draw(
            "How many times as long as the ordinary case it takes, of the network that is slowed most.",
            &Panel::Parts(bars(
                &format!("{group}: time by condition"),
                "times as long as the ordinary case",
                times,
            )),
        );
    }
}

/// The largest error of each layer that is the worst one of a case.
fn layers(section: &mut Section, cases: &[Value]) {
    let mut rows: Vec<(String, Vec<f64>)> = Vec::new();
    for case in cases {
        let (Some(layer), Some(error)) = (text(case, "layer/layer"), number(case, "layer/relative")) else {
            continue;
        };
        let name = format!("{}: {layer}", text(case, "network").unwrap_or("?"));
        match rows.iter_mut().find(|(known, _)| *known == name) {
            Some((_, worst)) => worst[0] = worst[0].max(error),
            None => rows.push((name, vec![error])),
        }
    }
    if rows.is_empty() {
        return;
    }
    rows.sort_by(|a, b| a.0.cmp(&b.0));
    section.draw(
        "The layer with the largest difference from f64 in each case, as a part of its largest value; of all cases the largest.",
        &Panel::Quantiles(Quantiles {
            title: "Error by layer".to_owned(),
            about: "layers that were the worst one of a case".to_owned(),
            x_title: "relative error".to_owned(),
            quantiles: vec!["largest error"],
            rows,
        }),
    );
}

const COLUMNS: [&str; 11] = [
    "case",
    "network",
    "steps",
    "compared",
    "that differ",
    "outcome",
    "relative error",
    "promised",
    "worst layer",
    "largest value",
    "time (times the ordinary)",
];

fn row(case: &Value) -> Vec<String> {
    let counted = |key: &str| number(case, key).map_or_else(String::new, count);
    let small = |path: &str| number(case, path).map_or_else(String::new, short);
    let found = |key: &str| number(case, key).unwrap_or(0.0);
    let (refused, infinite) = (found("refused"), found("infinite") + found("infinite_inside"));
    let outcome = match (refused > 0.0, infinite > 0.0) {
        (true, _) => format!("{} refused (NaN)", count(refused)),
        (_, true) => format!("{} infinite", count(infinite)),
        _ => "finite".to_owned(),
    };
    let layer = text(case, "layer/layer").map(|layer| format!("{layer} {}", small("layer/relative")));
    let ratio = number(case, "times_ordinary").map(|ratio| format!(" ({})", shown(ratio)));
    let us = number(case, "us").map(|us| time(us) + &ratio.unwrap_or_default());
    vec![
        text(case, "case").unwrap_or("?").to_owned(),
        text(case, "network").unwrap_or("?").to_owned(),
        counted("steps"),
        counted("compared"),
        counted("different"),
        outcome,
        small("prediction/relative"),
        small("within"),
        layer.unwrap_or_default(),
        small("largest_activation"),
        us.unwrap_or_default(),
    ]
}
