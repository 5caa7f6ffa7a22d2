//! `meissner verify`: shipped networks, an own description, a recording, a frame network, and
//! streams to replay.

use serde_json::Value;

use super::digits_data::small;
use crate::exit_status::fails;
use crate::support::{argument, file, meissner, message, object, words};

/// The object that a successful run prints.
fn verified(arguments: &[&str]) -> Value {
    let output = meissner(&[&["verify"], arguments, &["--json"]].concat());
    let report = object(&output);
    assert_eq!((&report["mismatch"], &report["header"]["command"]), (&Value::Null, &"verify".into()));
    report
}

/// A recording of events that lie close together.
fn recording() -> (tempfile::TempDir, std::path::PathBuf) {
    let event = |i: u32| format!("{},{},{},{}", 150 * i, 10 + i * 7 % 13, 8 + i * 5 % 11, i % 2);
    let events = (0..300).map(event).collect::<Vec<_>>().join("\n");
    file("recording.csv", format!("# sensor 34x34\nt,x,y,p\n{events}\n"))
}

#[test]
fn a_shipped_network_is_verified_on_random_streams() {
    let report = verified(&["tactigraph-past", "--cases", "3"]);
    let check = &report["checks"][0];
    assert_eq!(
        (&check["name"], &check["cases"], &check["refused"]),
        (&"random streams".into(), &3.into(), &0.into())
    );
    for key in ["inputs", "comparisons", "rows"] {
        assert!(check[key].as_u64() > Some(0), "{key}: {check}");
    }
    assert_eq!(report["header"]["network"]["name"], "tactigraph-past");
    assert_eq!(report, verified(&["tactigraph-past", "--cases", "3"]), "a run is determined by its seed");
    assert_ne!(report["checks"], verified(&["tactigraph-past", "--cases", "3", "--seed", "2"])["checks"]);
}

#[test]
fn a_description_without_weights_is_verified_with_drawn_ones_on_streams_and_recordings() {
    let (_network, description) = file("own.toml", small("own", &[]));
    let (_recording, events) = recording();
    let arguments = [argument(&description), argument(&events), "--cases", "2", "--every", "25"];
    let report = verified(&arguments);
    assert_eq!(report["header"]["weights"]["preparation"], "drawn");
    assert_eq!(report["header"]["weights"]["source"], "drawn from seed 1");
    let check = &report["checks"][1];
    assert_eq!((&check["name"], &check["inputs"]), (&argument(&events).into(), &300.into()));
    assert_eq!(check["comparisons"], 13, "every 25 events, and at the end");
    let output = meissner(&[&["verify"], &arguments[..]].concat());
    let said = words(&output);
    assert!(output.status.success(), "{}", message(&output));
    assert!(said.contains("own") && said.contains("equal over 2 streams"), "{said}");
}

#[test]
fn a_frame_network_is_verified_on_random_frames() {
    let report = verified(&["slip-lstm", "--cases", "3"]);
    assert_eq!(
        (&report["checks"][0]["cases"], &report["header"]["network"]["kind"]),
        (&3.into(), &"frames".into())
    );
    for option in [&["--sensor", "8x8"][..], &["--every", "5"], &["some.csv"]] {
        fails(&meissner(&[&["verify", "slip-lstm"], option].concat()), 2, &["frame network"]);
    }
}

#[test]
fn a_minimal_stream_is_replayed_and_a_text_of_another_form_is_refused() {
    let steps = "# sensor 8x8\n# capacity 2\nt,x,y,p\n0,1,1,1\n9,9,1,0\n5,2,1,0\n# advance 40\n# predict\n# snapshot\n\
                 60,3,3,1\n70,4,3,1\n# bytes\n# reset\n1,1,1,1\n";
    let (_folder, path) = file("failure.csv", steps);
    let report = verified(&["tactigraph-past", "--replay", argument(&path)]);
    let check = &report["checks"][0];
    assert_eq!((&check["inputs"], &check["comparisons"]), (&6.into(), &5.into()));
    let (_frames, sequence) =
        file("frames.txt", "# values 120\nframe 3=0.5 7=-1\n# predict\nframe\n# bytes\n");
    assert_eq!(verified(&["slip-lstm", "--replay", argument(&sequence)])["checks"][0]["inputs"], 2);
    let (_wrong, wrong) = file("wrong.csv", "# sensor 8x8\n0,1,1,1\n0;1;1;1\n");
    fails(
        &meissner(&["verify", "graphres", "--replay", argument(&wrong)]),
        2,
        &[argument(&wrong), "line 3", "t,x,y,p", "0;1;1;1"],
    );
    fails(&meissner(&["verify", "graphres", "--replay", "none.csv"]), 1, &["none.csv"]);
}

#[test]
fn wrong_arguments_are_refused() {
    fails(&meissner(&["verify"]), 2, &["NETWORK"]);
    fails(&meissner(&["verify", "graphres", "--cases", "many"]), 2, &["--cases"]);
    fails(&meissner(&["verify", "graphres", "--replay", "a.csv", "b.csv"]), 2, &["--replay"]);
    fails(&meissner(&["verify", "graphress"]), 1, &["graphress", "did you mean graphres?"]);
    fails(&meissner(&["verify", "graphres-published", "--cases", "1"]), 1, &["graphres-published"]);
    fails(
        &meissner(&["verify", "graphres", "--failure", "no/such/folder/file.csv"]),
        1,
        &["no/such/folder/file.csv"],
    );
}
