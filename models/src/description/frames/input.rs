//! The `[input]` table: shape and source of the frames.
//!
//! Enters: a table. Leaves: an [`Input`], with `None` for whatever was reported as a problem.

use std::ops::RangeInclusive;

use meissner_engine::frames::FrameShape;
use meissner_engine::representations::{Sampling, Scaling, SignedRule};
use toml::de::DeValue;

use super::layer::{CHANNELS, SIDES};
use super::source::{CropPlace, FrameSource, PictureSettings, Readings, SignedTiming};
use crate::description::problem::ProblemKind;
use crate::description::table::{Table, integer, number};
use crate::systems::contact_area::ContactSettings;

/// Values of a frame that is a vector.
const VALUES: RangeInclusive<i64> = 1..=1 << 16;
/// Lengths of windows in microseconds: up to an hour.
const TIMES_US: RangeInclusive<i64> = 1..=3_600_000_000;
/// The range that the engine accepts.
const STEPS: RangeInclusive<i64> = 1..=1 << 16;

/// A network's input.
#[derive(Debug)]
pub(super) struct Input {
    pub(super) shape: Option<FrameShape>,
    pub(super) source: Option<FrameSource>,
}

/// Reads the table.
pub(super) fn read(mut table: Table<'_, '_>) -> Input {
    let shape = match table.choice("kind", &[("image", true), ("vector", false)], None) {
        Some(true) => {
            let channels = table.size("channels", CHANNELS, None);
            let (height, width) = (table.size("height", SIDES, None), table.size("width", SIDES, None));
            let sides = height.zip(width);
            channels.zip(sides).map(|(channels, (height, width))| FrameShape::Image {
                channels,
                height,
                width,
            })
        }
        Some(false) => table.size("values", VALUES, None).map(FrameShape::Vector),
        None => {
            // The keys of an unknown kind are unknown.
            table.ignore(&["channels", "height", "width", "values"]);
            None
        }
    };
    let words = ["event-counts", "signed", "tactile-image", "electrodes", "picture"];
    let choices: [(&str, usize); 5] = std::array::from_fn(|i| (words[i], i));
    let word = table.choice("frames", &choices, None);
    let source = match word {
        Some(0) => event_counts(&mut table),
        Some(1) => signed(&mut table),
        Some(2) => readings(&mut table, true).map(FrameSource::TactileImage),
        Some(3) => readings(&mut table, false).map(FrameSource::Electrodes),
        Some(_) => picture(&mut table),
        None => None,
    };
    if let (Some(shape), Some(source)) = (shape, source)
        && let Some(expected) = source.refuses(shape)
    {
        let line = table.line_of("kind").unwrap_or_default();
        table.refuse(line, "kind", expected, shape.to_string());
    }
    if word.is_some() {
        table.finish();
    }
    Input { shape, source }
}

fn event_counts(table: &mut Table<'_, '_>) -> Option<FrameSource> {
    let period_us = table.integer("period_us", TIMES_US, Some(10_000));
    let place = crop(table);
    let expected = "a finite number from 1 on";
    let maximum = table.required("maximum", expected, |v| real(v).filter(|&v| v >= 1.0));
    Some(FrameSource::EventCounts { period_us: period_us?, place: place?, maximum: maximum?.value })
}

fn signed(table: &mut Table<'_, '_>) -> Option<FrameSource> {
    let rules = [("sum", SignedRule::Sum), ("latest", SignedRule::Latest)];
    let rule = table.choice("rule", &rules, Some(SignedRule::Sum));
    let place = crop(table);
    let timing = if table.line_of("period_us").is_some() {
        table.inapplicable("span_us", "no period_us: a frame shows a sliding span or consecutive periods");
        let period_us = table.integer("period_us", TIMES_US, None);
        period_us.map(|period_us| SignedTiming::Consecutive { period_us })
    } else {
        table.integer("span_us", TIMES_US, None).map(|span_us| SignedTiming::Sliding { span_us })
    };
    Some(FrameSource::Signed { timing: timing?, place: place?, rule: rule? })
}

fn crop(table: &mut Table<'_, '_>) -> Option<CropPlace> {
    let expected = "\"centre\", or the first column and row, such as [116, 72]";
    let read = |value: &DeValue<'_>| match value {
        DeValue::Array(place) if place.len() == 2 => {
            let read = |i: usize| u16::try_from(integer(place.get(i)?.get_ref())?).ok();
            Some(CropPlace::At { x: read(0)?, y: read(1)? })
        }
        value => value.as_str().filter(|&word| word == "centre").map(|_| CropPlace::Centre),
    };
    table.defaulted("crop", expected, Some(CropPlace::Centre), read)
}

