//! The distribution of latencies as a drawing: for each latency, the share of events or predictions that took longer.
//!
//! Both axes are logarithmic, so that the median and the slowest in 100,000 are read off the same curve. Whole lines are
//! all events; dashed ones are push + predict by phase, where there are both.

use std::fmt::Write;

use super::pass::Measured;
use super::report::{Report, whole};
use crate::svg;
use meissner_pipeline::text::grouped;

/// Size of the drawing, and of the field of the curves in it.
const WIDTH: f64 = 1080.0;
const HEIGHT: f64 = 520.0;
const LEFT: f64 = 92.0;
const RIGHT: f64 = 762.0;
const TOP: f64 = 82.0;
const BOTTOM: f64 = 458.0;
/// Shares below this one are not told apart from 0, whatever the number of events.
const LEAST_SHARE_EXPONENT: i32 = -7;
/// Points closer than this, in units of the drawing, are drawn as one.
const CLOSE: f64 = 0.25;

/// A curve: its name, colour and dashes, and its points (latency in microseconds, share that took longer).
struct Curve {
    name: &'static str,
    colour: &'static str,
    dashes: &'static str,
    points: Vec<(f64, f64)>,
}

/// Powers of ten that bound the field.
struct Axes {
    /// Of latencies in microseconds.
    x: (i32, i32),
    /// Of shares, down from 0 (all).
    least: i32,
}

/// The drawing, as a file of its own.
pub(super) fn svg(report: &Report, measured: &Measured) -> String {
    let curves = curves(measured);
    let axes = Axes::around(&curves);
    let mut svg = String::new();
    head(&mut svg, report)
        .and_then(|()| axes.write(&mut svg))
        .and_then(|()| curves.iter().try_for_each(|curve| curve.write(&mut svg, &axes)))
        .and_then(|()| legend(&mut svg, &curves))
        .and_then(|()| writeln!(svg, "</svg>"))
        .expect("writing to a string does not fail");
    svg
}

fn curves(measured: &Measured) -> Vec<Curve> {
    let [push, predict, push_predict] = whole(measured);
    let (idle, burst) = (&measured.idle.push_predict, &measured.burst.push_predict);
    // Where there is one phase only, its curve is that of all.
    let by_phase = idle.count() > 0 && burst.count() > 0;
    let phase =
        |latency: &meissner_pipeline::latency::Latency| if by_phase { latency.longer() } else { Vec::new() };
    // Colours that stay apart for those who do not see red and green apart.
    [
        ("push", "#0072b2", "", push.longer()),
        ("predict", "#e69f00", "", predict.longer()),
        ("push + predict", "#222222", "", push_predict.longer()),
        ("push + predict, idle", "#009e73", "7 4", phase(idle)),
        ("push + predict, burst", "#cc3377", "7 4", phase(burst)),
    ]
    .into_iter()
    .filter(|(_, _, _, points)| !points.is_empty())
    .map(|(name, colour, dashes, points)| Curve { name, colour, dashes, points })
    .collect()
}

fn head(svg: &mut String, report: &Report) -> std::fmt::Result {
    let passes = if report.passes > 1 { format!(" x {} passes", report.passes) } else { String::new() };
    let recording = report.recording.rsplit(['/', '\\']).next().unwrap_or(&report.recording);
    let about = format!(
        "{recording}: {} events{passes}, {} predictions, {} kernels",
        grouped(report.events),
        grouped(report.predictions),
        report.isa
    );
    svg::head(svg, (WIDTH, HEIGHT), LEFT, &format!("Latency of {}", report.network), &about)
}

impl Axes {
    /// Bounds that hold all points, at whole powers of ten.
    fn around(curves: &[Curve]) -> Self {
        let points = || curves.iter().flat_map(|curve| &curve.points);
        let fold = |start: f64, pick: fn(f64, f64) -> f64| points().map(|p| p.0).fold(start, pick);
        let (least, most) = (fold(f64::INFINITY, f64::min), fold(0.0, f64::max));
        // A clock may not tell a short time from none.
        let power = |us: f64| us.max(1e-3).log10();
        let x = if points().next().is_some() {
            (power(least).floor() as i32, power(most).ceil() as i32)
        } else {
            (0, 3)
        };
        let smallest = points().map(|p| p.1).filter(|&share| share > 0.0).fold(0.1, f64::min);
        let least = (smallest.log10().floor() as i32).max(LEAST_SHARE_EXPONENT);
        Self { x: (x.0, x.1.max(x.0 + 1)), least }
    }

    fn x(&self, us: f64) -> f64 {
        let (first, last) = (f64::from(self.x.0), f64::from(self.x.1));
        LEFT + (us.max(1e-3).log10() - first) / (last - first) * (RIGHT - LEFT)
    }

    fn y(&self, share: f64) -> f64 {
        let least = f64::from(self.least);
        TOP + share.log10().max(least) / least * (BOTTOM - TOP)
    }

