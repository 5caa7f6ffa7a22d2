//! Axes with ticks, and the field between two of them.
//!
//! Input: ranges of values and of pixels. Output: positions, ticks at round values, grid, labels
//! and titles.

use crate::svg::{Area, FINE_GRID, FRAME, GRID, Svg};
use crate::text::{SIZE, grouped, width};

/// Maximum number of intervals between the ticks of a linear axis.
const MAX_INTERVALS: f64 = 8.0;
/// Margin at both ends of an axis, as a share of its length.
const MARGIN: f64 = 0.05;
/// Pixels at the low end of a logarithmic axis for the value 0.
const ZERO_STRIP: f64 = 26.0;
/// Room for labels to the left of an axis, and minimum space between two labels.
const ROOM: f64 = 100.0;
const APART: f64 = 4.0;
/// Baseline of the title of a vertical axis, and the smallest one that stays inside the panel.
const TITLE: f64 = 12.0;
const MIN_TITLE: f64 = 8.0;

/// An axis: low and high end (decimal logarithms if it is logarithmic), and their pixels.
#[derive(Debug)]
pub(crate) struct Axis {
    logarithmic: bool,
    range: (f64, f64),
    pixels: (f64, f64),
    /// Position of the value 0 on a logarithmic axis that shows it.
    zero: Option<f64>,
}

/// A tick, with a label or between labels.
pub(crate) struct Tick {
    place: f64,
    pub(crate) label: Option<String>,
}

impl Axis {
    /// A linear axis for values in `range`.
    pub(crate) fn linear(range: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { logarithmic: false, range, pixels, zero: None }
    }

    /// A logarithmic axis between two powers of ten, which may be fractions.
    pub(crate) fn logarithmic(powers: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { logarithmic: true, range: powers, pixels, zero: None }
    }

    /// The same axis with a strip for the value 0 at its low end.
    pub(crate) fn with_zero(self) -> Self {
        let (low, high) = self.pixels;
        let strip = ZERO_STRIP * (high - low).signum();
        Self { pixels: (low + strip, high), zero: Some(low + strip / 2.0), ..self }
    }

    /// The pixel of `value`. Values beyond an end are shown at that end.
    pub(crate) fn place(&self, value: f64) -> f64 {
        if let Some(zero) = self.zero.filter(|_| value <= 0.0) {
            return zero;
        }
        let ((low, high), (start, end)) = (self.range, self.pixels);
        // A value may be a negative rounding error, whose logarithm is not a number.
        let along = if self.logarithmic { value.max(0.0).log10() } else { value };
        start + (along.clamp(low, high) - low) / (high - low) * (end - start)
    }

    pub(crate) fn ticks(&self) -> Vec<Tick> {
        if self.logarithmic { self.logarithmic_ticks() } else { self.linear_ticks() }
    }

    /// Ticks at multiples of 1, 2 or 5 times a power of ten.
    fn linear_ticks(&self) -> Vec<Tick> {
        let (low, high) = self.range;
        let steps = (-9..).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| (power, digit * 10_f64.powi(power))));
        let (power, step) =
            steps.into_iter().find(|(_, step)| (high - low) / step <= MAX_INTERVALS).unwrap_or((0, 1.0));
        let decimals = (-power).max(0) as usize;
        let tick = |i: i64| {
            let value = i as f64 * step;
            let label = if decimals == 0 { grouped_signed(value) } else { format!("{value:.decimals$}") };
            Tick { place: self.place(value), label: Some(label) }
        };
        // Division can miss a tick at an end by a rounding error.
        ((low / step - 1e-9).ceil() as i64..=(high / step + 1e-9).floor() as i64).map(tick).collect()
    }

    /// Ticks at the digits of every power of ten, with more labels if there are fewer powers.
    fn logarithmic_ticks(&self) -> Vec<Tick> {
        let (low, high) = self.range;
        let labelled: &[u32] = match high - low {
            powers if powers < 2.0 => &[1, 2, 3, 5, 7],
            powers if powers < 4.0 => &[1, 2, 5],
            _ => &[1],
        };
        let powers = low.floor() as i32..=high.floor() as i32;
        let ticks = powers.flat_map(|power| (1..=9).map(move |digit| (digit, power)));
        let ticks = ticks.map(|(digit, power)| (digit, power, f64::from(digit) * 10_f64.powi(power)));
        ticks
            .filter(|(.., value)| (low - 1e-9..=high + 1e-9).contains(&value.log10()))
            .map(|(digit, power, value)| {
                let label = labelled.contains(&digit).then(|| number(digit, power));
                Tick { place: self.place(value), label }
            })
            .collect()
    }
}

