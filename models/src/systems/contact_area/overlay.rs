//! Enters: an image, its contact, its forces. Leaves: the image with these drawn over it.
//!
//! First the forces of the pixels in contact, by colour and opacity (out = (image (255 - a) + colour a) / 255, rounded),
//! then the outline: pixels in contact with a neighbour above, below, left or right that is not, or with none; then a
//! cross at the centroid.

use super::colour_map::ColourMap;
use super::error::{ContactError, same_length, setting};
use super::geometry::{Centroid, ImageSize};

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// The image (H, W, 3), interleaved.
    pub rgb: &'a [u8],
    /// Pixels (H, W) in contact.
    pub mask: &'a [bool],
    /// Forces (H, W) in N per pixel, where there are any.
    pub force: Option<&'a [f32]>,
    /// Where the cross is drawn, if at all.
    pub centroid: Option<Centroid>,
}

/// How it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlay {
    size: ImageSize,
    full_scale_n: f32,
    /// Colours of the forces, from none to the full scale.
    pub colours: ColourMap,
    /// Colour of the outline.
    pub outline: [u8; 3],
    /// Colour of the cross.
    pub cross: [u8; 3],
    /// Pixels of each of the cross's arms beside its centre.
    pub arm: usize,
}

impl Overlay {
    /// For images of this size; a force of `full_scale_n` per pixel or more has the strongest colour. The outline is
    /// white, the cross blue with arms of 6 pixels.
    ///
    /// # Errors
    /// [`ContactError::Setting`] where `full_scale_n` is not positive and finite, or the size empty or too large.
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
    /// [`ContactError::Length`] where a part of the picture or `out` is not of the size.
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

/// Lays a colour over a pixel.
fn blend(pixel: &mut [u8], [r, g, b, opacity]: [u8; 4]) {
    let over = u32::from(opacity);
    for (level, colour) in pixel.iter_mut().zip([r, g, b]) {
        *level = ((u32::from(*level) * (255 - over) + u32::from(colour) * over + 127) / 255) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::{Overlay, Picture, blend};
    use crate::systems::contact_area::{Centroid, ColourMap, ContactError, ImageSize};

    const SIZE: ImageSize = ImageSize { width: 5, height: 5 };

    fn drawn(mask: &[bool], force: Option<&[f32]>, centroid: Option<(f64, f64)>) -> Vec<[u8; 3]> {
        let centroid = centroid.map(|(x_px, y_px)| Centroid { x_px, y_px, x_mm: 0.0, y_mm: 0.0 });
        let overlay = Overlay { arm: 1, ..Overlay::new(SIZE, 2.0).unwrap() };
        let mut out = vec![0; 75];
        overlay.draw(&Picture { rgb: &[100; 75], mask, force, centroid }, &mut out).unwrap();
        out.as_chunks().0.to_vec()
    }

    /// Rows and columns 1 to 3.
    fn square() -> [bool; 25] {
        std::array::from_fn(|at| (1..4).contains(&(at % 5)) && (1..4).contains(&(at / 5)))
    }

    #[test]
    fn without_a_contact_the_image_stays() {
        assert_eq!(drawn(&[false; 25], Some(&[9.0; 25]), None), [[100; 3]; 25]);
    }

    #[test]
    fn a_contact_has_an_outline_and_forces_inside_it() {
        let found = drawn(&square(), Some(&[1.0; 25]), None);
        // Half of the full scale: 255, 170, 0 with an opacity of 165 over 100.
        // (100 * 90 + 255 * 165) / 255 = 200.3, (9000 + 170 * 165) / 255 = 145.3, 9000 / 255 = 35.3.
        for (at, pixel) in found.into_iter().enumerate() {
            let expected = match (square()[at], at) {
                (_, 12) => [200, 145, 35],
                (true, _) => [255; 3],
                (false, _) => [100; 3],
            };
            assert_eq!(pixel, expected, "pixel {at}");
        }
        assert_eq!(drawn(&square(), None, None)[12], [100; 3]);
    }

    #[test]
    fn a_contact_at_the_border_has_its_outline_there() {
        let found = drawn(&[true; 25], None, None);
        let edges = found.iter().filter(|pixel| **pixel == [255; 3]).count();
        assert_eq!((edges, found[12]), (16, [100; 3]));
    }

    #[test]
    fn the_cross_is_cut_at_the_border() {
        let blue = [0, 90, 255];
        let places = |x, y| -> Vec<usize> {
            let found = drawn(&[false; 25], None, Some((x, y)));
            (0..25).filter(|&at| found[at] == blue).collect()
        };
        assert_eq!(places(2.4, 1.5), [7, 11, 12, 13, 17]);
        assert_eq!(places(0.0, 0.0), [0, 1, 5]);
        assert_eq!(places(-1.0, 4.0), [20]);
        assert!(places(f64::INFINITY, f64::MIN).is_empty());
    }

    #[test]
    fn an_opaque_colour_covers_and_a_transparent_one_does_not() {
        let mut pixel = [10, 20, 30];
        blend(&mut pixel, [200, 210, 220, 0]);
        assert_eq!(pixel, [10, 20, 30]);
        blend(&mut pixel, [200, 210, 220, 255]);
        assert_eq!(pixel, [200, 210, 220]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let overlay = Overlay::new(SIZE, 2.0).unwrap();
        assert_eq!(overlay.colours, ColourMap::HEAT);
        let (rgb, mask, force) = ([0; 75], [false; 25], [0.0; 25]);
        let whole = Picture { rgb: &rgb, mask: &mask, force: Some(&force), centroid: None };
        let cut = [
            Picture { rgb: &rgb[1..], ..whole },
            Picture { mask: &mask[1..], ..whole },
            Picture { force: Some(&force[1..]), ..whole },
        ];
        for picture in cut {
            assert!(matches!(overlay.draw(&picture, &mut [0; 75]), Err(ContactError::Length { .. })));
        }
        assert!(overlay.draw(&whole, &mut [0; 74]).is_err());
        for scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(Overlay::new(SIZE, scale).is_err());
        }
    }
}
