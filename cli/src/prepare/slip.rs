//! Windows of readings with labels, as one safetensors file.

use std::collections::BTreeMap;
use std::io::{Write, stdout};

use meissner_engine::representations::{ELECTRODES, Scaling};
use meissner_models::TensorFile;
use meissner_models::systems::slip::{CLASSES, ObjectSet, SlipWindows};
use serde::Serialize;

use super::SlipArgs;
use crate::error::CliError;
use crate::output;
use crate::slip::SlipData;
use crate::tell::tell;
use meissner_pipeline::model::describe_frames;
use meissner_pipeline::text::grouped;

/// The windows of all recordings.
#[derive(Default)]
struct Prepared {
    frames: Vec<f32>,
    readings: Vec<f32>,
    label: Vec<i64>,
    recording: Vec<i64>,
    object: Vec<i64>,
}

pub(super) fn prepare(args: &SlipArgs) -> Result<(), CliError> {
    let (description, _) = describe_frames(&args.network)?;
    let mut windows = SlipWindows::new(&description)?;
    let data = SlipData::read(&args.data)?;
    let objects = objects(&data);
    let mut prepared = Prepared::default();
    for (index, recording) in data.recordings.iter().enumerate() {
        let Prepared { frames, readings, .. } = &mut prepared;
        let count = data.cut(index, &mut windows, frames, Some(readings))?;
        let object = objects.iter().position(|&object| object == data.objects[index].name);
        let ids = [recording.class, index, object.unwrap_or_default()].map(|id| id as i64);
        let Prepared { label, recording, object, .. } = &mut prepared;
        for (list, id) in [label, recording, object].into_iter().zip(ids) {
            list.extend(std::iter::repeat_n(id, count));
        }
    }
    let count = prepared.label.len();
    let preparation = description.preparation().unwrap_or_default();
    let mut file = TensorFile::new(metadata(&data, &objects, preparation.clone()));
    let shape = [&[count, windows.steps()], windows.frame_shape()].concat();
    file.f32("frames", &shape, &prepared.frames);
    file.f32("readings", &[count, windows.steps(), ELECTRODES], &prepared.readings);
    file.i64("label", &[count], &prepared.label);
    file.i64("recording", &[count], &prepared.recording);
    file.i64("object", &[count], &prepared.object);
    output::write(&args.out, file.into_bytes())?;
    data.notes.iter().for_each(|note| tell(format_args!("note: {note}")));
    let (windows, recordings) = (grouped(count as u64), grouped(data.recordings.len() as u64));
    let mut out = stdout().lock();
    writeln!(
        out,
        "{}: {windows} windows of {recordings} recordings, {preparation}, consecutive and without overlap",
        args.out.display()
    )?;
    Ok(out.flush()?)
}

/// Names of the objects that there are, sorted.
fn objects(data: &SlipData) -> Vec<&'static str> {
    let mut objects: Vec<_> = data.objects.iter().map(|object| object.name).collect();
    objects.sort_unstable();
    objects.dedup();
    objects
}

fn metadata(data: &SlipData, objects: &[&str], preparation: String) -> BTreeMap<String, String> {
    let recordings: Vec<_> = data.recordings.iter().map(|recording| &recording.name).collect();
    let sets: BTreeMap<_, _> = data.objects.iter().map(|object| (object.name, object.set.name())).collect();
    let basic =
        data.recordings.iter().zip(&data.objects).filter(|(_, object)| object.set == ObjectSet::Basic);
    let readings = basic.flat_map(|(recording, _)| recording.readings.iter().map(|reading| &reading.values));
    let range = match Scaling::range_of(readings) {
        Some(Scaling::Range { minimum, maximum }) => Some([minimum, maximum]),
        _ => None,
    };
    [
        ("classes", json(&CLASSES)),
        ("recordings", json(&recordings)),
        ("objects", json(&objects)),
        ("sets", json(&sets)),
        ("preparation", preparation),
        ("range_basic", json(&range)),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("names and finite numbers always serialise")
}
