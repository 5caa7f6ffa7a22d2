//! Computed and skipped work of each layer, for events and for frames.

use meissner_plot::Panel;
use serde_json::Value;

use crate::json::{list, number, text};
use crate::parts::{Section, Table, shares};
use crate::words::{count, percent};

/// A kind of rows or pixels.
struct Kind {
    key: &'static str,
    /// Name in the legend.
    name: &'static str,
    /// Whether it is also counted among the computed ones.
    within_computed: bool,
    is_work: bool,
    /// Number of its colour; 5 is grey.
    colour: usize,
}

const fn work(key: &'static str, name: &'static str, within_computed: bool, colour: usize) -> Kind {
    Kind { key, name, within_computed, is_work: true, colour }
}

const fn saved(key: &'static str, name: &'static str, colour: usize) -> Kind {
    Kind { key, name, within_computed: false, is_work: false, colour }
}

/// Kinds of layers over events, and of frame layers; the first kind is the computed ones.
const ROWS: &[Kind] = &[
    work("recomputed", "computed", false, 0),
    work("unchanged", "computed, equal", true, 4),
    work("within_tolerance", "computed, within the tolerance", true, 1),
    saved("kept", "kept", 5),
];
const PIXELS: &[Kind] = &[
    work("computed", "computed", false, 0),
    saved("skipped", "kept", 5),
    saved("absorbed", "only zeros came", 2),
];

/// Reasons for skipped work of an engine over events, and their meaning.
const REASONS: [(&str, &str); 10] = [
    ("rows_recomputed", "rows that were computed"),
    ("rows_unchanged", "of them equal to the stored row: nothing above follows"),
    ("rows_within_tolerance", "of them within the tolerance: nothing above follows"),
    ("rows_kept", "rows that no event affected: kept"),
    ("neighbourhoods_checked", "neighbourhoods that were looked at again"),
    ("neighbourhoods_unchanged", "of them unchanged"),
    ("readout_cells_recomputed", "cells of the readout that were computed"),
    ("readout_cells_unchanged", "of them equal"),
    ("predictions_reused", "predictions without any new row: reused"),
    ("events_evicted", "events that left a full window early"),
];

/// Adds the picture and the tables of skips of `summary`, and the share of rows that was computed.
pub(super) fn skips(section: &mut Section, summary: &Value) {
    if let Some(skips) = summary.get("skips") {
        let rows = |key| number(skips, key).unwrap_or(0.0);
        let all = rows("rows_recomputed") + rows("rows_kept");
        if all > 0.0 {
            section.figure("rows computed (%)", Some(100.0 * rows("rows_recomputed") / all));
        }
        layers(section, list(skips, "layers"), ROWS, "rows");
        let reasons = REASONS.iter().filter_map(|(key, meaning)| {
            let found = number(skips, key).filter(|&found| found > 0.0)?;
            Some(vec![(*meaning).to_owned(), count(found)])
        });
        section.table(Table::new("What was skipped, and why", &["", "count"], reasons.collect()));
    }
    if let Some(pixels) = summary.get("pixels") {
        layers(section, list(pixels, "layers"), PIXELS, "pixels");
    }
}

/// Adds the picture and the table of layers whose rows or pixels are of some `kinds`.
pub(super) fn pixels(section: &mut Section, found: &[Value]) {
    layers(section, found, PIXELS, "pixels");
}

fn layers(section: &mut Section, found: &[Value], kinds: &[Kind], what: &str) {
    let counts = |layer: &Value, kind: &Kind| number(layer, kind.key).unwrap_or(0.0);
    // Kinds that never occur would only fill the legend.
    let used: Vec<&Kind> = kinds
        .iter()
        .filter(|kind| {
            !kind.within_computed && kind.is_work || found.iter().any(|layer| counts(layer, kind) > 0.0)
        })
        .collect();
    let row = |layer: &Value| {
        let equal: f64 =
            used.iter().filter(|kind| kind.within_computed).map(|kind| counts(layer, kind)).sum();
        let mut values: Vec<f64> = used.iter().map(|kind| counts(layer, kind)).collect();
        values[0] = (values[0] - equal).max(0.0);
        let name = text(layer, "name").unwrap_or("?").to_owned();
        (values.iter().sum::<f64>() > 0.0).then_some((name, values))
    };
    let rows: Vec<(String, Vec<f64>)> = found.iter().filter_map(row).collect();
    if rows.is_empty() {
        return;
    }
    let names: Vec<&str> = used.iter().map(|kind| kind.name).collect();
    let title = if what == "rows" { "Rows by layer" } else { "Pixels by layer" };
    let caption = format!(
        "Each bar is all {what} of a layer over the whole stream. The input of those that were kept had not \
         changed: they are exact without any work."
    );
    let parts: Vec<(&str, usize)> = used.iter().map(|kind| (kind.name, kind.colour)).collect();
    let panel = shares(title, &format!("share of the {what} (%)"), &parts, rows.clone());
    section.draw(caption, &Panel::Parts(panel));
    let headings: Vec<&str> = std::iter::once("layer").chain(names).chain(["computed of all (%)"]).collect();
    let cells = rows.into_iter().map(|(name, values)| {
        let work: f64 =
            used.iter().zip(&values).filter(|(kind, _)| kind.is_work).map(|(_, value)| value).sum();
        let computed = percent(work / values.iter().sum::<f64>());
        std::iter::once(name).chain(values.into_iter().map(count)).chain([computed]).collect()
    });
    section.table(Table::new(title, &headings, cells.collect()));
}
