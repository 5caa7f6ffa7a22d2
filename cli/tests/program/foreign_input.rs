//! Inputs as people have them: texts in other layouts, inputs of another kind, recordings that were
//! cut short, outputs that are there already.

use std::fs;

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, encode};

use crate::exit_status::fails;
use crate::support::{
    argument, default_recording, file, lines, meissner, meissner_reading, message, object, text,
};

fn scene() -> Vec<Event> {
    (0..300_u16)
        .map(|i| Event::new(i64::from(i) * 40, i * 7 % 128, i * 31 % 97, i.is_multiple_of(3)))
        .collect()
}

fn rows(line: impl Fn(&Event) -> String) -> String {
    scene().iter().map(|event| line(event) + "\n").collect()
}

fn encoded(format: Format) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(format, Some(Sensor::new(128, 128)), &scene(), &mut bytes).expect("the format holds them");
    bytes
}

/// The predictions of a run with `more`, of `path` as text.
fn predictions(path: &str, more: &[&str]) -> Vec<String> {
    let run =
        ["run", path, "--sensor", "128x128", "--network", "tactigraph-past", "--every", "5000us", "--json"];
    let (lines, summary) = lines(&meissner(&[&run[..], more].concat()));
    assert_eq!(summary["accepted"], 300, "{path}");
    lines.iter().map(|line| line["value"].to_string()).collect()
}

#[test]
fn texts_in_the_layouts_of_public_data_sets_give_the_same_predictions() {
    let p = |e: &Event| u8::from(e.on);
    let (_a, plain) = file("plain.csv", rows(|e| format!("{},{},{},{}", e.t_us, e.x, e.y, p(e))));
    let expected = predictions(argument(&plain), &[]);
    let (_b, mnist_dvs) =
        file("mnist.txt", rows(|e| format!("{} {} {} {}", e.x, e.y, e.t_us, i8::from(e.on) * 2 - 1)));
    let seconds = |e: &Event| format!("0.{:06}000", e.t_us);
    let (_c, davis) = file("events.txt", rows(|e| format!("{} {} {} {}", seconds(e), e.x, e.y, p(e))));
    assert_eq!(predictions(argument(&mnist_dvs), &[]), expected);
    assert_eq!(predictions(argument(&davis), &[]), expected);
    let (_d, odd) =
        file("odd.txt", rows(|e| format!("{};{};-;{};{}", p(e), e.y, e.x, e.t_us as f64 / 1000.0)));
    assert_eq!(predictions(argument(&odd), &["--columns", "py_xt", "--time-unit", "ms"]), expected);
}

#[test]
fn an_ambiguous_text_is_bad_usage_that_shows_the_line_and_the_options() {
    let (_folder, path) = file("short.txt", "14 27 38 1\n15 28 39 1\n");
    let expected = ["short.txt", "`14 27 38 1`", "txyp or xytp", "--columns xytp", "--time-unit"];
    for command in ["run", "play", "bench", "info", "soak"] {
        let more: &[&str] = if command == "soak" { &["--events", "10"] } else { &[] };
        fails(&meissner(&[&[command, argument(&path)], more].concat()), 2, &expected);
    }
    fails(&meissner(&["convert", argument(&path), "out.npy"]), 2, &expected);
    fails(&meissner(&["pareto", "angle", argument(&path)]), 2, &expected);
    let arriving = meissner_reading(&["run", "-", "--sensor", "64x64"], "14 27 38 1\n15 28 39 1\n");
    assert_eq!(arriving.status.code(), Some(2));
    for expected in ["standard input", "`14 27 38 1`", "--columns xytp"] {
        assert!(message(&arriving).contains(expected), "{}", message(&arriving));
    }
    let output = meissner(&["info", argument(&path), "--columns", "xytp", "--json"]);
    let info = object(&output);
    assert_eq!((&info["first_t_us"], &info["last_t_us"]), (&38.into(), &39.into()));
    for wrong in [&["--columns", "xyt"][..], &["--time-unit", "min"]] {
        fails(&meissner(&[&["info", argument(&path)], wrong].concat()), 2, &["error: "]);
    }
    let (_folder, path) = file("five.txt", "1 2 70000 1 9\n");
    fails(&meissner(&["info", argument(&path)]), 1, &["five.txt", "--columns xytp"]);
    assert!(meissner(&["info", argument(&path), "--columns", "xytp_"]).status.success());
    let recording = default_recording();
    fails(&meissner(&["info", argument(&recording), "--columns", "xytp"]), 2, &["--columns", "EVT3"]);
}

