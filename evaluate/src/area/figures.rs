//! Figures of maps of force against the truth.
//!
//! A map of a network is scaled to the pixels of the sensor that took the picture. A pixel is truly
//! in contact where the pressure exceeds [`CONTACT_MPA`]. The published label differs: it spreads
//! the force evenly over all pixels that are pressed at all ([`Figures::iou_even`]).

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use meissner_engine::frames::FrameOptions;
use meissner_models::systems::contact_area::{Centroid, ContactError, ContactReport, PixelSize, iou};
use meissner_run::RunError;
use meissner_run::latency::microseconds;
use meissner_run::model::{FrameModel, LayerCost};
use meissner_run::run::ContactPredictor;
use serde::Serialize;

use crate::area::pictures::{Labelled, Press, Truth};
use crate::doubts::{BAD, Doubts};
use crate::error::Result;
use crate::metrics::MeanStd;

/// Figures of a network on a file of pictures.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Figures {
    pub pictures: usize,
    /// Intersection over union of the pixels in contact; 1 where there are none in both.
    pub iou: MeanStd,
    /// The same against the published label. Under it, all pressed pixels bear an equal share of
    /// the force, and they are in contact if this share exceeds the threshold. `None` where no
    /// force is known.
    pub iou_even: Option<MeanStd>,
    /// Absolute error of the total force, in N.
    pub force_n: Option<MeanStd>,
    /// Distance of the centroids in mm, over pictures with contact in both.
    pub centroid_mm: Option<MeanStd>,
    /// Absolute error of the area, in mm^2.
    pub area_mm2: MeanStd,
    /// How unlike the training's pictures the pictures are, if the weights have statistics of
    /// these. A prediction is bad if it is more than three times as far from an `IoU` of 1 as the
    /// mean.
    pub doubts: Option<Doubts>,
    /// By kind of indenter.
    pub kinds: BTreeMap<String, KindFigures>,
    /// Multiply-adds of a picture, without the skipped ones.
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

/// The predictions of a network for the pictures of a press.
pub(crate) struct Outcome {
    kind: String,
    pictures: Vec<Contact>,
    multiply_adds: u64,
    /// Predicted force on each pixel of each picture, in N.
    pub(crate) maps: Vec<f32>,
}

/// A contact that was found in a picture, compared with the truth.
pub(super) struct Contact {
    pub(super) iou: f64,
    pub(super) iou_even: Option<f64>,
    /// True and predicted force.
    force_n: Option<(f64, f64)>,
    pub(super) centroid_mm: Option<f64>,
    pub(super) area_mm2: f64,
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
        let scale = (pixel_mm / own_mm) * (pixel_mm / own_mm);
        let mut outcome =
            Self { kind: press.kind.clone(), pictures: Vec::new(), multiply_adds: 0, maps: Vec::new() };
        for picture in &press.pictures {
            let Answer { report, push_predict, .. } = run.measure(&picture.rgb)?;
            let predictor = &run.predictor;
            let update_us = microseconds(push_predict);
            let found = Found {
                mask: predictor.mask(),
                pixels: report.pixels,
                centroid: report.centroid,
                force_n: Some(report.force_n * scale),
            };
            let contact = Known::of(picture, pixel_mm, predictor.size().width).contact(&found, pixel_mm);
            let contact = contact.map_err(RunError::from)?;
            outcome.pictures.push(Contact { unlike: predictor.unlike(), update_us, ..contact });
            outcome.maps.extend(predictor.force().iter().map(|force| (f64::from(*force) * scale) as f32));
        }
        let counters = run.predictor.counters();
        outcome.multiply_adds = costs.iter().zip(&counters.layers).map(|(cost, layer)| cost.of(layer)).sum();
        Ok(outcome)
    }

    /// The sum of 1 minus the intersection over union, and the number of pictures.
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
            iou_even: known(&all, |contact| contact.iou_even),
            doubts,
            force_n: force_error(&all),
            centroid_mm: known(&all, |contact| contact.centroid_mm),
            area_mm2: over(&all, |contact| contact.area_mm2),
            kinds: kinds.into_iter().map(|(name, contacts)| (name, kind(contacts))).collect(),
            multiply_adds: work / all.len().max(1) as u64,
            update_us: times.get(times.len() / 2).copied().unwrap_or_default(),
            scatter: all.iter().filter_map(|contact| contact.force_n).collect(),
        }
    }
}

/// Pressure of a contact: the published 1e-4 N on a pixel of 0.06 mm of the shipped networks.
const CONTACT_MPA: f64 = 1e-4 / (0.06 * 0.06);

