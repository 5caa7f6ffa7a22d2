//! Several results side by side: one row for each result, one column for each figure that at least
//! two have.

use meissner_plot::{Panel, Series, Style};

use crate::parts::{Picture, Section, Table, bars, plane, quantiles};
use crate::read::{Body, Outcome};
use crate::stream::Along;
use crate::words::number;

/// Maximum number of results in one picture, because there are six colours.
const MAX_SERIES: usize = 6;
/// Maximum number of results as columns of the table; more results become rows.
const MAX_COLUMNS: usize = 6;
/// A median counts as faster only beyond this ratio.
const NEAR: f64 = 1.05;

/// The figure for the speed of a result relative to its input.
const SPEED: &str = "times as fast as the input";

/// The comparison of all results.
pub(crate) struct Comparison {
    pub(crate) answer: Vec<String>,
    pub(crate) pictures: Vec<Picture>,
    pub(crate) table: Table,
}

/// A short name for each result that distinguishes it from the others.
pub(crate) fn names(results: &[Outcome]) -> Vec<String> {
    let candidates: [fn(&Outcome) -> String; 4] = [
        Outcome::subject,
        |of| format!("{}, {}", of.subject(), of.command),
        // For inputs of one file, their numbers.
        |of| of.name.rsplit(", ").next().filter(|last| last.starts_with("input ")).unwrap_or("").to_owned(),
        |of| crate::words::file_name(&of.name).to_owned(),
    ];
    let all = candidates.map(|name| results.iter().map(name).collect::<Vec<_>>());
    let is_unique = |names: &Vec<String>| {
        let mut sorted = names.clone();
        sorted.sort_unstable();
        sorted.windows(2).all(|two| two[0] != two[1])
    };
    let unique = all.into_iter().find(is_unique);
    unique.unwrap_or_else(|| results.iter().map(|of| of.name.clone()).collect())
}

/// Compares results with their sections; `None` if there is only one.
pub(crate) fn compare(results: &[Outcome], sections: &[Section], names: &[String]) -> Option<Comparison> {
    if results.len() < 2 {
        return None;
    }
    let mut columns: Vec<&str> = Vec::new();
    let has = |section: &Section, column: &str| section.figures.iter().any(|(name, _)| name == column);
    for (name, _) in sections.iter().flat_map(|section| &section.figures) {
        let shared = sections.iter().filter(|section| has(section, name)).count();
        if shared > 1 && !columns.contains(&name.as_str()) {
            columns.push(name);
        }
    }
    let value = |section: &Section, column: &str| {
        section.figures.iter().find(|(name, _)| name == column).map(|&(_, value)| value)
    };
    let cell =
        |section: &Section, column: &str| value(section, column).map_or_else(|| "-".to_owned(), number);
    let (headings, rows): (Vec<&str>, Vec<Vec<String>>) = if results.len() <= MAX_COLUMNS {
        let row = |column: &&str| {
            let cells = sections.iter().map(|section| cell(section, column));
            std::iter::once((*column).to_owned()).chain(cells).collect()
        };
        (names.iter().map(String::as_str).collect(), columns.iter().map(row).collect())
    } else {
        let row = |(section, name): (&Section, &String)| {
            let cells = columns.iter().map(|column| cell(section, column));
            std::iter::once(name.clone()).chain(cells).collect()
        };
        (columns.clone(), sections.iter().zip(names).map(row).collect())
    };
    let headings: Vec<&str> = std::iter::once("").chain(headings).collect();
    let table = Table::new("Figures that results have in common", &headings, rows);
    let mut pictures = Vec::new();
    let times = sections.iter().zip(names).filter_map(|(section, name)| {
        let (what, quantiles) = section.times.as_ref()?;
        Some((what, name.clone(), quantiles.clone()))
    });
    let times: Vec<_> = times.collect();
    if times.len() > 1 {
        let alike = times.iter().all(|(what, ..)| *what == times[0].0);
        let about = if alike { times[0].0.as_str() } else { "what is timed differs: each result says it" };
        let rows = times.iter().map(|(_, name, of)| (name.clone(), of.clone()));
        let panel = quantiles("Latency", about, rows.collect());
        let caption = "From the median to the longest; left is faster.";
        pictures.push(Picture::new(caption, &Panel::Quantiles(panel)));
    }
    for column in ["events/s", "sustained events/s", SPEED] {
        let rows: Vec<(String, f64)> = sections
            .iter()
            .zip(names)
            .filter_map(|(section, name)| Some((name.clone(), value(section, column)?)))
            .collect();
        if rows.len() > 1 {
            pictures.push(Picture::new("Longer is faster.", &Panel::Parts(bars(column, column, rows))));
        }
    }
    predictions(results, names, &mut pictures);
    Some(Comparison { answer: answer(sections, names), pictures, table })
}

