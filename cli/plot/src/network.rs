//! A network as boxes from top to bottom, in bands.
//!
//! An input that is not the box above is a curve at the side: second inputs on the right, others on
//! the left.

use std::collections::BTreeMap;

use crate::svg::{Area, FRAME, GREY, LINE, Place, Svg};
use crate::text::{SIZE, bold_width, shortened, width, wrapped};

/// Left edge and width of a box, height of two rows and of each row beyond, distance of boxes.
const LEFT: f64 = 130.0;
const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 44.0;
const ROW: f64 = 18.0;
const GAP: f64 = 22.0;
/// Width of the text of a box.
const INSIDE: f64 = WIDTH - 24.0;
/// Minimum space between the kind and the shape.
const APART: f64 = 16.0;
/// Space of a band above and below its boxes, and height of its label.
const MARGIN: f64 = 9.0;
const LABEL: f64 = 24.0;
/// Width of a band.
const TOTAL: f64 = 752.0;
/// Largest distance from the boxes to a curve.
const MAX_BEND: f64 = 120.0;
/// Fill of bands.
const BANDS: [&str; 2] = ["#eef4fb", "#f3f1fa"];

/// Boxes, ordered so that each comes after its inputs.
#[derive(Clone, Debug)]
pub struct Network<'a> {
    /// Labels of the bands.
    pub bands: Vec<String>,
    /// From top to bottom. Boxes of one band follow one another.
    pub boxes: Vec<Node<'a>>,
}

/// A box of a [`Network`].
#[derive(Clone, Debug)]
pub struct Node<'a> {
    /// Unique, bold in the first row.
    pub name: &'a str,
    /// Left part of the second row, or more rows if it is long.
    pub kind: String,
    /// Right part of the last row.
    pub shape: String,
    /// A colour such as `#ffffff`.
    pub fill: &'static str,
    /// Index of its band.
    pub band: Option<usize>,
    /// Name of the box that it reads.
    pub from: Option<&'a str>,
    /// Name of the box that it reads as a second input, and a mark for that.
    pub joins: Option<(&'a str, &'static str)>,
}

impl Network<'_> {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        let (areas, bands, height) = self.layout();
        for (band, area) in bands {
            svg.rect(&area, BANDS[band % BANDS.len()]).set("rx", 8);
            let label = shortened(&self.bands[band], area.width() - 20.0, |text| width(text, SIZE));
            svg.text((area.left + 10.0, area.top + 19.0), &label).fill(GREY);
        }
        let mut above = None;
        for node in &self.boxes {
            let area = areas[node.name];
            let Area { top, bottom, .. } = area;
            svg.rect(&area, node.fill).set("stroke", FRAME).set("rx", 5);
            let name = shortened(node.name, INSIDE, |text| bold_width(text, SIZE));
            svg.text((LEFT + 12.0, top + 18.0), &name).bold();
            for (i, line) in node.rows().iter().enumerate() {
                svg.text((LEFT + 12.0, top + 36.0 + ROW * i as f64), line);
            }
            svg.text((LEFT + WIDTH - 12.0, bottom - 8.0), &node.shape).end();
            if let Some(from) = node.from {
                if above == node.from {
                    let x = LEFT + WIDTH / 2.0;
                    svg.path(&format!("M{x} {}V{top}", areas[from].bottom), LINE);
                    svg.shape(&format!("M{x} {top}l-4 -8h8z"), LINE);
                } else {
                    curve(svg, &areas[from], &area, None);
                }
            }
            if let Some((joins, mark)) = node.joins {
                curve(svg, &areas[joins], &area, Some(mark));
            }
            above = Some(node.name);
        }
        (TOTAL, height)
    }

    /// Areas of the boxes by name, bands with their areas, and the height of all.
    fn layout(&self) -> (BTreeMap<&str, Area>, Vec<(usize, Area)>, f64) {
        let mut areas = BTreeMap::new();
        let mut bands: Vec<(usize, Area)> = Vec::new();
        let mut y = MARGIN;
        for node in &self.boxes {
            let height = HEIGHT + ROW * (node.rows().len() - 1) as f64;
            if let Some(band) = node.band {
                if bands.last().is_none_or(|last| last.0 != band) {
                    bands.push((band, Area::at((0.0, y - MARGIN), TOTAL, 0.0)));
                    y += LABEL;
                }
                bands.last_mut().expect("one was pushed").1.bottom = y + height + MARGIN;
            }
            areas.insert(node.name, Area::at((LEFT, y), WIDTH, height));
            y += height + GAP;
        }
        (areas, bands, y)
    }
}

impl Node<'_> {
    /// The rows of the kind, and an empty row if the shape has no room beside the last.
    fn rows(&self) -> Vec<String> {
        let mut rows = wrapped(&self.kind, INSIDE, |line| width(line, SIZE));
        let last = rows.last().map_or(0.0, |last| width(last, SIZE));
        if rows.is_empty() || last + APART + width(&self.shape, SIZE) > INSIDE {
            rows.push(String::new());
        }
        rows
    }
}

/// A curve between two boxes: on the right with a mark, on the left without.
fn curve(svg: &mut Svg, from: &Area, to: &Area, mark: Option<&str>) {
    let (start, end) = (from.centre().1, to.centre().1);
    let (x, side, dashes) = if mark.is_some() { (LEFT + WIDTH, 1.0, "5 3") } else { (LEFT, -1.0, "") };
    // Longer curves bend further out, so that nested ones stay apart.
    let out = x + side * (24.0 + (end - start) / 5.0).min(MAX_BEND);
    svg.path(&format!("M{x} {start}C{out:.1} {start} {out:.1} {end} {x} {end}"), LINE).dashes(dashes);
    svg.shape(&format!("M{x} {end}l{} -4v8z", 8.0 * side), LINE);
    mark.map(|mark| svg.text((x + 12.0, end + 17.0), mark).fill(LINE));
}
