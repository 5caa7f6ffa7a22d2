//! Figures of maps of force against what is true.
//!
//! A map of a network is scaled to the pixels of the sensor that took the picture. A pixel is truly
//! in contact where the pressure exceeds [`CONTACT_MPA`].

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use meissner_engine::frames::FrameOptions;
use meissner_models::systems::contact_area::{
    Centroid, ContactReport, DifferenceBaseline, DifferenceSettings, PixelSize, iou,
};
use meissner_run::RunError;
use meissner_run::latency::microseconds;
use meissner_run::model::{FrameModel, LayerCost};
use meissner_run::run::{BLUR_RADIUS, ContactPredictor};
use serde::Serialize;

use crate::area::pictures::{Labelled, Press, Set, Truth};
use crate::doubts::{BAD, Doubts};
use crate::error::Result;
use crate::metrics::MeanStd;
use crate::workers::Workers;

/// Figures of a network on a file of pictures.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Figures {
    pub pictures: usize,
    /// Intersection over union of the pixels in contact; 1 where there are none in both.
    pub iou: MeanStd,
    /// Absolute error of the total force, in N.
    pub force_n: Option<MeanStd>,
    /// Distance of the centroids in mm, over pictures with contact in both.
    pub centroid_mm: Option<MeanStd>,
    /// Absolute error of the area, in mm^2.
    pub area_mm2: MeanStd,
    /// What predictions say about their pictures, where the weights say what those of the training
    /// were like. Bad: more than three times as far from an `IoU` of 1 as the mean.
    pub doubts: Option<Doubts>,
    /// By kind of indenter.
    pub kinds: BTreeMap<String, KindFigures>,
    /// Multiply-adds of a picture, those that were skipped left out.
    pub multiply_adds: u64,
    /// Median time of a picture in microseconds.
    pub update_us: f64,
    /// True and predicted total forces.
    #[serde(rename = "pairs", serialize_with = "crate::thinned::pairs")]
    pub scatter: Vec<(f64, f64)>,
}

/// Figures of a kind of indenter.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct KindFigures {
    pub pictures: usize,
    pub iou: MeanStd,
    pub force_n: Option<MeanStd>,
}

/// Figures of the pixels at which pictures differ from the sensor at rest.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct BaselineFigures {
    /// Of twelve thresholds in grey levels, that of the highest `IoU`: the baseline is favoured.
    pub threshold: f32,
    pub iou: MeanStd,
    pub centroid_mm: Option<MeanStd>,
    pub area_mm2: MeanStd,
}

/// Thresholds that are tried for image differences, in grey levels.
const THRESHOLDS: [f32; 12] = [5.0, 8.0, 10.0, 12.0, 15.0, 18.0, 22.0, 26.0, 30.0, 36.0, 44.0, 52.0];

/// What a network made of the pictures of a press.
pub(crate) struct Outcome {
    kind: String,
    pictures: Vec<Contact>,
    multiply_adds: u64,
    /// Predicted force on each pixel of each picture, in N.
    pub(crate) maps: Vec<f32>,
}

struct Contact {
    iou: f64,
    /// True and predicted.
    force_n: Option<(f64, f64)>,
    centroid_mm: Option<f64>,
    area_mm2: f64,
    unlike: Option<f32>,
    update_us: f64,
}

impl Outcome {
    pub(crate) fn of(
        model: &FrameModel,
        how: PressOptions,
        costs: &[LayerCost],
        press: &Press,
    ) -> Result<Self> {
        let mut run = Run::new(model, how)?;
        run.begin(press);
        let own_mm = run.predictor.pixel().sides_mm()[0];
        let pixel_mm = press.pixel_mm.unwrap_or(own_mm);
        let (scale, pixel) = ((pixel_mm / own_mm) * (pixel_mm / own_mm), PixelSize::new(pixel_mm, pixel_mm));
        let pixel = pixel.map_err(RunError::from)?;
        let mut outcome =
            Self { kind: press.kind.clone(), pictures: Vec::new(), multiply_adds: 0, maps: Vec::new() };
        for picture in &press.pictures {
            let Answer { report, push_predict, .. } = run.measure(&picture.rgb)?;
            let predictor = &run.predictor;
            let update_us = microseconds(push_predict);
            let mask = true_mask(&picture.truth, pixel_mm);
            let found = predictor.mask();
            let width = predictor.size().width;
            outcome.pictures.push(Contact {
                iou: iou(found, &mask).map_err(RunError::from)?,
                force_n: picture.force_n().map(|force| (force, report.force_n * scale)),
                centroid_mm: distance(report.centroid, centroid(&picture.truth, &mask, width), pixel_mm),
                area_mm2: (pixel.area_mm2(report.pixels) - pixel.area_mm2(count(&mask))).abs(),
                unlike: predictor.unlike(),
                update_us,
            });
            outcome.maps.extend(predictor.force().iter().map(|force| (f64::from(*force) * scale) as f32));
        }
        let counters = run.predictor.counters();
        outcome.multiply_adds = costs.iter().zip(&counters.layers).map(|(cost, layer)| cost.of(layer)).sum();
        Ok(outcome)
    }

