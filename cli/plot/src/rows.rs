//! Rows with names: bars of parts from left to right, and quantiles on a logarithmic axis.

use crate::axes::{Axis, Field, decades, widened};
use crate::svg::{Area, FRAME, INK, ON_DARK, ON_LIGHT, Place, SMALL, Svg, WHITE, colour};
use crate::text::{heading, legend, shortened, width};

const RIGHT: f64 = 400.0;
const TOTAL: f64 = 440.0;
/// Widest column of names, and the space between a name and its row.
const MAX_NAMES: f64 = 150.0;
const APART: f64 = 10.0;
/// Height of a row, and of its bar.
const ROW: f64 = 24.0;
const BAR: f64 = 15.0;
const BELOW: f64 = 10.0;
/// Minimum width of a part with its number inside.
const MIN_NUMBER: f64 = 34.0;
/// A part with a value is at least this wide.
const MIN_PART: f64 = 1.5;
const RADIUS: f64 = 4.5;

/// Bars that are divided into parts, one a row.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Bold, above the rows.
    pub title: String,
    /// A line below the title.
    pub about: String,
    /// Names of the parts with the numbers of their colours, in the order in which they are drawn.
    pub parts: Vec<(String, usize)>,
    /// Title of the axis, with its unit.
    pub x_title: String,
    /// Whether each bar has the whole width, and its parts are percentages.
    pub shares: bool,
    /// Name and parts of each row. Parts are at least 0; others count as 0.
    pub rows: Vec<(String, Vec<f64>)>,
}

/// Quantiles of times, one distribution a row.
#[derive(Clone, Debug)]
pub struct Quantiles {
    /// Bold, above the rows.
    pub title: String,
    /// A line below the title.
    pub about: String,
    /// Title of the logarithmic axis, with its unit.
    pub x_title: String,
    /// Names of the quantiles, ascending: at most five.
    pub quantiles: Vec<&'static str>,
    /// Name and quantiles of each row.
    pub rows: Vec<(String, Vec<f64>)>,
}

/// The field of `rows` below the baseline `above`, with the names of the rows to its left.
fn area(svg: &mut Svg, names: &[&str], above: f64) -> Area {
    let widest = names.iter().map(|name| width(name, SMALL)).fold(0.0, f64::max).min(MAX_NAMES);
    let left = widest + APART;
    let height = ROW * names.len() as f64 + 6.0;
    let area = Area::at((left, above + BELOW), RIGHT - left, height);
    for (i, name) in names.iter().enumerate() {
        let name = shortened(name, MAX_NAMES, |name| width(name, SMALL));
        svg.text((left - APART + 2.0, middle(&area, i) + 4.0), &name).end().size(SMALL);
    }
    area
}

/// The middle of a row.
fn middle(area: &Area, row: usize) -> f64 {
    area.top + 3.0 + ROW * (row as f64 + 0.5)
}

/// The names of rows.
fn names(rows: &[(String, Vec<f64>)]) -> Vec<&str> {
    rows.iter().map(|(name, _)| name.as_str()).collect()
}

