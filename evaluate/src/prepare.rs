//! Inputs of networks with labels, for training: as tensors of a safetensors file.
//!
//! Input: a data set, or streams. Output: [`Prepared`] tensors, as the engine makes them.

pub(crate) mod dome;
mod filmed;
mod frames;
mod gel;
mod presses;
mod windows;

use std::collections::BTreeMap;
use std::path::Path;

use meissner_engine::filters::{Chain, EventFilter, FilterRule};
use meissner_engine::representations::{ELECTRODES, Scaling};
use meissner_engine::{Batch, Edges, EngineError, Event, Graph, Search, Sensor, Stream};
use meissner_io::Reading;
use meissner_io::datasets::{SlipRecording, Split};
use meissner_models::systems::slip;
use meissner_models::systems::slip::ObjectSet;
use meissner_models::{Description, FrameDescription, TensorFile, draw};
use meissner_run::text::grouped;
use rayon::ThreadPool;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::error::{Result, weights_error};
use crate::events::EventData;
use crate::slip::{SlipData, Windows};
use crate::streams::Streams;
pub use dome::{DOME_KINDS, dome_presses};
pub use filmed::{film_images, film_markers, grasps, with_causes};
pub use frames::training_frames;
pub use gel::{GelPlan, Shapes, gel_presses, measured_optics};
pub use presses::labelled_presses;
pub use windows::{Ages, training_windows};

/// Tensors for training.
pub struct Prepared {
    /// The tensors with their metadata.
    pub file: TensorFile,
    /// A description of the tensors, in one line for people.
    pub contents: String,
}

/// The windows of `data` with labels. `meissner prepare slip --help` lists the tensors.
///
/// # Errors
/// The network does not read electrodes, or a reading cannot be scaled.
pub fn slip_windows(data: &SlipData, description: &FrameDescription) -> Result<Prepared> {
    let windows = Windows::cut(data, description)?;
    let mut objects: Vec<&str> = data.objects.iter().map(|object| object.name).collect();
    objects.sort_unstable();
    objects.dedup();
    let whole = |stretch: &[Reading]| stretch.len() / windows.steps * windows.steps;
    let readings = data.recordings.iter().flat_map(SlipRecording::stretches);
    let readings =
        readings.flat_map(|stretch| stretch[..whole(stretch)].iter().flat_map(|reading| reading.values));
    let readings: Vec<f32> = readings.collect();
    let count = windows.cases.len();
    let of_windows = |id: &dyn Fn(usize) -> usize| {
        (0..count).map(|window| id(windows.cases.recording(window)) as i64).collect::<Vec<_>>()
    };
    let object = |recording: usize| objects.iter().position(|name| *name == data.objects[recording].name);
    let preparation = description.preparation().unwrap_or_default();
    let mut file = TensorFile::new(slip_metadata(data, &objects, preparation.clone()));
    let shape = [&[count, windows.steps], windows.frame_shape].concat();
    file.f32("frames", &shape, &windows.values);
    file.f32("readings", &[count, windows.steps, ELECTRODES], &readings);
    file.i64("label", &[count], &of_windows(&|recording| data.recordings[recording].class));
    file.i64("recording", &[count], &of_windows(&|recording| recording));
    file.i64("object", &[count], &of_windows(&|recording| object(recording).unwrap_or_default()));
    let (windows, recordings) = (grouped(count as u64), grouped(data.recordings.len() as u64));
    let contents = format!(
        "{windows} windows of {recordings} recordings, {preparation}, consecutive and without overlap"
    );
    Ok(Prepared { file, contents })
}

fn slip_metadata(data: &SlipData, objects: &[&str], preparation: String) -> BTreeMap<String, String> {
    let recordings: Vec<_> = data.recordings.iter().map(|recording| &recording.name).collect();
    let sets: BTreeMap<_, _> = data.objects.iter().map(|object| (object.name, object.set.name())).collect();
    let basic =
        data.recordings.iter().zip(&data.objects).filter(|(_, object)| object.set == ObjectSet::Basic);
    let readings = basic.flat_map(|(recording, _)| recording.readings.iter().map(|reading| &reading.values));
    let range = match Scaling::range_of(readings) {
        Some(Scaling::Range { minimum, maximum }) => Some([minimum, maximum]),
        _ => None,
    };
    let mut metadata = metadata([
        ("classes", json!(slip::CLASSES)),
        ("recordings", json!(recordings)),
        ("objects", json!(objects)),
        ("sets", json!(sets)),
    ]);
    metadata.insert("preparation".to_owned(), preparation);
    // Not through a `Value`, because it stores numbers as f64.
    let range = serde_json::to_string(&range).expect("finite numbers always serialise");
    metadata.insert("range_basic".to_owned(), range);
    metadata
}

