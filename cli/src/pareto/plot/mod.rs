//! The results as a drawing: time against error, every setting a point, the front a line with its points named.
//!
//! A network has a colour, a shape and a size. Points on the front are filled and named, and the exact ones are named
//! wherever they are; others are hollow, and have their name as a title that a viewer shows. Networks are drawn from the
//! largest shape to the smallest: where points meet, every colour is seen. Names keep off points, steps and error bars.

mod axes;
mod labels;
#[cfg(test)]
mod tests;

use std::fmt::{self, Write};

use super::measurement::EXACT;
use super::report::{Compared, NetworkReport, Report, SettingReport};
use crate::svg::{self, COLOURS};
use axes::{Axes, FIELD};
use labels::Area;
use meissner_pipeline::text::grouped;

/// Size of the drawing.
const SIZE: (f64, f64) = (1180.0, 704.0);
/// Width of a character of a label, with some room.
const CHARACTER: f64 = 7.0;
/// Reach of a point's shape: that of the first network, and that of the last of several.
const REACH: (f64, f64) = (6.5, 3.5);
/// Half of the width of an error bar.
const CAP: f64 = 3.0;
/// A label that is farther than this from its point has a line to it.
const NEAR: f64 = 9.0;

/// Height of a line of the key, and names beside each other in it.
const KEY_LINE: f64 = 16.0;
const KEY_COLUMNS: usize = 2;

/// A setting in the drawing.
struct Point<'a> {
    /// Of its network.
    network: usize,
    setting: &'a SettingReport,
    at: (f64, f64),
}

/// The drawing, as a file of its own.
pub(super) fn svg(report: &Report) -> String {
    let mut svg = String::new();
    draw(&mut svg, report).expect("writing to a string does not fail");
    svg
}

fn draw(svg: &mut String, report: &Report) -> fmt::Result {
    let data = &report.data;
    let name = data.name.trim_end_matches(['/', '\\']);
    let about = format!(
        "{}: {} {}s, {} timed, {} repeats by turns with the exact network, one thread, {} kernels",
        name.rsplit(['/', '\\']).next().unwrap_or(name),
        grouped(data.size),
        report.unit,
        grouped(data.timed),
        report.repeats,
        report.isa
    );
    let axes = Axes::around(report);
    let points = points(report, &axes);
    let fronts = fronts(report, &points);
    let names = Names::new(report, &points, &fronts, &axes);
    let size = (SIZE.0, SIZE.1 + names.key_height());
    svg::head(svg, size, FIELD.left, &format!("Run time against error: {}", report.system), &about)?;
    legend(svg, &report.networks)?;
    axes.write(svg, report)?;
    for (places, colour) in &fronts {
        line(svg, places, colour)?;
    }
    for point in &points {
        interval(svg, point, &axes)?;
    }
    for network in 0..report.networks.len() {
        for on_front in [false, true] {
            let of = |point: &&Point<'_>| point.network == network && point.setting.on_front == on_front;
            points.iter().filter(of).try_for_each(|point| marker(svg, point, report))?;
        }
    }
    names.write(svg)?;
    writeln!(svg, "</svg>")
}

fn points<'a>(report: &'a Report, axes: &Axes) -> Vec<Point<'a>> {
    let of = |(network, report): (usize, &'a NetworkReport)| {
        let point = move |setting: &'a SettingReport| Point {
            network,
            setting,
            at: (axes.x(setting.us), axes.y(setting.error)),
        };
        report.settings.iter().map(point).collect::<Vec<_>>()
    };
    report.networks.iter().enumerate().flat_map(of).collect()
}

/// Reach of the shape of the network at this place among so many.
fn reach(network: usize, networks: usize) -> f64 {
    let (first, last) = REACH;
    match networks {
        0 | 1 => f64::midpoint(first, last),
        _ => first - (first - last) * network as f64 / (networks - 1) as f64,
    }
}

fn colour(network: usize) -> &'static str {
    COLOURS[network % COLOURS.len()]
}

fn legend(svg: &mut String, networks: &[NetworkReport]) -> fmt::Result {
    const Y: f64 = 86.0;
    let mut x = FIELD.left + 6.0;
    for (place, network) in networks.iter().enumerate() {
        let name = svg::escaped(&network.network);
        shape(svg, place, reach(place, networks.len()), (x, Y - 4.5), "", true)?;
        writeln!(svg, "<text x=\"{:.1}\" y=\"{Y}\">{name}</text>", x + 11.0)?;
        x += 36.0 + 7.5 * network.network.chars().count() as f64;
    }
    writeln!(
        svg,
        "<text x=\"{}\" y=\"{Y}\" text-anchor=\"end\" fill=\"#555555\">filled and named: on the front, nothing is \
         faster without more error</text>",
        FIELD.right
    )
}

