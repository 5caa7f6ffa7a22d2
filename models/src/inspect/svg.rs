//! A description's graph as an SVG picture: one box a layer from top to bottom, a band for each level, what is read
//! from further up as curves at the sides: skips on the right, other inputs on the left.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::table::kind;
use crate::{Description, Layer, LayerKind};

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

/// Fill of bands and boxes, by what the layer is.
const BANDS: [&str; 2] = ["#eef4fb", "#f3f1fa"];

impl Description {
    /// The graph as a standalone SVG picture.
    ///
    /// # Panics
    /// Never: it is written to a string.
    pub fn to_svg(&self) -> String {
        let mut svg = String::new();
        Drawing::new(self).write(&mut svg).expect("writing to a string does not fail");
        svg
    }
}

struct Drawing<'a> {
    description: &'a Description,
    /// Top of each box, by the layer's name.
    tops: BTreeMap<&'a str, usize>,
    /// Level, top and bottom of each band.
    bands: Vec<(usize, usize, usize)>,
    height: usize,
}

impl<'a> Drawing<'a> {
    fn new(description: &'a Description) -> Self {
        let mut tops = BTreeMap::new();
        let mut bands: Vec<(usize, usize, usize)> = Vec::new();
        let mut y = TOP;
        let rows = std::iter::once(("events", Some(0)))
            .chain(description.layers().iter().map(|layer| (layer.name.as_str(), layer.level)));
        for (name, level) in rows {
            match level {
                Some(level) if bands.last().is_none_or(|band| band.0 != level) => {
                    // Band, label, box: the previous band has ended MARGIN below its last box.
                    bands.push((level, y - MARGIN, 0));
                    y += LABEL;
                }
                _ => {}
            }
            tops.insert(name, y);
            if level.is_some()
                && let Some(band) = bands.last_mut()
            {
                band.2 = y + HEIGHT + MARGIN;
            }
            y += PITCH;
        }
        Self { description, tops, bands, height: y }
    }

    fn write(&self, svg: &mut String) -> std::fmt::Result {
        let (title, height) = (escaped(self.description.name()), self.height);
        writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {TOTAL} {height}\" width=\"{TOTAL}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\">"
        )?;
        writeln!(svg, "<title>{title}</title>")?;
        writeln!(svg, "<rect width=\"{TOTAL}\" height=\"{height}\" fill=\"#ffffff\"/>")?;
        let parameters = self.description.parameters();
        writeln!(
            svg,
            "<text x=\"20\" y=\"28\" font-size=\"17\" font-weight=\"bold\">{title}</text>\
             <text x=\"20\" y=\"46\" fill=\"#555555\">{parameters} parameters, window {} ms</text>",
            self.description.span_us() as f64 / 1000.0
        )?;
        for &(level, top, bottom) in &self.bands {
            let label = escaped(&self.description.level_label(level));
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
        self.write_box(svg, "events", "#ffffff", "polarity of each event: -1 or 1", "1 channel")?;
        for layer in self.description.layers() {
            self.write_layer(svg, layer)?;
        }
        self.write_edges(svg)?;
        writeln!(svg, "</svg>")
    }

    fn write_layer(&self, svg: &mut String, layer: &Layer) -> std::fmt::Result {
        let fill = match layer.kind {
            LayerKind::Spline { .. } => "#cfe3f7",
            LayerKind::Pool { .. } => "#f8dfc4",
            LayerKind::Readout { .. } => "#f5e9b8",
            LayerKind::Dense { .. } => "#d5ecd0",
        };
        let shape = match layer.kind {
            LayerKind::Pool { .. } | LayerKind::Readout { .. } => {
                format!("{} \u{2192} {}", layer.inputs, layer.outputs)
            }
            _ => format!("{} \u{2192} {}, {} parameters", layer.inputs, layer.outputs, layer.parameters),
        };
        self.write_box(svg, &layer.name, fill, &kind(layer), &shape)
    }

    fn write_box(
        &self,
        svg: &mut String,
        name: &str,
        fill: &str,
        what: &str,
        shape: &str,
    ) -> std::fmt::Result {
        let top = self.tops[name];
        let (first, second, right) = (top + 18, top + 36, LEFT + WIDTH - 12);
        let (name, what, shape) = (escaped(&shortened(name)), escaped(what), escaped(shape));
        writeln!(
            svg,
            "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" rx=\"5\" fill=\"{fill}\" \
             stroke=\"#777777\"/><text x=\"{0}\" y=\"{first}\" font-weight=\"bold\">{name}</text>\
             <text x=\"{0}\" y=\"{second}\">{what}</text>\
             <text x=\"{right}\" y=\"{second}\" text-anchor=\"end\">{shape}</text>",
            LEFT + 12
        )
    }

    fn write_edges(&self, svg: &mut String) -> std::fmt::Result {
        let mut above = "events";
        for layer in self.description.layers() {
            let top = self.tops[layer.name.as_str()];
            if layer.from == above {
                let (x, from) = (LEFT + WIDTH / 2, self.tops[above] + HEIGHT);
                writeln!(svg, "<path d=\"M{x} {from}V{top}\" fill=\"none\" stroke=\"#444444\"/>")?;
                writeln!(svg, "<path d=\"M{x} {top}l-4 -8h8z\" fill=\"#444444\"/>")?;
            } else {
                self.write_curve(svg, &layer.from, top, LEFT, false)?;
            }
            if let LayerKind::Spline { skip: Some(skip), .. } = &layer.kind {
                self.write_curve(svg, skip, top, LEFT + WIDTH, true)?;
            }
            above = &layer.name;
        }
        Ok(())
    }

    /// A curve from the box of `from` to the box at `top`, along the side at `x`.
    fn write_curve(
        &self,
        svg: &mut String,
        from: &str,
        top: usize,
        x: usize,
        right: bool,
    ) -> std::fmt::Result {
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
        if right {
            writeln!(svg, "<text x=\"{}\" y=\"{}\" fill=\"#444444\">+</text>", x + 12, end - 8)?;
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
