//! Fits: how good a network is for the user's own sensor, and whether more presses would help.

use meissner_plot::{Matrix, Panel, Scale, Series, Style};
use serde_json::Value;

use crate::json::{counts, list, number, numbers, pairs, text, texts};
use crate::parts::{Section, Table, plane, predicted};
use crate::words::{count, counted, number as shown, percent, shown_unit};

/// The section of a fit.
pub(crate) fn section(object: &Value) -> Section {
    let mut section = Section::default();
    let outputs = list(object, "outputs");
    let classes = texts(object, "classes");
    let presses = number(object, "data/presses").unwrap_or(0.0);
    let mut rows = Vec::new();
    for of in outputs {
        let (name, unit) = (text(of, "name").unwrap_or("the class"), text(of, "unit").unwrap_or_default());
        let (unit, _) = shown_unit(unit);
        let (Some(error), Some(constant)) = (number(of, "error/mean"), number(of, "constant/mean")) else {
            continue;
        };
        let interval = |path: &str| match numbers(of, path).as_slice() {
            [low, high] => format!("{} to {}", shown(*low), shown(*high)),
            _ => String::new(),
        };
        section.answer.push(if classes.is_empty() {
            format!(
                "{name} is off by {} {unit} on presses that were held out (95 %: {}). Always to say the mean \
                 is off by {}.",
                shown(error),
                interval("error/interval"),
                shown(constant)
            )
        } else {
            format!(
                "{} % of the presses that were held out get the right class. The most frequent class is right in {} %.",
                percent(1.0 - error),
                percent(1.0 - constant)
            )
        });
        section.figure(&format!("error of {name} ({unit})"), Some(error));
        section.figure(&format!("constant's error of {name} ({unit})"), Some(constant));
        let before = number(of, "before/mean").map_or_else(String::new, shown);
        let [error, constant] = [error, constant].map(shown);
        rows.push(vec![
            name.to_owned(),
            unit.to_owned(),
            error,
            interval("error/interval"),
            constant,
            before,
        ]);
    }
    section.answer.extend(outputs.iter().filter_map(|of| Some(sentence(text(of, "advice")?))));
    section.figure("presses", Some(presses));
    for (of, points) in outputs.iter().zip(list(object, "pairs")) {
        let (unit, _) = shown_unit(text(of, "unit").unwrap_or_default());
        let title = text(of, "name").unwrap_or("?");
        predicted(
            &mut section,
            title,
            unit,
            pairs(points),
            ("at the end of presses that were held out", presses),
        );
    }
    outputs.iter().for_each(|of| curves(&mut section, of));
    let headings = ["output", "unit", "error", "95 %", "constant", "before the fit"];
    section.table(Table::new("Errors at the end of presses that were held out", &headings, rows));
    let counts_of_presses = counts(object, "confusion");
    if !classes.is_empty() && !counts_of_presses.is_empty() {
        section.draw(
            "Rows are true classes, columns predicted ones, in percent of the row.",
            &Panel::Matrix(Matrix {
                title: "Confusion".to_owned(),
                about: "at the ends of presses that were held out".to_owned(),
                classes: &classes,
                counts: counts_of_presses,
            }),
        );
    }
    let heads = list(object, "heads").iter().filter_map(|head| {
        let cell = |key: &str| number(head, key).map_or_else(String::new, shown);
        let layers = number(head, "layers")
            .map(|layers| format!(", its first {}", counted(layers, "layer", "layers")));
        let name = format!("{}{}", text(head, "head")?, layers.unwrap_or_default());
        Some(vec![name, cell("values"), cell("error")])
    });
    section.table(Table::new("Heads", &["head", "values read", "error / constant's"], heads.collect()));
    let facts = [
        ("presses", Some(count(presses))),
        ("events", number(object, "data/events").map(count)),
        ("readouts", number(object, "data/instants").map(count)),
        ("layers of", text(object, "base/name").map(str::to_owned)),
        ("folds", number(object, "folds").map(count)),
        ("events/s of the middle press", number(object, "sensor/events_per_s").map(count)),
    ];
    let facts = facts.into_iter().filter_map(|(name, value)| Some(vec![name.to_owned(), value?]));
    section.table(Table::new("Data", &["", ""], facts.collect()));
    section
}

/// Text as a sentence.
fn sentence(text: &str) -> String {
    let mut characters = text.chars();
    let first = characters.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", characters.as_str().trim_end_matches('.'))
}

/// The learning curve of an output, and its errors by age.
fn curves(section: &mut Section, of: &Value) {
    let (name, unit) = (text(of, "name").unwrap_or("classes"), text(of, "unit").unwrap_or_default());
    let (unit, _) = shown_unit(unit);
    let title = if unit.is_empty() { "error".to_owned() } else { format!("error ({unit})") };
    let curve: Vec<(f64, f64, [f64; 2])> = list(of, "curve")
        .iter()
        .filter_map(|point| {
            let interval = numbers(point, "error/interval");
            let ends = [*interval.first()?, *interval.get(1)?];
            Some((number(point, "presses")?, number(point, "error/mean")?, ends))
        })
        .collect();
    let constant = number(of, "constant/mean");
    if let (Some(&(_, error, _)), Some(last)) = (curve.last(), curve.last().map(|point| point.0)) {
        let mut series = vec![
            Series::new("fitted", 0, Style::Line, curve.iter().map(|&(x, y, _)| (x, y)).collect()),
            Series::new(
                "95 % interval",
                4,
                Style::Dashed,
                curve.iter().map(|&(x, _, [low, _])| (x, low)).collect(),
            ),
            Series::new("", 4, Style::Dashed, curve.iter().map(|&(x, .., [_, high])| (x, high)).collect()),
        ];
        if let Some(twice) = number(of, "error_with_twice") {
            series.push(Series::new("continued", 1, Style::Dashed, vec![(last, error), (2.0 * last, twice)]));
        }
        let mut panel =
            plane(&format!("{name}: more presses"), ["presses that it was fitted to", &title], series);
        panel.scale = Scale::FromZero;
        section
            .draw("The learning curve. Where it still falls, more presses would help.", &Panel::Plane(panel));
    }
    let ages: Vec<(f64, f64)> = list(of, "ages")
        .iter()
        .filter_map(|age| {
            let middle = (number(age, "from_us")? + number(age, "until_us")?) / 2e3;
            Some((middle, number(age, "error")?))
        })
        .collect();
    if ages.len() > 1 {
        let mut series = vec![Series::new("fitted", 0, Style::Line, ages.clone())];
        if let (Some(constant), Some(first), Some(last)) = (constant, ages.first(), ages.last()) {
            let ends = vec![(first.0, constant), (last.0, constant)];
            series.push(Series::new("constant, at the end", 5, Style::Dashed, ends));
        }
        let mut panel =
            plane(&format!("{name}: by age"), ["time since the first event (ms)", &title], series);
        panel.scale = Scale::FromZero;
        section.draw("How long after the first event how good it is.", &Panel::Plane(panel));
    }
}
