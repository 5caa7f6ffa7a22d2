//! An engine over frames, as a session runs it: pictures of an optical sensor, readings of
//! electrodes, frames of events.
//!
//! Input: items as the sensor gives them. Output: predictions, and sections with the read,
//! computed and predicted values. Invariant: the preparation of items, and the resets of the state,
//! are as in a run of the program.

mod networks;
mod shown;

use std::sync::Arc;

use meissner_engine::frames::{FrameCounters, FrameEngine, FrameOptions, FrameShape, Skip};
use meissner_engine::representations::{ELECTRODES, Sampling, TactileForm, TactileWindow};
use meissner_models::FrameSource;
use meissner_models::description::frames::PictureSettings;
use meissner_models::systems::contact_area::{
    ContactMeter, ContactReport, ContactSettings, ForceNormalisation, ImageNormalisation, ImageSize,
};

use crate::error::ViewError;
use crate::facts::{ComparedLayer, Facts, Info};
use crate::frame::{Bytes, FrameWriter};
use crate::networks::Chosen;
use crate::subject::{Item, Seen, Subject};
pub use networks::{Framed, ShippedFrames};

/// An item of the input of a frame network.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Time in microseconds.
    pub t_us: i64,
    /// Whether it does not continue the items before it, so that the state is reset.
    pub begins: bool,
    /// The content from the sensor.
    pub content: Content,
}

/// The content of an item from a sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// A picture, interleaved RGB, of the size of the network's input.
    Picture(Vec<u8>),
    /// A reading of all electrodes, in the sensor's counts.
    Reading([f32; ELECTRODES]),
    /// A frame of events: the values that are not 0, by their index in (channels, rows, columns).
    Events(Vec<(u32, f32)>),
}

impl Item for Frame {
    const SPEED: f64 = 1.0;
    const APART: usize = 64;

    fn t_us(&self) -> i64 {
        self.t_us
    }

    fn kept(&self) -> usize {
        match &self.content {
            // Of 320 x 240 pixels: 230 MB.
            Content::Picture(_) => 1000,
            // A quarter of an hour of readings.
            Content::Reading(_) | Content::Events(_) => 1 << 17,
        }
    }
}

/// The sensor of frames.
#[derive(Clone, Debug, Default)]
pub struct FrameSensor {
    /// Columns and rows of the sensor.
    pub size: [u16; 2],
    /// The picture without contact, if pictures enter as differences; the first picture by default.
    pub reference: Option<Vec<u8>>,
}

/// An engine over frames, and its input.
pub struct Frames {
    framed: Arc<Framed>,
    engine: FrameEngine,
    /// The newest frame of the network.
    input: Vec<f32>,
    /// Pixels in which it differs from the frame of the previous prediction, by rows.
    changed: Vec<bool>,
    /// The newest prediction in the form of the network, and in the form for people.
    output: Vec<f32>,
    values: Vec<f32>,
    /// The counts before the newest items.
    before: FrameCounters,
    taken: u64,
    kind: Kind,
}

/// The conversion of items to frames.
enum Kind {
    Pictures(Box<Pictures>),
    Electrodes(TactileWindow, usize),
    Events,
}

/// The conversion of pictures to frames, and of predictions to contacts.
struct Pictures {
    images: ImageNormalisation,
    difference: bool,
    reference: Option<Vec<u8>>,
    forces: ForceNormalisation,
    meter: ContactMeter,
    /// Force in N per pixel.
    force: Vec<f32>,
    contact: Option<ContactReport>,
    threshold_n: f32,
    pixel_mm2: f64,
}

impl Pictures {
    fn new(settings: PictureSettings, shape: FrameShape) -> Result<Self, ViewError> {
        let FrameShape::Image { height, width, .. } = shape else { return Err(ViewError::Shape) };
        let (size, pixel) = (ImageSize { width, height }, settings.pixel_size()?);
        let (threshold_n, median_window) = (settings.threshold_n, settings.median_window);
        Ok(Self {
            images: settings.image_normalisation()?,
            difference: settings.difference,
            reference: None,
            forces: settings.force_normalisation()?,
            meter: ContactMeter::new(ContactSettings { size, pixel, threshold_n, median_window })?,
            force: vec![0.0; size.pixels()?],
            contact: None,
            threshold_n,
            pixel_mm2: pixel.area_mm2(1),
        })
    }
}

