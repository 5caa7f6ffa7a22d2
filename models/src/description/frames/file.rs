//! A frame network's file in its written form: values typed and in range, references not resolved.
//!
//! Input: tables. Output: layers; the kind of a layer is `None` if a problem of it was reported.

use std::ops::RangeInclusive;

use meissner_engine::filters::FilterRule;
use meissner_engine::frames::FrameShape;
use meissner_engine::representations::{Sampling, Scaling, SignedRule};
use meissner_kernels::Activation;
use toml::de::DeValue;

use crate::description::document::{LAYER, ParsedLayer, layers};
use crate::description::filters;
use crate::description::frames::layer::{CHANNELS, FRAME, FrameKind, SIDES};
use crate::description::frames::source::{CropPlace, FrameSource, PictureSettings, Readings, SignedTiming};
use crate::description::layer::activations;
use crate::description::table::{Table, integer, name, number};
use crate::systems::contact_area::ContactSettings;

const OUTPUTS: RangeInclusive<i64> = 1..=1 << 16;
const STACKED: RangeInclusive<i64> = 0..=1023;
const FRAMES: RangeInclusive<i64> = 1..=1 << 16;

/// Kinds of layers; [`kind`] reads the keys of each.
const KINDS: [&str; 13] = [
    "conv",
    "upconv",
    "max_pool",
    "average_pool",
    "global_average",
    "sum",
    "concat",
    "squeeze_excite",
    "conv_lstm",
    "lstm",
    "delay",
    "flatten",
    "dense",
];

pub(super) fn read_layers(root: &mut Table<'_, '_>) -> Vec<ParsedLayer<FrameKind>> {
    let reference = "the name of a layer, or \"frame\"";
    layers(root, LAYER, FRAME, reference, &KINDS, |word, table, layer| keys(word, reference, table, layer))
}

/// Reads the filters of the events from which frames of `source` are made; other sources have no
/// filters.
pub(super) fn read_filters(root: &mut Table<'_, '_>, source: Option<&FrameSource>) -> Vec<FilterRule> {
    match source {
        Some(FrameSource::EventCounts { .. } | FrameSource::Signed { .. }) | None => filters::read(root),
        Some(_) => {
            root.inapplicable("filter", "frames of events");
            Vec::new()
        }
    }
}

/// Reads the tables `list` of a head, in which no layer may have the name `input`.
pub(in crate::description) fn read_head(
    root: &mut Table<'_, '_>,
    list: &'static str,
    input: &str,
) -> Vec<ParsedLayer<FrameKind>> {
    let reference = "the name of a layer, or the readout";
    layers(root, list, input, reference, &KINDS, |word, table, layer| keys(word, reference, table, layer))
}

fn keys(word: &str, reference: &str, mut table: Table<'_, '_>, layer: &mut ParsedLayer<FrameKind>) {
    if word == "concat" {
        layer.second = table.required("with", reference, name);
        let with = layer.second.as_ref().map(|given| given.value.clone());
        layer.kind = with.map(|with| FrameKind::Concat { with });
    } else {
        layer.kind = table.known(|table| kind(word, table));
    }
    if matches!(word, "conv" | "upconv" | "squeeze_excite" | "conv_lstm" | "lstm" | "dense") {
        layer.read_weights(&mut table);
    }
    table.finish();
}

