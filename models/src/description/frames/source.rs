//! The source of a network's frames, with its settings: plain data for the program.

use std::fmt;

use meissner_engine::Sensor;
use meissner_engine::frames::FrameShape;
use meissner_engine::representations::{Crop, Sampling, Scaling, SignedRule, TACTILE_COLUMNS, TACTILE_ROWS};
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Value, json};

use crate::systems::contact_area::{ContactError, ForceNormalisation, ImageNormalisation, PixelSize};

/// The source of the frames of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FrameSource {
    /// Events of each polarity per pixel over consecutive windows, divided by a maximum: counts of
    /// [`meissner_engine::representations::ConsecutiveFrames`].
    EventCounts {
        /// Length of a window in microseconds.
        period_us: i64,
        /// Pixels that are shown.
        place: CropPlace,
        /// Count that is scaled to 1.
        maximum: f32,
    },
    /// Polarities of events: signed frames of
    /// [`meissner_engine::representations::ConsecutiveFrames`] or of
    /// [`meissner_engine::representations::SlidingSigned`].
    Signed {
        /// The events that a frame shows.
        timing: SignedTiming,
        /// Pixels that are shown.
        place: CropPlace,
        /// The value of a pixel, from its events.
        rule: SignedRule,
    },
    /// 12 x 11 images of 24 electrodes ([`meissner_engine::representations::TactileWindow`]).
    TactileImage(Readings),
    /// The values of 24 electrodes, scaled in one way or, side by side, in two.
    Electrodes(Readings),
    /// Pictures of an optical tactile sensor.
    Picture(PictureSettings),
}

/// Place of the shown pixels on the sensor; the network's input has their number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CropPlace {
    /// In the middle; if the remaining number of pixels is odd, one pixel further to the left and
    /// the top.
    #[default]
    Centre,
    /// From this pixel on.
    At {
        /// First column.
        x: u16,
        /// First row.
        y: u16,
    },
}

impl CropPlace {
    /// `width` x `height` pixels of `sensor`. If the sensor is smaller, the crop starts at the
    /// first pixel and is refused later.
    pub fn crop(self, width: u16, height: u16, sensor: Sensor) -> Crop {
        let (x, y) = match self {
            Self::Centre => {
                (sensor.width.saturating_sub(width) / 2, sensor.height.saturating_sub(height) / 2)
            }
            Self::At { x, y } => (x, y),
        };
        Crop::new(x, y, width, height)
    }
}

/// The events that a signed frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignedTiming {
    /// The events of the last microseconds, at any time.
    Sliding {
        /// Length in microseconds.
        span_us: i64,
    },
    /// The events of consecutive windows.
    Consecutive {
        /// Length of a window in microseconds.
        period_us: i64,
    },
}

/// The conversion of readings to the frames of a sequence. The state starts from zero with each
/// sequence; its prediction is that of the last frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Number of frames of a sequence.
    pub steps: usize,
    /// The readings of one sequence.
    pub sampling: Sampling,
    /// The values that are scaled to 0 and 1.
    pub scaling: Scaling,
}

/// The conversions of pictures to the input, and of the output to forces, of a network for contact
/// areas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureSettings {
    /// Whether the input is the difference of a picture from a reference, a picture without
    /// contact.
    pub difference: bool,
    /// Mean of red, green and blue, of values in [0, 1], or of their differences.
    pub mean: [f32; 3],
    /// Their standard deviations.
    pub std: [f32; 3],
    /// Mean of the forces in N per pixel.
    pub force_mean: f32,
    /// Their standard deviation.
    pub force_std: f32,
    /// Width and height of a pixel in mm.
    pub pixel_mm: [f64; 2],
    /// Force in N per pixel above which there is contact.
    pub threshold_n: f32,
    /// Number of reports in the running median of total forces.
    pub median_window: usize,
}

impl PictureSettings {
    /// The conversion from a picture to the input of the network.
    ///
    /// # Errors
    /// As [`ImageNormalisation::new`]; never for the settings of a checked description.
    pub fn image_normalisation(&self) -> Result<ImageNormalisation, ContactError> {
        ImageNormalisation::new(self.mean, self.std)
    }

    /// The conversion from the output of the network to forces.
    ///
    /// # Errors
    /// As [`ForceNormalisation::new`]; never for the settings of a checked description.
    pub fn force_normalisation(&self) -> Result<ForceNormalisation, ContactError> {
        ForceNormalisation::new(self.force_mean, self.force_std)
    }

    /// Size of a pixel.
    ///
    /// # Errors
    /// As [`PixelSize::new`]; never for the settings of a checked description.
    pub fn pixel_size(&self) -> Result<PixelSize, ContactError> {
        PixelSize::new(self.pixel_mm[0], self.pixel_mm[1])
    }
}