/// The settings of frames that are made of readings, as images or as they are.
fn readings(table: &mut Table<'_, '_>, image: bool) -> Option<Readings> {
    let steps = table.size("steps", STEPS, None);
    let expected =
        "\"consecutive\", \"sliding\" or the stride from one reading to the next (from 1 to 65536)";
    let sampling = table.defaulted("sampling", expected, Some(Sampling::Consecutive), |value| {
        match (value.as_str(), integer(value)) {
            (Some("consecutive"), _) => Some(Sampling::Consecutive),
            (Some("sliding"), _) => Some(Sampling::Sliding),
            (_, Some(stride)) if STEPS.contains(&stride) => Some(Sampling::Step { stride: stride as usize }),
            _ => None,
        }
    });
    let expected = if image {
        "\"image\", \"reading\", or a range such as [1800, 3500]"
    } else {
        "\"image\", \"reading\", a range such as [1800, 3500], or [\"reading\", [1800, 3500]]"
    };
    let scaling = table.required("scaling", expected, scaling)?;
    if image && matches!(scaling.value, Scaling::ReadingAndRange { .. }) {
        let with = "frames = \"electrodes\": an image has one value for each electrode";
        table.report(scaling.line, ProblemKind::Inapplicable { key: "scaling", with });
        return None;
    }
    Some(Readings { steps: steps?, sampling: sampling?, scaling: scaling.value })
}

fn scaling(value: &DeValue<'_>) -> Option<Scaling> {
    match (value.as_str(), value.as_array().map(|list| &**list)) {
        (Some("image"), _) => Some(Scaling::PerImage),
        (Some("reading"), _) => Some(Scaling::PerReading),
        (None, Some([word, range])) if word.get_ref().as_str() == Some("reading") => {
            let (minimum, maximum) = range_of(range.get_ref())?;
            Some(Scaling::ReadingAndRange { minimum, maximum })
        }
        (None, Some(_)) => {
            let (minimum, maximum) = range_of(value)?;
            Some(Scaling::Range { minimum, maximum })
        }
        _ => None,
    }
}

/// A minimum and a maximum above it.
fn range_of(value: &DeValue<'_>) -> Option<(f32, f32)> {
    let [minimum, maximum] = reals(value)?;
    (minimum < maximum).then_some((minimum, maximum))
}

fn picture(table: &mut Table<'_, '_>) -> Option<FrameSource> {
    let mean = table.required("mean", "means of red, green and blue, such as [0.5, 0.5, 0.5]", reals);
    let std = table.required("std", "standard deviations of red, green and blue, each above 0", |value| {
        let std: [f32; 3] = reals(value)?;
        std.iter().all(|&v| v > 0.0).then_some(std)
    });
    let force_mean = table.required("force_mean", "a finite number (N per pixel)", real);
    let expected = "a finite number above 0 (N per pixel)";
    let force_std = table.required("force_std", expected, |value| real(value).filter(|&v| v > 0.0));
    let expected = "width and height of a pixel in mm, such as [0.06, 0.06]";
    let pixel_mm = table.required("pixel_mm", expected, |value| {
        let pixel: [f64; 2] = numbers(value)?;
        pixel.iter().all(|&side| side > 0.0).then_some(pixel)
    });
    let expected = "a finite number of at least 0 (N per pixel)";
    let threshold_n = table.defaulted("threshold_n", expected, Some(ContactSettings::THRESHOLD_N), |value| {
        real(value).filter(|&v| v >= 0.0)
    });
    let expected = "an odd number from 1 to 9999";
    let median = table.defaulted("median_window", expected, Some(ContactSettings::MEDIAN_WINDOW), |value| {
        let window = integer(value).filter(|window| (1..=9999).contains(window) && window % 2 == 1)?;
        Some(window as usize)
    });
    let std_line = std.as_ref().map(|given| given.line);
    let picture = PictureSettings {
        mean: mean?.value,
        std: std?.value,
        force_mean: force_mean?.value,
        force_std: force_std?.value,
        pixel_mm: pixel_mm?.value,
        threshold_n: threshold_n?,
        median_window: median?,
    };
    if let (Err(error), Some(line)) = (picture.image_normalisation(), std_line) {
        table.refuse(line, "std", error.to_string(), format!("{:?}", picture.std));
        return None;
    }
    Some(FrameSource::Picture(picture))
}

/// A number that is finite as f32.
fn real(value: &DeValue<'_>) -> Option<f32> {
    number(value).map(|v| v as f32).filter(|v| v.is_finite())
}

/// A list of exactly N numbers.
fn numbers<const N: usize>(value: &DeValue<'_>) -> Option<[f64; N]> {
    let values: Option<Vec<f64>> = value.as_array()?.iter().map(|v| number(v.get_ref())).collect();
    values?.try_into().ok()
}

/// As [`numbers`], each finite as f32.
fn reals<const N: usize>(value: &DeValue<'_>) -> Option<[f32; N]> {
    let values = numbers::<N>(value)?.map(|v| v as f32);
    values.iter().all(|v| v.is_finite()).then_some(values)
}
