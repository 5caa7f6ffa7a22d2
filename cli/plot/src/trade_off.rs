//! Run time against error: a point for each setting of each network, and lines on the front.
//!
//! A network has a colour, a shape and a size. Points on the front are filled, others hollow.
//! Networks are drawn from the largest shape to the smallest, so that every colour is visible where
//! points meet. Labels keep off points, lines and error bars.

use crate::axes::{Axis, Field, ends, widened};
use crate::labels;
use crate::svg::{Area, Element, FRAME, GREY, Place, SMALL, Svg, WHITE, colour};
use crate::text::{legend, width};

const FIELD: Area = Area { left: 84.0, top: 30.0, right: 1124.0, bottom: 558.0 };
/// Font size of labels.
const LABEL: f64 = 12.0;
/// Radius of a point's shape: for the first network, and for the last of several.
const REACH: (f64, f64) = (6.5, 3.5);
/// A label that is farther than this from its point has a line to it.
const NEAR: f64 = 9.0;
/// Height of a line of the key, and its number of columns.
const KEY_LINE: f64 = 16.0;
const KEY_COLUMNS: usize = 2;
/// A linear axis is used up to this ratio of the largest to the smallest error.
const MAX_LINEAR: f64 = 10.0;

/// Settings of networks by run time and error; smaller is better for both.
#[derive(Clone, Debug)]
pub struct TradeOff {
    /// Title of the logarithmic axis of times, with its unit.
    pub time_title: String,
    /// Title of the axis of errors, with its unit.
    pub error_title: String,
    /// A note beside the title of the axis of errors.
    pub about: String,
    /// The kind of the errors.
    pub errors: Errors,
    /// Names of the networks.
    pub networks: Vec<String>,
    /// The settings of all networks.
    pub points: Vec<Setting>,
}

/// The kind of errors, which determines their axis and the fronts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Errors {
    /// Percentages: the axis is linear or logarithmic by range, and networks share one front.
    Percentages,
    /// Quantities in one unit, such as forces: the same, without a maximum value.
    Quantities,
    /// Differences from the exact outputs of each network: the axis is logarithmic with a place for
    /// 0, and each network has its own front.
    Differences,
}

/// A point of a [`TradeOff`].
#[derive(Clone, Debug)]
pub struct Setting {
    /// Index of its network.
    pub network: usize,
    /// Run time, at least 0.
    pub time: f64,
    /// Error, at least 0.
    pub error: f64,
    /// Both ends of the error bar.
    pub interval: Option<(f64, f64)>,
    /// Whether it is on the front: no other is better in one respect and as good in the other.
    pub on_front: bool,
    /// Text beside the point. If there is not room for all texts, they become numbers with a key
    /// below.
    pub label: Option<String>,
    /// Text that a browser shows while the pointer is over the point.
    pub tooltip: String,
}

impl TradeOff {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        // A legend of several rows moves the field down.
        let down = (self.legend(svg) + 18.0 - FIELD.top).max(0.0);
        let mut part = Svg::default();
        let (width, height) = self.draw_field(&mut part);
        svg.group((0.0, down), &part);
        (width, height + down)
    }

    fn draw_field(&self, svg: &mut Svg) -> Place {
        let field = self.field();
        let place = |point: &Setting| field.place(point.time, point.error);
        field.draw(svg, &self.time_title, &self.error_title);
        svg.text_upwards((27.0, FIELD.centre().1), &self.about).size(SMALL).fill(GREY);
        // Labels must not cover these areas.
        let mut obstacles = Vec::new();
        for (corners, stroke) in self.fronts(place) {
            obstacles.extend(corners.windows(2).map(|ends| Area::spanning(ends[0], ends[1], 1.0)));
            svg.polyline(corners.into_iter(), stroke).width(1.6).set("stroke-opacity", 0.8);
        }
        for point in &self.points {
            let Some((low, high)) = point.interval else { continue };
            let (x, low, high) = (place(point).0, field.y.place(low), field.y.place(high));
            obstacles.push(Area { left: x - 3.0, top: high, right: x + 3.0, bottom: low });
            let opacity = if point.on_front { 0.7 } else { 0.2 };
            svg.error_bar(x, (low, high), colour(point.network)).set("stroke-opacity", opacity);
        }
        let mut points: Vec<&Setting> = self.points.iter().collect();
        points.sort_by_key(|point| (point.network, point.on_front));
        for point in points {
            let reach = self.reach(point.network);
            obstacles.push(Area::spanning(place(point), place(point), reach + 1.0));
            shape(svg, point.network, reach, place(point), point.on_front).tooltip(&point.tooltip);
        }
        let mut named: Vec<(Place, &str)> =
            self.points.iter().filter_map(|point| Some((place(point), point.label.as_deref()?))).collect();
        named.sort_by(|a, b| a.0.0.total_cmp(&b.0.0));
        (FIELD.right + 8.0, FIELD.bottom + 56.0 + write_labels(svg, &named, &obstacles))
    }

    /// A field that contains all points and error bars.
    fn field(&self) -> Field {
        let times = self.points.iter().map(|point| point.time.max(1e-6).log10());
        let errors = || {
            self.points.iter().flat_map(|point| {
                let (low, high) = point.interval.unwrap_or((point.error, point.error));
                [point.error, low, high]
            })
        };
        let pixels = (FIELD.bottom, FIELD.top);
        let is_wide = || ends(errors()).is_some_and(|(least, most)| least > 0.0 && most > MAX_LINEAR * least);
        // The maximum value, and the shortest linear axis: 2 points or a tenth of it.
        let (most, least) = match self.errors {
            Errors::Percentages => (100.0, 2.0),
            Errors::Quantities | Errors::Differences => {
                (f64::INFINITY, ends(errors()).map_or(1.0, |(_, most)| most / 10.0).max(1e-6))
            }
        };
        let y = if self.errors == Errors::Differences {
            Axis::logarithmic(widened(errors().map(f64::log10), 1.0), pixels).with_zero()
        } else if is_wide() {
            let (low, high) = widened(errors().map(f64::log10), 0.5);
            Axis::logarithmic((low, high.min(most.log10())), pixels)
        } else {
            let (low, high) = widened(errors(), least);
            Axis::linear((low.max(0.0), high.min(most)), pixels)
        };
        Field { area: FIELD, x: Axis::logarithmic(widened(times, 0.5), (FIELD.left, FIELD.right)), y }
    }

    /// Draws the names of the networks and a note. Returns the baseline of the last row.
    fn legend(&self, svg: &mut Svg) -> f64 {
        let names = self.networks.iter().map(String::as_str);
        let sides = (FIELD.left + 6.0, FIELD.right);
        let last = legend(svg, sides, -5.0, names, |svg, network, (x, y)| {
            shape(svg, network, f64::midpoint(REACH.0, REACH.1), (x + 8.0, y - 4.0), true);
        });
        let about = "filled and named: on the front, nothing is faster without more error";
        let entry = |name: &String| 39.0 + width(name, SMALL);
        let named = self.networks.iter().map(entry).sum::<f64>();
        let shares = named + width(about, SMALL) <= FIELD.width() && last <= 12.0;
        let y = if shares { last } else { last + 16.0 };
        svg.text((FIELD.right, y), about).end().size(SMALL).fill(GREY);
        y
    }

    /// Distance from the centre to the border of the shape of a network.
    fn reach(&self, network: usize) -> f64 {
        let (first, last) = REACH;
        match self.networks.len() {
            0 | 1 => f64::midpoint(first, last),
            networks => first - (first - last) * network as f64 / (networks - 1) as f64,
        }
    }

    /// Corners and colour of the step lines through the points on the fronts. Up to the time of the
    /// next point, the one before it is the best.
    fn fronts(&self, place: impl Fn(&Setting) -> Place) -> Vec<(Vec<Place>, &'static str)> {
        let corners = |network: Option<usize>| {
            let on_front = |point: &&Setting| point.on_front && network.is_none_or(|of| of == point.network);
            let mut places: Vec<Place> = self.points.iter().filter(on_front).map(&place).collect();
            places.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
            let before = |i: usize| places[i.saturating_sub(1)].1;
            (0..places.len()).flat_map(|i| [(places[i].0, before(i)), places[i]]).collect()
        };
        if self.errors == Errors::Differences {
            (0..self.networks.len()).map(|network| (corners(Some(network)), colour(network))).collect()
        } else {
            vec![(corners(None), FRAME)]
        }
    }
}