fn metadata<const N: usize>(entries: [(&str, Value); N]) -> BTreeMap<String, String> {
    entries.map(|(key, value)| (key.to_owned(), value.to_string())).into()
}

/// The events of all recordings of `data`, one recording after the other, with labels, splits and
/// `folds` folds. `meissner prepare digits --help` lists the tensors.
///
/// # Errors
/// There cannot be so many folds.
pub fn labelled_events(data: &EventData, folds: usize) -> Result<Prepared> {
    let recordings = &data.recordings;
    let integers = |values: Vec<usize>| values.into_iter().map(|value| value as i64).collect::<Vec<_>>();
    let split = recordings.iter().map(|recording| usize::from(recording.split == Split::Test)).collect();
    let fold = data.folds(folds)?;
    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let mut file = TensorFile::new(metadata([
        ("classes", json!(data.set.classes)),
        ("recordings", json!(names)),
        ("sensor", json!([data.set.sensor.width, data.set.sensor.height])),
    ]));
    add_streams(&mut file, recordings.iter().map(|recording| recording.events.iter()));
    for (name, values) in [
        ("label", integers(recordings.iter().map(|recording| recording.class).collect())),
        ("split", integers(split)),
        ("fold", integers(fold)),
    ] {
        file.i64(name, &[values.len()], &values);
    }
    let contacts = recordings.iter().map(|recording| recording.contact);
    if let Some(contacts) = contacts.collect::<Option<Vec<_>>>() {
        let stamps = contacts.iter().flat_map(|of| [of.begin_us, of.held_us, of.lifted_us]);
        file.i64("stamps_us", &[contacts.len(), 3], &stamps.collect::<Vec<_>>());
    }
    let contents = format!(
        "{} events of {} recordings, {} for training, in {folds} folds",
        grouped(data.events()),
        grouped(recordings.len() as u64),
        grouped(data.of(Split::Train).len() as u64)
    );
    Ok(Prepared { file, contents })
}

/// Adds the events of `streams` as `t_us`, `x`, `y` and `on`, and their bounds as `start`.
fn add_streams<'a, S>(file: &mut TensorFile, streams: impl Iterator<Item = S> + Clone)
where
    S: ExactSizeIterator<Item = &'a Event>,
{
    let mut start = vec![0];
    let mut end = 0;
    start.extend(streams.clone().map(|stream| {
        end += stream.len() as i64;
        end
    }));
    let mut add = |name, value: fn(&Event) -> i64| {
        let values: Vec<i64> = streams.clone().flatten().map(value).collect();
        file.i64(name, &[values.len()], &values);
    };
    add("t_us", |event| event.t_us);
    add("x", |event| event.x.into());
    add("y", |event| event.y.into());
    add("on", |event| event.on.into());
    file.i64("start", &[start.len()], &start);
}

/// One level of the graphs of all streams.
#[derive(Default)]
struct Level {
    start: Vec<i32>,
    edges: Vec<i32>,
    source: Vec<i32>,
    attribute: Vec<f32>,
    /// Offsets, for levels whose blocks read them.
    offset: Vec<f32>,
    /// For each row of the level below, the row that pools it.
    cell: Vec<i32>,
    index: Vec<i32>,
}

/// The graphs of the streams in the file `events`, by the threads of `pool`: see [`graphs_of`].
///
/// # Errors
/// The file cannot be read, or its streams do not fit.
pub fn graphs(events: &Path, description: &Description, pool: &ThreadPool) -> Result<Prepared> {
    let streams = Streams::read(events)?;
    pool.install(|| graphs_of(&streams, description))
}

