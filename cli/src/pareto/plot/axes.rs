//! The axes: time, logarithmic; error, linear for shares of wrong answers, else logarithmic with a line for none.

use std::fmt::{self, Write};

use super::labels::Area;
use crate::pareto::report::{Compared, Report};
use crate::svg;

/// Where points lie.
pub(super) const FIELD: Area = Area { left: 92.0, top: 112.0, right: 1148.0, bottom: 640.0 };
/// Height of the strip at the bottom of a logarithmic axis that stands for 0.
const NOTHING: f64 = 26.0;
/// Room at both ends, as a share of the axis.
const ROOM: f64 = 0.05;
/// Largest share as a multiple of the smallest that a linear axis still tells apart.
const MOST_LINEAR: f64 = 10.0;
/// Most marks of a linear axis.
const MOST_MARKS: f64 = 10.0;

/// From figures to places.
pub(super) struct Axes {
    /// Decimal logarithms of the times at both ends.
    x: (f64, f64),
    y: Scale,
}

enum Scale {
    /// Shares at both ends.
    Linear(f64, f64),
    /// Decimal logarithms of the shares at both ends.
    Shares(f64, f64),
    /// Decimal logarithms at both ends.
    Logarithmic(f64, f64),
}

impl Axes {
    /// Axes that hold all points of `report` with their intervals.
    pub(super) fn around(report: &Report) -> Self {
        let settings = || report.networks.iter().flat_map(|network| &network.settings);
        let times = settings().map(|setting| setting.us.max(1e-6).log10());
        let y = match report.compared {
            Compared::TaskError => {
                let bounds = settings().flat_map(|s| {
                    let (low, high) = s.interval_95.unwrap_or((s.error, s.error));
                    [low, high]
                });
                let least = bounds.clone().fold(f64::INFINITY, f64::min);
                let most = bounds.clone().fold(0.0, f64::max);
                if least > 0.0 && most > MOST_LINEAR * least {
                    let (low, high) = widened(bounds.map(f64::log10), 0.5);
                    Scale::Shares(low, high)
                } else {
                    let (low, high) = widened(bounds, 0.02);
                    Scale::Linear(low, high)
                }
            }
            Compared::RelativeRms => {
                let errors = settings().map(|setting| setting.error).filter(|&error| error > 0.0);
                let (low, high) = widened(errors.map(f64::log10), 1.0);
                Scale::Logarithmic(low, high)
            }
        };
        Self { x: widened(times, 0.5), y }
    }

    pub(super) fn x(&self, us: f64) -> f64 {
        let (first, last) = self.x;
        FIELD.left + (us.max(1e-6).log10() - first) / (last - first) * (FIELD.right - FIELD.left)
    }

    pub(super) fn y(&self, error: f64) -> f64 {
        let along = |value: f64, (low, high): (f64, f64), bottom: f64| {
            bottom - (value - low) / (high - low) * (bottom - FIELD.top)
        };
        match self.y {
            Scale::Linear(low, high) => along(error, (low, high), FIELD.bottom),
            Scale::Shares(low, high) => along(error.log10(), (low, high), FIELD.bottom),
            Scale::Logarithmic(..) if error <= 0.0 => FIELD.bottom - NOTHING / 2.0,
            Scale::Logarithmic(low, high) => along(error.log10(), (low, high), FIELD.bottom - NOTHING),
        }
    }

