//! Draws a contact over its image.
//!
//! Input: an image, its contact, its forces. Output: a copy with these drawn over it: forces in
//! contact by colour and opacity (out = (image (255 - a) + colour a) / 255, rounded); the outline,
//! which is contact at the border or next to a pixel (above, below, left, right) without contact; a
//! cross at the centroid.

use super::{Centroid, ContactError, ImageSize, same_length, setting};

/// A picture of a contact.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// The image (H, W, 3), interleaved.
    pub rgb: &'a [u8],
    /// Pixels (H, W) in contact.
    pub mask: &'a [bool],
    /// Forces (H, W) in N per pixel, if any.
    pub force: Option<&'a [f32]>,
    /// Position of the cross, if any.
    pub centroid: Option<Centroid>,
}

/// Colours and sizes of the drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlay {
    pub(crate) size: ImageSize,
    pub(crate) full_scale_n: f32,
    /// Colours of the forces, from none to the full scale.
    pub colours: ColourMap,
    /// Colour of the outline.
    pub outline: [u8; 3],
    /// Colour of the cross.
    pub cross: [u8; 3],
    /// Length of the arms of the cross, in pixels from its centre.
    pub arm: usize,
}

impl Overlay {
    /// Draws over images of this size. Forces of `full_scale_n` per pixel or more have the
    /// strongest colour; the outline is white, the cross blue with arms of 6 pixels.
    ///
    /// # Errors
    /// [`ContactError::Setting`] for `full_scale_n` not positive and finite, or a bad size.
    pub fn new(size: ImageSize, full_scale_n: f32) -> Result<Self, ContactError> {
        size.pixels()?;
        let holds = full_scale_n > 0.0 && full_scale_n.is_finite();
        setting("full scale (N per pixel)", "a positive number", full_scale_n.into(), holds)?;
        let (colours, outline, cross) = (ColourMap::HEAT, [255; 3], [0, 90, 255]);
        Ok(Self { size, full_scale_n, colours, outline, cross, arm: 6 })
    }

    /// Draws into `out` (H, W, 3); O(pixels).
    ///
    /// # Errors
    /// [`ContactError::Length`] if a part of the picture or `out` has another size.
    pub fn draw(&self, picture: &Picture<'_>, out: &mut [u8]) -> Result<(), ContactError> {
        let Picture { rgb, mask, force, centroid } = *picture;
        let pixels = self.size.pixels()?;
        same_length("image (3 bytes a pixel)", pixels * 3, rgb.len())?;
        same_length("mask", pixels, mask.len())?;
        same_length("map of forces", pixels, force.map_or(pixels, <[f32]>::len))?;
        same_length("overlay (3 bytes a pixel)", pixels * 3, out.len())?;
        out.copy_from_slice(rgb);
        for at in (0..mask.len()).filter(|&at| mask[at]) {
            let pixel = &mut out[at * 3..at * 3 + 3];
            if self.is_edge(mask, at) {
                pixel.copy_from_slice(&self.outline);
            } else if let Some(force) = force {
                blend(pixel, self.colours.at(force[at] / self.full_scale_n));
            }
        }
        if let Some(Centroid { x_px, y_px, .. }) = centroid {
            self.draw_cross(out, x_px.round() as i64, y_px.round() as i64);
        }
        Ok(())
    }

    /// Whether a pixel in contact lies at the contact's edge.
    fn is_edge(&self, mask: &[bool], at: usize) -> bool {
        let ImageSize { width, height } = self.size;
        let (x, y) = (at % width, at / width);
        let inside = x > 0 && x + 1 < width && y > 0 && y + 1 < height;
        !(inside && mask[at - 1] && mask[at + 1] && mask[at - width] && mask[at + width])
    }

    /// The part of the cross that is on the image.
    fn draw_cross(&self, out: &mut [u8], x: i64, y: i64) {
        let arm = self.arm.min(self.size.width.max(self.size.height)) as i64;
        for step in -arm..=arm {
            for (x, y) in [(x.saturating_add(step), y), (x, y.saturating_add(step))] {
                let on = |place: i64, length: usize| usize::try_from(place).ok().filter(|&p| p < length);
                if let (Some(x), Some(y)) = (on(x, self.size.width), on(y, self.size.height)) {
                    let at = (y * self.size.width + x) * 3;
                    out[at..at + 3].copy_from_slice(&self.cross);
                }
            }
        }
    }
}

pub(crate) fn blend(pixel: &mut [u8], [r, g, b, opacity]: [u8; 4]) {
    let over = u32::from(opacity);
    for (level, colour) in pixel.iter_mut().zip([r, g, b]) {
        *level = ((u32::from(*level) * (255 - over) + u32::from(colour) * over + 127) / 255) as u8;
    }
}

/// A colour map through five colours at 0, 1/4, 1/2, 3/4 and 1, linear between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColourMap {
    /// Red, green, blue and opacity, each from 0 to 255 (opacity 0: transparent).
    pub points: [[u8; 4]; 5],
}

impl ColourMap {
    /// From transparent through yellow and orange to red.
    pub const HEAT: Self = Self {
        points: [
            [255, 255, 160, 0],
            [255, 235, 60, 110],
            [255, 170, 0, 165],
            [240, 80, 0, 200],
            [190, 0, 0, 225],
        ],
    };

    /// The colour at `t`; below 0 and NaN count as 0, above 1 as 1. Halves are rounded upwards.
    pub fn at(&self, t: f32) -> [u8; 4] {
        // NaN is not above 0.
        let place = if t > 0.0 { t.min(1.0) * 4.0 } else { 0.0 };
        let below = (place as usize).min(3);
        let part = place - below as f32;
        std::array::from_fn(|channel| {
            let (a, b) = (f32::from(self.points[below][channel]), f32::from(self.points[below + 1][channel]));
            (a + (b - a) * part + 0.5) as u8
        })
    }
}
