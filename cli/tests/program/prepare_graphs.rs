//! Graphs of streams of events, as a file for training.

use std::collections::BTreeMap;
use std::path::Path;

use meissner_engine::{Engine, Event, Sensor};
use meissner_models::{Description, TensorFile, draw};
use safetensors::{Dtype, SafeTensors};

use crate::exit_status::fails;
use crate::support::{argument, meissner, message};

/// Cells of 4 by 3 pixels and of 500 us, read out over the halves of the image.
const NETWORK: &str = r#"[network]
name = "cells"
span_us = 1000

[graph]
kind = "knn"
k = 3
candidates = "past"
lifetime = "window"
scale = 0.5

[[layer]]
name = "pool"
kind = "pool"
cell = ["1/2", "1/2"]
time = "1/2"
position = "centre"
scale = 0.5

[[layer]]
name = "conv"
kind = "spline"
channels = 2
kernel = 2

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 1]
by_time = true

[[layer]]
name = "fc"
kind = "dense"
outputs = 1

[output]
names = ["a"]
unit = "logit"
"#;

const SENSOR: [u16; 2] = [8, 6];

/// The columns of a file by name.
type Columns = BTreeMap<&'static str, Vec<i64>>;

/// Two streams. After the last event of the second one, its first two events have left the window.
fn streams() -> Vec<Vec<Event>> {
    let event = |t: i64, x, y| Event::new(t, x, y, t % 3 > 0);
    let first =
        vec![event(100, 0, 0), event(300, 1, 2), event(300, 7, 5), event(650, 3, 3), event(1_050, 4, 3)];
    let second = (0..12).map(|i| event(-40 + 150 * i, (5 * i % 8) as u16, (7 * i % 6) as u16)).collect();
    vec![first, second]
}

/// The file of the streams, after `change`.
fn file(streams: &[Vec<Event>], change: impl FnOnce(&mut Columns)) -> Vec<u8> {
    let events = || streams.iter().flatten();
    let mut start = vec![0];
    streams.iter().for_each(|stream| start.push(start[start.len() - 1] + stream.len() as i64));
    let mut columns = BTreeMap::from([
        ("t_us", events().map(|e| e.t_us).collect()),
        ("x", events().map(|e| e.x.into()).collect()),
        ("y", events().map(|e| e.y.into()).collect()),
        ("on", events().map(|e| e.on.into()).collect()),
        ("start", start),
    ]);
    change(&mut columns);
    let sensor = format!("[{}, {}]", SENSOR[0], SENSOR[1]);
    let mut file = TensorFile::new([("sensor".to_owned(), sensor)].into());
    columns.iter().for_each(|(name, values)| file.i64(name, &[values.len()], values));
    file.into_bytes()
}

/// Runs the program over `events`, in `folder`.
fn prepare(folder: &Path, events: &[u8]) -> std::process::Output {
    let [network, from, to] = ["net.toml", "events", "graphs"].map(|name| folder.join(name));
    std::fs::write(&network, NETWORK).expect("the folder can be written");
    std::fs::write(&from, events).expect("the folder can be written");
    let network = argument(&network);
    meissner(&["prepare", "graphs", argument(&from), "--network", network, "--out", argument(&to)])
}

fn integers(file: &SafeTensors<'_>, name: &str) -> Vec<i32> {
    let tensor = file.tensor(name).expect("it is there");
    assert_eq!(tensor.dtype(), Dtype::I32, "{name}");
    let number = |bytes: &[u8]| i32::from_le_bytes(bytes.try_into().expect("4 bytes"));
    tensor.data().chunks_exact(4).map(number).collect()
}

/// Source and attribute of each row's in-edges.
fn edges(file: &SafeTensors<'_>, level: usize) -> Vec<Vec<(i32, [f32; 3])>> {
    let [edges, source] = ["edges", "source"].map(|name| integers(file, &format!("level{level}.{name}")));
    let attribute = file.tensor(&format!("level{level}.attribute")).expect("it is there");
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("4 bytes"));
    let attribute: Vec<f32> = attribute.data().chunks_exact(4).map(number).collect();
    let edge = |e: usize| (source[e], [0, 1, 2].map(|d| attribute[3 * e + d]));
    edges.windows(2).map(|ends| (ends[0] as usize..ends[1] as usize).map(edge).collect()).collect()
}

