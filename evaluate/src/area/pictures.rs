//! Pictures of presses with their truth, from simulated and from real sensors.

use std::path::Path;

use meissner_io::datasets::BallPictures;
use meissner_models::systems::contact_area::ImageSize;
use meissner_run::RunError;
use meissner_simulator::gel::Grid;
use safetensors::tensor::{Dtype, SafeTensors};
use serde::Serialize;

use crate::error::{EvaluateError, RequestPart, Result, StreamsError};
use crate::streams::{self, bounds, floats, integers, tensor, wrong};

/// The source of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// `meissner simulate gel`: the force on each pixel is known.
    Simulated,
    /// A real sensor under balls: the circle of contact was marked by hand.
    Real,
}

/// A file of pictures, all of one size.
pub(crate) struct Set {
    pub(crate) name: String,
    pub(crate) source: Source,
    pub(crate) size: ImageSize,
    pub(crate) presses: Vec<Press>,
}

/// Consecutive pictures of one press.
pub(crate) struct Press {
    pub(crate) kind: String,
    /// The sensor at rest.
    pub(crate) reference: Vec<u8>,
    /// Width of a pixel on the surface; `None` where it is not known.
    pub(crate) pixel_mm: Option<f64>,
    pub(crate) pictures: Vec<Labelled>,
}

/// A picture, interleaved RGB.
pub(crate) struct Labelled {
    pub(crate) rgb: Vec<u8>,
    pub(crate) truth: Truth,
}

/// The truth about a picture.
pub(crate) enum Truth {
    /// Normal force on the surface of each pixel in N.
    Force(Vec<f32>),
    /// Pixels in contact.
    Contact(Vec<bool>),
}

impl Labelled {
    pub(crate) fn force_n(&self) -> Option<f64> {
        match &self.truth {
            Truth::Force(force) => Some(force.iter().map(|&force| f64::from(force)).sum()),
            Truth::Contact(_) => None,
        }
    }
}

/// Factor by which real pictures are enlarged: pictures of the balls have half as many pixels along
/// a side as networks read.
const ENLARGED: usize = 2;

