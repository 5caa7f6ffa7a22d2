//! Networks over events that tell digits: each setting against the labels, and against the exact outputs.
//!
//! Errors are those of the recordings that a training has not seen: of the split test, or, where the trainings are folds, of
//! what each held out. Times and numerical errors are those of the first training over some of these recordings, evenly
//! chosen, whole, each from an empty window on.

use std::rc::Rc;

use meissner_engine::Event;
use meissner_io::datasets::Split;
use meissner_models::systems::digits::SENSOR;
use rayon::ThreadPool;

use super::args::DigitsArgs;
use super::events::EventSubject;
use super::fingerprint::Fingerprint;
use super::measurement::Subject;
use super::settings::{check, mean_rate, settings};
use super::study::{Data, Study};
use super::wrong::{Judge, Judged};
use crate::digits::{Asked, Candidate, DigitsData, Training, candidates, validations};
use crate::error::CliError;
use meissner_pipeline::PipelineError;

/// Events that are timed where nothing else is asked for.
const TIMED: usize = 20_000;

/// A data set, and the networks that are asked for with the events that they take of it.
pub(super) struct DigitsPlan {
    data: DigitsData,
    networks: Vec<(Candidate, Vec<Vec<Event>>)>,
    notes: Vec<String>,
}

/// A training with the places of the recordings that it is judged on.
type Part = (Rc<Training>, Vec<usize>);

impl DigitsPlan {
    pub(super) fn read(args: &DigitsArgs) -> Result<Self, CliError> {
        let (candidates, notes) = candidates(Asked {
            networks: &args.networks,
            weights: args.weights.as_deref(),
            trainings: args.trainings.as_deref(),
            stride: None,
        })?;
        let data = DigitsData::read(&args.data)?;
        let taken = |stride: usize| {
            let recordings = data.recordings.iter();
            recordings.map(|recording| recording.events.iter().copied().step_by(stride).collect()).collect()
        };
        let networks = candidates.into_iter().map(|candidate| {
            let events = taken(candidate.stride);
            (candidate, events)
        });
        let networks = networks.collect();
        let notes = data.notes.iter().cloned().chain(notes).collect();
        Ok(Self { data, networks, notes })
    }
}

/// What `args` ask for over `plan`.
pub(super) fn study<'a>(
    args: &DigitsArgs,
    plan: &'a DigitsPlan,
    pool: &'a ThreadPool,
) -> Result<Study<'a>, CliError> {
    let data = &plan.data;
    let mut subjects: Vec<Box<dyn Subject + 'a>> = Vec::new();
    let mut timed = 0;
    for (candidate, events) in &plan.networks {
        let (of, seeds) = seeds(args, candidate, data)?;
        let (first, chosen) = &seeds[0][0];
        let streams = spread(chosen, events, args.common.timed_events(TIMED));
        timed = timed.max(streams.iter().map(|events| events.len() as u64).sum());
        let description = &candidate.description;
        let failed = |source| PipelineError::Weights {
            weights: first.label.as_str().into(),
            source: Box::new(source),
        };
        let network = description.network(&first.weights).map_err(failed)?;
        let settings = settings(&network, mean_rate(&streams));
        check(&network, &settings)?;
        let mut fingerprint = Fingerprint::new();
        fingerprint.text(&format!("{description:?}, every {}", candidate.stride));
        let judged = |(training, chosen): &Part, fingerprint: &mut Fingerprint| {
            fingerprint.weights(&training.weights);
            let recordings = chosen.iter().map(|&place| {
                fingerprint.text(&data.recordings[place].name);
                (&events[place][..], data.recordings[place].class)
            });
            let recordings = recordings.collect();
            Judged { weights: training.weights.clone(), label: training.label.clone(), recordings }
        };
        let parts = |parts: &Vec<Part>| parts.iter().map(|part| judged(part, &mut fingerprint)).collect();
        let label = match seeds.iter().flatten().count() {
            1 => first.label.clone(),
            count => format!("{count} trainings, timed with {}", first.label),
        };
        let judge = Judge {
            of,
            description: description.clone(),
            sensor: SENSOR,
            seeds: seeds.iter().map(parts).collect(),
            pool,
        };
        subjects.push(Box::new(EventSubject {
            name: description.name().to_owned(),
            weights: label,
            fingerprint: fingerprint.finish(),
            network,
            sensor: SENSOR,
            settings,
            streams,
            repeats: args.common.repeat,
            judge: Some(judge),
        }));
    }
    Ok(Study {
        system: "digits",
        unit: "event",
        asked: args.common.timed_events(TIMED),
        data: Data {
            name: args.data.display().to_string(),
            recordings: data.recordings.len() as u64,
            size: data.events(),
            timed,
            fingerprint: fingerprint(data),
        },
        subjects,
        notes: plan.notes.clone(),
    })
}

/// What the trainings of `candidate` are judged on, by seed: folds where there are any, else whole trainings.
fn seeds(
    args: &DigitsArgs,
    candidate: &Candidate,
    data: &DigitsData,
) -> Result<(&'static str, Vec<Vec<Part>>), CliError> {
    let folds = validations(&candidate.trainings, data, args.folds.map(|folds| folds as usize))?;
    if !folds.is_empty() {
        return Ok(("cross-validation", folds.into_iter().map(|seed| seed.folds).collect()));
    }
    let test = data.of(Split::Test);
    if test.is_empty() {
        return Err(CliError::NoTestSplit { folder: args.data.clone() });
    }
    let whole = candidate.trainings.iter().map(|training| vec![(Rc::clone(training), test.clone())]);
    Ok(("split test", whole.collect()))
}

/// The events of some of the recordings `chosen`, as far apart as possible: at least one, and about `count` events.
fn spread<'a>(chosen: &[usize], events: &'a [Vec<Event>], count: usize) -> Vec<&'a [Event]> {
    let all: usize = chosen.iter().map(|&place| events[place].len()).sum();
    // A recording has at least one event.
    let mean = (all / chosen.len()).max(1);
    let wanted = count.div_ceil(mean).min(chosen.len());
    let place = |i: usize| chosen[(2 * i + 1) * chosen.len() / (2 * wanted)];
    (0..wanted).map(|i| &events[place(i)][..]).collect()
}

fn fingerprint(data: &DigitsData) -> String {
    let mut fingerprint = Fingerprint::new();
    for recording in &data.recordings {
        fingerprint.text(&recording.name);
        fingerprint.text(&recording.class.to_string());
        fingerprint.events(&recording.events);
    }
    fingerprint.finish()
}

#[cfg(test)]
mod tests {
    use super::spread;
    use meissner_engine::Event;

    #[test]
    fn timed_recordings_are_far_apart_and_at_least_one() {
        let events: Vec<Vec<Event>> = (0..10).map(|i| vec![Event::new(i, 0, 0, true); 4]).collect();
        let firsts = |chosen: &[usize], count: usize| -> Vec<i64> {
            spread(chosen, &events, count).iter().map(|events| events[0].t_us).collect()
        };
        let all: Vec<usize> = (0..10).collect();
        assert_eq!(firsts(&all, 1), [5]);
        assert_eq!(firsts(&all, 8), [2, 7]);
        assert_eq!(firsts(&all, 1000), (0..10).collect::<Vec<_>>());
        assert_eq!(firsts(&[3, 9], 5), [3, 9]);
    }
}