/// The graphs of `streams`, each from a reset to its last event, as a network of `description`
/// builds them behind its filters. `meissner prepare graphs --help` lists the tensors.
///
/// # Errors
/// The streams do not fit.
pub fn graphs_of(streams: &Streams, description: &Description) -> Result<Prepared> {
    // The graph does not depend on the weights.
    let network = description.network(&draw(description, 0)).map_err(weights_error("drawn weights"))?;
    let batch = Batch::new(network, streams.sensor)?.with_search(Search::Grid);
    let parts = streams.parts();
    let graph = |&events: &&[Event]| {
        let kept = passing(events, description.filters(), streams.sensor)?;
        let events: Vec<Event> = kept.iter().map(|&at| events[at]).collect();
        Ok::<_, EngineError>((kept, batch.graph(Stream::new(&events))?))
    };
    let graphs: Vec<(Vec<usize>, Graph)> = parts.par_iter().map(graph).collect::<Result<_, _>>()?;

    let mut levels: Vec<Level> = (0..batch.network().levels()).map(|_| Level::default()).collect();
    let (mut event, mut readout) = (Vec::new(), Vec::new());
    for (((kept, graph), end), part) in graphs.iter().zip(streams.ends()).zip(&parts) {
        let rows = &kept[kept.len() - graph.levels[0].edges.rows()..];
        event.extend(rows.iter().map(|&at| (end - part.len() + at) as i32));
        for (level, (to, trace)) in levels.iter_mut().zip(&graph.levels).enumerate() {
            let first = to.start_stream(&trace.edges);
            to.index.extend(trace.cells.iter().flatten().map(|&i| i as i32));
            if level > 0 {
                let below = graph.levels[level - 1].edges.rows();
                to.pool(below, &trace.members, first);
            }
        }
        readout.extend(graph.readout.iter().map(|&cell| cell as i32));
    }

    let mut file = TensorFile::new(BTreeMap::new());
    file.i32("event", &[event.len()], &event);
    file.i32("readout", &[readout.len()], &readout);
    for (i, level) in levels.into_iter().enumerate() {
        level.write(i, &mut file);
    }
    let (count, rows) = (grouped(graphs.len() as u64), grouped(event.len() as u64));
    Ok(Prepared { file, contents: format!("graphs of {count} streams, {rows} rows at the event level") })
}

/// The indices of the `events` that the filters of `rules` pass.
fn passing(events: &[Event], rules: &[FilterRule], sensor: Sensor) -> Result<Vec<usize>, EngineError> {
    let mut filters = Chain::of_rules(rules, sensor)?;
    Ok((0..events.len()).filter(|&at| filters.admit(events[at])).collect())
}

impl Level {
    /// Appends the rows of a stream, and returns the index of the first one.
    fn start_stream(&mut self, edges: &Edges) -> i32 {
        let first = self.edges.len() as i32;
        self.start.push(first);
        for row in 0..edges.rows() {
            self.edges.push(self.source.len() as i32);
            self.source.extend(edges.row(row).iter().map(|edge| first + edge.row as i32));
            self.attribute.extend(edges.row(row).iter().flat_map(|edge| edge.u));
            self.offset.extend(edges.offsets(row).as_flattened());
        }
        first
    }

    /// Stores which row, from `first` on, pools each of the `below` rows of the level below.
    fn pool(&mut self, below: usize, members: &[Vec<usize>], first: i32) {
        let start = self.cell.len();
        self.cell.resize(start + below, -1);
        for (row, members) in (first..).zip(members) {
            members.iter().for_each(|&member| self.cell[start + member] = row);
        }
    }

    fn write(mut self, level: usize, file: &mut TensorFile) {
        let rows = self.edges.len();
        self.start.push(rows as i32);
        self.edges.push(self.source.len() as i32);
        let name = |name| format!("level{level}.{name}");
        file.i32(&name("start"), &[self.start.len()], &self.start);
        file.i32(&name("edges"), &[self.edges.len()], &self.edges);
        file.i32(&name("source"), &[self.source.len()], &self.source);
        file.f32(&name("attribute"), &[self.source.len(), 3], &self.attribute);
        if !self.offset.is_empty() {
            file.f32(&name("offset"), &[self.source.len(), 3], &self.offset);
        }
        if level > 0 {
            file.i32(&name("cell"), &[self.cell.len()], &self.cell);
            file.i32(&name("index"), &[rows, 3], &self.index);
        }
    }
}