impl Parts {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        let mut above = heading(svg, &self.title, &self.about, RIGHT);
        if self.parts.len() > 1 {
            let parts = self.parts.iter().map(|(name, _)| name.as_str());
            above = legend(svg, (0.0, RIGHT), above, parts, |svg, i, (x, y)| {
                svg.rect(&Area::at((x, y - 9.0), 14.0, 10.0), colour(self.parts[i].1));
            });
        }
        let area = area(svg, &names(&self.rows), above);
        let valid = |value: f64| if value.is_finite() { value.max(0.0) } else { 0.0 };
        let sum = |parts: &[f64]| parts.iter().map(|&value| valid(value)).sum::<f64>();
        let most = self.rows.iter().map(|(_, parts)| sum(parts)).fold(0.0, f64::max);
        let end = if self.shares { 100.0 } else { most.max(f64::MIN_POSITIVE) * 1.02 };
        let x = Axis::linear((0.0, end), (area.left, area.right));
        let y = Axis::linear((0.0, 1.0), (area.bottom, area.top));
        let field = Field { area, x, y };
        field.draw_across(svg, &self.x_title);
        for (row, (_, parts)) in self.rows.iter().enumerate() {
            let whole = sum(parts);
            let scale = if self.shares { 100.0 / whole.max(f64::MIN_POSITIVE) } else { 1.0 };
            let (mut until, top) = (0.0, middle(&area, row) - BAR / 2.0);
            for (i, value) in parts.iter().map(|&value| valid(value)).enumerate() {
                if value == 0.0 {
                    continue;
                }
                let (left, right) = (field.x.place(until * scale), field.x.place((until + value) * scale));
                until += value;
                // A rare part is visible, and stays inside.
                let left = left.min(area.right - MIN_PART);
                let right = right.max(left + MIN_PART);
                let part = self.parts.get(i).map_or(i, |part| part.1);
                svg.rect(&Area { left, top, right, bottom: top + BAR }, colour(part));
                let share = 100.0 * value / whole;
                if self.shares && right - left >= MIN_NUMBER && (share * 10.0).round() < 1000.0 {
                    let ink = Self::ink(part);
                    let place = (f64::midpoint(left, right), top + BAR - 3.5);
                    svg.text(place, &format!("{share:.1}")).middle().size(11.0).fill(ink);
                }
            }
        }
        (TOTAL, area.bottom + 50.0)
    }

    /// The ink of numbers on a part.
    fn ink(part: usize) -> &'static str {
        // Blue and magenta are dark, the other colours are light.
        if matches!(part % 6, 0 | 3) { ON_DARK } else { ON_LIGHT }
    }
}

impl Quantiles {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        let above = heading(svg, &self.title, &self.about, RIGHT);
        let quantiles = self.quantiles.iter().copied();
        let above = legend(svg, (0.0, RIGHT), above, quantiles, |svg, i, (x, y)| {
            mark(svg, i, (x + 9.0, y - 4.0), 0);
        });
        let area = area(svg, &names(&self.rows), above);
        let all = || self.rows.iter().flat_map(|(_, quantiles)| quantiles).copied();
        let positive = || all().filter(|&value| value > 0.0);
        let (low, high) = decades(positive(), (0.0, 3.0));
        let (least, most) = widened(positive().map(f64::log10), 0.5);
        let powers = (least.max(low), most.min(high));
        let x = Axis::logarithmic(powers, (area.left, area.right));
        let y = Axis::linear((0.0, 1.0), (area.bottom, area.top));
        let field = Field { area, x, y };
        field.draw_across(svg, &self.x_title);
        for (row, (_, quantiles)) in self.rows.iter().enumerate() {
            let y = middle(&area, row);
            let place = |value: &f64| field.x.place(*value);
            if let (Some(first), Some(last)) = (quantiles.first(), quantiles.last()) {
                svg.line((place(first), y), (place(last), y), FRAME).width(1.6);
            }
            for (i, value) in quantiles.iter().enumerate().rev() {
                mark(svg, i, (place(value), y), row);
            }
        }
        (TOTAL, area.bottom + 50.0)
    }
}

/// Draws the mark of a quantile: a disc for the first, then ever lighter ones; a cross for the last
/// of five.
fn mark(svg: &mut Svg, quantile: usize, (x, y): Place, row: usize) {
    let colour = colour(row);
    let r = RADIUS;
    match quantile {
        0 => svg.circle((x, y), r + 1.0, colour),
        1 => svg.line((x, y - r), (x, y + r), INK).width(2.0),
        2 => svg.shape(&format!("M{x:.1} {:.1}l{r} {r}l-{r} {r}l-{r} -{r}z", y - r), INK),
        3 => svg
            .shape(&format!("M{x:.1} {:.1}l{r} {}h-{}z", y - r, 2.0 * r, 2.0 * r), WHITE)
            .set("stroke", INK),
        _ => {
            let d = 2.0 * r;
            svg.path(&format!("M{:.1} {:.1}l{d} {d}m0 -{d}l-{d} {d}", x - r, y - r), INK).width(1.4)
        }
    };
}