impl Set {
    /// The pictures in an archive of balls (.npz), or a file of `meissner simulate gel`.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        if path.extension().is_some_and(|extension| extension == "npz") {
            return Ok(Self::of_balls(&path.display().to_string(), &BallPictures::read(path)?));
        }
        let bytes = meissner_io::read_whole(path).map_err(RunError::File)?;
        let set = Self::read_bytes(&path.display().to_string(), &bytes)
            .map_err(|source| EvaluateError::Streams { path: path.to_owned(), source })?;
        if set.pictures() == 0 {
            let found = format!("{}: none", path.display());
            return Err(EvaluateError::request(RequestPart::Pictures, "pictures", found));
        }
        Ok(set)
    }

    pub(crate) fn pictures(&self) -> usize {
        self.presses.iter().map(|press| press.pictures.len()).sum()
    }

    pub(crate) fn check(&self, network: &str, size: ImageSize) -> Result<()> {
        if self.size == size {
            return Ok(());
        }
        let shown = |size: ImageSize| format!("{} x {} pixels", size.width, size.height);
        let expected = format!("pictures of {}, for {network}", shown(size));
        Err(EvaluateError::request(
            RequestPart::Pictures,
            expected,
            format!("{}: {}", self.name, shown(self.size)),
        ))
    }

    pub(crate) fn read_bytes(name: &str, bytes: &[u8]) -> Result<Self, StreamsError> {
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let file = SafeTensors::deserialize(bytes)?;
        let pictures = tensor(&file, "picture", Dtype::U8, "U8 (pictures, H, W, 3)")?;
        let &[count, height, width, 3] = pictures.shape() else {
            return Err(wrong("picture", "U8 (pictures, H, W, 3)", &pictures));
        };
        let pixels = height * width;
        let start = bounds(&integers(&file, "start", None)?, count)?;
        let presses = start.len().saturating_sub(1);
        let expect = |name: &str, dtype: Dtype, shape: &[usize]| {
            let expected = format!("{dtype:?} {shape:?}");
            let view = tensor(&file, name, dtype, &expected)?;
            if view.shape() == shape { Ok(view.data().to_vec()) } else { Err(wrong(name, &expected, &view)) }
        };
        let forces = floats(&expect("force", Dtype::F32, &[count, height, width])?);
        let references = expect("reference", Dtype::U8, &[presses, height, width, 3])?;
        let pixel_mm = floats(&expect("pixel_mm", Dtype::F32, &[presses])?);
        let kinds = header.metadata().as_ref().and_then(|metadata| metadata.get("indenters"));
        let kinds: Vec<String> = kinds.and_then(|kinds| serde_json::from_str(kinds).ok()).unwrap_or_default();
        let finite = |list: &str, values: &[f32], least: f32| match values
            .iter()
            .position(|v| !v.is_finite() || *v < least)
        {
            Some(at) => Err(streams::value(
                list,
                at,
                format!("a finite number of at least {least}"),
                values[at].to_string(),
            )),
            None => Ok(()),
        };
        finite("force", &forces, 0.0)?;
        finite("pixel_mm", &pixel_mm, f32::MIN_POSITIVE)?;
        let labelled = |i: usize| Labelled {
            rgb: pictures.data()[3 * pixels * i..3 * pixels * (i + 1)].to_vec(),
            truth: Truth::Force(forces[pixels * i..pixels * (i + 1)].to_vec()),
        };
        let press = |i: usize| Press {
            kind: kinds.get(i).map_or("unknown", String::as_str).to_owned(),
            reference: references[3 * pixels * i..3 * pixels * (i + 1)].to_vec(),
            pixel_mm: Some(pixel_mm[i].into()),
            pictures: (start[i]..start[i + 1]).map(labelled).collect(),
        };
        Ok(Self {
            name: name.to_owned(),
            source: Source::Simulated,
            size: ImageSize { width, height },
            presses: (0..presses).map(press).collect(),
        })
    }

    /// Pictures of balls, enlarged, and turned to be wider than high as simulated ones are.
    pub(crate) fn of_balls(name: &str, balls: &BallPictures) -> Self {
        let (width, height) = (balls.width, balls.height);
        let is_upright = height > width;
        let size = if is_upright { [height, width] } else { [width, height] }.map(|side| ENLARGED * side);
        let grid = Grid { width, height, pitch_mm: 1.0 };
        // The index in the real picture. Rows become columns, columns become rows from below.
        let place = |column: usize, row: usize| {
            let [x, y] = [column, row].map(|at| (at as f64 + 0.5) / ENLARGED as f64 - 0.5);
            if is_upright { [(width - 1) as f64 - y, x] } else { [x, y] }
        };
        let enlarge = |picture: &[u8]| {
            let mut enlarged = Vec::with_capacity(size[0] * size[1] * 3);
            for (row, column) in (0..size[1]).flat_map(|row| (0..size[0]).map(move |column| (row, column))) {
                let place = place(column, row);
                enlarged.extend((0..3).map(|channel| {
                    grid.between(place, |i| f64::from(picture[3 * i + channel])).round() as u8
                }));
            }
            enlarged
        };
        let inside = |[x, y, radius]: [f64; 3]| {
            let pixels = (0..size[1]).flat_map(|row| (0..size[0]).map(move |column| place(column, row)));
            pixels.map(|[column, row]| (column - x).hypot(row - y) <= radius).collect()
        };
        let reference = enlarge(&balls.background);
        let press = |ball: &meissner_io::datasets::Ball| Press {
            kind: "ball".to_owned(),
            reference: reference.clone(),
            pixel_mm: None,
            pictures: vec![Labelled {
                rgb: enlarge(&ball.picture),
                truth: Truth::Contact(inside(ball.circle)),
            }],
        };
        let presses = balls.balls.iter().map(press).collect();
        let name = name.to_owned();
        Self { name, source: Source::Real, size: ImageSize { width: size[0], height: size[1] }, presses }
    }
}
