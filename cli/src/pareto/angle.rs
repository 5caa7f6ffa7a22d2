//! Networks over events along one recording without labels: how far each setting is from the exact prediction.

use meissner_engine::{Admission, Event, LatePolicy};

use super::args::AngleArgs;
use super::events::EventSubject;
use super::fingerprint::Fingerprint;
use super::measurement::Subject;
use super::settings::{check, mean_rate, settings};
use super::study::{Data, Study};
use crate::error::CliError;
use meissner_pipeline::lost::Lost;
use meissner_pipeline::model::{Model, describe, labelled, weights};

/// The network where none is named.
const NETWORK: &str = "graphres";
/// Events that are timed where nothing else is asked for.
const TIMED: usize = 20_000;

/// The events that are timed, of a recording that is read once.
pub(super) struct AngleData {
    name: String,
    sensor: meissner_engine::Sensor,
    /// In the recording.
    all: usize,
    events: Vec<Event>,
    /// What is lost of them.
    notes: Vec<String>,
}

impl AngleData {
    /// The part of the recording that `args` ask for.
    pub(super) fn read(args: &AngleArgs) -> Result<Self, CliError> {
        let source = args.read.open(Some(&args.recording), args.sensor.is_some(), true)?;
        let (name, sensor) = (source.name.clone(), source.sensor(args.sensor)?);
        let all = source.collect::<Result<Vec<Event>, _>>()?;
        let first_us = all.first().map_or(0, |event| event.t_us);
        // In i128: times may lie anywhere.
        let begin = i128::from(first_us) + i128::from(args.from_us.unwrap_or(0));
        let taken = all.iter().filter(|event| i128::from(event.t_us) >= begin);
        let events: Vec<Event> = taken.copied().take(args.common.timed_events(TIMED)).collect();
        if events.is_empty() {
            let (expected, found) = ("events to measure".to_owned(), "none".to_owned());
            return Err(CliError::Option { option: "RECORDING", expected, found });
        }
        let mut gate = Admission::new(sensor, LatePolicy::Drop);
        for &event in &events {
            // What is accepted is counted, too.
            let _ = gate.admit(event);
        }
        let lost = Lost { events: *gate.counters(), sensor, outside_crop: 0, lines_refused: 0 };
        let notes = lost.warn(&name).into_iter().map(|warning| warning.message).collect();
        Ok(Self { name, sensor, all: all.len(), events, notes })
    }
}

/// What `args` ask for over `data`.
pub(super) fn study<'a>(args: &AngleArgs, data: &'a AngleData) -> Result<Study<'a>, CliError> {
    let default = [NETWORK.to_owned()];
    let names = if args.networks.is_empty() { &default[..] } else { &args.networks[..] };
    if let (Some(_), [_, _, ..]) = (&args.weights, names) {
        let (expected, found) = ("one --network".to_owned(), format!("{} networks", names.len()));
        return Err(CliError::Option { option: "--weights", expected, found });
    }
    let streams = vec![&data.events[..]];
    let (mut subjects, mut notes): (Vec<Box<dyn Subject + 'a>>, _) = (Vec::new(), data.notes.clone());
    for name in names {
        let (description, shipped) = describe(name)?;
        let (weights, label) = weights(name, shipped, args.weights.as_deref())?;
        let Model { network, card, .. } =
            Model::of(&description, (&weights, label.clone()), args.ignore_preparation)?;
        if card.stride() > 1 {
            let expected = "weights of networks that take every event".to_owned();
            let found = format!("{name}, whose weights say \"stride\" {}", card.stride());
            return Err(CliError::Option { option: "--network", expected, found });
        }
        notes.extend(card.warnings(Some([data.sensor.width, data.sensor.height])));
        if subjects.iter().any(|other| other.network() == network.name()) {
            let (expected, found) = ("each network once".to_owned(), format!("{name} again"));
            return Err(CliError::Option { option: "--network", expected, found });
        }
        let settings = settings(&network, mean_rate(&streams));
        check(&network, &settings)?;
        let mut fingerprint = Fingerprint::new();
        fingerprint.text(&format!("{description:?}"));
        fingerprint.weights(&weights);
        subjects.push(Box::new(EventSubject {
            name: network.name().to_owned(),
            weights: labelled(label, &weights),
            fingerprint: fingerprint.finish(),
            network,
            sensor: data.sensor,
            settings,
            streams: streams.clone(),
            repeats: args.common.repeat,
            judge: None,
        }));
    }
    let mut fingerprint = Fingerprint::new();
    fingerprint.text(&data.sensor.to_string());
    fingerprint.events(&data.events);
    Ok(Study {
        system: "angle",
        unit: "event",
        asked: args.common.timed_events(TIMED),
        data: Data {
            name: data.name.clone(),
            recordings: 1,
            size: data.all as u64,
            timed: data.events.len() as u64,
            fingerprint: fingerprint.finish(),
        },
        subjects,
        notes,
    })
}
