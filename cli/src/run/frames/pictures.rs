//! Networks over pictures of an optical tactile sensor: images, contact areas and forces out.

use std::io::{self, Write};
use std::path::Path;
use std::time::Instant;

use meissner_engine::frames::FrameShape;
use meissner_io::{Image, ImageSequence, read_image};
use meissner_models::description::frames::PictureSettings;
use meissner_models::systems::contact_area::{
    Centroid, ContactMeter, ContactReport, ContactSettings, DifferenceBaseline, DifferenceReport,
    DifferenceSettings, ForceNormalisation, ImageNormalisation, ImageSize,
};
use serde::Serialize;

use super::FrameModel;
use super::header::header;
use super::overlay::Overlays;
use super::report::Report;
use super::summary::{InputCounts, Summary};
use crate::error::CliError;
use crate::progress::Progress;
use crate::run::RunArgs;
use crate::run::ending::Ending;
use meissner_pipeline::PipelineError;
use meissner_pipeline::frame_predictor::FramePredictor;
use meissner_pipeline::interrupt;
use meissner_pipeline::latency::microseconds;
use meissner_pipeline::provenance::InputCard;
use meissner_pipeline::source;
use meissner_pipeline::text::grouped;

/// Difference to the reference above which a pixel is in contact, in levels.
const DIFFERENCE: f32 = 10.0;
/// The box that differences are averaged over reaches so many pixels to each side.
const BLUR_RADIUS: usize = 2;

/// A prediction, as programs see it.
#[derive(Serialize)]
struct Line<'a> {
    image: &'a str,
    area_mm2: f64,
    force_n: f64,
    median_force_n: f64,
    centroid: Option<Place>,
    baseline: Option<Baseline>,
    overlay: Option<String>,
    update_us: f64,
}

#[derive(Clone, Copy, Serialize)]
struct Baseline {
    area_mm2: f64,
    centroid: Option<Place>,
}

#[derive(Clone, Copy, Serialize)]
struct Place {
    x_px: f64,
    y_px: f64,
    x_mm: f64,
    y_mm: f64,
}

impl From<Centroid> for Place {
    fn from(Centroid { x_px, y_px, x_mm, y_mm }: Centroid) -> Self {
        Self { x_px, y_px, x_mm, y_mm }
    }
}

impl From<DifferenceReport> for Baseline {
    fn from(report: DifferenceReport) -> Self {
        Self { area_mm2: report.area_mm2, centroid: report.centroid.map(Place::from) }
    }
}

pub(super) fn run(
    args: &RunArgs,
    model: &FrameModel,
    machine: FramePredictor,
    settings: PictureSettings,
) -> Result<(), CliError> {
    let no_input = |found| CliError::NoInput {
        network: args.input.network.clone(),
        expected: "a picture, a folder of pictures or a list of them",
        found,
    };
    let path = args.input.recording.as_deref().ok_or_else(|| no_input("no INPUT"))?;
    if source::is_stdin(path) {
        return Err(no_input("standard input"));
    }
    interrupt::listen();
    let pictures = ImageSequence::open(path)?;
    let all = pictures.len() as u64;
    let limit = usize::try_from(args.input.limit.unwrap_or(u64::MAX)).unwrap_or(usize::MAX);
    let mut measure = Measure::new(args, model, settings, &pictures.paths()[..pictures.len().min(limit)])?;
    let mut machine = machine;
    let (mut report, mut taken) = (None, 0);
    let every = || {
        for picture in pictures.take(limit) {
            if interrupt::requested() {
                break;
            }
            let (path, image) = picture?;
            measure.check(&path, &image)?;
            let report = match &mut report {
                Some(report) => report,
                // A first picture that does not fit is found before anything is printed.
                None => report.insert(open_report(args, model, &machine, all)?),
            };
            measure.take(&mut machine, report, taken + 1, &path, &image)?;
            taken += 1;
        }
        Ok(())
    };
    let ended = every();
    let mut report = match (report, &ended) {
        (Some(report), _) => report,
        (None, Ok(())) => open_report(args, model, &machine, all)?,
        (None, Err(_)) => return ended,
    };
    let summary = Summary::new(&machine, InputCounts::Pictures { pictures: taken }, Vec::new());
    Ending::new(ended).sum_up(|| report.summary(&summary))
}

fn open_report(args: &RunArgs, model: &FrameModel, machine: &FramePredictor, all: u64) -> io::Result<Report> {
    // Every picture is shown as soon as it is measured, whether it is one of thousands or not.
    let name = args.input.recording.as_deref().map(|path| path.display().to_string()).unwrap_or_default();
    let about = format!("{} pictures", grouped(all));
    let provenance = model.header(InputCard::other(&name, &about));
    Report::new(args.json, true, &provenance, None, Progress::new(None, args.json), |out| {
        header(out, args, model, machine.options(), &[&name, &about])?;
        headings(out, args.frames.reference.is_some())
    })
}