    /// The sum of what the intersections over union lack to 1, and the number of pictures.
    pub(crate) fn lacking(&self) -> (f64, u64) {
        (self.pictures.iter().map(|contact| 1.0 - contact.iou).sum(), self.pictures.len() as u64)
    }

    /// Sum of absolute errors of the total force in N, and number of pictures with a true force.
    pub(crate) fn force_error(&self) -> (f64, u64) {
        let errors = self.pictures.iter().filter_map(|contact| contact.force_n);
        let errors = errors.map(|(expected, found)| (found - expected).abs());
        errors.fold((0.0, 0), |(sum, count), error| (sum + error, count + 1))
    }
}

impl Figures {
    pub(crate) fn new(outcomes: &[&Outcome]) -> Self {
        let all: Vec<&Contact> = outcomes.iter().flat_map(|outcome| &outcome.pictures).collect();
        let mut kinds: BTreeMap<String, Vec<&Contact>> = BTreeMap::new();
        for outcome in outcomes {
            kinds.entry(outcome.kind.clone()).or_default().extend(&outcome.pictures);
        }
        let kind = |contacts: Vec<&Contact>| KindFigures {
            pictures: contacts.len(),
            iou: over(&contacts, |contact| contact.iou),
            force_n: force_error(&contacts),
        };
        let iou = over(&all, |contact| contact.iou);
        let is_bad = |contact: &Contact| 1.0 - contact.iou > BAD * (1.0 - iou.mean);
        let doubts = Doubts::of(all.iter().map(|contact| (contact.unlike, is_bad(contact))));
        let mut times: Vec<f64> = all.iter().map(|contact| contact.update_us).collect();
        times.sort_by(f64::total_cmp);
        let work: u64 = outcomes.iter().map(|outcome| outcome.multiply_adds).sum();
        Self {
            pictures: all.len(),
            iou,
            doubts,
            force_n: force_error(&all),
            centroid_mm: MeanStd::of(
                &all.iter().filter_map(|contact| contact.centroid_mm).collect::<Vec<_>>(),
            ),
            area_mm2: over(&all, |contact| contact.area_mm2),
            kinds: kinds.into_iter().map(|(name, contacts)| (name, kind(contacts))).collect(),
            multiply_adds: work / all.len().max(1) as u64,
            update_us: times.get(times.len() / 2).copied().unwrap_or_default(),
            scatter: all.iter().filter_map(|contact| contact.force_n).collect(),
        }
    }
}

pub(crate) fn baseline(set: &Set, workers: &Workers) -> Result<BaselineFigures> {
    let judge = |(): &mut (), press: &Press| -> Result<Vec<Vec<Contact>>, RunError> {
        let pixel_mm = press.pixel_mm.unwrap_or(1.0);
        let pixel = PixelSize::new(pixel_mm, pixel_mm)?;
        let masks: Vec<_> =
            press.pictures.iter().map(|picture| true_mask(&picture.truth, pixel_mm)).collect();
        let at = |threshold: f32| {
            let settings = DifferenceSettings { size: set.size, pixel, threshold, blur_radius: BLUR_RADIUS };
            let mut baseline = DifferenceBaseline::new(&press.reference, settings)?;
            let contact = |(picture, mask): (&Labelled, &Vec<bool>)| {
                let report = baseline.measure(&picture.rgb)?;
                Ok(Contact {
                    iou: iou(baseline.mask(), mask)?,
                    force_n: None,
                    centroid_mm: distance(
                        report.centroid,
                        centroid(&picture.truth, mask, set.size.width),
                        pixel_mm,
                    ),
                    area_mm2: (report.area_mm2 - pixel.area_mm2(count(mask))).abs(),
                    unlike: None,
                    update_us: 0.0,
                })
            };
            press.pictures.iter().zip(&masks).map(contact).collect()
        };
        THRESHOLDS.into_iter().map(at).collect()
    };
    let presses = workers.for_each(&(), &set.presses, judge)?;
    let figures = THRESHOLDS.iter().enumerate().map(|(index, &threshold)| {
        let contacts: Vec<&Contact> = presses.iter().flat_map(|press| &press[index]).collect();
        BaselineFigures {
            threshold,
            iou: over(&contacts, |contact| contact.iou),
            centroid_mm: MeanStd::of(
                &contacts.iter().filter_map(|contact| contact.centroid_mm).collect::<Vec<_>>(),
            ),
            area_mm2: over(&contacts, |contact| contact.area_mm2),
        }
    });
    let best = figures.max_by(|a, b| a.iou.mean.total_cmp(&b.iou.mean));
    Ok(best.expect("there are thresholds"))
}