/// The fastest result: among results that time the same, or else relative to its input.
fn answer(sections: &[Section], names: &[String]) -> Vec<String> {
    let timed = sections.iter().zip(names).filter_map(|(section, name)| {
        let (what, quantiles) = section.times.as_ref()?;
        Some((what, name, quantiles.first().copied()?))
    });
    let mut timed: Vec<_> = timed.collect();
    timed.sort_by(|a, b| a.2.total_cmp(&b.2));
    let alike = timed.len() == sections.len() && timed.iter().all(|(what, ..)| *what == timed[0].0);
    if let [(what, fast, least), .., (_, slow, most)] = timed.as_slice()
        && alike
        && *least > 0.0
        && *most > NEAR * least
    {
        let times = number(most / least);
        return vec![format!(
            "{fast} is the fastest at the median ({what}): {times} times as fast as {slow}."
        )];
    }
    let speed =
        |section: &Section| section.figures.iter().find(|(name, _)| name == SPEED).map(|&(_, speed)| speed);
    let mut speeds: Vec<(&String, f64)> =
        sections.iter().zip(names).filter_map(|(section, name)| Some((name, speed(section)?))).collect();
    speeds.sort_by(|a, b| b.1.total_cmp(&a.1));
    match speeds.as_slice() {
        [(fast, most), .., (slow, least)] => {
            let [most, least] = [*most, *least].map(number);
            vec![format!("{fast} is {most} times as fast as its input came, {slow} {least} times.")]
        }
        _ => Vec::new(),
    }
}

/// Predictions of the same quantity by several results in one picture.
fn predictions(results: &[Outcome], names: &[String], pictures: &mut Vec<Picture>) {
    let streams = results.iter().zip(names).filter_map(|(result, name)| match &result.body {
        Body::Stream(stream) if stream.along == Along::Time => Some((result.input(), name, stream)),
        _ => None,
    });
    let streams: Vec<_> = streams.take(MAX_SERIES).collect();
    let mut quantities: Vec<(&str, &str, &str)> = Vec::new();
    for (input, _, stream) in &streams {
        for value in &stream.values {
            let quantity = (crate::words::file_name(input), value.name.as_str(), value.unit.as_str());
            if !quantities.contains(&quantity) {
                quantities.push(quantity);
            }
        }
    }
    for (input, name, unit) in quantities.into_iter().take(MAX_SERIES) {
        let mut series = Vec::new();
        for (of, result, stream) in &streams {
            let is_it = |value: &&crate::stream::Valued| value.name == name && value.unit == unit;
            let value = stream.values.iter().find(is_it).filter(|_| crate::words::file_name(of) == input);
            let Some(value) = value else { continue };
            if series.is_empty() && value.truth.last().is_some() {
                series.push(Series::new("true", 5, Style::Dashed, value.truth.points()));
            }
            let colour = series.iter().filter(|series: &&Series| series.style == Style::Line).count();
            series.push(Series::new((*result).clone(), colour % 5, Style::Line, value.line.points()));
        }
        if series.iter().filter(|series| series.style == Style::Line).count() > 1 {
            let axes = ["time since the first prediction (ms)", &format!("{name} ({unit})")];
            let caption = format!("The same input, {input}: each line is a result.");
            pictures.push(Picture::new(
                caption,
                &Panel::Plane(plane(&format!("Predicted {name}"), axes, series)),
            ));
        }
    }
}
