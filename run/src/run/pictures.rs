//! Runs a network over pictures of a tactile sensor: contact areas, forces, overlays.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use meissner_engine::frames::{FrameCounters, FrameOptions, FrameShape};
use meissner_io::{Image, ImageSequence, read_image, write_png};
use meissner_models::FrameSource;
use meissner_models::systems::contact_area::{
    ContactMeter, ContactReport, ContactSettings, DifferenceBaseline, DifferenceSettings, ForceNormalisation,
    ImageNormalisation, ImageSize, Overlay, Picture, PixelSize,
};

use crate::error::{Result, RunError};
use crate::interrupt;
use crate::latency::microseconds;
use crate::model::FrameModel;
use crate::run::prediction::{Observer, PicturePrediction, Prediction};
use crate::run::summary::FramePredictor;
use crate::run::summary::{Ended, Ending, FrameSummary, InputCounts, Summary};

/// A pixel is in contact if it differs from the reference by more than this, in levels.
const DIFFERENCE: f32 = 10.0;
/// Pixels to each side of the box over which differences are averaged.
pub const BLUR_RADIUS: usize = 2;

/// Options of a run over pictures.
#[derive(Clone, Debug, Default)]
pub struct PictureOptions {
    /// Largest number of pictures to take.
    pub limit: Option<u64>,
    /// Picture without contact, to compare with by plain differences.
    pub reference: Option<PathBuf>,
    /// Folder for overlays.
    pub overlay: Option<PathBuf>,
    /// Force in N per pixel at the strongest colour; by default the strongest of each picture.
    pub full_scale_n: Option<f32>,
}

/// A network over pictures with its pictures, before the run.
pub struct PictureRun {
    pictures: ImageSequence,
    /// The first picture, read before anything is shown, so that a wrong size is found early.
    first: Option<(PathBuf, Image)>,
    count: u64,
    limit: usize,
    taken: u64,
    measure: Measure,
}

/// The contacts of pictures, and what is made of them.
struct Measure {
    network: String,
    contacts: ContactPredictor,
    baseline: Option<DifferenceBaseline>,
    overlays: Option<Overlays>,
}

impl PictureRun {
    /// A run of `model` over the picture, the folder of pictures or the list of pictures at `path`.
    ///
    /// # Errors
    /// The model does not predict forces from pictures, the first picture or the reference cannot
    /// be read or has a different size, or overlays would replace input files.
    pub fn open(
        model: &FrameModel,
        frame_options: FrameOptions,
        path: &Path,
        options: &PictureOptions,
    ) -> Result<Self> {
        interrupt::listen();
        let mut pictures = ImageSequence::open(path)?;
        let count = pictures.len() as u64;
        let limit = usize::try_from(options.limit.unwrap_or(u64::MAX)).unwrap_or(usize::MAX);
        let measure =
            Measure::new(model, frame_options, options, &pictures.paths()[..pictures.len().min(limit)])?;
        let first = if limit > 0 { pictures.next().transpose()? } else { None };
        if let Some((path, image)) = &first {
            measure.check(path, image)?;
        }
        Ok(Self { pictures, first, count, limit, taken: 0, measure })
    }

    /// The number of pictures.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Takes all pictures, or the pictures up to a [requested](interrupt::requested) end.
    pub fn run(mut self, observer: &mut dyn Observer) -> Ended {
        let ending = Ending(self.take_all(observer));
        let counts = InputCounts::Pictures { pictures: self.taken };
        let summary = FrameSummary::new(&self.measure.contacts.predictor, counts, Vec::new());
        Ended { summary: Summary::Frames(summary), result: ending.0 }
    }

    fn take_all(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let Self { pictures, first, limit, taken, measure, .. } = self;
        for picture in first.take().map(Ok).into_iter().chain(pictures).take(*limit) {
            if interrupt::requested() {
                break;
            }
            let (path, image): (PathBuf, Image) = picture?;
            measure.check(&path, &image)?;
            measure.take(observer, *taken + 1, &path, &image)?;
            *taken += 1;
        }
        Ok(())
    }
}

