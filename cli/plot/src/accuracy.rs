//! Accuracies: lines against time with their intervals, bars by group, and confusion matrices.

use crate::axes::{Axis, Field};
use crate::svg::{Area, FINE_GRID, FRAME, GREY, INK, Place, SHADE, SMALL, Svg, WHITE, colour};
use crate::text::{self, SIZE, heading, legend, shortened, width};

pub(crate) const LINES: Area = Area { left: 62.0, top: 66.0, right: 580.0, bottom: 396.0 };
const COMPACT: Area = Area { right: 396.0, bottom: 286.0, ..LINES };
/// Space from the baseline above a field or grid to it, and from a panel's text to the next panel.
const BELOW: f64 = 8.0;
const APART: f64 = 16.0;
/// Width of the line that is drawn last. Earlier lines are wider by `WIDER`, so that all are
/// visible.
const NARROWEST: f64 = 1.8;
const WIDER: f64 = 1.6;

const BARS: Area = Area { left: 62.0, top: 12.0, right: 880.0, bottom: 312.0 };
/// Share of a group's width that its bars take.
const FILLED: f64 = 0.8;
const WIDEST_BAR: f64 = 60.0;
/// Dashes of the lines for references.
const DASHES: [&str; 2] = ["8 4", "2 3"];

/// Side of a cell of a matrix, and the space for names and titles.
const CELL: f64 = 33.0;
const LEFT: f64 = 46.0;
const TOP: f64 = 66.0;
/// Longest name of a class, in pixels.
const MAX_NAME: f64 = 130.0;

/// Accuracies against time: a line for each curve over a band, its interval.
#[derive(Clone, Debug)]
pub struct Curves {
    /// Bold, above the field.
    pub title: String,
    /// A line below the title.
    pub about: String,
    /// Title of the axis of time, with its unit.
    pub time_title: String,
    /// The times, ascending from 0 or later.
    pub times: Vec<f64>,
    /// The accuracy of guessing, from 0 to 1.
    pub chance: f64,
    /// Whether the panel is small, for a page.
    pub compact: bool,
    /// In the order in which they are drawn.
    pub curves: Vec<AccuracyCurve>,
}

/// One line of [`Curves`]. Accuracies are from 0 to 1, one for each time.
#[derive(Clone, Debug)]
pub struct AccuracyCurve {
    /// Text of the legend.
    pub name: String,
    /// Number of its colour, from 0. Six colours repeat.
    pub colour: usize,
    /// Accuracy at each time.
    pub accuracy: Vec<f64>,
    /// Both ends of the interval at each time.
    pub interval: Vec<(f64, f64)>,
}

impl Curves {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        let area = if self.compact { COMPACT } else { LINES };
        let width = area.right + 40.0;
        let about = heading(svg, &self.title, &self.about, width - APART);
        let names = self.curves.iter().map(|curve| curve.name.as_str());
        let last = legend(svg, (area.left, area.right), about, names, |svg, i, (x, y)| {
            svg.rect(&Area::at((x, y - 6.0), 16.0, 4.0), colour(self.curves[i].colour));
        });
        // A longer heading moves the field down.
        let down = (last + BELOW - area.top).max(0.0);
        let mut part = Svg::default();
        self.draw_field(&mut part, area);
        svg.group((0.0, down), &part);
        (width, area.bottom + 50.0 + down)
    }

    fn draw_field(&self, svg: &mut Svg, area: Area) {
        let last = self.times.last().copied().filter(|&last| last > 0.0).unwrap_or(1.0);
        let field = percent_field(area, (0.0, last));
        field.draw(svg, &self.time_title, "accuracy (%)");
        let chance = field.y.place(100.0 * self.chance);
        svg.line((area.left, chance), (area.right, chance), FRAME).dashes("2 3");
        svg.text((area.right - 4.0, chance - 5.0), "chance").end().size(SMALL).fill(GREY);
        let at = |(&time, share): (&f64, f64)| field.place(time, 100.0 * share);
        // All lines are above all bands, so that each line can be followed where lines meet.
        for curve in &self.curves {
            let high = self.times.iter().zip(curve.interval.iter().map(|interval| interval.1)).map(at);
            let low = self.times.iter().zip(curve.interval.iter().map(|interval| interval.0)).map(at);
            svg.polygon(high.chain(low.rev()), colour(curve.colour)).set("fill-opacity", 0.15);
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let places = self.times.iter().zip(curve.accuracy.iter().copied()).map(at);
            let width = NARROWEST + WIDER * (self.curves.len() - 1 - i) as f64;
            svg.polyline(places, colour(curve.colour)).width(width);
        }
    }
}

