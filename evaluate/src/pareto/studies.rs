//! The studies: one recording without labels, digits, direction of slip.
//!
//! Networks over events are timed on streams, each from an empty window on. Errors against labels
//! are those of recordings and objects that a training has not seen. With several trainings, the
//! first one is timed.

use std::cell::OnceCell;
use std::path::Path;
use std::sync::Arc;

use meissner_engine::{Event, Sensor};
use meissner_models::DEFAULT_NETWORK;
use meissner_models::systems::slip::ObjectSet;
use meissner_run::model::{LayerCost, Model, describe, labelled, weights};
use meissner_run::source::Source;

use super::event_network::{EventNetwork, Judge};
use super::frame_network::FramesNetwork;
use super::frame_settings;
use super::report::DataReport;
use super::state::Fingerprint;
use super::{NetworkReport, NetworkStudy, Options, Study};
use crate::error::{EvaluateError, RequestPart, weights_error};
use crate::events::{EventTask, lost};
use crate::slip::{Slip, SlipData, Windows};
use crate::trainings::{EvaluatedNetwork, Request, candidates};
use crate::trials::Fold;
use crate::workers::Workers;

/// Timed events without another number.
const EVENTS: usize = 20_000;
/// Timed windows without another number.
const WINDOWS: usize = 400;

/// The part of a recording and the networks of a study without labels.
#[derive(Clone, Copy, Debug)]
pub struct AngleOptions<'a> {
    /// Names of shipped networks or description files; none for [`DEFAULT_NETWORK`].
    pub networks: &'a [String],
    /// Weights of the only network.
    pub weights: Option<&'a Path>,
    /// Accepts weights that were trained on another preparation of the input.
    pub ignore_preparation: bool,
    /// Size of the sensor, instead of the recording's.
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
        return Err(EvaluateError::request(RequestPart::Recording, "events to measure", "none"));
    }
    let mut notes: Vec<String> =
        lost(&name, sensor, [&events]).into_iter().map(|lost| lost.message).collect();

    let default = [DEFAULT_NETWORK.to_owned()];
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
        let stride = card.network.stride;
        if stride > 1 {
            let found = format!("{name}, whose weights say \"stride\" {stride}");
            let expected = "weights of networks that take every event";
            return Err(EvaluateError::request(RequestPart::Networks, expected, found));
        }
        notes.extend(card.warnings(Some([sensor.width, sensor.height])));
        if networks.iter().any(|other| other.report.network == network.name()) {
            return Err(EvaluateError::twice(name));
        }
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}"));
        fingerprint.weights(&weights);
        let (name, streams) = (network.name().to_owned(), vec![events.clone()]);
        let network = EventNetwork { network, sensor, streams, repeats: options.repeats, judge: None };
        networks.push(network.study(NetworkReport::new(name, labelled(label, &weights), fingerprint))?);
    }
    let mut fingerprint = Fingerprint::default();
    fingerprint.text(&sensor.to_string());
    fingerprint.events(&events);
    let (size, timed) = (all.len() as u64, events.len() as u64);
    let data = DataReport { name, recordings: 1, size, timed, fingerprint: fingerprint.finish() };
    Ok(Study { system: "angle", unit: "event", asked: count, data, networks, notes })
}

/// The study of networks over events for a task, on the data set in `folder`. Errors are those on
/// the split test, or of the cross-validation where a network has folds, of which there must be
/// `folds`.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit.
pub fn events<'a, T: EventTask>(
    folder: &Path,
    request: Request<'_>,
    folds: Option<usize>,
    options: &Options,
    workers: &'a Workers,
) -> Result<Study<'a>, EvaluateError> {
    let (candidates, more_notes) = candidates::<T>(request)?;
    let strides = candidates.iter().map(EvaluatedNetwork::stride).collect::<Result<Vec<_>, _>>()?;
    let data = Arc::new(T::read(folder)?);
    let asked = options.timed.unwrap_or(EVENTS);
    let (mut networks, mut timed) = (Vec::new(), 0);
    for (EvaluatedNetwork { description, trainings }, stride) in candidates.into_iter().zip(strides) {
        // Folds where there are any, else whole trainings.
        let mut trials = data.trials(&trainings, folds)?;
        let has_folds = trials.iter().any(|trial| trial.scheme.is_some());
        trials.retain(|trial| trial.scheme.is_some() == has_folds);
        data.has_test(&trials)?;
        let of = if has_folds { "cross-validation" } else { "split test" };
        let taken = |place: usize| data.recordings[place].events.iter().copied().step_by(stride);
        let Fold { training: first, cases } = &trials[0].folds[0];
        let streams = spread(cases, |place| taken(place).len(), asked);
        let streams: Vec<Vec<Event>> = streams.into_iter().map(|place| taken(place).collect()).collect();
        timed = timed.max(streams.iter().map(|events| events.len() as u64).sum());
        let network = description.network(&first.weights).map_err(weights_error(&first.label))?;
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}, every {stride}"));
        let all = || trials.iter().flat_map(|trial| &trial.folds);
        for Fold { training, cases } in all() {
            fingerprint.weights(&training.weights);
            cases.iter().for_each(|&place| fingerprint.text(&data.recordings[place].name));
        }
        let label = timed_label(all().count(), &first.label);
        let (sensor, name) = (data.set.sensor, description.name().to_owned());
        let judge = Some(Judge { of, data: Arc::clone(&data), stride, description, trials, workers });
        let network = EventNetwork { network, sensor, streams, repeats: options.repeats, judge };
        networks.push(network.study(NetworkReport::new(name, label, fingerprint))?);
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
    Ok(Study { system: data.set.task, unit: "event", asked, data: report, networks, notes })
}