impl Frames {
    /// An engine that skips in this way.
    fn skipping(framed: &Arc<Framed>, skip: Skip) -> Result<Self, ViewError> {
        let (network, shape) = (&framed.network, framed.network.input());
        let kind = match framed.source {
            FrameSource::Picture(settings) => Kind::Pictures(Box::new(Pictures::new(settings, shape)?)),
            FrameSource::TactileImage(of) | FrameSource::Electrodes(of) => {
                let is_image = matches!(framed.source, FrameSource::TactileImage(_));
                let form = if is_image { TactileForm::Image } else { TactileForm::Reading };
                let window = TactileWindow::new(of.steps, of.sampling, of.scaling, form)?;
                let stride = if let Sampling::Step { stride } = of.sampling { stride } else { 1 };
                Kind::Electrodes(window, of.steps * stride)
            }
            _ => Kind::Events,
        };
        // Frames of events are mostly zero.
        let options = FrameOptions::new().with_skip(skip).with_sparse(matches!(kind, Kind::Events));
        let engine = FrameEngine::with_options(Arc::clone(network), options)?;
        let pixels = if let FrameShape::Image { height, width, .. } = shape { height * width } else { 0 };
        Ok(Self {
            framed: Arc::clone(framed),
            before: engine.counters().clone(),
            input: vec![0.0; shape.values()],
            changed: vec![false; pixels],
            output: vec![0.0; network.output().values()],
            values: Vec::new(),
            taken: 0,
            engine,
            kind,
        })
    }

    /// Whether the readings of a window slide.
    fn slides(&self) -> bool {
        match self.framed.source {
            FrameSource::TactileImage(of) | FrameSource::Electrodes(of) => of.sampling == Sampling::Sliding,
            _ => false,
        }
    }

    /// Pushes the frame that `item` completes; returns whether a prediction is due.
    fn push(&mut self, item: &Frame) -> Result<bool, ViewError> {
        let Self { engine, input, kind, .. } = self;
        match (kind, &item.content) {
            (Kind::Pictures(of), Content::Picture(rgb)) => {
                let reference = of.difference.then(|| &**of.reference.get_or_insert_with(|| rgb.clone()));
                of.images.apply(rgb, reference, input)?;
                engine.push(input)?;
            }
            (Kind::Electrodes(window, _), Content::Reading(values)) => {
                if item.begins {
                    window.reset();
                }
                let Some(sequence) = window.push(values)? else { return Ok(false) };
                engine.reset();
                engine.push_slice(sequence.values)?;
                let last = sequence.values.len() - input.len();
                input.copy_from_slice(&sequence.values[last..]);
            }
            (Kind::Events, Content::Events(values)) => {
                if item.begins {
                    engine.reset();
                }
                input.fill(0.0);
                for &(at, value) in values {
                    *input.get_mut(at as usize).ok_or(ViewError::Shape)? = value;
                }
                engine.push(input)?;
            }
            _ => return Err(ViewError::Shape),
        }
        Ok(true)
    }

    /// Reads a prediction, and converts it for people; returns how unlike the frames are.
    fn predict(&mut self) -> Result<Option<f32>, ViewError> {
        let prediction = self.engine.predict()?;
        self.output.copy_from_slice(prediction.values);
        let unlike = prediction.unlike;
        self.values.clear();
        if let Kind::Pictures(of) = &mut self.kind {
            of.force.copy_from_slice(&self.output);
            of.forces.apply(&mut of.force);
            let contact = of.meter.measure(&of.force)?;
            self.values.extend([contact.area_mm2 as f32, contact.force_n as f32]);
            of.contact = Some(contact);
        } else {
            self.values.extend_from_slice(&self.output);
        }
        Ok(unlike)
    }
}