/// Pressure of a contact: the published 1e-4 N on a pixel of 0.06 mm of the shipped networks.
const CONTACT_MPA: f64 = 1e-4 / (0.06 * 0.06);

/// The pixels in contact: marked, or under more pressure than [`CONTACT_MPA`].
fn true_mask(truth: &Truth, pixel_mm: f64) -> Vec<bool> {
    let least_n = CONTACT_MPA * pixel_mm * pixel_mm;
    match truth {
        Truth::Force(force) => force.iter().map(|&force| f64::from(force) > least_n).collect(),
        Truth::Contact(mask) => mask.clone(),
    }
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|&&touches| touches).count()
}

/// The middle of the pixels in contact, weighted by force where known; `None` without contact.
fn centroid(truth: &Truth, mask: &[bool], width: usize) -> Option<[f64; 2]> {
    let (mut sum, mut at) = (0.0, [0.0; 2]);
    for i in (0..mask.len()).filter(|&i| mask[i]) {
        let weight = match truth {
            Truth::Force(force) => f64::from(force[i]),
            Truth::Contact(_) => 1.0,
        };
        sum += weight;
        at[0] += weight * (i % width) as f64;
        at[1] += weight * (i / width) as f64;
    }
    (sum > 0.0).then(|| at.map(|at| at / sum))
}

fn distance(found: Option<Centroid>, expected: Option<[f64; 2]>, pixel_mm: f64) -> Option<f64> {
    let (found, [x, y]) = (found?, expected?);
    Some((found.x_px - x).hypot(found.y_px - y) * pixel_mm)
}

fn force_error(contacts: &[&Contact]) -> Option<MeanStd> {
    let errors = contacts
        .iter()
        .filter_map(|contact| contact.force_n)
        .map(|(expected, found)| (found - expected).abs());
    MeanStd::of(&errors.collect::<Vec<_>>())
}

/// Of no pictures, 0.
fn over(contacts: &[&Contact], figure: impl Fn(&Contact) -> f64) -> MeanStd {
    MeanStd::over(contacts, |contact| figure(contact)).unwrap_or(MeanStd { mean: 0.0, std: None })
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PressOptions {
    /// What is skipped between pictures.
    pub(crate) options: FrameOptions,
    /// Of so many pictures the network sees the first; its answer stands for the others.
    pub(crate) every: usize,
}

/// A network with its last answer.
pub(crate) struct Run {
    pub(crate) predictor: ContactPredictor,
    every: usize,
    pictures: usize,
    last: Option<ContactReport>,
}

/// The contact in a picture, and the time for it.
pub(crate) struct Answer {
    pub(crate) report: ContactReport,
    pub(crate) push: Duration,
    pub(crate) push_predict: Duration,
}

impl Run {
    pub(crate) fn new(model: &FrameModel, how: PressOptions) -> Result<Self, RunError> {
        let predictor = ContactPredictor::new(model, how.options)?;
        Ok(Self { predictor, every: how.every, pictures: 0, last: None })
    }

    /// Forgets all pictures, and takes the picture of the sensor at rest.
    pub(crate) fn begin(&mut self, press: &Press) {
        self.predictor.reset();
        self.predictor.set_reference(&press.reference);
        (self.pictures, self.last) = (0, None);
    }

    /// The answer to the next picture, or the last one where the network does not see it.
    pub(crate) fn measure(&mut self, rgb: &[u8]) -> Result<Answer, RunError> {
        let start = Instant::now();
        let is_seen = self.pictures.is_multiple_of(self.every);
        self.pictures += 1;
        if let Some(report) = self.last.filter(|_| !is_seen) {
            let spent = start.elapsed();
            return Ok(Answer { report, push: spent, push_predict: spent });
        }
        self.predictor.push(rgb)?;
        let push = start.elapsed();
        let report = self.predictor.predict()?;
        let push_predict = start.elapsed();
        self.last = Some(report);
        Ok(Answer { report, push, push_predict })
    }
}