#[test]
fn rows_edges_and_cells_are_those_of_the_engine() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let output = prepare(folder.path(), &file(&streams(), |_| ()));
    assert!(output.status.success(), "{}", message(&output));
    let bytes = std::fs::read(folder.path().join("graphs")).expect("it was written");
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");

    let description = Description::parse(NETWORK).expect("consistent");
    let network = description.network(&draw(&description, 9)).expect("drawn weights fit");
    let mut engine = Engine::new(network, Sensor::new(SENSOR[0], SENSOR[1])).expect("the network is exact");
    let (mut rows, mut events, mut event_of) = (vec![0], 0, Vec::new());
    let mut expected = Vec::new();
    let mut cells = Vec::new();
    for stream in streams() {
        engine.reset();
        engine.push_slice(&stream);
        let (first, window) = (rows[rows.len() - 1], engine.events());
        let left = stream.len() - window.len();
        event_of.extend((events + left..events + stream.len()).map(|event| event as i32));
        events += stream.len();
        for index in 0..window.len() {
            let list = engine.neighbourhood(index);
            expected.push(list.iter().map(|n| (first + n.row as i32, n.u)).collect::<Vec<_>>());
        }
        let cell =
            |e: &Event| [i32::from(e.x / 4), i32::from(e.y / 3), ((e.t_us - stream[0].t_us) / 500) as i32];
        let newest = cell(&stream[stream.len() - 1])[2];
        cells.extend(window.iter().map(|e| (rows.len(), cell(e), newest)));
        rows.push(first + window.len() as i32);
    }
    assert_eq!(integers(&file, "event"), event_of);
    assert_eq!(integers(&file, "level0.start"), rows);
    assert_eq!(edges(&file, 0), expected);

    // Cells of both streams in the order of streams, and within one of (t, y, x).
    let mut order: Vec<_> =
        cells.iter().map(|&(stream, [x, y, t], newest)| (stream, t, y, x, newest)).collect();
    order.sort_unstable();
    order.dedup();
    let place = |&(stream, [x, y, t], newest): &(usize, [i32; 3], i32)| {
        order.iter().position(|&cell| cell == (stream, t, y, x, newest)).expect("every event has a cell")
            as i32
    };
    let cell: Vec<i32> = cells.iter().map(place).collect();
    assert_eq!(integers(&file, "level1.cell"), cell);
    let index: Vec<i32> = order.iter().flat_map(|&(_, t, y, x, _)| [x, y, t]).collect();
    assert_eq!(integers(&file, "level1.index"), index);
    let readout: Vec<i32> = order.iter().map(|&(_, t, _, x, newest)| 2 * (newest - t) + x).collect();
    assert_eq!(integers(&file, "readout"), readout);
    let merged = edges(&file, 1).into_iter().map(|list| list.iter().map(|edge| edge.0).collect::<Vec<_>>());
    let sources = |reader: usize| {
        let readers = (0..cell.len()).filter(|&row| cell[row] as usize == reader);
        let mut sources: Vec<i32> =
            readers.flat_map(|row| expected[row].iter().map(|edge| cell[edge.0 as usize])).collect();
        sources.retain(|&source| source as usize != reader);
        sources.sort_unstable();
        sources.dedup();
        sources
    };
    assert_eq!(merged.collect::<Vec<_>>(), (0..order.len()).map(sources).collect::<Vec<_>>());
}

#[test]
fn streams_that_cannot_be_are_refused_with_their_place() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let refused = |change: &dyn Fn(&mut Columns), expected: &[&str]| {
        fails(&prepare(folder.path(), &file(&streams(), change)), 1, expected);
    };
    refused(&|columns| columns.get_mut("x").unwrap()[3] = 8, &["event 3", "a pixel of 8x6", "(8, 3)"]);
    refused(&|columns| columns.get_mut("y").unwrap()[3] = -1, &["event 3", "(3, -1)"]);
    refused(
        &|columns| columns.get_mut("t_us").unwrap()[2] = 299,
        &["event 2", "a time from 300", "found 299"],
    );
    refused(&|columns| columns.get_mut("start").unwrap()[1] = 18, &["start 1", "0 to 17", "found 18"]);
    refused(&|columns| columns.get_mut("start").unwrap()[2] = 16, &["start 2", "17 to 17", "found 16"]);
    refused(&|columns| drop(columns.remove("on")), &["tensor on", "I64 (17)", "found nothing"]);
    refused(&|columns| columns.get_mut("on").unwrap().truncate(4), &["tensor on", "I64 [4]"]);
    fails(&prepare(folder.path(), b"no tensors"), 1, &["expected a safetensors file"]);
}
