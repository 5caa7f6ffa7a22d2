//! A network over pictures with what makes frames of pictures, and contacts of its maps of force.

use std::time::{Duration, Instant};

use meissner_engine::frames::{FrameCounters, FrameOptions, FrameShape};
use meissner_models::FrameSource;
use meissner_models::systems::contact_area::{
    ContactMeter, ContactReport, ContactSettings, ForceNormalisation, ImageNormalisation, ImageSize,
    PixelSize,
};

use super::frame_predictor::FramePredictor;
use crate::error::RunError;
use crate::model::FrameModel;

/// Contacts in one picture after another.
///
/// Of a network whose pictures enter as differences, the first picture is the reference, unless
/// another was set.
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
    pub fn new(model: &FrameModel, options: FrameOptions) -> Result<Self, RunError> {
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

    /// Sets the picture without contact, interleaved RGB. Networks whose pictures do not enter as
    /// differences ignore it.
    pub fn set_reference(&mut self, rgb: &[u8]) {
        self.reference = Some(rgb.to_vec());
    }

    /// The contact in the next picture, interleaved RGB: [`Self::push`] and [`Self::predict`].
    ///
    /// # Errors
    /// The picture or the reference has another size, or a force is not finite.
    pub fn measure(&mut self, rgb: &[u8]) -> Result<ContactReport, RunError> {
        self.push(rgb)?;
        self.predict()
    }

    /// Takes the next picture, interleaved RGB.
    ///
    /// # Errors
    /// The picture or the reference has another size.
    pub fn push(&mut self, rgb: &[u8]) -> Result<(), RunError> {
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
    pub fn predict(&mut self) -> Result<ContactReport, RunError> {
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