/// Draws the shape of a network.
fn shape(svg: &mut Svg, network: usize, r: f64, (x, y): Place, filled: bool) -> &mut Element {
    let d = 2.0 * r;
    let path = match network % 5 {
        0 => format!("M{:.1} {y:.1}a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0z", x - r),
        1 => format!("M{:.1} {:.1}h{d}v{d}h-{d}z", x - r, y - r),
        2 => format!("M{x:.1} {:.1}l{r} {d}h-{d}z", y - r),
        3 => format!("M{x:.1} {:.1}l{r} {r}l-{r} {r}l-{r} -{r}z", y - r),
        _ => format!("M{x:.1} {:.1}l{r} -{d}h-{d}z", y + r),
    };
    let colour = colour(network);
    let fill = if filled { colour } else { WHITE };
    svg.shape(&path, fill).set("fill-opacity", 0.85).set("stroke", colour).width(1.3)
}

/// Writes the labels of points, or numbers and a key if there is no room. Returns the key's height.
fn write_labels(svg: &mut Svg, named: &[(Place, &str)], obstacles: &[Area]) -> f64 {
    let placed = |texts: &[String]| {
        let wanted = named.iter().zip(texts).map(|(&(at, _), text)| (at, width(text, LABEL) + 4.0));
        let wanted: Vec<_> = wanted.collect();
        labels::place(&wanted, obstacles, &FIELD)
    };
    let mut texts: Vec<String> = named.iter().map(|(_, label)| (*label).to_owned()).collect();
    let mut areas = placed(&texts);
    let numbered = areas.iter().any(Option::is_none);
    if numbered {
        texts = (1..=named.len()).map(|i| i.to_string()).collect();
        areas = placed(&texts);
    }
    for ((&(at, _), text), area) in named.iter().zip(&texts).zip(areas) {
        let Some(area) = area else { continue };
        let near = area.nearest(at);
        if (near.0 - at.0).hypot(near.1 - at.1) > NEAR {
            svg.line(at, near, "#999999").width(0.8);
        }
        // Grid lines must not mix with a label.
        svg.rect(&area, WHITE).set("fill-opacity", 0.8);
        svg.text((area.centre().0, area.bottom - 3.5), text).middle().size(LABEL);
    }
    if !numbered {
        return 0.0;
    }
    let rows = named.len().div_ceil(KEY_COLUMNS);
    for (i, ((_, label), number)) in named.iter().zip(&texts).enumerate() {
        let x = FIELD.left + FIELD.width() / KEY_COLUMNS as f64 * (i / rows) as f64;
        let y = FIELD.bottom + 64.0 + KEY_LINE * (i % rows) as f64;
        svg.text((x + 14.0, y), number).end().size(SMALL).bold();
        svg.text((x + 22.0, y), label).size(SMALL);
    }
    KEY_LINE * rows as f64 + 8.0
}

#[cfg(test)]
mod tests;