/// Source of the weights of so many trainings.
pub(super) fn timed_label(trainings: usize, first: &str) -> String {
    if trainings == 1 { first.to_owned() } else { format!("{trainings} trainings, timed with {first}") }
}

/// Some of the recordings `chosen`, as far apart as possible: at least one, and with about `count`
/// events.
pub(super) fn spread(chosen: &[usize], events: impl Fn(usize) -> usize, count: usize) -> Vec<usize> {
    let all: usize = chosen.iter().map(|&place| events(place)).sum();
    // A recording has at least one event.
    let mean = (all / chosen.len()).max(1);
    evenly(chosen, count.div_ceil(mean).min(chosen.len()))
}

/// `count` of `items`, as far apart as possible.
pub(super) fn evenly<T: Copy>(items: &[T], count: usize) -> Vec<T> {
    (0..count).map(|i| items[(2 * i + 1) * items.len() / (2 * count)]).collect()
}

/// The study of frame networks for the direction of slip, on the data set in `folder`. Errors are
/// those on unseen objects; folds are left out.
///
/// # Errors
/// The data set or a network cannot be read, a network has only folds, or all objects are seen.
pub fn slip<'a>(
    folder: &Path,
    request: Request<'_>,
    options: &Options,
    workers: &'a Workers,
) -> Result<Study<'a>, EvaluateError> {
    let (candidates, mut notes) = candidates::<Slip>(request)?;
    let data = Arc::new(SlipData::read(folder)?);
    notes.splice(0..0, data.notes.iter().cloned());
    let asked = options.timed.unwrap_or(WINDOWS);
    let (mut networks, mut size, mut timed) = (Vec::new(), 0, 0);
    for EvaluatedNetwork { description, trainings } in candidates {
        let name = description.name().to_owned();
        let whole: Vec<_> = trainings.iter().filter(|training| training.held_out.is_none()).collect();
        let folds = trainings.len() - whole.len();
        if folds > 0 {
            notes.push(format!(
                "{name}: {folds} folds are passed over, unseen objects are for whole trainings"
            ));
        }
        let Some(first) = whole.first() else {
            let expected = format!("a whole training of {name}");
            return Err(EvaluateError::request(RequestPart::Trainings, expected, "folds alone"));
        };
        let label = timed_label(whole.len(), &first.label);
        let windows = Windows::cut(&data, &description)?;
        let set = |window: usize| data.objects[windows.cases.recording(window)].set;
        let windows_of_unseen = (0..windows.cases.len()).filter(|&window| set(window) != ObjectSet::Basic);
        let unseen: Vec<usize> = windows_of_unseen.collect();
        if unseen.is_empty() {
            let (expected, found) = ("recordings of unseen objects", "Basic alone");
            return Err(EvaluateError::request(RequestPart::Data, expected, found));
        }
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}"));
        let mut parts = Vec::new();
        for training in &whole {
            fingerprint.weights(&training.weights);
            parts.push(description.network_parts(&training.weights).map_err(weights_error(&training.label))?);
        }
        notes.extend(frame_settings::notes(&name, &parts[0]));
        let network = FramesNetwork {
            trainings: parts,
            costs: description.layers().iter().map(LayerCost::new).collect(),
            data: Arc::clone(&data),
            timed: evenly(&unseen, asked.min(unseen.len())),
            windows,
            unseen,
            repeats: options.repeats,
            workers,
            exact: OnceCell::new(),
        };
        (size, timed) = (network.windows.cases.len(), network.timed.len());
        networks.push(network.study(NetworkReport::new(name, label, fingerprint)));
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
