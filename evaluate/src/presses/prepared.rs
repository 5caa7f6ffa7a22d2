//! Presses from a file of streams, as `prepare` and `simulate markers` write it.
//!
//! Input: the bytes of a safetensors file. Output: a recording for each stream, with the labels
//! along time (`truth.NAME`) and the classes (`label` and `label.NAME`, with their names in the
//! metadata). Streams of the split test keep no label, so that nothing is fitted to them.

use std::path::Path;
use std::sync::Arc;

use meissner_io::ReadOptions;
use safetensors::tensor::SafeTensors;

use super::join::Row;
use super::odd::Odd;
use super::offset::{Offset, OffsetSource};
use super::scan::{PressRecording, check};
use super::{Label, Options, Presses};
use crate::error::{EvaluateError, RequestPart, Result, StreamsError};
use crate::streams::{Streams, integers, value};

/// Tensor of the classes and key of their names, and the prefix of both for labels with their own
/// name.
const LABEL: &str = "label";
const CLASSES: &str = "classes";
/// The name of the label whose tensor has none.
const CLASS: &str = "class";
/// The number of the split test.
const TEST: i64 = 1;

/// Streams, and the file's other data beside their events and labels along time.
struct Prepared {
    streams: Streams,
    /// The name of each stream.
    names: Vec<String>,
    /// Each label of classes, and the class of each stream.
    classes: Vec<(Label, Vec<i64>)>,
    /// Whether each stream is of the split test.
    test: Vec<bool>,
}

/// Reads the presses in the file at `path`. O(bytes); all events are held in memory.
///
/// # Errors
/// The file cannot be read or does not fit, no press has a label, or the options are those of a
/// folder.
pub(super) fn read(path: &Path, options: &Options) -> Result<Presses> {
    let of_folder = |part, found: &str| {
        let expected = "a folder of recordings with it: a file of presses has its labels and events";
        Err(EvaluateError::request(part, expected, format!("{}{found}", path.display())))
    };
    if options.labels.is_some() {
        return of_folder(RequestPart::Labels, "");
    }
    if options.offset_us.is_some() {
        return of_folder(RequestPart::Offset, "");
    }
    if options.read != ReadOptions::default().strict(options.read.strict) {
        return of_folder(RequestPart::Folder, " with options about recordings");
    }
    let Prepared { streams, names, classes, test } = Streams::parsed(path, Prepared::parse)?;
    let mut labels: Vec<Label> = Vec::new();
    let truth = streams.truth.as_ref();
    for name in truth.iter().flat_map(|truth| truth.names()) {
        let unit = streams.units.get(name).cloned();
        labels.push(Label { name: name.to_owned(), unit, classes: Vec::new() });
    }
    labels.extend(classes.iter().map(|(label, _)| label.clone()));
    let (mut recordings, mut rows, mut ranges) = (Vec::new(), Vec::new(), Vec::new());
    for (press, (events, name)) in streams.parts().into_iter().zip(names).enumerate() {
        let recording = PressRecording::of((name, path), None, Some(streams.sensor), events);
        let start = rows.len();
        let of_classes = || classes.iter().map(|(_, of)| of[press] as f64);
        let row = |t_us, whole, numbers: Vec<f64>| {
            let values = numbers.into_iter().chain(of_classes()).collect();
            Row { press, t_us, whole, values }
        };
        match (test[press], streams.labels(press)) {
            (true, _) => {}
            (false, Some(of)) => rows.extend(of.t_us.iter().enumerate().map(|(i, &t_us)| {
                row(t_us, false, of.values.iter().map(|(_, values)| f64::from(values[i])).collect())
            })),
            (false, None) if classes.is_empty() => {}
            (false, None) => rows.push(row(recording.last_us, true, Vec::new())),
        }
        ranges.push(start..rows.len());
        recordings.push(recording);
    }
    let kept_back = test.iter().filter(|test| **test).count();
    if rows.is_empty() {
        let expected = format!("presses with labels in {}", path.display());
        let found = format!("{} presses, {kept_back} of them of the split test", recordings.len());
        return Err(EvaluateError::request(RequestPart::Folder, expected, found));
    }
    let mut odd = Odd::default();
    check(&recordings, &mut odd);
    Ok(Presses {
        folder: path.to_owned(),
        table: path.to_owned(),
        recordings,
        labels,
        rows,
        odd: odd.list(),
        offset: Offset { us: 0, source: OffsetSource::SensorClock },
        clock: None,
        kept_back,
        ranges,
        options: options.clone(),
        streams: Some(Arc::new(streams)),
    })
}

impl Prepared {
    fn parse(bytes: &[u8]) -> Result<Self, StreamsError> {
        let streams = Streams::from_bytes(bytes)?;
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let file = SafeTensors::deserialize(bytes)?;
        let count = streams.parts().len();
        // A JSON list of names; there must be `expected` names.
        let list = |key: &str, expected: Option<usize>| {
            let text = header.metadata().as_ref().and_then(|metadata| metadata.get(key));
            let list = text.and_then(|text| serde_json::from_str::<Vec<String>>(text).ok());
            let found = match (text, &list) {
                (None, _) => "nothing".to_owned(),
                (Some(_), Some(list)) => list.len().to_string(),
                (Some(text), None) => text.clone(),
            };
            let expected = match expected {
                Some(count) => format!("{count} names"),
                None => "names".to_owned(),
            };
            (list, StreamsError::Names { key: key.to_owned(), expected, found })
        };
        let names = match list("recordings", Some(count)) {
            (Some(names), _) if names.len() == count => names,
            (None, StreamsError::Names { found, .. }) if found == "nothing" => {
                (0..count).map(|press| format!("press {press}")).collect()
            }
            (_, error) => return Err(error),
        };
        let mut classes = Vec::new();
        let mut tensors: Vec<&str> = file.names();
        tensors.sort_unstable();
        for tensor in tensors {
            let own = tensor.strip_prefix(LABEL).map(|rest| (rest, rest.strip_prefix('.')));
            let (name, key) = match own {
                Some(("", _)) => (CLASS, CLASSES.to_owned()),
                Some((_, Some(name))) => (name, format!("{CLASSES}.{name}")),
                _ => continue,
            };
            let of = integers(&file, tensor, Some(count))?;
            let (names, error) = list(&key, None);
            let names = names.ok_or(error)?;
            if let Some(i) = of.iter().position(|class| !(0..names.len() as i64).contains(class)) {
                let expected = format!("an index into {} classes", names.len());
                return Err(value(tensor, i, expected, of[i].to_string()));
            }
            classes.push((Label { name: name.to_owned(), unit: None, classes: names }, of));
        }
        let has_split = file.names().contains(&"split");
        let split = if has_split { integers(&file, "split", Some(count))? } else { vec![0; count] };
        Ok(Self { streams, names, classes, test: split.into_iter().map(|split| split == TEST).collect() })
    }
}
