//! Frame networks that tell the direction of slip: each setting against the labels, and against the exact outputs.
//!
//! | file | job |
//! |---|---|
//! | `settings` | which approximations |
//! | `rounded` | frame networks with rounded weights |
//! | `subject` | a network with each of its settings |

mod settings;
mod subject;

use std::cell::OnceCell;

use meissner_models::systems::slip::ObjectSet;
use rayon::ThreadPool;

use super::args::SlipArgs;
use super::fingerprint::Fingerprint;
use super::measurement::Subject;
use super::study::{Data, Study};
use crate::error::CliError;
use crate::slip::{Candidate, SlipData, Windows, candidates};
use meissner_pipeline::PipelineError;
use meissner_pipeline::layer_cost::LayerCost;
use settings::{has_convolutions, has_pixels_to_keep, settings};
use subject::SlipSubject;

/// Windows that are timed where nothing else is asked for.
const TIMED: usize = 400;

/// What `args` ask for over `data`.
pub(super) fn study<'a>(
    args: &SlipArgs,
    data: &'a SlipData,
    pool: &'a ThreadPool,
) -> Result<Study<'a>, CliError> {
    let (candidates, mut notes) = candidates(&args.networks, args.trainings.as_deref())?;
    let asked = args.common.timed_events(TIMED);
    let mut subjects: Vec<Box<dyn Subject + 'a>> = Vec::new();
    let (mut size, mut timed) = (0, 0);
    for candidate in candidates {
        let subject = subject(args, candidate, data, pool, &mut notes)?;
        (size, timed) = (subject.windows.counts.iter().sum(), subject.timed.len());
        let parts = &subject.trainings[0];
        if !has_convolutions(parts) {
            notes.push(format!(
                "{}: no 3 x 3 convolution outside recurrent layers, so none by Winograd",
                subject.name
            ));
        }
        if !has_pixels_to_keep(parts) {
            notes.push(format!("{}: no pixel that a tolerance could keep, so none with one", subject.name));
        }
        subjects.push(Box::new(subject));
    }
    let mut fingerprint = Fingerprint::new();
    for (recording, object) in data.recordings.iter().zip(&data.objects) {
        fingerprint.text(&recording.name);
        fingerprint.text(&format!("{} {}", recording.class, object.name));
        recording.readings.iter().for_each(|reading| fingerprint.floats(&reading.values));
    }
    notes.splice(0..0, data.notes.iter().cloned());
    Ok(Study {
        system: "slip",
        unit: "window",
        asked,
        data: Data {
            name: args.data.display().to_string(),
            recordings: data.recordings.len() as u64,
            size: size as u64,
            timed: timed as u64,
            fingerprint: fingerprint.finish(),
        },
        subjects,
        notes,
    })
}

fn subject<'a>(
    args: &SlipArgs,
    candidate: Candidate,
    data: &'a SlipData,
    pool: &'a ThreadPool,
    notes: &mut Vec<String>,
) -> Result<SlipSubject<'a>, CliError> {
    let Candidate { description, trainings } = candidate;
    let name = description.name().to_owned();
    let (whole, folds): (Vec<_>, Vec<_>) =
        trainings.into_iter().partition(|training| training.held_out.is_none());
    if !folds.is_empty() {
        notes.push(format!(
            "{name}: {} folds are passed over, unseen objects are for whole trainings",
            folds.len()
        ));
    }
    let Some(first) = whole.first() else {
        let (expected, found) = (format!("a whole training of {name}"), "folds alone".to_owned());
        return Err(CliError::Option { option: "--trainings", expected, found });
    };
    let windows = Windows::cut(data, &description)?;
    let all = windows.all().into_iter().zip(&data.objects);
    let unseen: Vec<Vec<usize>> = all
        .map(|(windows, object)| if object.set == ObjectSet::Basic { Vec::new() } else { windows })
        .collect();
    let places: Vec<(usize, usize)> = unseen
        .iter()
        .enumerate()
        .flat_map(|(recording, windows)| windows.iter().map(move |&window| (recording, window)))
        .collect();
    if places.is_empty() {
        let (expected, found) = ("recordings of unseen objects".to_owned(), "Basic alone".to_owned());
        return Err(CliError::Option { option: "DATA", expected, found });
    }
    let timed = args.common.timed_events(TIMED).min(places.len());
    let mut fingerprint = Fingerprint::new();
    fingerprint.text(&format!("{description:?}"));
    let mut parts = Vec::new();
    for training in &whole {
        fingerprint.weights(&training.weights);
        let failed = |source| PipelineError::Weights {
            weights: training.label.as_str().into(),
            source: Box::new(source),
        };
        parts.push(description.network_parts(&training.weights).map_err(failed)?);
    }
    Ok(SlipSubject {
        name,
        weights: match whole.len() {
            1 => first.label.clone(),
            count => format!("{count} trainings, timed with {}", first.label),
        },
        fingerprint: fingerprint.finish(),
        costs: description.layers().iter().map(LayerCost::new).collect(),
        settings: settings(&parts[0], windows.steps()),
        trainings: parts,
        data,
        windows,
        unseen,
        timed: (0..timed).map(|i| places[(2 * i + 1) * places.len() / (2 * timed)]).collect(),
        repeats: args.common.repeat,
        pool,
        exact: OnceCell::new(),
    })
}
