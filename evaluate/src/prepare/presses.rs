//! Presses that people labelled themselves, for training.
//!
//! Input: [`Presses`]. Output: their events, with numbers as labels along time, as `eval angle`
//! reads them, and classes as `prepare digits` writes them.

use std::collections::{BTreeMap, BTreeSet};

use meissner_engine::{Event, Sensor};
use meissner_models::TensorFile;
use meissner_run::text::grouped;
use serde_json::{Value, json};

use super::{Prepared, add_streams, metadata};
use crate::error::{EvaluateError, RequestPart, Result};
use crate::events::folds;
use crate::presses::{Label, Presses};
use crate::streams::Truth;

/// A press that is written: its index, its instants with the numbers, and its classes.
type Chosen = (usize, Instants, Vec<usize>);
type Instants = Vec<(i64, Vec<f32>)>;

/// The labelled presses with their events, in `folds` folds, and notes for people about what was
/// left out. `meissner prepare presses --help` lists the tensors. Memory for all events.
///
/// Labels keep their units, which are written beside them. Copies of other recordings, presses
/// without a class, and instants that lack a number are left out.
///
/// # Errors
/// The recordings have no sensor, or different ones, a label has a name of the format, there
/// cannot be so many folds, or a recording cannot be read any more.
pub fn labelled_presses(presses: &Presses, folds_count: usize) -> Result<(Vec<String>, Prepared)> {
    let sensor = presses.sensor()?;
    let (classes, numbers): (Vec<usize>, Vec<usize>) =
        (0..presses.labels.len()).partition(|&label| presses.labels[label].is_class());
    for &label in &numbers {
        let name = &presses.labels[label].name;
        if ["start", "t_us"].contains(&name.as_str()) {
            let found = format!("{name}, which the format needs for itself");
            return Err(EvaluateError::request(RequestPart::Labels, "labels of other names", found));
        }
    }
    let (mut chosen, mut met, mut notes) =
        (Vec::<Chosen>::new(), BTreeSet::new(), BTreeMap::<&str, u64>::new());
    for press in presses.labelled() {
        let recording = &presses.recordings[press];
        let mut rows = Instants::new();
        for row in presses.rows_of(press) {
            let values: Vec<f32> = numbers.iter().map(|&label| row.values[label] as f32).collect();
            if values.iter().all(|value| value.is_finite()) {
                rows.push((row.t_us, values));
            } else {
                *notes.entry("instants that lack a number are left out").or_default() += 1;
            }
        }
        // A press has the class of its last instant that has one.
        let class = |&label: &usize| {
            let values = presses.rows_of(press).iter().rev().map(|row| row.values[label]);
            values.clone().find(|value| !value.is_nan()).map(|value| value as usize)
        };
        let of_classes: Option<Vec<usize>> = classes.iter().map(class).collect();
        match of_classes {
            _ if rows.is_empty() => {
                *notes.entry("presses without a complete instant are left out").or_default() += 1;
            }
            None => *notes.entry("presses without a class are left out").or_default() += 1,
            Some(_) if !met.insert((recording.fingerprint, recording.events)) => {
                *notes.entry("copies of other recordings are left out").or_default() += 1;
            }
            Some(classes) => chosen.push((press, rows, classes)),
        }
    }
    let first_class: Vec<usize> =
        chosen.iter().map(|(_, _, classes)| classes.first().copied().unwrap_or(0)).collect();
    let fold = folds(&first_class, folds_count)?;
    let streams: Vec<Vec<Event>> =
        chosen.iter().map(|(press, ..)| presses.events(*press)).collect::<Result<_>>()?;

    let mut file = TensorFile::new(described(presses, sensor, (&numbers, &classes), &chosen));
    add_streams(&mut file, streams.iter().map(|events| events.iter()));
    if !numbers.is_empty() {
        let names: Vec<&str> = numbers.iter().map(|&label| presses.labels[label].name.as_str()).collect();
        let rows: Vec<Instants> = chosen.iter().map(|(_, rows, _)| rows.clone()).collect();
        Truth::of_streams(&names, &rows).write(&mut file);
    }
    let mut integers = |name: &str, values: Vec<usize>| {
        let values: Vec<i64> = values.into_iter().map(|value| value as i64).collect();
        file.i64(name, &[values.len()], &values);
    };
    for (i, &label) in classes.iter().enumerate() {
        let of = chosen.iter().map(|(_, _, classes)| classes[i]).collect();
        integers(&of_label("label", i, &presses.labels[label]), of);
    }
    integers("split", vec![0; chosen.len()]);
    integers("fold", fold);
    let events: usize = streams.iter().map(Vec::len).sum();
    let contents = format!(
        "{} events of {} presses, in {folds_count} folds",
        grouped(events as u64),
        grouped(chosen.len() as u64)
    );
    let notes = notes.into_iter().map(|(what, count)| format!("{what}: {}", grouped(count))).collect();
    Ok((notes, Prepared { file, contents }))
}

/// `name` for the first label of classes, and with the label's name behind it for the others.
fn of_label(name: &str, i: usize, label: &Label) -> String {
    if i == 0 { name.to_owned() } else { format!("{name}.{}", label.name) }
}

fn described(
    presses: &Presses,
    sensor: Sensor,
    (numbers, classes): (&[usize], &[usize]),
    chosen: &[Chosen],
) -> BTreeMap<String, String> {
    let names: Vec<&str> =
        chosen.iter().map(|(press, ..)| presses.recordings[*press].name.as_str()).collect();
    let unit = |&label: &usize| {
        let label = &presses.labels[label];
        Some((label.name.clone(), json!(label.unit.as_deref()?)))
    };
    let units: serde_json::Map<String, Value> = numbers.iter().filter_map(unit).collect();
    let mut described = metadata([
        ("recordings", json!(names)),
        ("sensor", json!([sensor.width, sensor.height])),
        ("units", Value::Object(units)),
    ]);
    for (i, &label) in classes.iter().enumerate() {
        let label = &presses.labels[label];
        described.insert(of_label("classes", i, label), json!(label.classes).to_string());
    }
    described
}
