//! Accuracies as bars: a group for each set, a bar for each network with its standard deviation, and lines for what others
//! reach.

use std::fmt::{self, Write};

use meissner_models::systems::slip::ObjectSet;

use super::super::report::{NetworkReport, ReferenceReport, SetReport};
use super::LEFT;
use crate::svg::{COLOURS, escaped};

/// The field of the bars.
const START: f64 = LEFT + 42.0;
const END: f64 = 900.0;
const TOP: f64 = 92.0;
const BOTTOM: f64 = 392.0;
/// Part of a group's width that its bars take.
const FILLED: f64 = 0.8;
/// Widest bar.
const WIDEST: f64 = 60.0;
/// Dashes of the lines for others.
const DASHES: [&str; 2] = ["8 4", "2 3"];

/// Draws the bars of `networks` and the lines of `references`.
pub(super) fn draw(
    svg: &mut String,
    networks: &[&NetworkReport],
    references: &[ReferenceReport],
) -> fmt::Result {
    axis(svg)?;
    let sets: Vec<ObjectSet> =
        ObjectSet::ALL.into_iter().filter(|&set| networks.iter().any(|n| n.on(set).is_some())).collect();
    let group = (END - START) / sets.len().max(1) as f64;
    let bar = (group * FILLED / networks.len().max(1) as f64).min(WIDEST);
    for (i, &set) in sets.iter().enumerate() {
        let middle = START + group * (i as f64 + 0.5);
        let first = middle - bar * networks.len() as f64 / 2.0;
        let trained_on = networks.iter().filter_map(|n| n.on(set)).any(|on| on.trained_on);
        let mark = if trained_on { " (trained on)" } else { "" };
        writeln!(
            svg,
            "<text x=\"{middle:.1}\" y=\"{}\" text-anchor=\"middle\">{set}{mark}</text>",
            BOTTOM + 20.0
        )?;
        let bars = || {
            let judged = networks.iter().enumerate().filter_map(|(i, network)| Some((i, network.on(set)?)));
            judged.map(|(i, on)| (first + bar * i as f64, COLOURS[i % COLOURS.len()], on))
        };
        // Values over lines over bars: each can be read where they meet.
        bars().try_for_each(|(x, colour, on)| draw_bar(svg, x, bar, colour, on))?;
        for (reference, dashes) in references.iter().zip(DASHES.iter().cycle()) {
            if let Some(share) = reference.reference.accuracy(set) {
                let (y, reach) = (y(share), group * (FILLED + 0.12) / 2.0);
                line(svg, (middle - reach, middle + reach), y, dashes)?;
            }
        }
        bars().try_for_each(|(x, _, on)| draw_value(svg, x + bar / 2.0, on))?;
    }
    legend(svg, networks, references)
}

/// Where `share` lies.
fn y(share: f64) -> f64 {
    BOTTOM - share * (BOTTOM - TOP)
}

fn axis(svg: &mut String) -> fmt::Result {
    for percent in (0..=100_u8).step_by(20) {
        let y = y(f64::from(percent) / 100.0);
        writeln!(
            svg,
            "<line x1=\"{START}\" y1=\"{y:.1}\" x2=\"{END}\" y2=\"{y:.1}\" stroke=\"#dddddd\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{percent} %</text>",
            START - 8.0,
            y + 4.5
        )?;
    }
    let centre = f64::midpoint(TOP, BOTTOM);
    writeln!(
        svg,
        "<text transform=\"translate(22 {centre}) rotate(-90)\" text-anchor=\"middle\">accuracy</text>"
    )
}

/// A bar with a whisker of one standard deviation to either side.
fn draw_bar(svg: &mut String, x: f64, width: f64, colour: &str, on: &SetReport) -> fmt::Result {
    let accuracy = on.judged.accuracy;
    let (top, inner, middle) = (y(accuracy.mean), width * 0.86, x + width / 2.0);
    writeln!(
        svg,
        "<rect x=\"{:.1}\" y=\"{top:.1}\" width=\"{inner:.1}\" height=\"{:.1}\" fill=\"{colour}\"/>",
        x + (width - inner) / 2.0,
        BOTTOM - top
    )?;
    let Some(std) = accuracy.std else { return Ok(()) };
    let (high, low) = (y((accuracy.mean + std).min(1.0)), y((accuracy.mean - std).max(0.0)));
    let left = middle - 4.0;
    writeln!(
        svg,
        "<path d=\"M{middle:.1} {high:.1}V{low:.1}M{left:.1} {high:.1}h8M{left:.1} {low:.1}h8\" stroke=\"#222222\" \
         fill=\"none\"/>"
    )
}

/// The value of a bar whose middle is at `x`, above it and its whisker.
fn draw_value(svg: &mut String, x: f64, on: &SetReport) -> fmt::Result {
    let accuracy = on.judged.accuracy;
    let (number, top) = (100.0 * accuracy.mean, (accuracy.mean + accuracy.std.unwrap_or(0.0)).min(1.0));
    let y = y(top) - 5.0;
    // White behind the number, where a line crosses it.
    for stroke in [" stroke=\"#ffffff\" stroke-width=\"3\"", ""] {
        writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" font-size=\"11\"{stroke}>{number:.1}</text>"
        )?;
    }
    Ok(())
}

fn line(svg: &mut String, (from, to): (f64, f64), y: f64, dashes: &str) -> fmt::Result {
    writeln!(
        svg,
        "<line x1=\"{from:.1}\" y1=\"{y:.1}\" x2=\"{to:.1}\" y2=\"{y:.1}\" stroke=\"#222222\" stroke-width=\"1.6\" \
         stroke-dasharray=\"{dashes}\"/>"
    )
}

/// Names beside the field.
fn legend(svg: &mut String, networks: &[&NetworkReport], references: &[ReferenceReport]) -> fmt::Result {
    const LINE: f64 = 22.0;
    let left = END + 24.0;
    let mut y = TOP + 12.0;
    for (network, colour) in networks.iter().zip(COLOURS.iter().cycle()) {
        writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{}\" width=\"24\" height=\"13\" fill=\"{colour}\"/>\
             <text x=\"{}\" y=\"{y}\">{}</text>",
            y - 11.0,
            left + 32.0,
            escaped(&network.network)
        )?;
        y += LINE;
    }
    for (reference, dashes) in references.iter().zip(DASHES.iter().cycle()) {
        line(svg, (left, left + 24.0), y - 4.5, dashes)?;
        let name = escaped(reference.name);
        writeln!(svg, "<text x=\"{}\" y=\"{y}\">{name} (reference)</text>", left + 32.0)?;
        y += LINE;
    }
    writeln!(
        svg,
        "<text x=\"{left}\" y=\"{}\" font-size=\"11\" fill=\"#555555\">whiskers: one standard deviation over \
         trainings</text>",
        y + 4.0
    )
}
