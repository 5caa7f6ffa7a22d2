//! The picture of the camera inside a finger through the pad: a bolt that comes near, and the
//! contact.
//!
//! The light of a pixel, as a share of a white surface's, is
//!
//! ```text
//! I = (1 - c) (g + s (b - g) + r) + c w m        c = 1 - exp(-p / P)
//! b = m (0.3 + 0.7 n^2) exp(-gap / G)            r = r0 exp(-|slope|^2 / (2 W^2))
//! ```
//!
//! c is the share of the pixel in real contact: metal and silicone are rough, and the area where
//! they touch grows in proportion to a small pressure p (Greenwood and Williamson 1966, "Contact of
//! nominally flat surfaces"); here it saturates. Where they touch, silicone wets the metal, which
//! looks darker by the factor w. m is the metal's brightness with scratches, g the ground far
//! behind, s the share of the pixel that the bolt covers, out of focus with its distance. The lamps
//! stand around the camera: a surface that is turned away by the angle whose cosine is n gives
//! less, and so does one that is far away. r is the reflection of the lamps on the free surface of
//! the pad, which turns away from the camera where its slope rises (the lobe of Beckmann and
//! Spizzichino 1963).
//!
//! The model leaves out refraction, light from one part of the pad onto another, and shadows. No
//! constant was fitted to a real sensor: contrasts, light and scratches are drawn over ranges.

use std::f64::consts::TAU;

use libm::{cos, exp, sin, sqrt, tan};

use super::contact::{PAD, PressedPad, SENSOR};
use crate::gel::{Grid, Indenter, Placed};

/// The camera's pixels on the pad.
const PIXELS: Grid = Grid { width: SENSOR.width as usize, height: SENSOR.height as usize, pitch_mm: 0.16 };
/// The pressure P at which 63 % of a pixel are in contact.
const CLOSES_MPA: f64 = 0.004;
/// The distance G over which light falls to 37 %.
const FALLS_MM: f64 = 5.0;
/// The width W of the reflection, as a slope.
const LOBE: f64 = 0.12;
/// Blur of an edge, and the blur that each millimetre of distance adds.
const BLUR_MM: (f64, f64) = (0.2, 0.12);
/// Wavelengths of the scratches along the bolt, and their slant across it.
const SCRATCHES_MM: [(f64, f64); 3] = [(0.9, 0.2), (1.7, -0.4), (3.1, 0.1)];

/// Light, and how bolt and pad reflect it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Light of a white surface, in lux.
    pub lux: f64,
    /// Share of the light that the metal reflects where it faces the camera.
    pub metal: f64,
    /// The same share, relative to the metal, where silicone touches it.
    pub wet: f64,
    /// Brightness far behind the pad.
    pub ground: f64,
    /// Share of the light that the free surface of the pad reflects.
    pub reflection: f64,
    /// Contrast of scratches on the bolt, and their phases in radians.
    pub scratches: (f64, [f64; 3]),
}

/// The view of a bolt, a cylinder; for other indenters, only the contact is visible.
pub(super) struct View<'a> {
    bolt: &'a Placed,
    look: &'a Look,
    lowest_mm: f64,
    radius_mm: f64,
    half_mm: f64,
    turn: [f64; 2],
    slopes: [f64; 2],
}

impl<'a> View<'a> {
    /// The view of a bolt whose lowest point has this height.
    pub(super) fn new(bolt: &'a Placed, lowest_mm: f64, look: &'a Look) -> Self {
        let (radius_mm, half_mm) = match bolt.indenter {
            Indenter::Cylinder { radius_mm, length_mm } => (radius_mm, length_mm / 2.0),
            _ => (0.0, 0.0),
        };
        let turn = [cos(bolt.turn), sin(bolt.turn)];
        Self { bolt, look, lowest_mm, radius_mm, half_mm, turn, slopes: bolt.tilts.map(tan) }
    }

