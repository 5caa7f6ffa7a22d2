//! A network as an SVG picture: one box for each layer from top to bottom, a band for each level. Inputs that are not the
//! box above are curves at the sides: second inputs on the right, others on the left.

use std::collections::BTreeMap;
use std::fmt::{Result, Write};

use super::view::{Node, View};

/// Left edge, width and height of a box, and the distance from one box's top to the next one's.
const LEFT: usize = 150;
const WIDTH: usize = 460;
const HEIGHT: usize = 44;
const PITCH: usize = 66;
/// Height of the title.
const TOP: usize = 64;
/// Space that a band takes above and below its boxes, and height of its own label.
const MARGIN: usize = 9;
const LABEL: usize = 24;
/// Whole width.
const TOTAL: usize = 760;
/// Furthest that a curve bends outwards.
const LARGEST_BEND: usize = 120;

/// Fill of bands.
const BANDS: [&str; 2] = ["#eef4fb", "#f3f1fa"];

/// The SVG text of `view`.
pub(super) fn svg(view: &View<'_>) -> String {
    let mut svg = String::new();
    Drawing::new(view).write(&mut svg).expect("writing to a string does not fail");
    svg
}

struct Drawing<'a> {
    view: &'a View<'a>,
    /// Top of each box, by the layer's name.
    tops: BTreeMap<&'a str, usize>,
    /// Level, top and bottom of each band.
    bands: Vec<(usize, usize, usize)>,
    height: usize,
}

impl<'a> Drawing<'a> {
    fn new(view: &'a View<'a>) -> Self {
        let mut tops = BTreeMap::new();
        let mut bands: Vec<(usize, usize, usize)> = Vec::new();
        let mut y = TOP;
        let rows = std::iter::once((view.input.name, view.input.band))
            .chain(view.nodes.iter().map(|node| (node.name, node.band)));
        for (name, level) in rows {
            if let Some(level) = level {
                if bands.last().is_none_or(|band| band.0 != level) {
                    // The previous band ended MARGIN below its last box. This band starts with its label.
                    bands.push((level, y - MARGIN, 0));
                    y += LABEL;
                }
                let (_, _, bottom) = bands.last_mut().expect("a band of this level");
                *bottom = y + HEIGHT + MARGIN;
            }
            tops.insert(name, y);
            y += PITCH;
        }
        Self { view, tops, bands, height: y }
    }

    fn write(&self, svg: &mut String) -> Result {
        let (title, height) = (escaped(self.view.name), self.height);
        writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {TOTAL} {height}\" width=\"{TOTAL}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\">"
        )?;
        writeln!(svg, "<title>{title}</title>")?;
        writeln!(svg, "<rect width=\"{TOTAL}\" height=\"{height}\" fill=\"#ffffff\"/>")?;
        writeln!(
            svg,
            "<text x=\"20\" y=\"28\" font-size=\"17\" font-weight=\"bold\">{title}</text>\
             <text x=\"20\" y=\"46\" fill=\"#555555\">{}</text>",
            escaped(&self.view.about)
        )?;
        for &(level, top, bottom) in &self.bands {
            let label = escaped(&self.view.bands[level]);
            writeln!(
                svg,
                "<rect x=\"12\" y=\"{top}\" width=\"{}\" height=\"{}\" rx=\"8\" fill=\"{}\"/>\
                 <text x=\"22\" y=\"{}\" fill=\"#555555\">{label}</text>",
                TOTAL - 24,
                bottom - top,
                BANDS[level % BANDS.len()],
                top + 19
            )?;
        }
        let input = &self.view.input;
        self.write_box(svg, input.name, "#ffffff", &input.about, &input.shape)?;
        for node in &self.view.nodes {
            self.write_node(svg, node)?;
        }
        self.write_edges(svg)?;
        writeln!(svg, "</svg>")
    }

    fn write_node(&self, svg: &mut String, node: &Node<'_>) -> Result {
        let mut shape = node.shapes.join(" \u{2192} ");
        if let Some(parameters) = node.parameters {
            write!(shape, ", {parameters} parameters")?;
        }
        self.write_box(svg, node.name, node.fill, &node.kind, &shape)
    }

    fn write_box(&self, svg: &mut String, name: &str, fill: &str, about: &str, shape: &str) -> Result {
        let top = self.tops[name];
        let (first, second, right) = (top + 18, top + 36, LEFT + WIDTH - 12);
        let (name, about, shape) = (escaped(&shortened(name)), escaped(about), escaped(shape));
        writeln!(
            svg,
            "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" rx=\"5\" fill=\"{fill}\" \
             stroke=\"#777777\"/><text x=\"{0}\" y=\"{first}\" font-weight=\"bold\">{name}</text>\
             <text x=\"{0}\" y=\"{second}\">{about}</text>\
             <text x=\"{right}\" y=\"{second}\" text-anchor=\"end\">{shape}</text>",
            LEFT + 12
        )
    }

    fn write_edges(&self, svg: &mut String) -> Result {
        let mut above = self.view.input.name;
        for node in &self.view.nodes {
            let top = self.tops[node.name];
            if node.from == above {
                let (x, from) = (LEFT + WIDTH / 2, self.tops[above] + HEIGHT);
                writeln!(svg, "<path d=\"M{x} {from}V{top}\" fill=\"none\" stroke=\"#444444\"/>")?;
                writeln!(svg, "<path d=\"M{x} {top}l-4 -8h8z\" fill=\"#444444\"/>")?;
            } else {
                self.write_curve(svg, node.from, top, None)?;
            }
            if let Some((joins, mark)) = node.joins {
                self.write_curve(svg, joins, top, Some(mark))?;
            }
            above = node.name;
        }
        Ok(())
    }

    /// A curve from the box of `from` to the box at `top`: on the right with a mark, on the left without.
    fn write_curve(&self, svg: &mut String, from: &str, top: usize, mark: Option<&str>) -> Result {
        let right = mark.is_some();
        let x = if right { LEFT + WIDTH } else { LEFT };
        let start = self.tops[from] + HEIGHT / 2;
        let end = top + HEIGHT / 2;
        // Longer curves bend further out, so that nested ones stay apart.
        let bend = (24 + (end - start) / 5).min(LARGEST_BEND);
        let out = if right { x + bend } else { x - bend };
        let tip = if right { "l8 -4v8z" } else { "l-8 -4v8z" };
        let dashes = if right { " stroke-dasharray=\"5 3\"" } else { "" };
        writeln!(
            svg,
            "<path d=\"M{x} {start}C{out} {start} {out} {end} {x} {end}\" fill=\"none\" stroke=\"#444444\"{dashes}/>\
             <path d=\"M{x} {end}{tip}\" fill=\"#444444\"/>"
        )?;
        if let Some(mark) = mark {
            writeln!(svg, "<text x=\"{}\" y=\"{}\" fill=\"#444444\">{mark}</text>", x + 12, end - 8)?;
        }
        Ok(())
    }
}

/// A name that fits into its box.
fn shortened(name: &str) -> String {
    if name.chars().count() <= 48 {
        name.to_owned()
    } else {
        name.chars().take(47).chain(['\u{2026}']).collect()
    }
}

/// Text for XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