/// A pixel is pressed from this share of the greatest force on a pixel. The solver of contacts has
/// exact zeros outside, but a picture's pixel between two of the solver's takes a part of each.
const RIM: f64 = 0.01;

/// The truth about a picture, for comparisons.
pub(super) struct Known {
    /// The pixels in contact.
    mask: Vec<bool>,
    /// The same by the published label, where forces are known.
    even: Option<Vec<bool>>,
    /// The middle of the pixels in contact, weighted by force where known; `None` without contact.
    centroid: Option<[f64; 2]>,
    force_n: Option<f64>,
}

/// The contact that was found in a picture.
pub(super) struct Found<'a> {
    pub(super) mask: &'a [bool],
    /// Number of pixels in contact.
    pub(super) pixels: usize,
    pub(super) centroid: Option<Centroid>,
    /// `None` for a method that finds no force.
    pub(super) force_n: Option<f64>,
}

impl Known {
    pub(super) fn of(picture: &Labelled, pixel_mm: f64, width: usize) -> Self {
        let least_n = CONTACT_MPA * pixel_mm * pixel_mm;
        let (mask, even) = match &picture.truth {
            Truth::Force(force) => (above(force, least_n), Some(even(force, least_n))),
            Truth::Contact(mask) => (mask.clone(), None),
        };
        let (mut sum, mut at) = (0.0, [0.0; 2]);
        for i in (0..mask.len()).filter(|&i| mask[i]) {
            let weight = match &picture.truth {
                Truth::Force(force) => f64::from(force[i]),
                Truth::Contact(_) => 1.0,
            };
            sum += weight;
            at[0] += weight * (i % width) as f64;
            at[1] += weight * (i / width) as f64;
        }
        let centroid = (sum > 0.0).then(|| at.map(|at| at / sum));
        Self { mask, even, centroid, force_n: picture.force_n() }
    }

    /// Compares what was found on pixels of this width.
    pub(super) fn contact(&self, found: &Found<'_>, pixel_mm: f64) -> Result<Contact, ContactError> {
        let pixel = PixelSize::new(pixel_mm, pixel_mm)?;
        let even = self.even.as_ref().map(|even| iou(found.mask, even)).transpose()?;
        let distance = |found: Centroid, [x, y]: [f64; 2]| (found.x_px - x).hypot(found.y_px - y) * pixel_mm;
        Ok(Contact {
            iou: iou(found.mask, &self.mask)?,
            iou_even: even,
            force_n: self.force_n.zip(found.force_n),
            centroid_mm: found.centroid.zip(self.centroid).map(|(found, known)| distance(found, known)),
            area_mm2: (pixel.area_mm2(found.pixels) - pixel.area_mm2(count(&self.mask))).abs(),
            unlike: None,
            update_us: 0.0,
        })
    }
}

/// The pixels with more force than `least_n`.
fn above(force: &[f32], least_n: f64) -> Vec<bool> {
    force.iter().map(|&force| f64::from(force) > least_n).collect()
}

/// The pressed pixels, if an equal share of the force on each is more than `least_n`.
fn even(force: &[f32], least_n: f64) -> Vec<bool> {
    let [sum, most] = force.iter().fold([0.0, 0.0_f64], |[sum, most], &force| {
        let force = f64::from(force);
        [sum + force, most.max(force)]
    });
    let pressed = above(force, RIM * most);
    if sum > least_n * count(&pressed) as f64 { pressed } else { vec![false; force.len()] }
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|&&touches| touches).count()
}

pub(super) fn force_error(contacts: &[&Contact]) -> Option<MeanStd> {
    known(contacts, |contact| contact.force_n.map(|(expected, found)| (found - expected).abs()))
}

/// Mean over the pictures that have the figure.
pub(super) fn known(contacts: &[&Contact], figure: impl Fn(&Contact) -> Option<f64>) -> Option<MeanStd> {
    MeanStd::of(&contacts.iter().filter_map(|contact| figure(contact)).collect::<Vec<_>>())
}

/// Mean over all pictures; 0 without pictures.
pub(super) fn over(contacts: &[&Contact], figure: impl Fn(&Contact) -> f64) -> MeanStd {
    MeanStd::over(contacts, |contact| figure(contact)).unwrap_or(MeanStd { mean: 0.0, std: None })
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PressOptions {
    /// The work that is skipped between pictures.
    pub(crate) options: FrameOptions,
    /// The network sees the first of so many pictures; its answer stands for the others.
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

    /// The answer to the next picture, or the last answer if the network does not see this picture.
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