/// Reads the keys of a kind without references.
fn kind(word: &str, table: &mut Table<'_, '_>) -> FrameKind {
    match word {
        "conv" => FrameKind::Conv {
            channels: table.size("channels", CHANNELS, None),
            kernel: table.value("kernel", "1 or 3", None, |value| {
                integer(value).filter(|side| [1, 3].contains(side)).map(|side| side as usize)
            }),
            bias: table.boolean("bias", true),
            norm: norm(table),
            activation: activation(table, [Activation::Identity, Activation::Relu]),
        },
        "upconv" => FrameKind::UpConv {
            channels: table.size("channels", CHANNELS, None),
            bias: table.boolean("bias", true),
        },
        "max_pool" => FrameKind::MaxPool,
        "average_pool" => FrameKind::AveragePool { size: table.size("size", SIDES, None) },
        "global_average" => FrameKind::GlobalAverage,
        "sum" => FrameKind::Sum,
        "squeeze_excite" => {
            FrameKind::SqueezeExcite { reduction: table.size("reduction", CHANNELS, Some(16)) }
        }
        "conv_lstm" => FrameKind::ConvLstm {
            hidden: table.size("hidden", CHANNELS, None),
            peepholes: table.boolean("peepholes", false),
            activation: activation(table, [Activation::Tanh, Activation::Sigmoid]),
        },
        "lstm" => FrameKind::Lstm {
            hidden: table.size("hidden", CHANNELS, None),
            layer: table.size("layer", STACKED, Some(0)),
        },
        "delay" => FrameKind::Delay { frames: table.size("frames", FRAMES, None) },
        "flatten" => FrameKind::Flatten,
        _ => FrameKind::Dense {
            outputs: table.size("outputs", OUTPUTS, None),
            bias: table.boolean("bias", true),
            norm: norm(table),
            activation: activation(table, [Activation::Identity, Activation::Relu, Activation::Elu]),
        },
    }
}

/// The prefix of batch norm's tensors, if there is any.
fn norm(table: &mut Table<'_, '_>) -> Option<String> {
    table.text("norm", "the prefix of batch norm's tensor names")
}

/// One of `kinds`, by default the first.
fn activation<const N: usize>(table: &mut Table<'_, '_>, kinds: [Activation; N]) -> Activation {
    table.option("activation", &activations(kinds))
}

const VALUES: RangeInclusive<i64> = 1..=1 << 16;
/// Lengths of windows in microseconds: up to an hour.
const TIMES_US: RangeInclusive<i64> = 1..=3_600_000_000;
/// The range that the engine accepts.
const STEPS: RangeInclusive<i64> = 1..=1 << 16;

pub(super) fn read(mut table: Table<'_, '_>) -> (Option<FrameShape>, Option<FrameSource>) {
    let shape = match table.choice("kind", &[("image", true), ("vector", false)]) {
        Some(true) => table.known(|table| FrameShape::Image {
            channels: table.size("channels", CHANNELS, None),
            height: table.size("height", SIDES, None),
            width: table.size("width", SIDES, None),
        }),
        Some(false) => table.known(|table| FrameShape::Vector(table.size("values", VALUES, None))),
        None => {
            // The keys of an unknown kind are unknown.
            table.ignore(&["channels", "height", "width", "values"]);
            None
        }
    };
    let words = ["event-counts", "signed", "tactile-image", "electrodes", "picture"];
    let Some(word) = table.choice("frames", &words.map(|word| (word, word))) else {
        return (shape, None);
    };
    let source = match word {
        "event-counts" => table.known(event_counts),
        "signed" => table.known(signed),
        "tactile-image" => readings(&mut table, true).map(FrameSource::TactileImage),
        "electrodes" => readings(&mut table, false).map(FrameSource::Electrodes),
        _ => picture(&mut table),
    };
    if let (Some(shape), Some(source)) = (shape, source)
        && let Some(expected) = source.refuses(shape)
    {
        let line = table.line_of("kind").unwrap_or_default();
        table.refuse(line, "kind", expected, shape.to_string());
    }
    table.finish();
    (shape, source)
}

fn event_counts(table: &mut Table<'_, '_>) -> FrameSource {
    let period_us = table.integer("period_us", TIMES_US, Some(10_000));
    let place = crop(table);
    let expected = "a finite number from 1 on";
    let maximum = table.value("maximum", expected, None, |v| real(v).filter(|&v| v >= 1.0));
    FrameSource::EventCounts { period_us, place, maximum }
}

fn signed(table: &mut Table<'_, '_>) -> FrameSource {
    let rule = table.option("rule", &[("sum", SignedRule::Sum), ("latest", SignedRule::Latest)]);
    let place = crop(table);
    let timing = if table.line_of("period_us").is_some() {
        table.inapplicable("span_us", "no period_us: a frame shows a sliding span or consecutive periods");
        SignedTiming::Consecutive { period_us: table.integer("period_us", TIMES_US, None) }
    } else {
        table.ignore(&["period_us"]);
        SignedTiming::Sliding { span_us: table.integer("span_us", TIMES_US, None) }
    };
    FrameSource::Signed { timing, place, rule }
}

