//! A second reader of the bytes, written from the description of the layout.

use meissner_engine::{Engine, Event, Options, Sensor};
use serde_json::Value;

use super::{after, digits, line, press, session};
use crate::frame::{FrameWriter, sections};
use crate::{Networks, Shipped};

/// Reads numbers from the front of a section.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (first, rest) = self.0.split_first_chunk().expect("the section has this many bytes");
        self.0 = rest;
        *first
    }

    pub(super) fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    pub(super) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub(super) fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.take())
    }

    pub(super) fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }
}

/// The section with this tag.
pub(super) fn section<'a>(frame: &'a [u8], tag: &str) -> Reader<'a> {
    let all = sections(frame).expect("a frame");
    let found = all.into_iter().find(|(of, _)| of == tag.as_bytes());
    Reader(found.unwrap_or_else(|| panic!("no section {tag}")).1)
}

pub(super) fn json(frame: &[u8], tag: &str) -> Value {
    serde_json::from_slice(section(frame, tag).0).expect("JSON")
}

/// Events taken, and the flags.
pub(super) fn time(frame: &[u8]) -> (u64, u32) {
    let mut time = section(frame, "TIME");
    let (_, _, taken, _, _) = (time.f64(), time.f64(), time.f64(), time.f64(), time.f32());
    (taken as u64, time.u32())
}

/// The bits of the prediction.
pub(super) fn prediction(frame: &[u8]) -> Vec<u32> {
    let mut of = section(frame, "PRED");
    let outputs = of.u32();
    let _ = (of.u32(), of.f32(), of.f32());
    (0..outputs).map(|_| of.u32()).collect()
}

/// An engine after the first `count` events, with a separate prediction for the last one.
fn engine(network: &str, sensor: Sensor, events: &[Event]) -> Engine {
    let options = Options::new().with_record_rows(true);
    let network = Shipped.load(network).expect("a network").network;
    let mut engine = Engine::with_options(network, sensor, options).expect("an engine");
    let (last, before) = events.split_last().expect("there are events");
    engine.push_slice(before);
    engine.predict().expect("a prediction");
    engine.push(*last);
    engine.predict().expect("a prediction");
    engine
}

