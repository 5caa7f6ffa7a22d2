//! The results as a drawing: for each way of judging a row with accuracies against time and a confusion matrix for each
//! network.

mod curves;

use std::fmt::{self, Write};

use meissner_models::systems::digits::CLASSES;

use super::report::{Judged, Report, Way};
use crate::eval::matrix;
use crate::svg;
use meissner_pipeline::text::grouped;

/// Left border of everything.
const LEFT: f64 = 40.0;
/// Where the first row begins.
const TOP: f64 = 92.0;
/// Size of a matrix.
const CELL: (f64, f64) = (matrix::width(CLASSES.len()), matrix::height(CLASSES.len()));

/// Height of a row: below the marks of time stands what they are.
const ROW: f64 = CELL.1 + 24.0;

/// The drawing, as a file of its own.
pub(super) fn svg(report: &Report) -> String {
    let mut svg = String::new();
    draw(&mut svg, report).expect("writing to a string does not fail");
    svg
}

fn draw(svg: &mut String, report: &Report) -> fmt::Result {
    // The colour of a network is that of its place among all.
    let of_way = |way: Way| {
        let all = report.networks.iter().enumerate();
        all.filter_map(|(place, network)| Some((place, network, network.judged(way)?))).collect::<Vec<_>>()
    };
    let rows: Vec<_> = Way::ALL.into_iter().map(|way| (way.name(), of_way(way))).collect();
    let rows: Vec<_> = rows.into_iter().filter(|(_, networks)| !networks.is_empty()).collect();
    let most = rows.iter().map(|(_, networks)| networks.len()).max().unwrap_or(0);
    let width = 2.0 * LEFT + curves::WIDTH + CELL.0 * most as f64;
    let height = TOP + ROW * rows.len() as f64;
    let folder = report.data.folder.trim_end_matches('/');
    let about = format!(
        "{}: {} recordings, {} events; confusion matrices at the end of a recording: percent of the true class",
        folder.rsplit(['/', '\\']).next().unwrap_or(folder),
        grouped(report.data.recordings as u64),
        grouped(report.data.events)
    );
    svg::head(svg, (width, height), LEFT, "Digits, event by event", &about)?;
    for (row, (way, networks)) in rows.iter().enumerate() {
        let y = TOP + ROW * row as f64;
        writeln!(svg, "<g transform=\"translate({LEFT} {y})\">")?;
        curves::draw(svg, way, &report.times_us, networks)?;
        writeln!(svg, "</g>")?;
        for (column, (_, network, judged)) in networks.iter().enumerate() {
            let x = LEFT + curves::WIDTH + CELL.0 * column as f64;
            writeln!(svg, "<g transform=\"translate({x} {y})\">")?;
            let title = format!("{}, {way}", network.network);
            matrix::draw(svg, (&title, &accuracy(judged)), &CLASSES, &judged.confusion)?;
            writeln!(svg, "</g>")?;
        }
    }
    writeln!(svg, "</svg>")
}

/// The line below a matrix's title.
fn accuracy(judged: &Judged) -> String {
    let std = judged.accuracy.std.map_or_else(String::new, |std| format!(" \u{b1} {:.2}", 100.0 * std));
    let (low, high) = judged.interval_95;
    let seeds = if judged.trainings == 1 { "seed" } else { "seeds" };
    format!(
        "{:.2}{std} % (95 %: {:.1} to {:.1}), {} {seeds}, {} recordings",
        100.0 * judged.accuracy.mean,
        100.0 * low,
        100.0 * high,
        judged.trainings,
        grouped(judged.recordings)
    )
}
