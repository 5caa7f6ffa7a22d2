//! Lines and dots between two axes, such as errors against time.

use crate::axes::{Axis, Field, ends, widened};
use crate::svg::{Area, ORDERED, Place, Svg, WHITE, colour};
use crate::text::{heading, legend};

/// Left and top of the field, below a heading of two lines.
const CORNER: Place = (66.0, 66.0);
/// Width and height of a field, and of a compact one.
pub(crate) const SIZE: Place = (418.0, 330.0);
const COMPACT: Place = (330.0, 210.0);
/// Space from the baseline above a field to it, and from a panel's text to the next panel.
const BELOW: f64 = 8.0;
const APART: f64 = 16.0;
const WIDTH: f64 = 1.8;
const RADIUS: f64 = 1.8;
const MARK: f64 = 3.6;

/// Lines and dots in one field.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Bold, above the field.
    pub title: String,
    /// A line below the title.
    pub about: String,
    /// Title of the horizontal axis, with its unit.
    pub x_title: String,
    /// Title of the vertical axis, with its unit.
    pub y_title: String,
    /// The scale of its axes.
    pub scale: Scale,
    /// Whether the panel is small, for a page.
    pub compact: bool,
    /// Whether the numbers of colours are steps of a quantity: colours then go from dark to light.
    pub ordered: bool,
    /// In the order in which they are drawn.
    pub series: Vec<Series>,
}

/// The axes of a [`Plane`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Linear, over the range of the values.
    Fitting,
    /// Linear; the vertical axis begins at 0.
    FromZero,
    /// Both logarithmic, of values above 0.
    Logarithmic,
}

/// One line of a [`Plane`], or its dots.
#[derive(Clone, Debug)]
pub struct Series {
    /// Text of the legend; no entry if it is empty.
    pub name: String,
    /// Number of its colour, from 0. Six colours repeat; colours of a quantity go from 0 to 5.
    pub colour: usize,
    /// How the points are drawn.
    pub style: Style,
    /// The points. Those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// How a [`Series`] is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Style {
    Line,
    Dashed,
    Dots,
    /// Dots that stand out.
    Marks,
}

impl Series {
    /// The points in a colour and style, with their name.
    pub fn new(name: impl Into<String>, colour: usize, style: Style, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), colour, style, points }
    }
}

impl Plane {
    /// An empty plane with the titles of its axes.
    pub fn new(title: impl Into<String>, [x_title, y_title]: [&str; 2]) -> Self {
        let [x_title, y_title] = [x_title, y_title].map(str::to_owned);
        let (title, about, series) = (title.into(), String::new(), Vec::new());
        Self { title, about, x_title, y_title, scale: Scale::Fitting, compact: false, ordered: false, series }
    }

    /// Predicted over true values in `unit`: `dots` of a true and a predicted value each, on the
    /// dashed line where both are equal.
    pub fn predicted(title: impl Into<String>, unit: &str, dots: Vec<Series>) -> Self {
        let axes = ["true", "predicted"].map(|values| format!("{values} ({unit})"));
        let truth = ends(dots.iter().flat_map(|dots| &dots.points).map(|point| point.0));
        let line = truth.map(|(low, high)| vec![(low, low), (high, high)]);
        let equal = Series::new("equal", 5, Style::Dashed, line.unwrap_or_default());
        let series = std::iter::once(equal).chain(dots).collect();
        Self { series, ..Self::new(title, axes.each_ref().map(String::as_str)) }
    }

    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        let (across, down) = if self.compact { COMPACT } else { SIZE };
        let area = Area::at(CORNER, across, down);
        let width = area.right + 40.0;
        let about = heading(svg, &self.title, &self.about, width - APART);
        let named: Vec<&Series> = self.series.iter().filter(|series| !series.name.is_empty()).collect();
        let names = named.iter().map(|series| series.name.as_str());
        let last = legend(svg, (area.left, area.right), about, names, |svg, i, (x, y)| {
            let (colour, middle) = (self.colour(named[i]), (x + 8.0, y - 4.0));
            match named[i].style {
                Style::Line => svg.line((x, y - 4.0), (x + 16.0, y - 4.0), colour).width(2.6),
                Style::Dashed => svg.line((x, y - 4.0), (x + 16.0, y - 4.0), colour).width(2.6).dashes("4 2"),
                Style::Dots => svg.circle(middle, RADIUS + 0.8, colour),
                Style::Marks => svg.circle(middle, MARK, colour),
            };
        });
        // A longer heading moves the field down; a compact one is close to its heading.
        let down = last + BELOW - area.top;
        let down = if self.compact { down } else { down.max(0.0) };
        let mut part = Svg::default();
        self.draw_field(&mut part, area);
        svg.group((0.0, down), &part);
        (width, area.bottom + 50.0 + down)
    }

    /// The colour of a series.
    fn colour(&self, series: &Series) -> &'static str {
        if self.ordered { ORDERED[series.colour.min(ORDERED.len() - 1)] } else { colour(series.colour) }
    }

    fn draw_field(&self, svg: &mut Svg, area: Area) {
        let points = || self.series.iter().flat_map(|series| series.points.iter());
        let (across, down) = ((area.left, area.right), (area.bottom, area.top));
        let [x, y] = if self.scale == Scale::Logarithmic {
            let x = widened(points().map(|point| point.0.log10()), 0.3);
            let y = widened(points().map(|point| point.1.log10()), 0.3);
            [Axis::logarithmic(x, across), Axis::logarithmic(y, down)]
        } else {
            let (low, high) = widened(points().map(|point| point.1), 0.1);
            let x = Axis::linear(widened(points().map(|point| point.0), 0.1), across);
            [x, Axis::linear((if self.scale == Scale::FromZero { 0.0 } else { low }, high), down)]
        };
        let field = Field { area, x, y };
        field.draw(svg, &self.x_title, &self.y_title);
        for series in &self.series {
            let finite = series.points.iter().filter(|(x, y)| x.is_finite() && y.is_finite());
            let places = finite.map(|&(x, y)| field.place(x, y));
            match series.style {
                Style::Dots => places.for_each(|place| {
                    svg.circle(place, RADIUS, self.colour(series)).set("fill-opacity", 0.5);
                }),
                Style::Marks => places.for_each(|place| {
                    svg.circle(place, MARK, self.colour(series)).set("stroke", WHITE);
                }),
                style @ (Style::Line | Style::Dashed) => {
                    let dashes = if style == Style::Dashed { "6 4" } else { "" };
                    svg.polyline(places, self.colour(series)).width(WIDTH).dashes(dashes);
                }
            }
        }
    }
}
