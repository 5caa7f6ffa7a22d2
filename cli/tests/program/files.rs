//! `convert`, `info` and `draw`.

use std::path::Path;

use meissner_engine::Sensor;
use meissner_io::Format;

use crate::support::{argument, default_recording, file, meissner, meissner_reading, message, object, text};

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
        ("f.es", Format::Es),
    ] {
        let to = folder.path().join(name);
        // npy does not contain the geometry, so the next step needs it as an option.
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

/// Events of a second, one every 10 ms.
fn lines() -> String {
    let line = |i| format!("{},{},3,{}\n", 7_000 + i * 10_000, i % 30, i % 2);
    (0..100).map(line).collect()
}

#[test]
fn a_part_by_time_is_the_same_for_every_format_and_subcommand() {
    let (folder, csv) = file("events.csv", lines());
    let part = ["--from", "200ms", "--for", "0.1s"];
    let sensor = ["--sensor", "30x8"];
    for to in ["csv", "npy", "dat", "evt3", "es"] {
        let path = folder.path().join(format!("part.{to}"));
        convert(&csv, &path, &[&sensor[..], &part, &["--force"]].concat());
        let events = meissner_io::read(&path).expect("what was written can be read").events;
        let times: Vec<_> = events.iter().map(|event| event.t_us).collect();
        assert_eq!(times, (20..30).map(|i| 7_000 + i * 10_000).collect::<Vec<_>>(), "{to}");

        let whole = folder.path().join(format!("whole.{to}"));
        convert(&csv, &whole, &sensor);
        let info = meissner(&[&["info", argument(&whole), "--json"], &part[..]].concat());
        assert!(text(&info).contains("\"events\":10,"), "{to}: {}", text(&info));
        for subcommand in ["run", "bench"] {
            let more = [&sensor[..], &part, &["--network", "tactigraph-past", "--json"]].concat();
            let output = meissner(&[&[subcommand, argument(&whole)], &more[..]].concat());
            assert!(output.status.success(), "{}", message(&output));
            assert!(text(&output).contains("\"accepted\":10,"), "{subcommand} {to}: {}", text(&output));
        }
    }
    for (arguments, events) in
        [(&["--from", "990ms"][..], 1), (&["--for", "10ms"], 1), (&["--from", "2s"], 0)]
    {
        let info = meissner(&[&["info", argument(&csv), "--json"], arguments].concat());
        assert!(text(&info).contains(&format!("\"events\":{events},")), "{arguments:?}: {}", text(&info));
    }
}

#[test]
fn a_part_of_standard_input_is_taken_as_it_arrives() {
    let part = ["--from", "200ms", "--for", "0.1s", "--json"];
    let info = meissner_reading(&[&["info", "-"], &part[..]].concat(), &lines());
    assert!(text(&info).contains("\"events\":10,"), "{}", text(&info));
    let run = ["run", "-", "--sensor", "30x8", "--network", "tactigraph-past"];
    let output = meissner_reading(&[&run[..], &part].concat(), &lines());
    assert!(text(&output).contains("\"accepted\":10,"), "{}", text(&output));
}

#[test]
fn a_text_inside_gzip_is_read_without_its_bad_lines() {
    // In a stored block, with its length, the complement of it, and its CRC-32.
    let header = b"\x1f\x8b\x08\0\0\0\0\0\0\xff\x01\x15\0\xea\xff";
    let bytes = [&header[..], b"1,2,3,1\n2,2,3,1\noops\n", b"\xa2\x1b\x69\x37\x15\0\0\0"].concat();
    let (_folder, path) = file("events.csv.gz", bytes);
    let output = meissner(&["info", argument(&path), "--strict"]);
    assert!(
        message(&output).contains("events.csv.gz: CSV: ") && !output.status.success(),
        "{}",
        message(&output)
    );
    let run = ["run", argument(&path), "--sensor", "30x8", "--network", "tactigraph-past", "--json"];
    let output = meissner(&run);
    assert!(text(&output).contains("\"accepted\":2,"), "{} {}", text(&output), message(&output));
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
    let info = object(&output);
    let expected = serde_json::json!({
        "format": "CSV", "sensor": [8, 6], "events": 4, "on": 3, "off": 1, "first_t_us": 100, "last_t_us": 1600,
        "span_us": 1500, "events_per_s": 4.0 / 1.5e-3, "peak_events_per_ms": 3, "late": 1, "largest_xy": [7, 5],
        "other_streams": [], "left_out": [], "assumed": [], "salvaged": null,
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

/// The program with `arguments`, and a bound of 1 KiB or less on the files that it writes.
#[cfg(unix)]
fn with_little_room(arguments: &[&str]) -> std::process::Output {
    let script = "ulimit -f 1; trap '' XFSZ; exec \"$0\" \"$@\"";
    let mut command = std::process::Command::new("sh");
    command.args(["-c", script, env!("CARGO_BIN_EXE_meissner")]).args(arguments);
    command.output().expect("the program starts")
}

#[cfg(unix)]
#[test]
fn where_the_disk_is_full_the_former_file_stays_whole() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let recording = default_recording();
    let path = folder.path().join("file");
    let path = argument(&path);
    for arguments in [
        &["convert", argument(&recording), path, "--force", "--to", "csv"][..],
        &["inspect", "graphres", "--svg", path],
        &["draw", "tactigraph-past", "--out", path, "--force"],
        &["simulate", "gel", "--presses", "1", "--size", "32x24", "--out", path, "--force"],
    ] {
        std::fs::write(path, "former").expect("a place to write to");
        let output = with_little_room(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", message(&output));
        assert!(message(&output).contains("cannot write"), "{}", message(&output));
        assert_eq!(std::fs::read(path).expect("it is there"), b"former", "{arguments:?}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "{arguments:?}");
    }
}

#[test]
fn a_result_is_not_replaced_without_force_and_nothing_is_read_before() {
    let (_folder, kept) = file("kept.csv", "kept");
    let kept_path = argument(&kept);
    for arguments in [
        &["convert", "no/such", kept_path][..],
        &["draw", "tactigraph-past", "--out", kept_path],
        &["simulate", "dome", "--out", kept_path],
        &["simulate", "gel", "--out", kept_path],
        &["simulate", "grasp", "--out", kept_path],
        &["simulate", "images", "no/such", "--out", kept_path],
        &["simulate", "markers", "no/such", "--sensor", "8x8", "--out", kept_path],
        &["prepare", "digits", "no/such", "--out", kept_path],
        &["prepare", "slip", "no/such", "--network", "slip-lstm", "--out", kept_path],
        &["prepare", "touch", "objects", "no/such", "--out", kept_path],
        &["prepare", "graphs", "no/such", "--network", "tactigraph-past", "--out", kept_path],
    ] {
        let output = meissner(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", message(&output));
        assert!(message(&output).contains("--force replaces it"), "{}", message(&output));
        assert_eq!(std::fs::read(&kept).expect("it is there"), b"kept", "{arguments:?}");
    }
    let output = meissner(&["draw", "tactigraph-past", "--out", kept_path, "--force"]);
    assert!(output.status.success(), "{}", message(&output));
    assert_ne!(std::fs::read(&kept).expect("it is there"), b"kept");
}

#[test]
fn reports_pictures_and_states_replace_what_was_there() {
    let (_folder, path) = file("kept", "of before");
    for (arguments, start) in [
        (&["inspect", "tactigraph-past", "--svg"][..], &b"<svg"[..]),
        (&["run", "--limit", "300", "--network", "tactigraph-past", "--save-state"], b"MEISSNER"),
        (&["verify", "tactigraph-past", "--soak", "--events", "1000", "--out"], b"{"),
    ] {
        std::fs::write(&path, "of before").expect("a place to write to");
        let output = meissner(&[arguments, &[argument(&path)]].concat());
        assert!(output.status.success(), "{arguments:?}: {}", message(&output));
        assert!(std::fs::read(&path).expect("it is there").starts_with(start), "{arguments:?}");
    }
}

#[test]
fn an_empty_file_is_called_empty() {
    let (_folder, path) = file("empty.bin", "");
    let said = message(&meissner(&["info", argument(&path)]));
    assert!(said.contains("found nothing: it is empty"), "{said}");
}

mod draw {
    //! `draw`, and the output of `inspect --json` for authors of weights.

    use std::fs;
    use std::path::Path;

    use meissner_models::Weights;

    use crate::support::{argument, default_recording, file, lines, meissner, message, object, text};

    /// A description without weights.
    const OWN: &str = r#"[network]
name = "own"

[graph]
kind = "knn"
k = 4
candidates = "past"
lifetime = "frozen"
scale = 0.5

[[layer]]
name = "conv1"
kind = "spline"
channels = 8
kernel = 2

[[layer]]
name = "pool1"
kind = "pool"
cell = ["1/8", "1/6"]
scale = 0.25

[[layer]]
name = "conv2"
kind = "spline"
channels = 8
kernel = [2, 3]

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "fc"
kind = "dense"
outputs = 1

[output]
names = ["tilt"]
unit = "rad"
"#;

    fn draw(network: &str, seed: &str, out: &Path) {
        let output = meissner(&["draw", network, "--seed", seed, "--out", argument(out)]);
        assert!(output.status.success(), "{}", message(&output));
        assert!(message(&output).contains("nothing trained them"), "{}", message(&output));
    }

    #[test]
    fn a_new_description_runs_with_drawn_weights_that_say_that_nothing_trained_them() {
        let (folder, network) = file("own.toml", OWN);
        let out = folder.path().join("own.safetensors");
        draw(argument(&network), "3", &out);
        let weights = Weights::load(&out).expect("a weights file");
        assert_eq!(weights.metadata()["about"], "drawn, untrained, seed 3");
        let again = folder.path().join("again.safetensors");
        draw(argument(&network), "3", &again);
        assert!(
            fs::read(&out).expect("written") == fs::read(&again).expect("written"),
            "a seed gives its bytes"
        );
        let recording = default_recording();
        let run = ["run", argument(&recording), "--network", argument(&network), "--weights", argument(&out)];
        let (_, summary) =
            lines(&meissner(&[&run[..], &["--limit", "2000", "--every", "end", "--json"]].concat()));
        assert!(summary.to_string().contains("2000"), "{summary}");
        let shown = meissner(&[&run[..], &["--limit", "2000", "--every", "end"]].concat());
        assert!(text(&shown).contains("drawn, untrained, seed 3"), "{}", text(&shown));
    }

    #[test]
    fn weights_are_drawn_for_a_frame_network_too() {
        let (folder, _) = file("none", "");
        let out = folder.path().join("tdnn.safetensors");
        draw("force-tdnn", "1", &out);
        assert_eq!(Weights::load(&out).expect("a weights file").metadata()["network"], "force-tdnn");
    }

    #[test]
    fn drawn_weights_replace_no_file_without_force() {
        let (_folder, trained) = file("trained.safetensors", "hours of training");
        let output = meissner(&["draw", "force-tdnn", "--out", argument(&trained)]);
        assert_eq!(output.status.code(), Some(2));
        assert!(message(&output).contains("--force replaces it"), "{}", message(&output));
        assert_eq!(fs::read_to_string(&trained).expect("it is still there"), "hours of training");
    }

    #[test]
    fn a_description_file_without_weights_is_told_how_to_draw_some() {
        let (_folder, network) = file("own.toml", OWN);
        let output = meissner(&["run", "--network", argument(&network)]);
        assert_eq!(output.status.code(), Some(2));
        assert!(message(&output).contains("meissner draw"), "{}", message(&output));
    }

    #[test]
    fn inspect_lists_every_tensor_with_layer_shape_type_meaning_and_slot_order() {
        let (_folder, network) = file("own.toml", OWN);
        let output = meissner(&["inspect", argument(&network), "--json"]);
        let summary = object(&output);
        let kernel = &summary["tensors"][5];
        assert_eq!(kernel["name"], "conv2.conv.weight");
        assert_eq!(kernel["layer"], "conv2");
        assert_eq!(kernel["shape"], serde_json::json!([6, 8, 8]));
        assert_eq!(kernel["dtype"], "F32");
        assert_eq!(kernel["meaning"], "spline kernel: (slot, input channel, output channel)");
        assert_eq!(kernel["slot_strides"], serde_json::json!([1, 2, 6]));
        assert_eq!(
            summary["edge_attributes"]["levels"],
            serde_json::json!([
                {"level": 0, "rows": "events", "scale": 0.5},
                {"level": 1, "rows": "pool1", "scale": 0.25},
            ])
        );
        let tensors = summary["tensors"].as_array().expect("a list");
        assert_eq!(
            tensors.len(),
            12,
            "kernel and batch norm of two blocks, weight and bias of a dense layer"
        );
    }
}
