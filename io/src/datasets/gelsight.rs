//! `GelSight` sensors, from arrays in a `NumPy` archive: pictures of balls pressed on a sensor,
//! with the circle of contact, and tables of the colours of slopes.

use std::path::Path;

use crate::error::IoError;
use crate::{npy, zip};

/// Pictures of one sensor with a ball on it.
#[derive(Clone, Debug, PartialEq)]
pub struct BallPictures {
    /// Columns of a picture.
    pub width: usize,
    /// Rows of a picture.
    pub height: usize,
    /// The sensor at rest, row by row, with red, green and blue of a pixel side by side.
    pub background: Vec<u8>,
    /// The pictures.
    pub balls: Vec<Ball>,
}

/// A picture of a ball that is pressed on the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Ball {
    /// The picture, like the background. Levels beyond 0 to 255 are cut.
    pub picture: Vec<u8>,
    /// Column and row of the middle of the contact, and its radius, in pixels.
    pub circle: [f64; 3],
}

impl BallPictures {
    /// Reads the archive (npz) at `path`: `background` `|u1` (height, width, 3), `difference` `<i2`
    /// (pictures, height, width, 3), a picture minus the background, and `circle` `<f8` (pictures,
    /// 3). Other arrays are ignored. O(bytes).
    ///
    /// # Errors
    /// [`IoError`], with the path, if the archive cannot be read, an array is missing or has
    /// another type, shapes do not fit, or a circle is not finite.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(IoError::file("read", path))?;
        let (mut background, mut difference, mut circle) = (None, None, None);
        zip::for_each(&bytes, |name, content| {
            match name {
                "background.npy" => {
                    let npy::Array { shape, values, .. } = npy::array_of::<3, 1>(content, "|u1")?;
                    background = Some((shape, values.as_flattened().to_vec()));
                }
                "difference.npy" => {
                    let npy::Array { shape, values, .. } = npy::array_of::<4, 2>(content, "<i2")?;
                    let values: Vec<_> = values.iter().map(|&bytes| i16::from_le_bytes(bytes)).collect();
                    difference = Some((shape, values));
                }
                "circle.npy" => {
                    let npy::Array { shape, values, .. } = npy::array_of::<2, 8>(content, "<f8")?;
                    let values: Vec<_> = values.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect();
                    circle = Some((shape, values));
                }
                _ => {}
            }
            Ok(())
        })
        .map_err(IoError::content(path))?;
        let missing = |array: &str| IoError::unfit(path, format!("an array {array}"), "none");
        let ([height, width, colours], background) = background.ok_or_else(|| missing("background"))?;
        let (differences, difference) = difference.ok_or_else(|| missing("difference"))?;
        let (circles, circle) = circle.ok_or_else(|| missing("circle"))?;
        let pictures = differences[0];
        if colours != 3
            || width * height == 0
            || differences != [pictures, height, width, 3]
            || circles != [pictures, 3]
        {
            let expected = "background (height, width, 3), difference (pictures, height, width, 3), circle (pictures, 3)";
            let found = format!("{:?}, {differences:?}, {circles:?}", [height, width, colours]);
            return Err(IoError::unfit(path, expected, found));
        }
        if let Some(found) = circle.iter().find(|value| !value.is_finite()) {
            return Err(IoError::unfit(path, "finite circles", found.to_string()));
        }
        let picture = |difference: &[i16]| {
            let levels = difference.iter().zip(&background);
            levels.map(|(&moved, &level)| (i32::from(level) + i32::from(moved)).clamp(0, 255) as u8).collect()
        };
        let balls = difference.chunks_exact(background.len()).zip(circle.as_chunks().0);
        let balls =
            balls.map(|(difference, &circle)| Ball { picture: picture(difference), circle }).collect();
        Ok(Self { width: width as usize, height: height as usize, background, balls })
    }
}

/// How the colour of a pixel changes with the slope of the surface, as measured on a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SlopeColours {
    /// Bins of the slope's angle, from 0 to a right angle, and of its direction, a full turn.
    pub bins: usize,
    /// (3 colours, angles, directions, 6): the factors of x^2, y^2, x y, x, y and 1, with column
    /// and row in a picture of 640 x 480 pixels.
    pub table: Vec<f32>,
}

impl SlopeColours {
    /// Reads the array `sensor`, `<f4` (3, bins, bins, 6), of the archive (npz) at `path`.
    /// O(bytes).
    ///
    /// # Errors
    /// [`IoError`], with the path, if the archive cannot be read, or has no such array.
    pub fn read(path: impl AsRef<Path>, sensor: &str) -> Result<Self, IoError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(IoError::file("read", path))?;
        let (mut found, mut names) = (None, Vec::new());
        zip::for_each(&bytes, |name, content| {
            let name = name.trim_end_matches(".npy");
            if name == sensor {
                let npy::Array { shape, values, .. } = npy::array_of::<4, 4>(content, "<f4")?;
                found = Some((shape, values.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()));
            }
            names.push(name.to_owned());
            Ok(())
        })
        .map_err(IoError::content(path))?;
        let Some(([colours, bins, directions, terms], table)) = found else {
            return Err(IoError::unfit(path, format!("an array {sensor}"), names.join(", ")));
        };
        if [colours, directions, terms] != [3, bins, 6] {
            let found = format!("{:?}", [colours, bins, directions, terms]);
            return Err(IoError::unfit(path, format!("{sensor} (3, bins, bins, 6)"), found));
        }
        Ok(Self { bins: bins as usize, table })
    }
}