    fn write(&self, svg: &mut String) -> std::fmt::Result {
        for power in self.x.0..=self.x.1 {
            for digit in 1..=9_u8 {
                let us = f64::from(digit) * 10_f64.powi(power);
                let x = self.x(us);
                if x > RIGHT + CLOSE {
                    break;
                }
                let colour = if digit == 1 { "#cccccc" } else { "#efefef" };
                writeln!(
                    svg,
                    "<line x1=\"{x:.1}\" y1=\"{TOP}\" x2=\"{x:.1}\" y2=\"{BOTTOM}\" stroke=\"{colour}\"/>"
                )?;
            }
            let (x, y, label) = (self.x(10_f64.powi(power)), BOTTOM + 18.0, decimal(power));
            writeln!(svg, "<text x=\"{x:.1}\" y=\"{y}\" text-anchor=\"middle\">{label}</text>")?;
        }
        for power in self.least..=0 {
            let (y, label) = (self.y(10_f64.powi(power)), decimal(power + 2));
            writeln!(
                svg,
                "<line x1=\"{LEFT}\" y1=\"{y:.1}\" x2=\"{RIGHT}\" y2=\"{y:.1}\" stroke=\"#cccccc\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label} %</text>",
                LEFT - 8.0,
                y + 4.5
            )?;
        }
        let (middle, centre) = (f64::midpoint(LEFT, RIGHT), f64::midpoint(TOP, BOTTOM));
        writeln!(
            svg,
            "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#777777\"/>\n\
             <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">latency (microseconds)</text>\n\
             <text transform=\"translate(22 {centre}) rotate(-90)\" text-anchor=\"middle\">share that took longer</text>",
            RIGHT - LEFT,
            BOTTOM - TOP,
            BOTTOM + 44.0
        )
    }
}

impl Curve {
    /// Steps: between two latencies that occurred, the share stays.
    fn write(&self, svg: &mut String, axes: &Axes) -> std::fmt::Result {
        let mut path = String::new();
        let mut last = (f64::NEG_INFINITY, TOP);
        for &(us, share) in &self.points {
            let (x, y) = (axes.x(us), axes.y(share));
            if path.is_empty() {
                write!(path, "M{x:.1} {TOP:.1}")?;
            } else if x - last.0 < CLOSE && y - last.1 < CLOSE {
                continue;
            } else {
                write!(path, "H{x:.1}")?;
            }
            write!(path, "V{y:.1}")?;
            last = (x, y);
        }
        // The slowest is shown even where it is close to the one before.
        if let Some(&(us, share)) = self.points.last() {
            write!(path, "H{:.1}V{:.1}", axes.x(us), axes.y(share))?;
        }
        writeln!(
            svg,
            "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\" stroke-linejoin=\"round\"{}/>",
            self.colour,
            self.dashes()
        )
    }

    fn dashes(&self) -> String {
        if self.dashes.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", self.dashes) }
    }
}

/// The curves' names with their medians, beside the field, where no curve can be under them.
fn legend(svg: &mut String, curves: &[Curve]) -> std::fmt::Result {
    const LINE: f64 = 21.0;
    const BOX: f64 = 288.0;
    let (left, top) = (RIGHT + 18.0, TOP);
    if curves.is_empty() {
        let (x, y) = (f64::midpoint(LEFT, RIGHT), f64::midpoint(TOP, BOTTOM));
        return writeln!(svg, "<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\">no events</text>");
    }
    let height = LINE * (curves.len() + 1) as f64 + 10.0;
    let (median, slow) = (left + BOX - 68.0, left + BOX - 10.0);
    writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{BOX}\" height=\"{height}\" fill=\"#ffffff\" \
         stroke=\"#bbbbbb\"/>\n<g font-size=\"12\"><text x=\"{median}\" y=\"{0}\" text-anchor=\"end\" \
         fill=\"#555555\">p50 (us)</text><text x=\"{slow}\" y=\"{0}\" text-anchor=\"end\" \
         fill=\"#555555\">p99 (us)</text>",
        top + 18.0
    )?;
    for (i, curve) in curves.iter().enumerate() {
        let y = top + 18.0 + LINE * (i + 1) as f64;
        let line = y - 4.0;
        let at = |share: f64| {
            let point = curve.points.iter().find(|point| point.1 <= share);
            point.map_or_else(String::new, |&(us, _)| format!("{us:.*}", if us < 10.0 { 2 } else { 1 }))
        };
        writeln!(
            svg,
            "<line x1=\"{}\" y1=\"{line}\" x2=\"{}\" y2=\"{line}\" stroke=\"{}\" stroke-width=\"2.2\"{}/>\
             <text x=\"{}\" y=\"{y}\">{}</text><text x=\"{median}\" y=\"{y}\" text-anchor=\"end\">{}</text>\
             <text x=\"{slow}\" y=\"{y}\" text-anchor=\"end\">{}</text>",
            left + 8.0,
            left + 32.0,
            curve.colour,
            curve.dashes(),
            left + 38.0,
            curve.name,
            at(0.5),
            at(0.01)
        )?;
    }
    writeln!(svg, "</g>")
}

/// 10 to the power, in digits.
fn decimal(power: i32) -> String {
    match u32::try_from(power) {
        Ok(power) => grouped(10_u64.pow(power)),
        Err(_) => format!("{:.*}", power.unsigned_abs() as usize, 10_f64.powi(power)),
    }
}

#[cfg(test)]
mod tests {
    use super::{Axes, Curve, decimal};

    #[test]
    fn powers_of_ten_are_written_in_digits() {
        assert_eq!([-3, -1, 0, 2, 3].map(decimal), ["0.001", "0.1", "1", "100", "1,000"]);
    }

    #[test]
    fn the_axes_hold_every_point_even_the_degenerate_ones() {
        for points in [vec![], vec![(0.0, 0.0)], vec![(10.0, 0.5), (1000.0, 1e-9), (2000.0, 0.0)]] {
            let curve = Curve { name: "push", colour: "", dashes: "", points: points.clone() };
            let axes = Axes::around(&[curve]);
            for (us, share) in points {
                assert!((super::LEFT..=super::RIGHT).contains(&axes.x(us)), "{us}");
                assert!((super::TOP..=super::BOTTOM).contains(&axes.y(share)), "{share}");
            }
        }
    }
}
