//! What is odd in a recording is left out and told, and refused with `--strict`; what a recording
//! does not say can be given.

use crate::exit_status::fails;
use crate::support::{argument, default_recording, file, lines, meissner, message, object, text};

#[test]
fn info_convert_and_run_tell_what_is_left_out_and_refuse_it_when_they_are_strict() {
    // Time, row and an event; two words of padding; events in a row outside the sensor and of
    // another system; a good one.
    let words =
        [0x8000_u16, 0x6001, 0x0005, 0x2807, 0x9999, 0x9999, 0x07ff, 0x2001, 0x1005, 0x2002, 0x0004, 0x2803];
    let header = b"% evt 3.0\n% format EVT3;height=60;width=80\n% end\n";
    let words: Vec<u8> = words.into_iter().flat_map(u16::to_le_bytes).collect();
    let lines_of_text = b"# sensor 80x60\n1,7,5,1\noops\n1,3,4,1\n1,3,70,1\n2,7,5,1\n".to_vec();
    for (content, kinds, events) in [
        (
            [&header[..], &words].concat(),
            vec![("other_words", 2), ("outside_sensor", 1), ("other_events", 1)],
            2,
        ),
        (lines_of_text, vec![("lines", 2)], 3),
    ] {
        let (folder, path) = file("odd", content);
        let (path, to) = (argument(&path), folder.path().join("to.csv"));
        let output = meissner(&["info", path, "--json"]);
        let info = object(&output);
        let left_out = info["left_out"].as_array().expect("a list");
        let found: Vec<_> =
            left_out.iter().map(|kind| (kind["kind"].as_str(), kind["count"].as_u64())).collect();
        let kinds: Vec<_> = kinds.into_iter().map(|(kind, count)| (Some(kind), Some(count))).collect();
        assert_eq!((found, &info["events"]), (kinds, &events.into()));
        assert!(left_out[0]["first"].as_str().is_some_and(|first| first.contains("expected")), "{info}");
        assert!(text(&meissner(&["info", path])).contains("left out    "));
        let convert = ["convert", path, argument(&to)];
        let run = ["run", path, "--network", "tactigraph-past", "--every", "end"];
        for command in [&convert[..], &run] {
            let output = meissner(&[command, &["--strict"]].concat());
            assert_eq!(output.status.code(), Some(1), "{}", message(&output));
            let output = meissner(command);
            assert!(
                output.status.success() && message(&output).contains("warning: "),
                "{}",
                message(&output)
            );
            assert!(message(&output).contains("expected"), "{}", message(&output));
        }
        assert_eq!(meissner_io::read(&to).expect("it is CSV").events.len(), events);
    }
}

#[test]
fn the_chip_of_a_recording_that_names_none_can_be_given() {
    let record = |x: u32, y: u32, t: u32| {
        [(259 - y) << 22 | (345 - x) << 12 | 1 << 11, t].map(u32::to_be_bytes).concat()
    };
    let records: Vec<u8> = (0..50).flat_map(|i| record(i, 2 * i, 1000 * i)).collect();
    let content = [&b"#!AER-DAT2.0\n# Creation time: now\n"[..], &records].concat();
    let (_folder, path) = file("v2e.aedat", content);
    let path = argument(&path);
    fails(&meissner(&["info", path]), 1, &["v2e.aedat", "--chip DAVIS346", "--sensor 346x260"]);
    for option in [["--chip", "DAVIS346"], ["--sensor", "346x260"]] {
        let output = meissner(&[&["info", path, "--json"][..], &option].concat());
        assert!(text(&output).contains("\"sensor\":[346,260],\"events\":50"), "{}", text(&output));
        let run = ["run", path, "--network", "tactigraph-past", "--every", "end", "--json"];
        let (_, summary) = lines(&meissner(&[&run[..], &option].concat()));
        assert_eq!(summary["events"], 50, "{summary}");
    }
    fails(&meissner(&["info", path, "--chip", "CAT9"]), 2, &["--chip", "DAVIS346"]);
    let recording = default_recording();
    fails(&meissner(&["info", argument(&recording), "--chip", "DVS128"]), 2, &["--chip", "AEDAT2"]);
    fails(&meissner(&["info", argument(&recording), "--stream", "2"]), 1, &["stream 2 asked for"]);
}
