//! The studies: one recording without labels, digits, direction of slip.
//!
//! Networks over events are timed on streams, each from an empty window on. Errors against labels are those of recordings and
//! objects that a training has not seen. With several trainings, the first one is timed.

use std::cell::OnceCell;
use std::path::Path;
use std::sync::Arc;

use meissner_engine::{Admission, Event, LatePolicy, Sensor};
use meissner_io::datasets::Split;
use meissner_models::systems::digits::SENSOR;
use meissner_models::systems::slip::ObjectSet;
use meissner_pipeline::frame_predictor::LayerCost;
use meissner_pipeline::losses::InputLosses;
use meissner_pipeline::model::{Model, describe, labelled, weights};
use meissner_pipeline::source::Source;
use rayon::ThreadPool;

use super::events::{EventNetwork, Judge};
use super::frames::{FramesNetwork, has_convolutions, has_pixels_to_keep};
use super::report::DataReport;
use super::state::Fingerprint;
use super::{NetworkStudy, Options, Study};
use crate::digits::{self, Digits, DigitsData, Fold, cross_validations};
use crate::error::{EvaluateError, weights_error};
use crate::slip::{self, Slip, SlipData, Windows};
use crate::trainings::{Request, candidates};

/// Timed events without another number.
const EVENTS: usize = 20_000;
/// Timed windows without another number.
const WINDOWS: usize = 400;
/// The network without another name.
const NETWORK: &str = "graphres";

/// The part of a recording and the networks of a study without labels.
#[derive(Clone, Copy, Debug)]
pub struct AngleOptions<'a> {
    /// Names of shipped networks or description files; none for `graphres`.
    pub networks: &'a [String],
    /// Weights of the only network.
    pub weights: Option<&'a Path>,
    /// Accepts weights that were trained on another preparation of the input.
    pub ignore_preparation: bool,
    /// Size of the sensor, in place of the recording's.
    pub sensor: Option<Sensor>,
    /// Events of the first so many microseconds are left out.
    pub from_us: i64,
}

/// The study of networks over events on `source`, a recording without labels.
///
/// # Errors
/// The recording has no events, its sensor is unknown, or a network does not fit.
pub fn angle(
    source: Source,
    asked: AngleOptions<'_>,
    options: &Options,
) -> Result<Study<'static>, EvaluateError> {
    let (name, sensor) = (source.name.clone(), source.sensor(asked.sensor)?);
    let all = source.collect::<Result<Vec<Event>, _>>()?;
    let count = options.timed.unwrap_or(EVENTS);
    // In i128: times may be any numbers.
    let begin = i128::from(all.first().map_or(0, |event| event.t_us)) + i128::from(asked.from_us);
    let taken = all.iter().filter(|event| i128::from(event.t_us) >= begin);
    let events: Vec<Event> = taken.copied().take(count).collect();
    if events.is_empty() {
        return Err(EvaluateError::NoEvents);
    }
    let mut gate = Admission::new(sensor, LatePolicy::Drop);
    for &event in &events {
        // Accepted events are counted, too.
        let _ = gate.admit(event);
    }
    let lost = InputLosses::of_events(*gate.counters(), sensor);
    let mut notes: Vec<String> = lost.warn(&name).into_iter().map(|warning| warning.message).collect();

    let default = [NETWORK.to_owned()];
    let names = if asked.networks.is_empty() { &default[..] } else { asked.networks };
    if asked.weights.is_some() && names.len() > 1 {
        return Err(EvaluateError::OneNetwork { found: names.len() });
    }
    let mut networks: Vec<NetworkStudy<'static>> = Vec::new();
    for name in names {
        let (description, shipped) = describe(name)?;
        let (weights, label) = weights(name, shipped, asked.weights)?;
        let Model { network, card, .. } =
            Model::of(&description, (&weights, label.clone()), asked.ignore_preparation)?;
        if card.stride() > 1 {
            return Err(EvaluateError::Stride { network: name.clone(), stride: card.stride() });
        }
        notes.extend(card.warnings(Some([sensor.width, sensor.height])));
        if networks.iter().any(|other| other.name == network.name()) {
            return Err(EvaluateError::NetworkTwice(name.clone()));
        }
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}"));
        fingerprint.weights(&weights);
        let (name, streams) = (network.name().to_owned(), vec![events.clone()]);
        let network = EventNetwork { network, sensor, streams, repeats: options.repeats, judge: None };
        networks.push(network.study(name, labelled(label, &weights), fingerprint.finish())?);
    }
    let mut fingerprint = Fingerprint::default();
    fingerprint.text(&sensor.to_string());
    fingerprint.events(&events);
    let (size, timed) = (all.len() as u64, events.len() as u64);
    let data = DataReport { name, recordings: 1, size, timed, fingerprint: fingerprint.finish() };
    Ok(Study { system: "angle", unit: "event", asked: count, data, networks, notes })
}