impl Subject for Frames {
    type Network = Framed;
    type Item = Frame;
    type Sensor = FrameSensor;

    fn new(chosen: &Chosen<Framed>, sensor: &FrameSensor) -> Result<Self, ViewError> {
        let mut frames = Self::skipping(&chosen.network, Skip::Exact)?;
        if let Kind::Pictures(of) = &mut frames.kind {
            of.reference.clone_from(&sensor.reference);
        }
        Ok(frames)
    }

    fn learn(&mut self, first: &Frame) {
        if let (Kind::Pictures(of), Content::Picture(rgb)) = (&mut self.kind, &first.content) {
            of.reference.get_or_insert_with(|| rgb.clone());
        }
    }

    fn inherit(&mut self, other: &Self) {
        if let (Kind::Pictures(of), Kind::Pictures(other)) = (&mut self.kind, &other.kind) {
            of.reference.clone_from(&other.reference);
        }
    }

    fn begin(&mut self) -> Result<(), ViewError> {
        match &mut self.kind {
            // A prediction depends on its picture alone, and equal pixels need no computation.
            Kind::Pictures(_) => {}
            Kind::Electrodes(window, _) => window.reset(),
            Kind::Events => self.engine.reset(),
        }
        Ok(())
    }

    fn take(&mut self, items: &[Frame]) -> Result<Option<Seen<'_>>, ViewError> {
        self.before = self.engine.counters().clone();
        let earlier = self.input.clone();
        let mut due = false;
        for item in items {
            due = self.push(item)?;
            self.taken += 1;
        }
        let pixels = self.changed.len();
        for (pixel, changed) in self.changed.iter_mut().enumerate() {
            let mut channels = (pixel..earlier.len()).step_by(pixels);
            *changed = channels.any(|at| earlier[at].to_bits() != self.input[at].to_bits());
        }
        if !due {
            return Ok(None);
        }
        let unlike = self.predict()?;
        Ok(Some(Seen { values: &self.values, unlike }))
    }

    fn depends_from(&self, items: &[Frame]) -> Option<usize> {
        match &self.kind {
            Kind::Electrodes(_, window) => {
                let begin = items.iter().rposition(|item| item.begins).unwrap_or(0);
                let readings = items.len() - begin;
                Some(if self.slides() {
                    begin + readings.saturating_sub(*window)
                } else {
                    begin + (readings / window).saturating_sub(1) * window
                })
            }
            _ if self.engine.network().has_state() => None,
            _ => Some(items.len().saturating_sub(1)),
        }
    }

    fn state(&self) -> Option<Vec<u8>> {
        matches!(self.kind, Kind::Events).then(|| self.engine.to_bytes())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), ViewError> {
        self.engine.restore_bytes(state)?;
        self.predict().map(drop)
    }

    fn compare(&self, items: &[Frame]) -> Result<Vec<ComparedLayer>, ViewError> {
        let mut whole = Self::skipping(&self.framed, Skip::Nothing)?;
        whole.inherit(self);
        let first = self.depends_from(items).unwrap_or(0);
        whole.take(&items[first..])?;
        let pairs = self.output.iter().zip(&whole.output);
        let differ = pairs.filter(|(found, expected)| found.to_bits() != expected.to_bits()).count();
        let (name, rows) = (self.framed.predicts().to_owned(), self.output.len() as u64);
        Ok(vec![ComparedLayer { name, rows, differ: differ as u64 }])
    }

    fn facts(input: &str, sensor: &FrameSensor, name: &str, chosen: &Chosen<Framed>) -> Facts {
        networks::facts(input, sensor, name, chosen)
    }

    fn info(&self) -> Info {
        Info::default()
    }

    fn nodes(&self) -> usize {
        usize::try_from(self.taken).unwrap_or(usize::MAX)
    }

    fn write(&self, items: &[Frame], to: &mut FrameWriter) {
        self.show(items, to);
    }

    fn work(&self, to: &mut Bytes<'_>) {
        self.count(to);
    }
}