/// Accuracies as bars: a group for each set of data, a bar for each series, dashed references.
#[derive(Clone, Debug)]
pub struct Bars {
    /// Names of the groups.
    pub groups: Vec<String>,
    /// Name and accuracies of each series, one for each group.
    pub series: Vec<(String, Vec<Option<Bar>>)>,
    /// Name and accuracies of each reference, one for each group.
    pub references: Vec<(String, Vec<Option<f64>>)>,
    /// Title of the axis, with its unit: `accuracy (%)`.
    pub y_title: String,
    /// A note below the legend.
    pub note: String,
}

/// An accuracy from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct Bar {
    /// Mean over trainings.
    pub mean: f64,
    /// Standard deviation over trainings.
    pub std: Option<f64>,
}

impl Bars {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        let field = percent_field(BARS, (0.0, self.groups.len().max(1) as f64));
        let y = |share: f64| field.y.place(100.0 * share);
        field.draw(svg, "", &self.y_title);
        let group = BARS.width() / self.groups.len().max(1) as f64;
        let width = (group * FILLED / self.series.len().max(1) as f64).min(WIDEST_BAR);
        for (g, name) in self.groups.iter().enumerate() {
            let middle = field.x.place(g as f64 + 0.5);
            svg.text((middle, BARS.bottom + 20.0), name).middle();
            let first = middle - width * (self.series.len() as f64 - 1.0) / 2.0;
            let bars = self.series.iter().enumerate().filter_map(|(i, (_, accuracies))| {
                let Bar { mean, std } = accuracies[g]?;
                Some((i, first + width * i as f64, mean, std))
            });
            // Numbers are above lines and lines above bars, so that each can be read.
            for (i, x, mean, std) in bars.clone() {
                let bar = Area {
                    left: x - 0.43 * width,
                    top: y(mean),
                    right: x + 0.43 * width,
                    bottom: BARS.bottom,
                };
                svg.rect(&bar, colour(i));
                if let Some(std) = std {
                    svg.error_bar(x, (y(mean - std), y(mean + std)), INK);
                }
            }
            let reach = group * (FILLED + 0.12) / 2.0;
            for ((_, accuracies), dashes) in self.references.iter().zip(DASHES.iter().cycle()) {
                let Some(accuracy) = accuracies[g].map(y) else { continue };
                svg.line((middle - reach, accuracy), (middle + reach, accuracy), INK)
                    .width(1.6)
                    .dashes(dashes);
            }
            for (_, x, mean, std) in bars {
                let (at, number) = ((x, y(mean + std.unwrap_or(0.0)) - 5.0), format!("{:.1}", 100.0 * mean));
                // A narrow bar has a small number.
                let size = 11.0 * (0.95 * width / text::width(&number, 11.0)).clamp(0.5, 1.0);
                // White around the number, where a line crosses it.
                svg.text(at, &number).middle().size(size).set("stroke", WHITE).width(3.0);
                svg.text(at, &number).middle().size(size);
            }
        }
        let (left, mut y) = (BARS.right + 24.0, BARS.top + 12.0);
        for (i, (name, _)) in self.series.iter().enumerate() {
            svg.rect(&Area::at((left, y - 11.0), 24.0, 13.0), colour(i));
            svg.text((left + 32.0, y), name);
            y += 22.0;
        }
        for ((name, _), dashes) in self.references.iter().zip(DASHES.iter().cycle()) {
            svg.key((left, y), name, INK, dashes);
            y += 22.0;
        }
        svg.text((left, y + 4.0), &self.note).size(SMALL).fill(GREY);
        let names =
            self.series.iter().map(|(name, _)| name).chain(self.references.iter().map(|(name, _)| name));
        let names = names.map(|name| 32.0 + text::width(name, SIZE)).chain([text::width(&self.note, SMALL)]);
        (left + names.fold(320.0, f64::max), y.max(BARS.bottom + 44.0) + 18.0)
    }
}