#[test]
fn an_input_of_another_kind_is_named_with_the_networks_that_read_it() {
    let recording = default_recording();
    let names: Vec<String> = (1..=24).map(|e| format!("ff_e{e}")).collect();
    let (_a, electrodes) = file("slip.csv", format!("{}\n{}\n", names.join(","), ["3500"; 24].join(",")));
    let (_b, picture) = file("picture.pgm", "P5 1 1 255\n\x07");
    let (folder, events) = file("events.csv", "# sensor 8x8\nt,x,y,p\n1,2,3,1\n");
    let of_events = ["a recording of events", "graphres", "force-lstm", "event-frame-cnn"];
    for network in ["slip-best", "canf"] {
        for path in [&recording, &events] {
            fails(&meissner(&["run", argument(path), "--network", network]), 1, &of_events);
        }
    }
    let of_pictures = ["picture", "canf", "canf-plain"];
    let of_electrodes = ["readings of electrodes", "slip-best", "slip-regularised"];
    for network in ["tactigraph-past", "force-lstm"] {
        let run = |path| meissner(&["run", path, "--sensor", "8x8", "--network", network]);
        fails(&run(argument(&electrodes)), 1, &of_electrodes);
        fails(&run(argument(&picture)), 1, &of_pictures);
        fails(&run(argument(folder.path())), 1, &["a folder", "canf"]);
    }
    fails(&meissner(&["run", argument(&electrodes), "--network", "canf"]), 1, &of_electrodes);
    fails(&meissner(&["run", argument(&picture), "--network", "slip-best"]), 1, &of_pictures);
    fails(&meissner(&["run", argument(folder.path()), "--network", "slip-best"]), 1, &["a folder", "canf"]);
    fails(&meissner(&["info", argument(&electrodes)]), 1, &of_electrodes);
    fails(&meissner(&["convert", argument(folder.path()), "out.csv"]), 1, &["a folder"]);
}

#[test]
fn a_format_that_is_not_read_is_named_with_what_converts_it_whatever_the_network() {
    for (name, bytes, expected) in [
        ("a.csv.xz", &b"\xfd7zXZ\0\0\0"[..], ["xz", "unxz"]),
        ("a.bag", b"#ROSBAG V2.0\n", ["ROS bag", "rosbags"]),
        ("a.aedat", b"#!AER-DAT1.0\r\n\0\0", ["AEDAT 1", "DV"]),
        ("b.aedat", b"#!AER-DAT3.0\r\n\0\0", ["AEDAT 3.0", "DV"]),
    ] {
        let (_folder, path) = file(name, bytes);
        for network in ["tactigraph-past", "force-lstm", "slip-best", "canf"] {
            fails(
                &meissner(&["run", argument(&path), "--network", network]),
                1,
                &[name, expected[0], expected[1]],
            );
        }
        fails(&meissner(&["info", argument(&path)]), 1, &[name, expected[0], expected[1]]);
        fails(&meissner_reading(&["info", "-"], bytes), 1, &["standard input", expected[0], expected[1]]);
    }
}

#[test]
fn a_binary_recording_on_standard_input_is_named_and_its_path_asked_for() {
    for format in [Format::Evt3, Format::Dat, Format::Npy] {
        let bytes = encoded(format);
        for arguments in
            [&["info", "-"][..], &["convert", "-", "out.csv"], &["run", "-", "--network", "graphres"]]
        {
            let name = format.to_string();
            fails(
                &meissner_reading(arguments, &bytes),
                1,
                &["standard input", &name, "its path instead of -"],
            );
        }
    }
}