impl Measure {
    fn new(
        model: &FrameModel,
        frame_options: FrameOptions,
        options: &PictureOptions,
        paths: &[PathBuf],
    ) -> Result<Self> {
        let contacts = ContactPredictor::new(model, frame_options)?;
        let (size, pixel) = (contacts.size(), contacts.pixel());
        let mut measure = Self { network: model.name.clone(), contacts, baseline: None, overlays: None };
        if let Some(path) = &options.reference {
            let reference = read_image(path)?;
            measure.check(path, &reference)?;
            measure.contacts.set_reference(&reference.data);
            let settings =
                DifferenceSettings { size, pixel, threshold: DIFFERENCE, blur_radius: BLUR_RADIUS };
            measure.baseline = Some(DifferenceBaseline::new(&reference.data, settings)?);
        }
        if let Some(folder) = &options.overlay {
            measure.overlays = Some(Overlays::new(folder, paths, size, options.full_scale_n)?);
        }
        Ok(measure)
    }

    /// Refuses an image whose size differs from the network's input.
    fn check(&self, path: &Path, image: &Image) -> Result<()> {
        let ImageSize { width, height } = self.contacts.size();
        let (expected, found) = ((width, height), image.size());
        if found == expected {
            return Ok(());
        }
        Err(RunError::PictureSize { path: path.to_owned(), network: self.network.clone(), expected, found })
    }

    /// Measures picture number `taken`, and shows the result.
    fn take(&mut self, observer: &mut dyn Observer, taken: u64, path: &Path, image: &Image) -> Result<()> {
        let contact = self.contacts.measure(&image.data)?;
        let update_us = microseconds(self.contacts.take_update());
        let baseline = self.baseline.as_mut().map(|baseline| baseline.measure(&image.data)).transpose()?;
        let picture = Picture {
            rgb: &image.data,
            mask: self.contacts.mask(),
            force: Some(self.contacts.force()),
            centroid: contact.centroid,
        };
        let overlays = self.overlays.as_mut();
        let overlay = overlays.map(|overlays| overlays.write(path, image, &picture)).transpose()?;
        let prediction = PicturePrediction {
            image: &path.display().to_string(),
            contact,
            baseline,
            overlay: overlay.as_deref(),
            update_us,
            taken,
        };
        observer.prediction(&Prediction::Picture(prediction)).map_err(RunError::Output)
    }
}

/// Draws forces over pictures, and writes the overlays into a folder.
struct Overlays {
    folder: PathBuf,
    size: ImageSize,
    full_scale_n: Option<f32>,
    drawn: Vec<u8>,
}

impl Overlays {
    /// Prepares overlays of the pictures in `paths`. Creates `folder` if it does not exist.
    ///
    /// # Errors
    /// Two pictures have one name, or an overlay would replace its picture.
    fn new(folder: &Path, paths: &[PathBuf], size: ImageSize, full_scale_n: Option<f32>) -> Result<Self> {
        let drawn = vec![0; size.pixels()? * 3];
        let overlays = Self { folder: folder.to_owned(), size, full_scale_n, drawn };
        let pictures: Vec<PathBuf> = paths.iter().filter_map(|path| path.canonicalize().ok()).collect();
        let mut targets: Vec<(PathBuf, &PathBuf)> =
            paths.iter().map(|path| (overlays.target(path), path)).collect();
        for (target, _) in &targets {
            if target.canonicalize().is_ok_and(|target| pictures.contains(&target)) {
                return Err(RunError::OverlayTaken { path: target.clone(), other: "a picture".to_owned() });
            }
        }
        targets.sort();
        if let Some(pair) = targets.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            let other = format!("the overlay of {}", pair[0].1.display());
            return Err(RunError::OverlayTaken { path: pair[1].0.clone(), other });
        }
        Ok(overlays)
    }

    /// The path of the overlay of the picture at `path`.
    fn target(&self, path: &Path) -> PathBuf {
        let mut name: OsString = path.file_stem().unwrap_or_default().to_owned();
        name.push(".png");
        self.folder.join(name)
    }

    /// Writes the overlay of `picture`, which was read from `path`, and returns its path.
    fn write(&mut self, path: &Path, image: &Image, picture: &Picture<'_>) -> Result<String> {
        let forces = picture.force.unwrap_or_default();
        let strongest = forces.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let overlay = Overlay::new(self.size, self.full_scale_n.unwrap_or(strongest))?;
        overlay.draw(picture, &mut self.drawn)?;
        let target = self.target(path);
        // Not before there is something to put into it.
        let made = fs::create_dir_all(&self.folder);
        made.map_err(|source| RunError::file("write", &self.folder, source))?;
        write_png(&target, image.width, image.height, &self.drawn)?;
        Ok(target.display().to_string())
    }
}