/// Corners of a step line, and its colour.
type FilteredEngine = (Vec<(f64, f64)>, &'static str);

/// The step lines through the points on the fronts: until the next one is affordable, the one before it is the best. The
/// front of one network has its colour, one over all is grey.
fn fronts(report: &Report, points: &[Point<'_>]) -> Vec<FilteredEngine> {
    let corners = |of: &dyn Fn(&Point<'_>) -> bool| {
        let on_front = points.iter().filter(|point| point.setting.on_front && of(point));
        let mut places: Vec<(f64, f64)> = on_front.map(|point| point.at).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
        let before = |i: usize| places[i.saturating_sub(1)].1;
        (0..places.len()).flat_map(|i| [(places[i].0, before(i)), places[i]]).collect()
    };
    match report.compared {
        Compared::TaskError => vec![(corners(&|_| true), "#777777")],
        Compared::RelativeRms => (0..report.networks.len())
            .map(|network| (corners(&|point| point.network == network), colour(network)))
            .collect(),
    }
}

fn line(svg: &mut String, places: &[(f64, f64)], colour: &str) -> fmt::Result {
    let points: Vec<String> = places.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\" stroke-opacity=\"0.8\"/>",
        points.join(" ")
    )
}

/// What the error bar of a point covers.
fn bar(point: &Point<'_>, axes: &Axes) -> Option<Area> {
    let (low, high) = point.setting.interval_95?;
    let x = point.at.0;
    Some(Area { left: x - CAP, top: axes.y(high), right: x + CAP, bottom: axes.y(low) })
}

fn interval(svg: &mut String, point: &Point<'_>, axes: &Axes) -> fmt::Result {
    let Some(Area { left, top, bottom, .. }) = bar(point, axes) else { return Ok(()) };
    let opacity = if point.setting.on_front { "0.7" } else { "0.2" };
    writeln!(
        svg,
        "<path d=\"M{left:.1} {top:.1}h6m-3 0V{bottom:.1}m-3 0h6\" fill=\"none\" stroke=\"{}\" stroke-opacity=\"{opacity}\"/>",
        colour(point.network)
    )
}

fn marker(svg: &mut String, point: &Point<'_>, report: &Report) -> fmt::Result {
    let (setting, networks) = (point.setting, &report.networks);
    let title = format!(
        "{}, {}: {} {}, {:.2} times as fast, {} {}",
        networks[point.network].network,
        setting.setting,
        report.time_name(),
        setting.time_text(),
        setting.speed_up,
        report.error_name(),
        setting.error_text(report.compared)
    );
    shape(svg, point.network, reach(point.network, networks.len()), point.at, &title, setting.on_front)
}

/// The shape of a network.
fn shape(
    svg: &mut String,
    network: usize,
    r: f64,
    (x, y): (f64, f64),
    title: &str,
    filled: bool,
) -> fmt::Result {
    let path = match network % 5 {
        0 => format!("M{:.1} {y:.1}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 {} 0z", x - r, 2.0 * r, -2.0 * r),
        1 => format!("M{:.1} {:.1}h{}v{}h{}z", x - r, y - r, 2.0 * r, 2.0 * r, -2.0 * r),
        2 => format!("M{x:.1} {:.1}l{r} {}h{}z", y - r, 2.0 * r, -2.0 * r),
        3 => format!("M{x:.1} {:.1}l{r} {r}l-{r} {r}l-{r} -{r}z", y - r),
        _ => format!("M{x:.1} {:.1}l{r} -{}h{}z", y + r, 2.0 * r, -2.0 * r),
    };
    let fill = if filled { colour(network) } else { "#ffffff" };
    let title =
        if title.is_empty() { String::new() } else { format!("<title>{}</title>", svg::escaped(title)) };
    writeln!(
        svg,
        "<path d=\"{path}\" fill=\"{fill}\" fill-opacity=\"0.85\" stroke=\"{}\" stroke-width=\"1.3\">{title}</path>",
        colour(network)
    )
}

/// The names of the points on the front, and of the exact ones.
struct Names {
    /// Of each name its point, its text, and the box of its label.
    all: Vec<((f64, f64), String, Option<Area>)>,
    /// Whether labels are numbers, and the names stand in a key below the field: there is no room for them in it.
    numbered: bool,
}

impl Names {
    fn new(report: &Report, points: &[Point<'_>], fronts: &[FilteredEngine], axes: &Axes) -> Self {
        let is_named = |point: &&Point<'_>| point.setting.on_front || point.setting.setting == EXACT;
        let mut named: Vec<&Point<'_>> = points.iter().filter(is_named).collect();
        named.sort_by(|a, b| a.at.0.total_cmp(&b.at.0));
        let text = |point: &&Point<'_>| {
            let setting = point.setting;
            let mut text = setting.setting.clone();
            if report.networks.len() > 1 {
                text = format!("{}, {text}", report.networks[point.network].network);
            }
            if setting.interval_95.is_some() {
                text = format!("{text}, {} %", setting.error_text(report.compared));
            }
            text
        };
        let texts: Vec<String> = named.iter().map(text).collect();
        let count = report.networks.len();
        let shapes = points.iter().map(|point| Area::around(point.at, reach(point.network, count) + 1.0));
        let bars = points.iter().filter_map(|point| bar(point, axes));
        let ends = fronts.iter().flat_map(|(places, _)| places.windows(2));
        let steps = ends.map(|ends| Area::between(ends[0], ends[1]));
        let obstacles: Vec<Area> = shapes.chain(bars).chain(steps).collect();
        let place = |width: &dyn Fn(usize) -> f64| {
            let wanted: Vec<_> = named.iter().enumerate().map(|(i, point)| (point.at, width(i))).collect();
            labels::place(&wanted, &obstacles, &FIELD)
        };
        let width = |text: &str| CHARACTER * text.chars().count() as f64 + 4.0;
        let mut placed = place(&|i| width(&texts[i]));
        let numbered = placed.iter().any(Option::is_none);
        if numbered {
            placed = place(&|i| width(&(i + 1).to_string()));
        }
        let places = named.iter().map(|point| point.at);
        Self {
            all: places.zip(texts).zip(placed).map(|((at, text), area)| (at, text, area)).collect(),
            numbered,
        }
    }

    /// Height of the key.
    fn key_height(&self) -> f64 {
        if self.numbered { KEY_LINE * self.all.len().div_ceil(KEY_COLUMNS) as f64 + 8.0 } else { 0.0 }
    }

    fn write(&self, svg: &mut String) -> fmt::Result {
        for (i, (at, text, area)) in self.all.iter().enumerate() {
            let number = (i + 1).to_string();
            if let Some(area) = area {
                label(svg, *at, area, if self.numbered { &number } else { text })?;
            }
            if self.numbered {
                let rows = self.all.len().div_ceil(KEY_COLUMNS);
                let x = FIELD.left + (FIELD.right - FIELD.left) / KEY_COLUMNS as f64 * (i / rows) as f64;
                let y = SIZE.1 + KEY_LINE * (i % rows) as f64;
                writeln!(
                    svg,
                    "<text x=\"{:.1}\" y=\"{y:.1}\" font-size=\"11.5\" text-anchor=\"end\" font-weight=\"bold\">{number}</text>\
                     <text x=\"{:.1}\" y=\"{y:.1}\" font-size=\"11.5\">{}</text>",
                    x + 14.0,
                    x + 22.0,
                    svg::escaped(text)
                )?;
            }
        }
        Ok(())
    }
}

/// A label in its box, with a line to its point where that is not beside it.
fn label(svg: &mut String, (x, y): (f64, f64), area: &Area, text: &str) -> fmt::Result {
    let (near_x, near_y) = area.nearest((x, y));
    if (near_x - x).hypot(near_y - y) > NEAR {
        writeln!(
            svg,
            "<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{near_x:.1}\" y2=\"{near_y:.1}\" stroke=\"#999999\" \
             stroke-width=\"0.8\"/>"
        )?;
    }
    // Lines of the axes may lie below a name, and must not be read with it.
    writeln!(
        svg,
        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"#ffffff\" fill-opacity=\"0.8\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"12\" text-anchor=\"middle\">{}</text>",
        area.left,
        area.top,
        area.right - area.left,
        area.bottom - area.top,
        f64::midpoint(area.left, area.right),
        area.bottom - 3.5,
        svg::escaped(text)
    )
}