#[test]
fn a_recording_that_was_cut_short_names_salvage_and_salvage_counts_what_is_whole() {
    for format in [Format::Evt3, Format::Dat, Format::Npy, Format::Csv] {
        let bytes = encoded(format);
        let (_folder, path) = file("cut", &bytes[..bytes.len() - 5]);
        let path = argument(&path);
        fails(&meissner(&["info", path, "--strict"]), 1, &["cut", "--salvage"]);
        assert_eq!(meissner(&["info", path]).status.success(), format == Format::Csv);
        // A text is read without its last line, which is counted as refused, unless it is to be
        // strict.
        fails(&meissner(&["run", path, "--sensor", "128x128", "--strict"]), 1, &["cut", "--salvage"]);
        let output = meissner(&["info", path, "--salvage", "--json"]);
        assert!(output.status.success(), "{}", message(&output));
        let info = object(&output);
        let (salvaged, events) = (&info["salvaged"], info["events"].as_u64().expect("a count"));
        assert!((290..300).contains(&events), "{format}: {events}");
        assert_eq!(salvaged["events"], events);
        assert!(salvaged["bytes_not_read"].as_u64().is_some_and(|bytes| bytes > 0), "{salvaged}");
        assert!(salvaged["place"].is_string() && salvaged["what"].is_string(), "{salvaged}");
        assert!(message(&output).contains("salvaged: ") && message(&output).contains("not read"));
        let read = ["--sensor", "128x128", "--salvage"];
        for network in ["tactigraph-past", "force-lstm"] {
            let run = [&["run", path, "--json", "--network", network][..], &read].concat();
            let (_, summary) = lines(&meissner(&run));
            assert_eq!(&summary["salvaged"], salvaged, "{summary}");
            assert_eq!(summary["events"], events);
        }
        assert!(text(&meissner(&["info", path, "--salvage"])).contains("salvaged    "));
    }
    // Whole recordings say nothing, and a damaged one is refused by a strict reader with it as
    // without.
    let recording = default_recording();
    let output = meissner(&["info", argument(&recording), "--salvage", "--json"]);
    assert!(text(&output).contains("\"salvaged\":null") && message(&output).is_empty());
    let (_folder, path) = file("bad.csv", "t,x,y,p\n1,2,3,1\noops\n2,2,3,1\n");
    fails(&meissner(&["info", argument(&path), "--salvage", "--strict"]), 1, &["bad.csv", "line 3"]);
    fails(&meissner(&["info", "-", "--salvage"]), 2, &["--salvage", "standard input"]);
}

#[test]
fn convert_replaces_a_file_only_when_told_to() {
    let (_folder, path) = file("out.csv", "kept");
    let recording = default_recording();
    let convert = ["convert", argument(&recording), argument(&path)];
    fails(&meissner(&convert), 2, &["out.csv", "--force"]);
    assert_eq!(fs::read(&path).expect("it is still there"), b"kept");
    for force in ["--force", "-f"] {
        let output = meissner(&[&convert[..], &[force]].concat());
        assert!(output.status.success(), "{}", message(&output));
    }
    assert!(fs::read(&path).expect("it is there").starts_with(b"# sensor"));
}

#[test]
fn convert_reads_and_writes_the_standard_streams() {
    let text = rows(|e| format!("{},{},{},{}", e.t_us, e.x, e.y, u8::from(e.on)));
    for format in [Format::Csv, Format::Npy, Format::Dat, Format::Evt3] {
        let to = format.to_string().to_lowercase();
        let output = meissner_reading(&["convert", "-", "-", "--to", &to, "--sensor", "128x128"], &text);
        assert!(output.status.success(), "{}", message(&output));
        assert_eq!(output.stdout, encoded(format), "{format}");
        assert!(message(&output).contains("standard output: 300 events"), "{}", message(&output));
    }
    fails(&meissner_reading(&["convert", "-", "-"], &text), 2, &["--to csv|npy|dat|evt3|es"]);
}
