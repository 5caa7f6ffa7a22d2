//! The results as a drawing: time against error, every setting a point, the front a line with its points named.
//!
//! A network has a colour and a shape. Points on the front are filled and named, and the exact ones are named wherever they
//! are; others are hollow, and have their name as a title that a viewer shows.

mod axes;
mod labels;

use std::fmt::{self, Write};

use super::measurement::EXACT;
use super::report::{Compared, NetworkReport, Report, SettingReport};
use crate::svg::{self, COLOURS};
use crate::text::{grouped, percent};
use axes::{Axes, FIELD};
use labels::Area;

/// Size of the drawing.
const SIZE: (f64, f64) = (1180.0, 704.0);
/// Width of a character of a label, with some room.
const CHARACTER: f64 = 7.0;
/// Reach of a point's shape, and of what labels stay away from.
const REACH: f64 = 5.0;
/// A label that is farther than this from its point has a line to it.
const NEAR: f64 = 9.0;

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
    svg::head(svg, SIZE, FIELD.left, &format!("Run time against error: {}", report.system), &about)?;
    legend(svg, &report.networks)?;
    let axes = Axes::around(report);
    axes.write(svg, report)?;
    let points = points(report, &axes);
    let fronts = fronts(report, &points);
    for (places, colour) in &fronts {
        line(svg, places, colour)?;
    }
    for point in &points {
        interval(svg, point, &axes)?;
    }
    for first in [false, true] {
        for point in points.iter().filter(|point| point.setting.on_front == first) {
            marker(svg, point, &report.networks[point.network].network)?;
        }
    }
    names(svg, report, &points, &fronts)?;
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

fn colour(network: usize) -> &'static str {
    COLOURS[network % COLOURS.len()]
}

fn legend(svg: &mut String, networks: &[NetworkReport]) -> fmt::Result {
    const Y: f64 = 86.0;
    let mut x = FIELD.left + 6.0;
    for (place, network) in networks.iter().enumerate() {
        let name = svg::escaped(&network.network);
        shape(svg, place, (x, Y - 4.5), "", true)?;
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
type Front = (Vec<(f64, f64)>, &'static str);

/// The step lines through the points on the fronts: until the next one is affordable, the one before it is the best. The
/// front of one network has its colour, one over all is grey.
fn fronts(report: &Report, points: &[Point<'_>]) -> Vec<Front> {
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

fn interval(svg: &mut String, point: &Point<'_>, axes: &Axes) -> fmt::Result {
    let Some((low, high)) = point.setting.interval_95 else { return Ok(()) };
    let (x, top, bottom) = (point.at.0, axes.y(high), axes.y(low));
    let opacity = if point.setting.on_front { "0.7" } else { "0.2" };
    writeln!(
        svg,
        "<path d=\"M{:.1} {top:.1}h6m-3 0V{bottom:.1}m-3 0h6\" fill=\"none\" stroke=\"{}\" stroke-opacity=\"{opacity}\"/>",
        x - 3.0,
        colour(point.network)
    )
}

fn marker(svg: &mut String, point: &Point<'_>, network: &str) -> fmt::Result {
    let setting = point.setting;
    let title = format!(
        "{network}, {}: {:.2} us, {:.2} times as fast, error {:.2e}",
        setting.setting, setting.us, setting.speed_up, setting.error
    );
    shape(svg, point.network, point.at, &title, setting.on_front)
}

/// The shape of a network.
fn shape(svg: &mut String, network: usize, (x, y): (f64, f64), title: &str, filled: bool) -> fmt::Result {
    let r = REACH;
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
fn names(svg: &mut String, report: &Report, points: &[Point<'_>], fronts: &[Front]) -> fmt::Result {
    let mut named: Vec<&Point<'_>> =
        points.iter().filter(|point| point.setting.on_front || point.setting.setting == EXACT).collect();
    named.sort_by(|a, b| a.at.0.total_cmp(&b.at.0));
    let text = |point: &Point<'_>| {
        let setting = point.setting;
        let mut text = setting.setting.clone();
        if text == EXACT && report.networks.len() > 1 {
            text = format!("{text} {}", report.networks[point.network].network);
        }
        if setting.interval_95.is_some() {
            text = format!("{text}, {} %", percent(setting.error));
        }
        text
    };
    let texts: Vec<String> = named.iter().map(|point| text(point)).collect();
    let wanted: Vec<((f64, f64), f64)> = named
        .iter()
        .zip(&texts)
        .map(|(point, text)| (point.at, CHARACTER * text.chars().count() as f64 + 4.0))
        .collect();
    let steps =
        fronts.iter().flat_map(|(places, _)| places.windows(2).map(|ends| Area::between(ends[0], ends[1])));
    let obstacles: Vec<Area> =
        points.iter().map(|point| Area::around(point.at, REACH + 1.0)).chain(steps).collect();
    let placed = labels::place(&wanted, &obstacles, &FIELD);
    for ((point, text), area) in named.iter().zip(&texts).zip(placed) {
        let Some(area) = area else { continue };
        let ((x, y), (near_x, near_y)) = (point.at, area.nearest(point.at));
        if (near_x - x).hypot(near_y - y) > NEAR {
            writeln!(
                svg,
                "<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{near_x:.1}\" y2=\"{near_y:.1}\" stroke=\"#999999\" \
                 stroke-width=\"0.8\"/>"
            )?;
        }
        // Bars and lines may lie below a name, and must not be read with it.
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
        )?;
    }
    Ok(())
}
