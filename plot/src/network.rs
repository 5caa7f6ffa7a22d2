//! A network as boxes from top to bottom, in bands.
//!
//! Inputs that are not the box above are curves at the sides: second inputs on the right, others on the left.

use std::collections::BTreeMap;

use crate::svg::{Area, FRAME, GREY, Place, Svg};

/// Left edge, width and height of a box, and the distance from the top of one box to the top of the next.
const LEFT: f64 = 130.0;
const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 44.0;
const PITCH: f64 = 66.0;
/// Space of a band above and below its boxes, and height of its label.
const MARGIN: f64 = 9.0;
const LABEL: f64 = 24.0;
/// Width of a band.
const TOTAL: f64 = 752.0;
/// Largest distance from the boxes to a curve.
const LARGEST_BEND: f64 = 120.0;
const LINE: &str = "#444444";
/// Fill of bands.
const BANDS: [&str; 2] = ["#eef4fb", "#f3f1fa"];
/// Most characters of a name.
const LONGEST: usize = 48;

/// Boxes in an order in which each comes after its inputs.
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
    /// Left part of the second row.
    pub kind: String,
    /// Right part of the second row.
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
        let (tops, bands, height) = self.layout();
        for (band, area) in bands {
            svg.rect(&area, BANDS[band % BANDS.len()]).set("rx", 8);
            svg.text((area.left + 10.0, area.top + 19.0), &self.bands[band]).fill(GREY);
        }
        let mut above = None;
        for node in &self.boxes {
            let top = tops[node.name];
            svg.rect(&Area::at((LEFT, top), WIDTH, HEIGHT), node.fill).set("stroke", FRAME).set("rx", 5);
            svg.text((LEFT + 12.0, top + 18.0), &shortened(node.name)).bold();
            svg.text((LEFT + 12.0, top + 36.0), &node.kind);
            svg.text((LEFT + WIDTH - 12.0, top + 36.0), &node.shape).end();
            if let Some(from) = node.from {
                if above == node.from {
                    let x = LEFT + WIDTH / 2.0;
                    svg.path(&format!("M{x} {}V{top}", tops[from] + HEIGHT), LINE);
                    svg.shape(&format!("M{x} {top}l-4 -8h8z"), LINE);
                } else {
                    curve(svg, tops[from], top, None);
                }
            }
            if let Some((joins, mark)) = node.joins {
                curve(svg, tops[joins], top, Some(mark));
            }
            above = Some(node.name);
        }
        (TOTAL, height)
    }

    /// Tops of the boxes by name, bands with their areas, and the height of all.
    fn layout(&self) -> (BTreeMap<&str, f64>, Vec<(usize, Area)>, f64) {
        let mut tops = BTreeMap::new();
        let mut bands: Vec<(usize, Area)> = Vec::new();
        let mut y = MARGIN;
        for node in &self.boxes {
            if let Some(band) = node.band {
                if bands.last().is_none_or(|last| last.0 != band) {
                    bands.push((band, Area::at((0.0, y - MARGIN), TOTAL, 0.0)));
                    y += LABEL;
                }
                bands.last_mut().expect("one was pushed").1.bottom = y + HEIGHT + MARGIN;
            }
            tops.insert(node.name, y);
            y += PITCH;
        }
        (tops, bands, y)
    }
}

/// A curve between the boxes with these tops: on the right with a mark, on the left without.
fn curve(svg: &mut Svg, from: f64, top: f64, mark: Option<&str>) {
    let (start, end) = (from + HEIGHT / 2.0, top + HEIGHT / 2.0);
    let (x, side, dashes) = if mark.is_some() { (LEFT + WIDTH, 1.0, "5 3") } else { (LEFT, -1.0, "") };
    // Longer curves bend further out, so that nested ones stay apart.
    let out = x + side * (24.0 + (end - start) / 5.0).min(LARGEST_BEND);
    svg.path(&format!("M{x} {start}C{out:.1} {start} {out:.1} {end} {x} {end}"), LINE).dashes(dashes);
    svg.shape(&format!("M{x} {end}l{} -4v8z", 8.0 * side), LINE);
    mark.map(|mark| svg.text((x + 12.0, end - 8.0), mark).fill(LINE));
}

/// A name that fits into its box.
fn shortened(name: &str) -> String {
    if name.chars().count() <= LONGEST {
        return name.to_owned();
    }
    name.chars().take(LONGEST - 1).chain(['\u{2026}']).collect()
}
