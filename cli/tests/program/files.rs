//! `convert` and `info`.

use std::path::Path;

use meissner_engine::Sensor;
use meissner_io::Format;

use crate::support::{argument, default_recording, file, meissner, meissner_reading, message, text};

fn convert(from: &Path, to: &Path, more: &[&str]) {
    let output = meissner(&[&["convert", argument(from), argument(to)], more].concat());
    assert!(output.status.success(), "{}", message(&output));
}

#[test]
fn every_format_that_is_written_gives_the_same_events_back() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let original = meissner_io::read(&default_recording()).expect("the recording is sound");
    let mut from = default_recording();
    for (name, format) in [
        ("a.csv", Format::Csv),
        ("b.npy", Format::Npy),
        ("c.dat", Format::Dat),
        ("d.raw", Format::Evt3),
        ("e.evt3", Format::Evt3),
    ] {
        let to = folder.path().join(name);
        // npy does not hold the geometry, so the next step has to be told.
        convert(
            &from,
            &to,
            if from.extension() == Some("npy".as_ref()) { &["--sensor", "346x260"] } else { &[] },
        );
        let copy = meissner_io::read(&to).expect("what was written can be read");
        assert_eq!(copy.format, format);
        assert_eq!(copy.events, original.events, "{name}");
        assert_eq!(copy.sensor, (format != Format::Npy).then(|| Sensor::new(346, 260)), "{name}");
        from = to;
    }
}

#[test]
fn the_format_can_be_named_where_the_extension_does_not_say() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let to = folder.path().join("events.out");
    convert(&default_recording(), &to, &["--to", "dat"]);
    assert_eq!(meissner_io::read(&to).expect("it is DAT").format, Format::Dat);
}

#[test]
fn standard_input_can_be_converted() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let to = folder.path().join("events.raw");
    let output = meissner_reading(&["convert", "-", argument(&to), "--sensor", "8x8"], "5,1,2,1\n9,3,4,0\n");
    assert!(output.status.success(), "{}", message(&output));
    assert_eq!(meissner_io::read(&to).expect("it is EVT3").events.len(), 2);
}

#[test]
fn an_event_beside_the_sensor_is_refused_and_the_file_stays_as_it_was() {
    let (_folder, to) = file("kept.csv", "kept");
    let recording = default_recording();
    let output = meissner(&["convert", argument(&recording), argument(&to), "--sensor", "8x8", "--force"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("kept.csv"), "{}", message(&output));
    assert_eq!(std::fs::read(&to).expect("it is still there"), b"kept");
}

#[test]
fn a_lost_geometry_is_mentioned() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let (recording, to) = (default_recording(), folder.path().join("events.npy"));
    let output = meissner(&["convert", argument(&recording), argument(&to)]);
    assert!(message(&output).contains("--sensor WxH"), "{}", message(&output));
}

#[test]
fn info_counts_what_a_recording_holds() {
    let (_folder, path) = file("events.csv", "# sensor 8x6\n100,1,2,1\n400,7,3,0\n300,2,5,1\n1600,2,2,1\n");
    let output = meissner(&["info", argument(&path), "--json"]);
    let info: serde_json::Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    let expected = serde_json::json!({
        "format": "CSV", "sensor": [8, 6], "events": 4, "on": 3, "off": 1, "first_t_us": 100, "last_t_us": 1600,
        "span_us": 1500, "events_per_s": 4.0 / 1.5e-3, "peak_events_per_ms": 3, "late": 1, "largest_xy": [7, 5],
        "other_streams": [], "salvaged": null,
    });
    assert_eq!(info, expected);
    let output = text(&meissner(&["info", argument(&path)]));
    assert!(output.contains("8 x 6 pixels") && output.contains("3 on, 1 off"), "{output}");
}

#[test]
fn info_on_a_recording_without_events_has_no_times() {
    let (_folder, path) = file("none.csv", "t,x,y,p\n");
    let output = meissner(&["info", argument(&path)]);
    assert!(output.status.success(), "{}", message(&output));
    assert!(text(&output).contains("not named"), "{}", text(&output));
}
