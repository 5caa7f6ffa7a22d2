//! The distribution of latencies: for each latency, the share of calls that took longer.
//!
//! Both axes are logarithmic: one curve shows the median and the slowest of 100,000 calls.

use crate::axes::{Axis, Field, decades};
use crate::svg::{Area, GREY, Place, SMALL, Svg, colour};
use crate::text::grouped;

const FIELD: Area = Area { left: 70.0, top: 4.0, right: 744.0, bottom: 304.0 };
/// Shares below 10 to this power, in percent, are drawn like 0.
const MIN_POWER: f64 = -5.0;
/// Steps shorter than this many pixels are drawn as one.
const CLOSE: f64 = 1.0;
/// Quantiles in the table below the field: a name, and the share of calls that took longer.
const QUANTILES: [(&str, f64); 4] = [("p50", 0.5), ("p99", 0.01), ("p99.9", 0.001), ("max", 0.0)];

/// Latency distributions in one field, with a table of their quantiles below it.
#[derive(Clone, Debug)]
pub struct Distribution {
    /// Without curves, the panel says that there were no events.
    pub curves: Vec<LatencyCurve>,
}

/// The latencies of one kind of call.
#[derive(Clone, Debug)]
pub struct LatencyCurve {
    /// The kind of call.
    pub name: String,
    /// Whether the line is dashed, as for a part of the calls.
    pub dashed: bool,
    /// Latency in microseconds and the share of calls that took longer, ascending; the last is 0.
    pub points: Vec<(f64, f64)>,
}

impl Distribution {
    /// Draws the panel. Returns its width and height with the space to the next panel.
    pub(crate) fn draw(&self, svg: &mut Svg) -> Place {
        const LINE: f64 = 20.0;
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let (x, y) = ((FIELD.left, FIELD.right), (FIELD.bottom, FIELD.top));
        let (least, most) =
            decades(points().map(|&(_, share)| 100.0 * share).chain([10.0, 100.0]), (0.0, 2.0));
        let field = Field {
            area: FIELD,
            x: Axis::logarithmic(decades(points().map(|&(us, _)| us), (0.0, 3.0)), x),
            y: Axis::logarithmic((least.max(MIN_POWER), most), y),
        };
        field.draw(svg, "latency (microseconds)", "share that took longer (%)");
        if self.curves.is_empty() {
            svg.text(FIELD.centre(), "no events").middle();
        }
        let table = FIELD.bottom + 68.0;
        let column = |i: usize| FIELD.right - 86.0 * (QUANTILES.len() - 1 - i) as f64;
        for (i, (name, _)) in QUANTILES.iter().enumerate().filter(|_| !self.curves.is_empty()) {
            svg.text((column(i), table), &format!("{name} (us)")).end().size(SMALL).fill(GREY);
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let dashes = if curve.dashed { "7 4" } else { "" };
            // Earlier lines are wider, so that lines that meet are all visible.
            let width = 1.6 + 0.6 * (self.curves.len() - 1 - i) as f64;
            svg.path(&curve.steps(&field), colour(i)).width(width).dashes(dashes);
            let y = table + LINE * (i + 1) as f64;
            svg.key((FIELD.left, y), &curve.name, colour(i), dashes);
            for (i, &(_, share)) in QUANTILES.iter().enumerate() {
                let us = curve.points.iter().find(|point| point.1 <= share).map_or(0.0, |point| point.0);
                svg.text((column(i), y), &shown(us)).end();
            }
        }
        // Half of the last tick is to the right of the field.
        (FIELD.right + 28.0, table + LINE * self.curves.len() as f64 + 6.0)
    }
}

/// Microseconds with two decimals below 10 and none from 1,000.
fn shown(us: f64) -> String {
    if us >= 1000.0 {
        return grouped(us.round() as u64);
    }
    let decimals = if us < 10.0 { 2 } else { usize::from(us < 1000.0) };
    format!("{us:.decimals$}")
}

impl LatencyCurve {
    /// A path of steps: the share is constant between two latencies that occurred.
    fn steps(&self, field: &Field) -> String {
        let mut last = (f64::NEG_INFINITY, FIELD.top);
        let step = |(i, &(us, share)): (usize, &(f64, f64))| {
            let (x, y) = field.place(us, 100.0 * share);
            // The longest latency is shown even if it is close to the one before.
            let is_shown = x - last.0 >= CLOSE || y - last.1 >= CLOSE || i + 1 == self.points.len();
            is_shown.then(|| {
                last = (x, y);
                if i == 0 { format!("M{x:.1} {:.1}V{y:.1}", FIELD.top) } else { format!("H{x:.1}V{y:.1}") }
            })
        };
        self.points.iter().enumerate().filter_map(step).collect()
    }
}