/// Contacts in one picture after another.
///
/// Where pictures enter as differences, the first is the reference unless one was set.
pub struct ContactPredictor {
    size: ImageSize,
    pixel: PixelSize,
    difference: bool,
    reference: Option<Vec<u8>>,
    images: ImageNormalisation,
    forces: ForceNormalisation,
    meter: ContactMeter,
    pub(super) predictor: FramePredictor,
    planes: Vec<f32>,
    force: Vec<f32>,
}

impl ContactPredictor {
    /// Contacts that `model` predicts.
    ///
    /// # Errors
    /// The model does not predict forces from pictures, or it refuses `options`.
    pub fn new(model: &FrameModel, options: FrameOptions) -> Result<Self> {
        let (input, output) = (model.description.input(), model.description.output());
        let (FrameSource::Picture(settings), FrameShape::Image { height, width, .. }) = (model.source, input)
        else {
            return Err(RunError::is_frame_network(&model.name));
        };
        let expected = FrameShape::Image { channels: 1, height, width };
        if output != expected {
            let expected = format!("a prediction of {expected}, a force for each pixel");
            return Err(RunError::other_network(&model.name, expected, output.to_string()));
        }
        let (size, pixel) = (ImageSize { width, height }, settings.pixel_size()?);
        let (threshold_n, median_window) = (settings.threshold_n, settings.median_window);
        Ok(Self {
            size,
            pixel,
            difference: settings.difference,
            reference: None,
            images: settings.image_normalisation()?,
            forces: settings.force_normalisation()?,
            meter: ContactMeter::new(ContactSettings { size, pixel, threshold_n, median_window })?,
            predictor: FramePredictor::new(model.network.clone(), options, &model.card.outputs)?,
            planes: vec![0.0; input.values()],
            force: vec![0.0; output.values()],
        })
    }

    /// Size of the pictures.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Size of a pixel on the surface of the sensor.
    pub fn pixel(&self) -> PixelSize {
        self.pixel
    }

    /// Sets the picture without contact, interleaved RGB, for differences.
    pub fn set_reference(&mut self, rgb: &[u8]) {
        self.reference = Some(rgb.to_vec());
    }

    /// The contact in the next picture, interleaved RGB: [`Self::push`] and [`Self::predict`].
    ///
    /// # Errors
    /// The picture or the reference has another size, or a force is not finite.
    pub fn measure(&mut self, rgb: &[u8]) -> Result<ContactReport> {
        self.push(rgb)?;
        self.predict()
    }

    /// Takes the next picture, interleaved RGB.
    ///
    /// # Errors
    /// The picture or the reference has another size.
    pub fn push(&mut self, rgb: &[u8]) -> Result<()> {
        let start = Instant::now();
        let reference = self.difference.then(|| &**self.reference.get_or_insert_with(|| rgb.to_vec()));
        self.images.apply(rgb, reference, &mut self.planes)?;
        self.predictor.prepared(start.elapsed());
        Ok(self.predictor.push(&self.planes)?)
    }

    /// The contact in the last picture.
    ///
    /// # Errors
    /// A force is not finite.
    pub fn predict(&mut self) -> Result<ContactReport> {
        self.predictor.predict(|predicted| {
            for (force, &y) in self.force.iter_mut().zip(predicted.values) {
                *force = self.forces.force(y);
            }
            Ok(self.meter.measure(&self.force)?)
        })
    }

    /// The forces (H, W) of the last picture, in N per pixel.
    pub fn force(&self) -> &[f32] {
        &self.force
    }

    /// The pixels (H, W) in contact in the last picture.
    pub fn mask(&self) -> &[bool] {
        self.meter.mask()
    }

    /// Time spent on pictures since the last call.
    pub fn take_update(&mut self) -> Duration {
        self.predictor.take_update()
    }

    /// What was computed and what was skipped.
    pub fn counters(&self) -> FrameCounters {
        self.predictor.counters()
    }

    /// Forgets all pictures, the reference among them.
    pub fn reset(&mut self) {
        self.reference = None;
        self.predictor.reset();
        self.meter.reset();
    }
}