/// The study of networks over events for digits, on the data set in `folder`. Errors are those on the split test, or of the
/// cross-validation where a network has folds, of which there must be `folds`.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit.
pub fn digits<'a>(
    folder: &Path,
    request: Request<'_>,
    folds: Option<usize>,
    options: &Options,
    pool: &'a ThreadPool,
) -> Result<Study<'a>, EvaluateError> {
    let (candidates, more_notes) = candidates::<Digits>(request)?;
    let strides = candidates.iter().map(digits::Candidate::stride).collect::<Result<Vec<_>, _>>()?;
    let data = Arc::new(DigitsData::read(folder)?);
    let asked = options.timed.unwrap_or(EVENTS);
    let (mut networks, mut timed) = (Vec::new(), 0);
    for (candidate, stride) in candidates.iter().zip(strides) {
        let (of, seeds) = seeds(folder, candidate, &data, folds)?;
        let taken = |place: usize| data.recordings[place].events.iter().copied().step_by(stride);
        let events = |place: usize| taken(place).collect::<Vec<Event>>();
        let (first, chosen) = &seeds[0][0];
        let streams = spread(chosen, |place| taken(place).len(), asked);
        let streams: Vec<Vec<Event>> = streams.into_iter().map(events).collect();
        timed = timed.max(streams.iter().map(|events| events.len() as u64).sum());
        let description = &candidate.description;
        let network = description.network(&first.weights).map_err(weights_error(&first.label))?;
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}, every {stride}"));
        for (training, chosen) in seeds.iter().flatten() {
            fingerprint.weights(&training.weights);
            chosen.iter().for_each(|&place| fingerprint.text(&data.recordings[place].name));
        }
        let label = timed_label(seeds.iter().flatten().count(), &first.label);
        let (data, description) = (Arc::clone(&data), description.clone());
        let name = description.name().to_owned();
        let judge = Some(Judge { of, data, stride, description, seeds, pool });
        let network = EventNetwork { network, sensor: SENSOR, streams, repeats: options.repeats, judge };
        networks.push(network.study(name, label, fingerprint.finish())?);
    }
    let mut fingerprint = Fingerprint::default();
    for recording in &data.recordings {
        fingerprint.text(&recording.name);
        fingerprint.text(&recording.class.to_string());
        fingerprint.events(&recording.events);
    }
    let report = DataReport {
        name: folder.display().to_string(),
        recordings: data.recordings.len() as u64,
        size: data.events(),
        timed,
        fingerprint: fingerprint.finish(),
    };
    let notes = data.notes.iter().cloned().chain(more_notes).collect();
    Ok(Study { system: "digits", unit: "event", asked, data: report, networks, notes })
}

/// Source of the weights of so many trainings.
fn timed_label(trainings: usize, first: &str) -> String {
    if trainings == 1 { first.to_owned() } else { format!("{trainings} trainings, timed with {first}") }
}

/// The trainings of `candidate` by seed, each with its unseen recordings: folds where there are any, else whole trainings.
fn seeds(
    folder: &Path,
    candidate: &digits::Candidate,
    data: &DigitsData,
    folds: Option<usize>,
) -> Result<(&'static str, Vec<Vec<Fold>>), EvaluateError> {
    let validations = cross_validations(&candidate.trainings, data, folds)?;
    if !validations.is_empty() {
        return Ok(("cross-validation", validations.into_iter().map(|seed| seed.folds).collect()));
    }
    let test = data.of(Split::Test);
    if test.is_empty() {
        return Err(EvaluateError::NoTestSplit { folder: folder.to_owned() });
    }
    let whole = candidate.trainings.iter().map(|training| vec![(Arc::clone(training), test.clone())]);
    Ok(("split test", whole.collect()))
}

/// Some of the recordings `chosen`, as far apart as possible: at least one, and with about `count` events.
fn spread(chosen: &[usize], events: impl Fn(usize) -> usize, count: usize) -> Vec<usize> {
    let all: usize = chosen.iter().map(|&place| events(place)).sum();
    // A recording has at least one event.
    let mean = (all / chosen.len()).max(1);
    evenly(chosen, count.div_ceil(mean).min(chosen.len()))
}