fn crop(table: &mut Table<'_, '_>) -> CropPlace {
    let expected = "\"centre\", or the first column and row, such as [116, 72]";
    let read = |value: &DeValue<'_>| match value {
        DeValue::Array(place) if place.len() == 2 => {
            let read = |i: usize| u16::try_from(integer(place[i].get_ref())?).ok();
            Some(CropPlace::At { x: read(0)?, y: read(1)? })
        }
        value => value.as_str().filter(|&word| word == "centre").map(|_| CropPlace::Centre),
    };
    table.value("crop", expected, Some(CropPlace::Centre), read)
}

/// The settings of frames that are made of readings, either as images or unchanged.
fn readings(table: &mut Table<'_, '_>, image: bool) -> Option<Readings> {
    let expected = if image {
        "\"image\", \"reading\", or a range such as [1800, 3500]"
    } else {
        "\"image\", \"reading\", a range such as [1800, 3500], or [\"reading\", [1800, 3500]]"
    };
    let sampling =
        "\"consecutive\", \"sliding\" or the stride from one reading to the next (from 1 to 65536)";
    let readings = table.known(|table| Readings {
        steps: table.size("steps", STEPS, None),
        sampling: table.value("sampling", sampling, Some(Sampling::Consecutive), |value| {
            match (value.as_str(), integer(value)) {
                (Some("consecutive"), _) => Some(Sampling::Consecutive),
                (Some("sliding"), _) => Some(Sampling::Sliding),
                (_, Some(stride)) if STEPS.contains(&stride) => {
                    Some(Sampling::Step { stride: stride as usize })
                }
                _ => None,
            }
        }),
        scaling: table.value("scaling", expected, None, scaling),
    })?;
    if image && matches!(readings.scaling, Scaling::ReadingAndRange { .. }) {
        let with = "frames = \"electrodes\": an image has one value for each electrode";
        table.inapplicable("scaling", with);
        return None;
    }
    Some(readings)
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
    let picture = table.known(|table| PictureSettings {
        difference: table.boolean("difference", false),
        mean: table.value("mean", "means of red, green and blue, such as [0.5, 0.5, 0.5]", None, reals),
        std: table.value("std", "standard deviations of red, green and blue, each above 0", None, |value| {
            reals(value).filter(|std| std.iter().all(|&v| v > 0.0))
        }),
        force_mean: table.value("force_mean", "a finite number (N per pixel)", None, real),
        force_std: table.value("force_std", "a finite number above 0 (N per pixel)", None, |value| {
            real(value).filter(|&v| v > 0.0)
        }),
        pixel_mm: table.value(
            "pixel_mm",
            "width and height of a pixel in mm, such as [0.06, 0.06]",
            None,
            |v| numbers(v).filter(|pixel: &[f64; 2]| pixel.iter().all(|&side| side > 0.0)),
        ),
        threshold_n: table.value(
            "threshold_n",
            "a finite number of at least 0 (N per pixel)",
            Some(ContactSettings::THRESHOLD_N),
            |value| real(value).filter(|&v| v >= 0.0),
        ),
        median_window: table.value(
            "median_window",
            "an odd number from 1 to 9999",
            Some(ContactSettings::MEDIAN_WINDOW),
            |value| integer(value).filter(|v| (1..=9999).contains(v) && v % 2 == 1).map(|v| v as usize),
        ),
    })?;
    if let (Err(error), Some(line)) = (picture.image_normalisation(), table.line_of("std")) {
        table.refuse(line, "std", error.to_string(), format!("{:?}", picture.std));
        return None;
    }
    Some(FrameSource::Picture(picture))
}

/// A number that is finite as f32.
fn real(value: &DeValue<'_>) -> Option<f32> {
    number(value).map(|v| v as f32).filter(|v| v.is_finite())
}

fn numbers<const N: usize>(value: &DeValue<'_>) -> Option<[f64; N]> {
    let values: Option<Vec<f64>> = value.as_array()?.iter().map(|v| number(v.get_ref())).collect();
    values?.try_into().ok()
}

/// As [`numbers`], each finite as f32.
fn reals<const N: usize>(value: &DeValue<'_>) -> Option<[f32; N]> {
    let values = numbers::<N>(value)?.map(|v| v as f32);
    values.iter().all(|v| v.is_finite()).then_some(values)
}
