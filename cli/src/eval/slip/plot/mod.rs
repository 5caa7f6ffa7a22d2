//! The results as a drawing: accuracies of all networks on each set with those of others, then a confusion matrix for each
//! network (row) and set (column).

mod bars;

use std::fmt::{self, Write};

use meissner_models::systems::slip::{CLASSES, ObjectSet};

use super::report::{NetworkReport, Report, SetReport};
use crate::eval::matrix;
use crate::svg;
use meissner_pipeline::text::grouped;

/// Left border of everything.
const LEFT: f64 = 40.0;
/// Where the bars end and the first row of matrices begins.
const ROWS: f64 = 470.0;
/// Size of a matrix.
const CELL: (f64, f64) = (matrix::width(CLASSES.len()), matrix::height(CLASSES.len()));
const WIDTH: f64 = 2.0 * LEFT + 4.0 * CELL.0;

/// The drawing, as a file of its own.
pub(super) fn svg(report: &Report) -> String {
    let mut svg = String::new();
    draw(&mut svg, report).expect("writing to a string does not fail");
    svg
}

fn draw(svg: &mut String, report: &Report) -> fmt::Result {
    let judged: Vec<&NetworkReport> = report.networks.iter().filter(|n| !n.sets.is_empty()).collect();
    let height = ROWS + CELL.1 * judged.len() as f64 + 10.0;
    let folder = report.data.folder.trim_end_matches('/');
    let about = format!(
        "{}: {} recordings, {} readings; confusion matrices: percent of the true class",
        folder.rsplit(['/', '\\']).next().unwrap_or(folder),
        grouped(report.data.recordings as u64),
        grouped(report.data.readings as u64)
    );
    svg::head(svg, (WIDTH, height), LEFT, "Direction of slip", &about)?;
    bars::draw(svg, &judged, &report.references)?;
    for (row, network) in judged.iter().enumerate() {
        for (column, set) in ObjectSet::ALL.into_iter().enumerate() {
            let Some(on) = network.on(set) else { continue };
            let (x, y) = (LEFT + CELL.0 * column as f64, ROWS + CELL.1 * row as f64);
            writeln!(svg, "<g transform=\"translate({x} {y})\">")?;
            let trained_on = if on.trained_on { " (trained on)" } else { "" };
            let title = format!("{}, {set}{trained_on}", network.network);
            matrix::draw(svg, (&title, &accuracy(on)), &CLASSES, &on.judged.confusion)?;
            writeln!(svg, "</g>")?;
        }
    }
    writeln!(svg, "</svg>")
}

/// The line below a matrix's title.
fn accuracy(on: &SetReport) -> String {
    let judged = &on.judged;
    let std = judged.accuracy.std.map_or_else(String::new, |std| format!(" \u{b1} {:.2}", 100.0 * std));
    let trainings = if judged.trainings == 1 { "training" } else { "trainings" };
    format!(
        "{:.2}{std} %, {} {trainings}, {} windows",
        100.0 * judged.accuracy.mean,
        judged.trainings,
        grouped(judged.windows)
    )
}