    /// Draws the picture with the bolt and its contact moved by `place_mm`. O(pixels).
    pub(super) fn draw(&self, pad: &PressedPad, depth_mm: f64, place_mm: [f64; 2], picture: &mut [f32]) {
        let contact: Vec<f64> = pad
            .pressure_mpa()
            .iter()
            .map(|&p| if p > 0.0 { 1.0 - exp(-p / CLOSES_MPA) } else { 0.0 })
            .collect();
        let reflection = self.reflection(pad.displacement_mm());
        let blur_mm = BLUR_MM.0 + BLUR_MM.1 * (-depth_mm).max(0.0);
        for (i, pixel) in picture.iter_mut().enumerate() {
            let (x, y) = PIXELS.place(i % PIXELS.width, i / PIXELS.width);
            let (x, y) = (x - place_mm[0], y - place_mm[1]);
            let at = Corner::of(x, y);
            let touched = at.mixed(&contact);
            let (behind, metal) = self.behind((x, y), depth_mm, at.mixed(pad.displacement_mm()), blur_mm);
            let free = behind + at.mixed(&reflection);
            *pixel = ((1.0 - touched) * free + touched * self.look.wet * metal) as f32;
        }
    }

    /// The light through an untouched pad, and the metal's brightness; 0 beside the metal.
    fn behind(&self, (x, y): (f64, f64), depth_mm: f64, displacement_mm: f64, blur_mm: f64) -> (f64, f64) {
        let Look { metal, ground, scratches: (contrast, phases), .. } = *self.look;
        let (x, y) = (x - self.bolt.at_mm[0], y - self.bolt.at_mm[1]);
        let [cosine, sine] = self.turn;
        let (along, across) = (cosine * x + sine * y, cosine * y - sine * x);
        let inside = |reach: f64, place: f64| (0.5 + (reach - place.abs()) / blur_mm).clamp(0.0, 1.0);
        let covered = inside(self.radius_mm, across) * inside(self.half_mm, along);
        if covered == 0.0 {
            return (ground, 0.0);
        }
        let lines = SCRATCHES_MM
            .iter()
            .zip(phases)
            .map(|((length, slant), phase)| sin(TAU * (along + slant * across) / length + phase));
        let metal = metal * (1.0 + contrast * lines.sum::<f64>());
        let facing = (1.0 - across * across / (self.radius_mm * self.radius_mm)).max(0.0);
        let height = self.radius_mm * (1.0 - sqrt(facing)) + self.slopes[0] * x + self.slopes[1] * y;
        let gap = (height - self.lowest_mm - depth_mm + displacement_mm).max(0.0);
        let bright = metal * (0.3 + 0.7 * facing) * exp(-gap / FALLS_MM);
        (ground + covered * (bright - ground), metal)
    }

    /// The reflection of the free surface at each pixel of the pad.
    fn reflection(&self, displacement_mm: &[f64]) -> Vec<f64> {
        let Grid { width, height, pitch_mm } = PAD;
        let slope = |index: usize, count: usize, at: &dyn Fn(usize) -> f64| {
            let (before, after) = (index.saturating_sub(1), (index + 1).min(count - 1));
            (at(after) - at(before)) / ((after - before) as f64 * pitch_mm)
        };
        let lobe = |i: usize| {
            let (column, row) = (i % width, i / width);
            let along_x = slope(column, width, &|column| displacement_mm[row * width + column]);
            let along_y = slope(row, height, &|row| displacement_mm[row * width + column]);
            let squared = along_x * along_x + along_y * along_y;
            self.look.reflection * exp(-squared / (2.0 * LOBE * LOBE))
        };
        (0..PAD.pixels()).map(lobe).collect()
    }
}

/// A point between four pixels of the pad.
struct Corner {
    first: usize,
    share: [f64; 2],
}

impl Corner {
    fn of(x: f64, y: f64) -> Self {
        let split = |place: f64, count: usize| {
            let at = (place / PAD.pitch_mm + (count - 1) as f64 / 2.0).clamp(0.0, (count - 1) as f64);
            let first = (at as usize).min(count - 2);
            (first, at - first as f64)
        };
        let ((column, along), (row, across)) = (split(x, PAD.width), split(y, PAD.height));
        Self { first: row * PAD.width + column, share: [along, across] }
    }

    /// The field there, linear between the pixels.
    fn mixed(&self, field: &[f64]) -> f64 {
        let [along, across] = self.share;
        let line = |first: usize| field[first] + along * (field[first + 1] - field[first]);
        let (upper, lower) = (line(self.first), line(self.first + PAD.width));
        upper + across * (lower - upper)
    }
}
