//! Where overlays go, and what they show.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use meissner_io::{Image, write_png};
use meissner_models::systems::contact_area::{Centroid, ImageSize, Overlay, Picture};

use crate::error::CliError;

/// Draws forces over pictures, into a folder.
pub(super) struct Overlays {
    folder: PathBuf,
    size: ImageSize,
    /// Force of the strongest colour in N per pixel, where it is the same for all.
    full_scale_n: Option<f32>,
    drawn: Vec<u8>,
}

impl Overlays {
    /// Overlays of the pictures in `paths`, in `folder`, which is made where it is not there.
    ///
    /// # Errors
    /// Where two pictures have one name or an overlay would replace its picture, and where the folder cannot be made.
    pub(super) fn new(
        folder: &Path,
        paths: &[PathBuf],
        size: ImageSize,
        full_scale_n: Option<f32>,
    ) -> Result<Self, CliError> {
        fs::create_dir_all(folder).map_err(|source| CliError::Write { path: folder.to_owned(), source })?;
        let overlays =
            Self { folder: folder.to_owned(), size, full_scale_n, drawn: vec![0; size.pixels()? * 3] };
        let pictures: Vec<PathBuf> = paths.iter().filter_map(|path| path.canonicalize().ok()).collect();
        let mut targets: Vec<(PathBuf, &PathBuf)> =
            paths.iter().map(|path| (overlays.target(path), path)).collect();
        for (target, _) in &targets {
            if target.canonicalize().is_ok_and(|target| pictures.contains(&target)) {
                return Err(CliError::OverlayTaken { path: target.clone(), other: "a picture".to_owned() });
            }
        }
        targets.sort();
        if let Some(pair) = targets.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            let other = format!("the overlay of {}", pair[0].1.display());
            return Err(CliError::OverlayTaken { path: pair[1].0.clone(), other });
        }
        Ok(overlays)
    }

    /// Where the overlay of the picture at `path` goes.
    fn target(&self, path: &Path) -> PathBuf {
        let mut name: OsString = path.file_stem().unwrap_or_default().to_owned();
        name.push(".png");
        self.folder.join(name)
    }

    /// Writes the overlay of the picture at `path`, and returns where it is.
    pub(super) fn write(
        &mut self,
        path: &Path,
        image: &Image,
        force: &[f32],
        mask: &[bool],
        centroid: Option<Centroid>,
    ) -> Result<PathBuf, CliError> {
        let strongest = force.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let overlay = Overlay::new(self.size, self.full_scale_n.unwrap_or(strongest))?;
        let picture = Picture { rgb: &image.data, mask, force: Some(force), centroid };
        overlay.draw(&picture, &mut self.drawn)?;
        let target = self.target(path);
        write_png(&target, image.width, image.height, &self.drawn)?;
        Ok(target)
    }
}
