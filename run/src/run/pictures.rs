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
use crate::latency::{Latency, microseconds};
use crate::model::FrameModel;
use crate::run::prediction::{Observer, PicturePrediction, Prediction};
use crate::run::summary::FramePredictor;
use crate::run::summary::{Ended, Ending, FrameSummary, InputCounts, Summary};
use crate::run::video::{Video, VideoOptions, VideoPicture};

/// A pixel is in contact if it differs from the reference by more than this, in levels.
const DIFFERENCE: f32 = 10.0;
/// Pixels to each side of the box over which differences are averaged.
pub const BLUR_RADIUS: usize = 2;

/// Options of a run over pictures.
#[derive(Clone, Debug, Default)]
pub struct PictureOptions {
    /// Largest number of pictures to take; late pictures of a video count too.
    pub limit: Option<u64>,
    /// Format of a raw video, if the input is one.
    pub video: Option<VideoOptions>,
    /// Picture without contact, to compare with by plain differences.
    pub reference: Option<PathBuf>,
    /// Folder for overlays.
    pub overlay: Option<PathBuf>,
    /// Force in N per pixel at the strongest colour; by default the strongest of each picture.
    pub full_scale_n: Option<f32>,
}

/// A network over pictures with its pictures, before the run.
pub struct PictureRun {
    source: Source,
    limit: usize,
    taken: u64,
    measure: Measure,
}

/// The source of pictures.
enum Source {
    Files {
        pictures: ImageSequence,
        /// The first picture, read before anything is shown, so that a wrong size is found early.
        first: Option<(PathBuf, Image)>,
        count: u64,
    },
    Video {
        video: Video,
        period: Option<Duration>,
    },
}

/// A picture, before it is measured.
struct Taken {
    /// The path of its file, or its number in a video, after which its overlay is named.
    path: PathBuf,
    image: Image,
    /// Its number in a video.
    number: Option<u64>,
    /// Time of its arrival on a stream.
    arrived: Option<Instant>,
}

/// The contacts of pictures, and their results.
struct Measure {
    network: String,
    contacts: ContactPredictor,
    baseline: Option<DifferenceBaseline>,
    overlays: Option<Overlays>,
    /// Time from the arrival of a picture to its contact.
    arrival: Latency,
}

/// The pictures in the file, folder or list at `path`, or of the raw video in this file or on this
/// stream, with their paths or numbers, and whether they arrive while they are read.
///
/// # Errors
/// They cannot be opened, or a video comes in datagrams.
pub fn open_pictures(
    path: &Path,
    video: Option<VideoOptions>,
    limit: usize,
) -> Result<(impl Iterator<Item = Result<(PathBuf, Image)>> + Send + 'static, bool)> {
    let source = if let Some(video) = video {
        Source::video(path, video, limit)?
    } else {
        let pictures = ImageSequence::open(path)?;
        Source::Files { count: pictures.len() as u64, pictures, first: None }
    };
    let is_live = matches!(&source, Source::Video { video, .. } if !video.is_recorded);
    Ok((source.take(limit).map(|taken| taken.map(|taken| (taken.path, taken.image))), is_live))
}

impl Source {
    fn video(path: &Path, options: VideoOptions, limit: usize) -> Result<Self> {
        Ok(Self::Video { video: Video::open(path, options, limit)?, period: options.period() })
    }
}

impl PictureRun {
    /// A run of `model` over the picture, the folder of pictures or the list of pictures at `path`,
    /// or over the raw video in this file or on this stream.
    ///
    /// # Errors
    /// The model does not predict forces from pictures, the first picture or the reference cannot
    /// be read or has a different size, overlays would replace input files, or a video has a
    /// different size, cannot be opened or comes in datagrams.
    pub fn open(
        model: &FrameModel,
        frame_options: FrameOptions,
        path: &Path,
        options: &PictureOptions,
    ) -> Result<Self> {
        let limit = usize::try_from(options.limit.unwrap_or(u64::MAX)).unwrap_or(usize::MAX);
        let (source, measure) = if let Some(video) = options.video {
            let measure = Measure::new(model, frame_options, options, &[])?;
            measure.check_video(video)?;
            let source = Source::video(path, video, limit)?;
            interrupt::listen();
            (source, measure)
        } else {
            interrupt::listen();
            let mut pictures = ImageSequence::open(path)?;
            let count = pictures.len() as u64;
            let paths = &pictures.paths()[..pictures.len().min(limit)];
            let measure = Measure::new(model, frame_options, options, paths)?;
            let first = if limit > 0 { pictures.next().transpose()? } else { None };
            if let Some((path, image)) = &first {
                measure.check(path, image)?;
            }
            (Source::Files { pictures, first, count }, measure)
        };
        Ok(Self { source, limit, taken: 0, measure })
    }

