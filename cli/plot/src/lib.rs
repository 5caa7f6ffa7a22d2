//! Pictures of measurements as standalone SVG files.
//!
//! Input: plain data. Output: the text of a file. Equal data gives equal bytes.
//!
//! A picture is a [`page`] with rows of panels:
//!
//! | panel | contents |
//! |---|---|
//! | [`Distribution`] | latencies: the share of calls that took longer, with quantiles |
//! | [`Curves`], [`Bars`] | accuracies against time and by group |
//! | [`Matrix`] | a confusion matrix |
//! | [`TradeOff`] | run time against error, with fronts and labels |
//! | [`Network`] | the layers of a network |
//! | [`Plane`] | lines and dots between two axes |
//! | [`Parts`], [`Quantiles`] | a bar of parts, or the quantiles of times, for each row |
//!
//! [`figure`] draws one panel for a page of HTML.
//!
//! ```
//! use meissner_plot::{Distribution, LatencyCurve, Panel, page};
//!
//! // Of four calls, two took 10 us, one took 20 us and one took 40 us.
//! let points = vec![(10.0, 0.5), (20.0, 0.25), (40.0, 0.0)];
//! let push = LatencyCurve { name: "push".to_owned(), dashed: false, points };
//! let panel = Panel::Distribution(Distribution { curves: vec![push] });
//! let svg = page("Latency", "four calls", &[vec![panel]]);
//! assert!(svg.starts_with("<svg") && svg.contains("latency (microseconds)"));
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod accuracy;
mod axes;
mod labels;
mod latency;
mod network;
mod plane;
mod rows;
mod svg;
mod text;
mod trade_off;

pub use accuracy::{AccuracyCurve, Bar, Bars, Curves, Matrix};
pub use latency::{Distribution, LatencyCurve};
pub use network::{Network, Node};
pub use plane::{Plane, Scale, Series, Style};
pub use rows::{Parts, Quantiles};
pub use svg::{PALETTE, escaped};
pub use text::{grouped, percent};
pub use trade_off::{Errors, Setting, TradeOff};

use svg::{GREY, Svg};
use text::{SIZE, bold_width, width, wrapped};

/// A rectangular part of a picture.
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "the page of the crate lists them")]
#[non_exhaustive]
pub enum Panel<'a> {
    Bars(Bars),
    Curves(Curves),
    Distribution(Distribution),
    Matrix(Matrix<'a>),
    Network(Network<'a>),
    Parts(Parts),
    Plane(Plane),
    Quantiles(Quantiles),
    TradeOff(TradeOff),
}

/// A standalone SVG file: a bold `title`, the lines of `about` below it, and rows of panels from
/// left to right. Lines of `about` that are wider than the panels are broken.
///
/// # Panics
/// If a box of a network reads a name without a box, or bars have fewer accuracies than groups.
pub fn page(title: &str, about: &str, rows: &[Vec<Panel<'_>>]) -> String {
    const LEFT: f64 = 24.0;
    const TITLE: f64 = 18.0;
    /// Minimum room for text, if the panels are narrow or there is none.
    const MIN: f64 = 420.0;
    let rows: Vec<Vec<(Svg, (f64, f64))>> = rows.iter().map(|row| row.iter().map(drawn).collect()).collect();
    let widths = rows.iter().map(|row| row.iter().map(|(_, size)| size.0).sum::<f64>());
    let room = widths.fold(MIN.max(bold_width(title, TITLE)), f64::max);
    let mut svg = Svg::default();
    svg.text((LEFT, 34.0), title).size(TITLE).bold();
    let mut bottom = 56.0;
    for line in wrapped(about, room, |line| width(line, SIZE)) {
        svg.text((LEFT, bottom), &line).fill(GREY);
        bottom += 18.0;
    }
    if rows.iter().all(Vec::is_empty) {
        svg.text((LEFT, bottom + 8.0), "nothing to draw: no results");
        bottom += 26.0;
    }
    for row in rows {
        let (mut x, mut height) = (LEFT, 0.0_f64);
        for (part, size) in row {
            svg.group((x, bottom), &part);
            (x, height) = (x + size.0, height.max(size.1));
        }
        bottom += height;
    }
    svg.document((LEFT + room + LEFT, bottom + 10.0), title)
}

/// One panel as an element `svg` of a page of HTML, with `name` for screen readers, and its width
/// in pixels. It has no background, and its colours are attributes, so that a style sheet can
/// change them.
///
/// # Panics
/// As [`page`].
pub fn figure(name: &str, panel: &Panel<'_>) -> (String, f64) {
    /// Space on every side, for lines at the border.
    const MARGIN: f64 = 4.0;
    let (part, (width, height)) = drawn(panel);
    let mut svg = Svg::default();
    svg.group((MARGIN, MARGIN), &part);
    let width = width + 2.0 * MARGIN;
    (svg.element((width, height + 2.0 * MARGIN), name), width)
}

/// A panel with its width and height.
fn drawn(panel: &Panel<'_>) -> (Svg, (f64, f64)) {
    let mut part = Svg::default();
    let size = match panel {
        Panel::Bars(bars) => bars.draw(&mut part),
        Panel::Curves(curves) => curves.draw(&mut part),
        Panel::Distribution(distribution) => distribution.draw(&mut part),
        Panel::Matrix(matrix) => matrix.draw(&mut part),
        Panel::Network(network) => network.draw(&mut part),
        Panel::Parts(parts) => parts.draw(&mut part),
        Panel::Plane(plane) => plane.draw(&mut part),
        Panel::Quantiles(quantiles) => quantiles.draw(&mut part),
        Panel::TradeOff(trade_off) => trade_off.draw(&mut part),
    };
    (part, size)
}

#[cfg(test)]
mod tests;