#[test]
fn a_frame_has_the_window_the_graph_and_the_rows_of_the_engine() {
    for (input, network) in [(press(), "tactigraph-past"), (digits(line(900), false), "digits-past")] {
        let count = input.events.len().min(3_000) - 90;
        let (events, sensor) = (input.events[..count].to_vec(), input.sensor);
        let mut session = session(input, network);
        let frame = after(&mut session, &format!(r#"{{"do": "seek_event", "event": {count}}}"#));
        let mut engine = engine(network, sensor, &events);
        assert_eq!(frame.len() % 4, 0);

        let mut shown = section(&frame, "EVNT");
        let now_us = engine.now_us().expect("events");
        for event in engine.events() {
            let (x, y, age) = (shown.u16(), shown.u16(), shown.u32());
            let t_us = now_us - i64::from(age >> 1);
            assert_eq!(Event::new(t_us, x, y, age & 1 == 1), event);
        }
        assert!(shown.is_at_end());

        let mut near = section(&frame, "NEAR");
        for neighbour in engine.neighbourhood(engine.nodes() - 1) {
            assert_eq!(near.u32(), neighbour.row);
        }
        assert!(near.is_at_end());

        let mut wave = section(&frame, "WAVE");
        let computed = engine.computed_rows();
        assert_eq!(wave.u32() as usize, computed.len());
        let counts: Vec<[u32; 3]> = computed.iter().map(|_| [wave.u32(), wave.u32(), wave.u32()]).collect();
        for ([level, rows, count], expected) in counts.iter().zip(&computed) {
            assert_eq!(*count as usize, expected.len());
            let all = if *level == 0 { engine.nodes() } else { engine.cells(*level as usize).len() };
            assert_eq!(*rows as usize, all);
            for row in expected {
                assert_eq!(wave.u32(), (row.row as u32) << 1 | u32::from(row.changed));
            }
        }
        assert!(wave.is_at_end() && !computed[0].is_empty());

        let mut cells = section(&frame, "CELL");
        for level in 1..=cells.u32() as usize {
            let _ = (cells.u32(), cells.u32());
            let expected = engine.cells(level);
            let newest = expected.iter().map(|cell| cell[2]).max().expect("a cell");
            assert_eq!(cells.u32() as usize, expected.len());
            for [x, y, t] in expected {
                assert_eq!([cells.u16(), cells.u16()], [x as u16, y as u16]);
                assert_eq!(i64::from(cells.u32()), newest - t);
                assert!(cells.f32() >= 0.0);
            }
        }
        assert!(cells.is_at_end());

        let mut readout = section(&frame, "READ");
        let size = readout.u32() * readout.u32() * readout.u32();
        assert_eq!(size as usize, engine.readout().len());
        (0..size).for_each(|_| assert!(readout.f32().is_finite()));
        assert!(readout.is_at_end());

        let values: Vec<u32> = engine.predict().expect("finite").values.iter().map(|v| v.to_bits()).collect();
        assert_eq!(prediction(&frame), values);
    }
}

#[test]
fn a_frame_has_predictions_over_time_latencies_and_counts() {
    let mut session = session(press(), "tactigraph-past");
    let frame = after(&mut session, r#"{"do": "seek_event", "event": 9000}"#);
    let mut series = section(&frame, "SERS");
    let (outputs, points) = (series.u32(), series.u32());
    assert_eq!(outputs, 2);
    let mut last = -1.0;
    for _ in 0..points {
        let t_ms = series.f32();
        assert!(t_ms > last);
        last = t_ms;
        let _ = (series.f32(), series.f32());
    }
    assert!(series.is_at_end() && points > 0);

    let mut latency = section(&frame, "LATE");
    let measured = latency.f64();
    let _ = [latency.f32(), latency.f32(), latency.f32(), latency.f32(), latency.f32()];
    let buckets: Vec<u32> = (0..latency.u32()).map(|_| latency.u32()).collect();
    assert_eq!(f64::from(buckets.iter().sum::<u32>()), measured.min(8192.0));
    assert!(latency.is_at_end());

    let mut work = section(&frame, "WORK");
    assert_eq!(work.u32(), 3);
    let computed: Vec<f64> = (0..3).map(|_| [work.f64(), work.f64(), work.f64(), work.f64()][0]).collect();
    assert_eq!(computed, [9000.0; 3]);
    (0..6).for_each(|_| assert!(work.f64() >= 0.0));
    assert!(work.is_at_end());

    let mut of = section(&frame, "PRED");
    let (_, nodes, _, took) = (of.u32(), of.u32(), of.f32(), of.f32());
    assert!(nodes > 0 && took >= 0.0);
    let _ = (of.f32(), of.f32());
    assert!((of.f32() - 0.1).abs() < 0.01, "roll is true, by its unit");
    assert!(of.f32().is_nan(), "of pitch nothing is known");
    assert!(of.is_at_end());
}

#[test]
fn the_facts_name_the_layers_and_their_levels() {
    let facts = json(&session(digits(Vec::new(), true), "digits-past").facts(), "FACT");
    let layers: Vec<(&str, u64, bool)> = facts["layers"]
        .as_array()
        .expect("layers")
        .iter()
        .map(|of| {
            let name = of["name"].as_str().expect("a name");
            (name, of["level"].as_u64().expect("a level"), of["pooling"] == true)
        })
        .collect();
    assert_eq!(layers, [("conv1", 0, false), ("conv2", 0, false), ("conv3", 0, false), ("pool", 1, true)]);
    assert_eq!(facts["candidates"], "past");
    assert_eq!(facts["outputs"].as_array().map(Vec::len), Some(10));
    assert!(facts["classes"] == true && facts["live"] == true);
}

#[test]
fn a_section_that_is_no_multiple_of_4_bytes_is_padded_with_spaces() {
    let mut frame = FrameWriter::new();
    frame.json(*b"INFO", &[1]);
    assert_eq!(sections(&frame.finish()), Some(vec![(*b"INFO", &b"[1] "[..])]));
}

#[test]
fn what_is_no_frame_has_no_sections() {
    for bytes in [&b""[..], b"MSN2", b"MSN1INFO", b"MSN1INFO\x08\0\0\0[1] ", b"MSN1INFO\xff\xff\xff\xff"] {
        assert_eq!(sections(bytes), None, "{bytes:?}");
    }
}