    /// The number of pictures; `None` for a video.
    pub fn count(&self) -> Option<u64> {
        match self.source {
            Source::Files { count, .. } => Some(count),
            Source::Video { .. } => None,
        }
    }

    /// Takes all pictures, or the pictures up to a [requested](interrupt::requested) end.
    pub fn run(mut self, observer: &mut dyn Observer) -> Ended {
        let ending = Ending(self.take_all(observer));
        let Self { source, taken, measure, .. } = &mut self;
        let predictor = &mut measure.contacts.predictor;
        let counts = match source {
            Source::Files { .. } => InputCounts::Pictures { pictures: *taken },
            Source::Video { video, period } => {
                let period_us =
                    period.map_or(0, |period| u64::try_from(period.as_micros()).unwrap_or(u64::MAX));
                predictor.passed.add(taken.saturating_mul(period_us));
                InputCounts::Video(video.counts())
            }
        };
        let mut summary = FrameSummary::new(predictor, counts, Vec::new());
        let arrival = measure.arrival.quantiles().map(|quantiles| ("arrival", Some(quantiles)));
        summary.latency_us.0.extend(arrival);
        Ended { summary: Summary::Frames(summary), result: ending.0 }
    }

    fn take_all(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let Self { source, limit, taken, measure } = self;
        while *taken < *limit as u64 && !interrupt::requested() {
            let Some(picture) = source.next() else { break };
            measure.take(observer, *taken + 1, &picture?)?;
            *taken += 1;
        }
        Ok(())
    }
}

impl Iterator for Source {
    type Item = Result<Taken>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Files { pictures, first, .. } => {
                let next = first.take().map(Ok).or_else(|| pictures.next())?;
                let taken = next.map(|(path, image)| Taken { path, image, number: None, arrived: None });
                Some(taken.map_err(RunError::from))
            }
            Self::Video { video, .. } => {
                let picture = video.next()?;
                Some(picture.map(|VideoPicture { image, number, arrived }| Taken {
                    path: format!("{number:06}").into(),
                    image,
                    number: Some(number),
                    arrived: (!video.is_recorded).then_some(arrived),
                }))
            }
        }
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
        let (network, arrival) = (model.name.clone(), Latency::new());
        let mut measure = Self { network, contacts, baseline: None, overlays: None, arrival };
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

    /// Refuses a video whose pictures differ in size from the network's input.
    fn check_video(&self, video: VideoOptions) -> Result<()> {
        let ImageSize { width, height } = self.contacts.size();
        let found = video.format.size();
        if found == (width, height) {
            return Ok(());
        }
        let expected = format!("{width}x{height} pixels, as network {} reads them", self.network);
        Err(RunError::Video { expected, found: format!("{}x{}", found.0, found.1) })
    }

    /// Measures picture number `taken`, and shows the result.
    fn take(&mut self, observer: &mut dyn Observer, taken: u64, picture: &Taken) -> Result<()> {
        let Taken { path, image, number, arrived } = picture;
        self.check(path, image)?;
        let contact = self.contacts.measure(&image.data)?;
        let unlike = self.contacts.unlike();
        self.contacts.predictor.training.update(&[], unlike);
        let since_arrival = arrived.map(|arrived| arrived.elapsed());
        since_arrival.inspect(|&latency| self.arrival.record(latency));
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
        let name = number.is_none().then(|| path.display().to_string());
        let prediction = PicturePrediction {
            image: name.as_deref(),
            picture: *number,
            contact,
            unlike,
            baseline,
            overlay: overlay.as_deref(),
            update_us,
            since_arrival_us: since_arrival.map(microseconds),
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
        // The folder is created only when there is a file for it.
        let made = fs::create_dir_all(&self.folder);
        made.map_err(|source| RunError::file("write", &self.folder, source))?;
        write_png(&target, image.width, image.height, &self.drawn)?;
        Ok(target.display().to_string())
    }
}

/// Contacts in one picture after another.
///
/// If the network reads differences of pictures, the first picture is the reference unless one was
/// set.
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
    unlike: Option<f32>,
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
            unlike: None,
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
            self.unlike = predicted.unlike;
            for (force, &y) in self.force.iter_mut().zip(predicted.values) {
                *force = self.forces.force(y);
            }
            Ok(self.meter.measure(&self.force)?)
        })
    }

    /// How unlike the last picture is to those of the training, if the weights contain statistics
    /// of these.
    pub fn unlike(&self) -> Option<f32> {
        self.unlike
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

    /// Counts of computed and skipped pixels.
    pub fn counters(&self) -> FrameCounters {
        self.predictor.counters()
    }

    /// Forgets all pictures, including the reference.
    pub fn reset(&mut self) {
        self.reference = None;
        self.predictor.reset();
        self.meter.reset();
    }
}