/// How often each true class was predicted as each class.
#[derive(Clone, Debug)]
pub struct Matrix<'a> {
    /// Bold, above the grid.
    pub title: String,
    /// A line below the title.
    pub about: String,
    /// Short names of the classes.
    pub classes: &'a [&'a str],
    /// A row for each true class, a column for each predicted class.
    pub counts: Vec<Vec<u64>>,
}

impl Matrix<'_> {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        let names = self.classes.iter().map(|class| width(class, SIZE));
        let widest = names.fold(0.0, f64::max).min(MAX_NAME);
        let (left, above) = (LEFT.max(widest + 26.0), (widest - CELL).max(0.0));
        // Names that are wider than a column run upwards.
        let is_upright = widest > LEFT;
        let top = if is_upright { TOP + above } else { TOP };
        let side = CELL * self.classes.len() as f64;
        let grid = Area::at((left, top), side, side);
        let panel = grid.right + 26.0;
        let about = heading(svg, &self.title, &self.about, panel - APART);
        // A longer heading moves the grid with its names down.
        let down = (about + BELOW + 20.0 - TOP).max(0.0);
        let mut part = Svg::default();
        self.draw_grid(&mut part, &grid, is_upright);
        svg.group((0.0, down), &part);
        (panel, grid.bottom + 34.0 + down)
    }

    fn draw_grid(&self, svg: &mut Svg, grid: &Area, is_upright: bool) {
        svg.text_upwards((10.0, grid.centre().1), "true").size(SMALL).fill(GREY);
        svg.text((grid.centre().0, grid.bottom + 16.0), "predicted").middle().size(SMALL).fill(GREY);
        for (i, class) in self.classes.iter().enumerate() {
            let middle = (i as f64 + 0.5) * CELL;
            let class = shortened(class, MAX_NAME, |name| width(name, SIZE));
            if is_upright {
                let place = (grid.left + middle + 4.5, grid.top - 7.0 - width(&class, SIZE) / 2.0);
                svg.text_upwards(place, &class);
            } else {
                svg.text((grid.left + middle, grid.top - 7.0), &class).middle();
            }
            svg.text((grid.left - 7.0, grid.top + middle + 4.5), &class).end();
        }
        for (row, counts) in self.counts.iter().enumerate() {
            let sum: u64 = counts.iter().sum();
            for (column, &count) in counts.iter().enumerate() {
                let corner = (grid.left + CELL * column as f64, grid.top + CELL * row as f64);
                // A class that was never true has a grey row without numbers.
                let share = (sum > 0).then(|| count as f64 / sum as f64);
                let cell = Area::at(corner, CELL, CELL);
                match share {
                    Some(share) => svg.rect(&cell, SHADE).set("fill-opacity", strength(share)),
                    None => svg.rect(&cell, FINE_GRID),
                };
                svg.rect(&cell, "none").set("stroke", WHITE);
                if let Some(share) = share.filter(|&share| share > 0.0) {
                    let number =
                        if share < 0.005 { "<0.5".to_owned() } else { format!("{:.0}", 100.0 * share) };
                    let ink = if share >= 0.5 { WHITE } else { INK };
                    let place = (corner.0 + CELL / 2.0, corner.1 + CELL / 2.0 + 4.0);
                    svg.text(place, &number).middle().size(11.0).fill(ink);
                }
            }
        }
        svg.rect(grid, "none").set("stroke", FRAME);
    }
}

/// Opacity of a cell, from 0 to 1. The square root makes rare confusions visible. The step at one
/// half keeps numbers readable: dark ones on light cells, light ones on dark cells.
pub(crate) fn strength(share: f64) -> f64 {
    let strength = if share < 0.5 { 0.75 * share.max(0.0).sqrt() } else { 0.44 + 0.56 * share.min(1.0) };
    (strength * 1e3).round() / 1e3
}

/// A field whose y axis has all percentages.
fn percent_field(area: Area, x: (f64, f64)) -> Field {
    let (x, y) =
        (Axis::linear(x, (area.left, area.right)), Axis::linear((0.0, 100.0), (area.bottom, area.top)));
    Field { area, x, y }
}