impl FrameSource {
    /// Its word in a file.
    pub fn word(&self) -> &'static str {
        match self {
            Self::EventCounts { .. } => "event-counts",
            Self::Signed { .. } => "signed",
            Self::TactileImage(_) => "tactile-image",
            Self::Electrodes(_) => "electrodes",
            Self::Picture(_) => "picture",
        }
    }

    /// Number of frames after which the network's state starts from zero again; `None` if the state
    /// is kept.
    pub fn steps(&self) -> Option<usize> {
        match self {
            Self::TactileImage(readings) | Self::Electrodes(readings) => Some(readings.steps),
            Self::EventCounts { .. } | Self::Signed { .. } | Self::Picture(_) => None,
        }
    }

    /// The possible shapes of its frames, if `shape` is not one of them.
    pub(super) fn refuses(&self, shape: FrameShape) -> Option<String> {
        let (expected, fits) = match (self, shape) {
            (Self::TactileImage(_), _) => {
                let (channels, height, width) = (1, TACTILE_ROWS, TACTILE_COLUMNS);
                let image = FrameShape::Image { channels, height, width };
                (format!("an image {image}"), shape == image)
            }
            (Self::Electrodes(readings), _) => {
                let values = readings.scaling.values();
                (format!("a vector of {values} values"), shape == FrameShape::Vector(values))
            }
            (source, _) => {
                let channels = match source {
                    Self::EventCounts { .. } => 2,
                    Self::Picture(_) => 3,
                    _ => 1,
                };
                let found = matches!(shape, FrameShape::Image { channels: found, .. } if found == channels);
                (format!("an image with channels = {channels}"), found)
            }
        };
        let scaled = match self {
            Self::Electrodes(Readings { scaling: scaling @ Scaling::ReadingAndRange { .. }, .. }) => {
                format!(" with scaling = {}", scaling_value(*scaling))
            }
            _ => String::new(),
        };
        (!fits).then(|| format!("{expected}, as frames = {:?}{scaled} gives", self.word()))
    }

    /// Its settings by the keys of a file.
    fn settings(&self) -> Vec<(&'static str, Value)> {
        match *self {
            Self::EventCounts { period_us, place, maximum } => {
                vec![
                    ("period_us", json!(period_us)),
                    ("crop", place.value()),
                    ("maximum", json!(short(maximum))),
                ]
            }
            Self::Signed { timing, place, rule } => {
                let rule = match rule {
                    SignedRule::Sum => "sum",
                    SignedRule::Latest => "latest",
                };
                let timing = match timing {
                    SignedTiming::Sliding { span_us } => ("span_us", json!(span_us)),
                    SignedTiming::Consecutive { period_us } => ("period_us", json!(period_us)),
                };
                vec![timing, ("crop", place.value()), ("rule", json!(rule))]
            }
            Self::TactileImage(readings) | Self::Electrodes(readings) => readings.settings(),
            Self::Picture(picture) => vec![
                ("mean", json!(picture.mean.map(short))),
                ("std", json!(picture.std.map(short))),
                ("force_mean", json!(short(picture.force_mean))),
                ("force_std", json!(short(picture.force_std))),
                ("pixel_mm", json!(picture.pixel_mm)),
                ("threshold_n", json!(short(picture.threshold_n))),
                ("median_window", json!(picture.median_window)),
            ],
        }
    }
}

impl CropPlace {
    fn value(self) -> Value {
        match self {
            Self::Centre => json!("centre"),
            Self::At { x, y } => json!([x, y]),
        }
    }
}

impl Readings {
    fn settings(&self) -> Vec<(&'static str, Value)> {
        let sampling = match self.sampling {
            Sampling::Consecutive => json!("consecutive"),
            Sampling::Sliding => json!("sliding"),
            Sampling::Step { stride } => json!(stride),
        };
        vec![("steps", json!(self.steps)), ("sampling", sampling), ("scaling", scaling_value(self.scaling))]
    }
}

fn scaling_value(scaling: Scaling) -> Value {
    match scaling {
        Scaling::PerImage => json!("image"),
        Scaling::PerReading => json!("reading"),
        Scaling::Range { minimum, maximum } => json!([short(minimum), short(maximum)]),
        Scaling::ReadingAndRange { minimum, maximum } => json!(["reading", [short(minimum), short(maximum)]]),
    }
}

/// The shortest decimal number that equals `value` as f32.
fn short(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

impl fmt::Display for FrameSource {
    /// In one line, with the keys of a file: "event-counts, `period_us` = 10000, ...".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())?;
        self.settings().iter().try_for_each(|(key, value)| write!(f, ", {key} = {value}"))
    }
}

impl Serialize for FrameSource {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let mut map = s.serialize_map(None)?;
        map.serialize_entry("frames", self.word())?;
        for (key, value) in self.settings() {
            map.serialize_entry(key, &value)?;
        }
        map.end()
    }
}