fn headings(out: &mut impl Write, baseline: bool) -> io::Result<()> {
    let columns = ["area (mm2)", "force (N)", "median (N)"].map(|name| format!("  {name:>10}")).concat();
    write!(out, "{:<16}{columns}  {:>13}", "image", "centroid (px)")?;
    if baseline {
        write!(out, "  {:>19}  {:>15}", "baseline area (mm2)", "centroid (px)")?;
    }
    writeln!(out, "  {:>11}", "update (us)")
}

/// What stands before and behind the network.
struct Measure {
    network: String,
    size: ImageSize,
    images: ImageNormalisation,
    forces: ForceNormalisation,
    meter: ContactMeter,
    baseline: Option<DifferenceBaseline>,
    overlays: Option<Overlays>,
    planes: Vec<f32>,
    force: Vec<f32>,
}

impl Measure {
    fn new(
        args: &RunArgs,
        model: &FrameModel,
        settings: PictureSettings,
        paths: &[std::path::PathBuf],
    ) -> Result<Self, CliError> {
        let (input, output) = (model.description.input(), model.description.output());
        let network = args.input.network.clone();
        let FrameShape::Image { height, width, .. } = input else {
            return Err(PipelineError::IsFrameNetwork(network).into());
        };
        let expected = FrameShape::Image { channels: 1, height, width };
        if output != expected {
            let (expected, found) = (expected.to_string(), output.to_string());
            return Err(CliError::NoForceMap { network, expected, found });
        }
        let (size, pixel) = (ImageSize { width, height }, settings.pixel_size()?);
        let PictureSettings { threshold_n, median_window, .. } = settings;
        let mut measure = Self {
            network,
            size,
            images: settings.image_normalisation()?,
            forces: settings.force_normalisation()?,
            meter: ContactMeter::new(ContactSettings { size, pixel, threshold_n, median_window })?,
            baseline: None,
            overlays: None,
            planes: vec![0.0; input.values()],
            force: vec![0.0; output.values()],
        };
        if let Some(path) = &args.frames.reference {
            let reference = read_image(path)?;
            measure.check(path, &reference)?;
            let settings =
                DifferenceSettings { size, pixel, threshold: DIFFERENCE, blur_radius: BLUR_RADIUS };
            measure.baseline = Some(DifferenceBaseline::new(&reference.data, settings)?);
        }
        if let Some(folder) = &args.frames.overlay {
            measure.overlays = Some(Overlays::new(folder, paths, size, args.frames.full_scale)?);
        }
        Ok(measure)
    }

    /// Refuses an image that is not as large as the network's input.
    fn check(&self, path: &Path, image: &Image) -> Result<(), CliError> {
        let (expected, found) = ((self.size.width, self.size.height), image.size());
        if found == expected {
            return Ok(());
        }
        Err(CliError::PictureSize { path: path.to_owned(), network: self.network.clone(), expected, found })
    }

    /// Measures a picture and reports it; the picture is the `taken`th.
    fn take(
        &mut self,
        machine: &mut FramePredictor,
        report: &mut Report,
        taken: u64,
        path: &Path,
        image: &Image,
    ) -> Result<(), CliError> {
        let start = Instant::now();
        self.images.apply(&image.data, &mut self.planes)?;
        machine.prepared(start.elapsed());
        machine.push(&self.planes)?;
        let contact = machine.predict(|predicted| {
            for (force, &y) in self.force.iter_mut().zip(predicted.values) {
                *force = self.forces.force(y);
            }
            Ok::<_, CliError>(self.meter.measure(&self.force)?)
        })?;
        let update_us = microseconds(machine.take_update());
        let baseline = self.baseline.as_mut().map(|baseline| baseline.measure(&image.data)).transpose()?;
        let overlay = match &mut self.overlays {
            Some(overlays) => {
                let written =
                    overlays.write(path, image, &self.force, self.meter.mask(), contact.centroid)?;
                Some(written.display().to_string())
            }
            None => None,
        };
        let line = Line {
            image: &path.display().to_string(),
            area_mm2: contact.area_mm2,
            force_n: contact.force_n,
            median_force_n: contact.median_force_n,
            centroid: contact.centroid.map(Place::from),
            baseline: baseline.map(Baseline::from),
            overlay,
            update_us,
        };
        Ok(report.prediction(taken, &line, |_| text(path, &contact, baseline.as_ref(), update_us))?)
    }
}

/// The line for people.
fn text(path: &Path, contact: &ContactReport, baseline: Option<&DifferenceReport>, update_us: f64) -> String {
    let place = |centroid: Option<Centroid>| {
        centroid.map_or_else(|| "-".to_owned(), |c| format!("{:.1}, {:.1}", c.x_px, c.y_px))
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let ContactReport { area_mm2, force_n, median_force_n, centroid, .. } = *contact;
    let baseline = baseline.map_or_else(String::new, |report| {
        format!("  {:>19.3}  {:>15}", report.area_mm2, place(report.centroid))
    });
    let centroid = place(centroid);
    format!(
        "{name:<16}  {area_mm2:>10.3}  {force_n:>10.4}  {median_force_n:>10.4}  {centroid:>13}{baseline}  {update_us:>11.1}"
    )
}
