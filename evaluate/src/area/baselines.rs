//! Contacts without a network: figures of a map under the best of some thresholds, and the
//! difference of a picture from the sensor at rest.

use meissner_models::systems::contact_area::{DifferenceBaseline, DifferenceSettings, PixelSize};
use meissner_run::RunError;
use meissner_run::run::BLUR_RADIUS;
use meissner_simulator::gel::GelSensor;
use serde::Serialize;

use crate::area::figures::{Contact, Found, Known, force_error, known, over};
use crate::area::pictures::{Press, Set};
use crate::error::Result;
use crate::metrics::MeanStd;
use crate::workers::Workers;

/// Figures of a method that is no network.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct BaselineFigures {
    /// The threshold with the highest `IoU` out of twelve, which favours the baseline.
    pub threshold: f32,
    pub iou: MeanStd,
    /// As [`Figures::iou_even`](super::Figures::iou_even).
    pub iou_even: Option<MeanStd>,
    /// Absolute error of the total force in N; `None` without forces, found or known.
    pub force_n: Option<MeanStd>,
    pub centroid_mm: Option<MeanStd>,
    pub area_mm2: MeanStd,
}

/// The number of thresholds that are tried.
pub(super) const THRESHOLDS: usize = 12;

/// Figures with the best of the `thresholds`. `contacts` returns, for each threshold, the contact
/// in each picture of a press whose pixels have this width. Threads get clones of `engine`.
///
/// # Errors
/// Those of `contacts`; the caller wants to stop.
pub(super) fn favoured<E: Clone + Sync>(
    set: &Set,
    thresholds: [f32; THRESHOLDS],
    engine: &E,
    workers: &Workers,
    contacts: impl Fn(&mut E, &Press, f64) -> Result<Vec<Vec<Contact>>, RunError> + Sync + Send,
) -> Result<BaselineFigures> {
    // Real pictures do not state the width of a pixel: their sensor is as wide as the default one.
    let default_mm = GelSensor::default().width_mm / set.size.width as f64;
    let judge = |engine: &mut E, press: &Press| contacts(engine, press, press.pixel_mm.unwrap_or(default_mm));
    let presses = workers.for_each(engine, &set.presses, judge)?;
    let figures = thresholds.into_iter().enumerate().map(|(index, threshold)| {
        let contacts: Vec<&Contact> = presses.iter().flat_map(|press| &press[index]).collect();
        BaselineFigures {
            threshold,
            iou: over(&contacts, |contact| contact.iou),
            iou_even: known(&contacts, |contact| contact.iou_even),
            force_n: force_error(&contacts),
            centroid_mm: known(&contacts, |contact| contact.centroid_mm),
            area_mm2: over(&contacts, |contact| contact.area_mm2),
        }
    });
    let best = figures.max_by(|a, b| a.iou.mean.total_cmp(&b.iou.mean));
    Ok(best.expect("there are thresholds"))
}

/// Grey levels that are tried.
const LEVELS: [f32; THRESHOLDS] = [5.0, 8.0, 10.0, 12.0, 15.0, 18.0, 22.0, 26.0, 30.0, 36.0, 44.0, 52.0];

/// Figures of the pixels at which pictures differ from the sensor at rest.
pub(super) fn difference(set: &Set, workers: &Workers) -> Result<BaselineFigures> {
    favoured(set, LEVELS, &(), workers, |(), press, pixel_mm| {
        let pixel = PixelSize::new(pixel_mm, pixel_mm)?;
        let knowns: Vec<_> =
            press.pictures.iter().map(|picture| Known::of(picture, pixel_mm, set.size.width)).collect();
        let at = |threshold: f32| {
            let settings = DifferenceSettings { size: set.size, pixel, threshold, blur_radius: BLUR_RADIUS };
            let mut baseline = DifferenceBaseline::new(&press.reference, settings)?;
            let contacts = press.pictures.iter().zip(&knowns).map(|(picture, known)| {
                let report = baseline.measure(&picture.rgb)?;
                let (mask, pixels, centroid) = (baseline.mask(), report.pixels, report.centroid);
                Ok(known.contact(&Found { mask, pixels, centroid, force_n: None }, pixel_mm)?)
            });
            contacts.collect()
        };
        LEVELS.into_iter().map(at).collect()
    })
}
