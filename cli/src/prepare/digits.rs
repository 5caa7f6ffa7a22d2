//! Events of all recordings with labels, splits and folds, as one safetensors file.

use std::collections::BTreeMap;
use std::io::{Write, stdout};
use std::path::PathBuf;

use meissner_engine::Event;
use meissner_io::datasets::Split;
use meissner_models::TensorFile;
use meissner_models::systems::digits::{CLASSES, SENSOR, folds};
use serde_json::json;

use crate::args::{OUTPUT, STATUS};
use crate::digits::DigitsData;
use crate::error::CliError;
use crate::output;
use crate::tell::tell;
use meissner_pipeline::text::grouped;

/// What the file holds.
const TENSORS: &str = "\
Examples:
  meissner prepare digits nmnist/ --out digits.safetensors
  meissner prepare digits nmnist/ --folds 5 --out digits.safetensors

Tensors, all I64, the recordings by split (train first), by class and by number:
  t_us, x, y, on  (events): the events of all recordings, one after the other:
                  time in microseconds as recorded, column, row, 1 where the
                  brightness rose and 0 where it fell
  start           (recordings + 1): recording i has the events from start[i] to
                  below start[i + 1]
  label           (recordings): index into classes
  split           (recordings): 0 train, 1 test
  fold            (recordings): part of a cross-validation over both splits
                  together, from 0 on; sorted by label, the k-th recording is in
                  fold k mod N

Metadata, each JSON:
  classes, recordings   lists of names
  sensor                [columns, rows]";

/// `meissner prepare digits`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{TENSORS}\n\n{STATUS}"))]
pub(crate) struct DigitsArgs {
    /// Folder of the data set, with folders train and test.
    ///
    /// One of the two is enough. Recordings are files such as train/3/00123.bin.
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// File to write (safetensors); it is replaced where it exists.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    out: PathBuf,
    /// Number of folds of the cross-validation.
    ///
    /// Every recording is held out by one fold, and each fold holds about as many of every class.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..),
          help_heading = OUTPUT)]
    folds: u32,
}

pub(super) fn prepare(args: &DigitsArgs) -> Result<(), CliError> {
    let data = DigitsData::read(&args.data)?;
    let recordings = &data.recordings;
    let integers = |values: Vec<usize>| values.into_iter().map(|value| value as i64).collect::<Vec<_>>();
    let of_events = |value: fn(&Event) -> i64| {
        recordings.iter().flat_map(|recording| recording.events.iter().map(value)).collect::<Vec<_>>()
    };
    let ends = recordings.iter().scan(0, |end, recording| {
        *end += recording.events.len();
        Some(*end)
    });
    let start: Vec<usize> = std::iter::once(0).chain(ends).collect();
    let split = recordings.iter().map(|recording| usize::from(recording.split == Split::Test)).collect();
    let fold = folds(&data.classes(), args.folds as usize)?;

    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let metadata = [
        ("classes", json!(CLASSES)),
        ("recordings", json!(names)),
        ("sensor", json!([SENSOR.width, SENSOR.height])),
    ];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_string()));
    let mut file = TensorFile::new(BTreeMap::from(metadata));
    for (name, values) in [
        ("t_us", of_events(|event| event.t_us)),
        ("x", of_events(|event| event.x.into())),
        ("y", of_events(|event| event.y.into())),
        ("on", of_events(|event| event.on.into())),
        ("start", integers(start)),
        ("label", integers(data.classes())),
        ("split", integers(split)),
        ("fold", integers(fold)),
    ] {
        file.i64(name, &[values.len()], &values);
    }
    output::write(&args.out, file.into_bytes())?;
    data.notes.iter().for_each(|note| tell(format_args!("note: {note}")));
    let mut out = stdout().lock();
    writeln!(
        out,
        "{}: {} events of {} recordings, {} for training, in {} folds",
        args.out.display(),
        grouped(data.events()),
        grouped(recordings.len() as u64),
        grouped(data.of(Split::Train).len() as u64),
        args.folds
    )?;
    Ok(out.flush()?)
}