/// A whole number with a comma between thousands.
fn grouped_signed(value: f64) -> String {
    let sign = if value < 0.0 { "-" } else { "" };
    format!("{sign}{}", grouped(value.abs() as u64))
}

/// `digit` times 10 to the power: "2,000", "20", "0.02", "2e-4".
fn number(digit: u32, power: i32) -> String {
    let zeros = power.unsigned_abs() as usize;
    match power {
        0.. => format!("{digit}{}{}", "0".repeat(zeros % 3), ",000".repeat(zeros / 3)),
        -3.. => format!("0.{}{digit}", "0".repeat(zeros - 1)),
        _ => format!("{digit}e{power}"),
    }
}

/// Both ends of `values` with a margin, at least `least` apart; 0 and 1 if there are no values.
pub(crate) fn widened(values: impl Iterator<Item = f64>, least: f64) -> (f64, f64) {
    let Some((low, high)) = ends(values) else { return (0.0, 1.0) };
    let margin = (MARGIN * (high - low)).max((least - (high - low)) / 2.0);
    (low - margin, high + margin)
}

/// The powers of ten around `values`, at least one apart; `otherwise` if no value is positive.
pub(crate) fn decades(values: impl Iterator<Item = f64>, otherwise: (f64, f64)) -> (f64, f64) {
    let Some((low, high)) = ends(values.map(f64::log10)) else { return otherwise };
    (low.floor(), high.ceil().max(low.floor() + 1.0))
}

/// The smallest and the largest of the finite `values`.
pub(crate) fn ends(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.filter(|value| value.is_finite()).map(|value| (value, value));
    finite.reduce(|(low, high), (value, _)| (low.min(value), high.max(value)))
}

/// The part of a panel that shows values.
#[derive(Debug)]
pub(crate) struct Field {
    pub(crate) area: Area,
    pub(crate) x: Axis,
    /// Its pixels decrease from the low to the high end.
    pub(crate) y: Axis,
}

impl Field {
    /// The pixels of a value of each axis.
    pub(crate) fn place(&self, x: f64, y: f64) -> (f64, f64) {
        (self.x.place(x), self.y.place(y))
    }

    /// Draws grid, ticks, border and titles. An axis without a title has no ticks.
    pub(crate) fn draw(&self, svg: &mut Svg, x_title: &str, y_title: &str) {
        let Area { left, right, .. } = self.area;
        let (_, centre) = self.area.centre();
        // Long labels move the title to the left, if there is room.
        let mut title: f64 = TITLE;
        for Tick { place, label } in self.y.ticks() {
            let Some(label) = label else { continue };
            svg.line((left, place), (right, place), GRID);
            svg.text((left - 8.0, place + 4.5), &label).end();
            title = title.min(left - 8.0 - width(&label, SIZE) - 8.0);
        }
        if let Some(zero) = self.y.zero {
            svg.line((left, self.y.pixels.0), (right, self.y.pixels.0), FRAME).dashes("3 3");
            svg.text((left - 8.0, zero + 4.5), "0").end();
        }
        svg.text_upwards((title.max(MIN_TITLE), centre), y_title);
        self.draw_across(svg, x_title);
    }

    /// Draws the grid, the ticks and the title of the horizontal axis, and the border.
    pub(crate) fn draw_across(&self, svg: &mut Svg, x_title: &str) {
        let Area { left, top, right, bottom } = self.area;
        // Labels that would touch are left out.
        let mut free = left - ROOM;
        for Tick { place, label } in self.x.ticks().into_iter().filter(|_| !x_title.is_empty()) {
            svg.line((place, top), (place, bottom), if label.is_some() { GRID } else { FINE_GRID });
            let half = label.as_deref().map_or(0.0, |label| width(label, SIZE) / 2.0);
            if let Some(label) = label.filter(|_| place - half >= free) {
                svg.text((place, bottom + 18.0), &label).middle();
                free = place + half + APART;
            }
        }
        svg.rect(&self.area, "none").set("stroke", FRAME);
        if !x_title.is_empty() {
            svg.text((f64::midpoint(left, right), bottom + 40.0), x_title).middle();
        }
    }
}