    /// Lines, marks and titles.
    pub(super) fn write(&self, svg: &mut String, report: &Report) -> fmt::Result {
        self.times(svg)?;
        let wrong_answers = || {
            let of = report.networks.iter().flat_map(|network| &network.exact().measurement.task).next();
            (report.error_name(), format!("{}; bars: 95 % interval", of.map_or("", |task| task.of.as_str())))
        };
        let (title, about) = match self.y {
            Scale::Linear(low, high) => {
                self.shares(svg, low, high)?;
                wrong_answers()
            }
            Scale::Shares(low, high) => {
                self.shares_by_ratio(svg, low, high)?;
                wrong_answers()
            }
            Scale::Logarithmic(low, high) => {
                self.powers(svg, low, high)?;
                (report.error_name(), "against the exact outputs, as a share of their RMS".to_owned())
            }
        };
        let (middle, centre) =
            (f64::midpoint(FIELD.left, FIELD.right), f64::midpoint(FIELD.top, FIELD.bottom));
        writeln!(
            svg,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#777777\"/>\n\
             <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(20 {centre}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(38 {centre}) rotate(-90)\" text-anchor=\"middle\" font-size=\"11\" \
             fill=\"#555555\">{}</text>",
            FIELD.left,
            FIELD.top,
            FIELD.right - FIELD.left,
            FIELD.bottom - FIELD.top,
            FIELD.bottom + 44.0,
            report.time_name(),
            svg::escaped(title),
            svg::escaped(&about)
        )
    }

    fn times(&self, svg: &mut String) -> fmt::Result {
        let (first, last) = self.x;
        // Few powers leave room for what is between them.
        let named: &[u32] = match last - first {
            decades if decades < 2.0 => &[1, 2, 3, 5, 7],
            decades if decades < 4.0 => &[1, 2, 5],
            _ => &[1],
        };
        for power in first.floor() as i32..=last.ceil() as i32 {
            for digit in 1..=9 {
                let us = f64::from(digit) * 10_f64.powi(power);
                let x = self.x(us);
                if !(FIELD.left..=FIELD.right).contains(&x) {
                    continue;
                }
                let colour = if digit == 1 { "#cccccc" } else { "#efefef" };
                writeln!(
                    svg,
                    "<line x1=\"{x:.1}\" y1=\"{}\" x2=\"{x:.1}\" y2=\"{}\" stroke=\"{colour}\"/>",
                    FIELD.top, FIELD.bottom
                )?;
                if named.contains(&digit) {
                    let y = FIELD.bottom + 18.0;
                    let decimals = power.min(0).unsigned_abs() as usize;
                    writeln!(
                        svg,
                        "<text x=\"{x:.1}\" y=\"{y}\" text-anchor=\"middle\">{us:.decimals$}</text>"
                    )?;
                }
            }
        }
        Ok(())
    }

    fn shares(&self, svg: &mut String, low: f64, high: f64) -> fmt::Result {
        let steps = (-4..).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(power)));
        let step = steps.into_iter().find(|step| (high - low) / step <= MOST_MARKS).unwrap_or(1.0);
        // There is room beyond the ends, but there are no shares.
        let marks = (low.max(0.0) / step).ceil() as i64..=(high.min(1.0) / step).floor() as i64;
        let decimals = usize::from(step < 0.01);
        for mark in marks {
            let share = mark as f64 * step;
            line(svg, self.y(share), &format!("{:.decimals$}", 100.0 * share))?;
        }
        Ok(())
    }

    /// Marks at 1, 2, 3, 5 and 7 of every power of ten.
    fn shares_by_ratio(&self, svg: &mut String, low: f64, high: f64) -> fmt::Result {
        for power in low.floor() as i32..=high.floor() as i32 {
            for digit in [1.0, 2.0, 3.0, 5.0, 7.0] {
                let share = digit * 10_f64.powi(power);
                if (low..=high).contains(&share.log10()) && share <= 1.0 {
                    let decimals = (-2 - power).max(0) as usize;
                    line(svg, self.y(share), &format!("{:.decimals$}", 100.0 * share))?;
                }
            }
        }
        Ok(())
    }

    fn powers(&self, svg: &mut String, low: f64, high: f64) -> fmt::Result {
        for power in low.ceil() as i32..=high.floor() as i32 {
            line(svg, self.y(10_f64.powi(power)), &format!("1e{power}"))?;
        }
        let y = FIELD.bottom - NOTHING;
        writeln!(
            svg,
            "<line x1=\"{}\" y1=\"{y}\" x2=\"{}\" y2=\"{y}\" stroke=\"#777777\" stroke-dasharray=\"3 3\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\">0</text>",
            FIELD.left,
            FIELD.right,
            FIELD.left - 8.0,
            self.y(0.0) + 4.5
        )
    }
}

fn line(svg: &mut String, y: f64, label: &str) -> fmt::Result {
    writeln!(
        svg,
        "<line x1=\"{}\" y1=\"{y:.1}\" x2=\"{}\" y2=\"{y:.1}\" stroke=\"#dddddd\"/>\
         <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
        FIELD.left,
        FIELD.right,
        FIELD.left - 8.0,
        y + 4.5
    )
}

/// Both ends of `values` with room beyond them, at least `least` apart.
fn widened(values: impl Iterator<Item = f64>, least: f64) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        return (0.0, 1.0);
    }
    let room = (ROOM * (high - low)).max((least - (high - low)) / 2.0).max(0.0);
    (low - room, high + room)
}

#[cfg(test)]
mod tests {
    use super::widened;

    #[test]
    fn an_axis_has_room_at_both_ends_and_a_length_even_for_one_point() {
        assert_eq!(widened([1.0, 3.0].into_iter(), 0.5), (0.9, 3.1));
        assert_eq!(widened([2.0].into_iter(), 0.5), (1.75, 2.25));
        assert_eq!(widened(std::iter::empty(), 0.5), (0.0, 1.0));
    }
}