/// `count` of `items`, as far apart as possible.
fn evenly<T: Copy>(items: &[T], count: usize) -> Vec<T> {
    (0..count).map(|i| items[(2 * i + 1) * items.len() / (2 * count)]).collect()
}

/// The study of frame networks for the direction of slip, on the data set in `folder`. Errors are those on unseen objects;
/// folds are left out.
///
/// # Errors
/// The data set or a network cannot be read, a network has only folds, or all objects are seen.
pub fn slip<'a>(
    folder: &Path,
    request: Request<'_>,
    options: &Options,
    pool: &'a ThreadPool,
) -> Result<Study<'a>, EvaluateError> {
    let (candidates, mut notes) = candidates::<Slip>(request)?;
    let data = Arc::new(SlipData::read(folder)?);
    notes.splice(0..0, data.notes.iter().cloned());
    let asked = options.timed.unwrap_or(WINDOWS);
    let (mut networks, mut size, mut timed) = (Vec::new(), 0, 0);
    for candidate in candidates {
        let slip::Candidate { description, trainings } = candidate;
        let name = description.name().to_owned();
        let whole: Vec<_> = trainings.iter().filter(|training| training.held_out.is_none()).collect();
        let folds = trainings.len() - whole.len();
        if folds > 0 {
            notes.push(format!(
                "{name}: {folds} folds are passed over, unseen objects are for whole trainings"
            ));
        }
        let Some(first) = whole.first() else { return Err(EvaluateError::NoWholeTraining(name)) };
        let label = timed_label(whole.len(), &first.label);
        let windows = Windows::cut(&data, &description)?;
        let all = windows.all().into_iter().zip(&data.objects);
        let unseen = all.map(|(windows, object)| match object.set {
            ObjectSet::Basic => Vec::new(),
            _ => windows,
        });
        let unseen: Vec<Vec<usize>> = unseen.collect();
        let of_recording = |(recording, windows): (usize, &Vec<usize>)| {
            windows.iter().map(|&window| (recording, window)).collect::<Vec<_>>()
        };
        let places: Vec<(usize, usize)> = unseen.iter().enumerate().flat_map(of_recording).collect();
        if places.is_empty() {
            return Err(EvaluateError::NoUnseenObjects);
        }
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}"));
        let mut parts = Vec::new();
        for training in &whole {
            fingerprint.weights(&training.weights);
            parts.push(description.network_parts(&training.weights).map_err(weights_error(&training.label))?);
        }
        if !has_convolutions(&parts[0]) {
            notes.push(format!("{name}: no 3 x 3 convolution outside recurrent layers, so none by Winograd"));
        }
        if !has_pixels_to_keep(&parts[0]) {
            notes.push(format!("{name}: no pixel that a tolerance could keep, so none with one"));
        }
        let network = FramesNetwork {
            trainings: parts,
            costs: description.layers().iter().map(LayerCost::new).collect(),
            data: Arc::clone(&data),
            windows,
            unseen,
            timed: evenly(&places, asked.min(places.len())),
            repeats: options.repeats,
            pool,
            exact: OnceCell::new(),
        };
        (size, timed) = (network.windows.counts.iter().sum(), network.timed.len());
        networks.push(network.study(name, label, fingerprint.finish()));
    }
    let mut fingerprint = Fingerprint::default();
    for (recording, object) in data.recordings.iter().zip(&data.objects) {
        fingerprint.text(&recording.name);
        fingerprint.text(&format!("{} {}", recording.class, object.name));
        recording.readings.iter().for_each(|reading| fingerprint.floats(&reading.values));
    }
    let report = DataReport {
        name: folder.display().to_string(),
        recordings: data.recordings.len() as u64,
        size: size as u64,
        timed: timed as u64,
        fingerprint: fingerprint.finish(),
    };
    Ok(Study { system: "slip", unit: "window", asked, data: report, networks, notes })
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn timed_recordings_are_far_apart_and_at_least_one() {
        let chosen = |chosen: &[usize], count: usize| spread(chosen, |_| 4, count);
        let all: Vec<usize> = (0..10).collect();
        assert_eq!(chosen(&all, 1), [5]);
        assert_eq!(chosen(&all, 8), [2, 7]);
        assert_eq!(chosen(&all, 1000), all);
        assert_eq!(chosen(&[3, 9], 5), [3, 9]);
    }
}
