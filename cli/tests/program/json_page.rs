//! The keys of JSON outputs against `docs/json.md`. Every report and every line that a test reads
//! passes [`documented`].

use std::collections::BTreeSet;

use serde_json::Value;

use crate::support::{default_recording, headed_lines, meissner, meissner_reading, object};

const PAGE: &str = include_str!("../../../docs/json.md");
/// The heading between what the commands share and what each of them has.
const EACH: &str = "## Keys of each command";
/// Keys whose values have other keys: reasons, indenters, sets, and those of a description.
const NAMES: [&str; 4] = ["dropped", "kinds", "preparation", "references"];

/// The words in code of `text`.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let code = text.split('`').skip(1).step_by(2);
    code.flat_map(|code| code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')))
}

/// The title and the text of each section on a command.
fn sections() -> impl Iterator<Item = (&'static str, &'static str)> {
    let (_, each) = PAGE.split_once(EACH).expect("the page has this heading");
    each.split("\n### ").skip(1).filter_map(|section| section.split_once('\n'))
}

/// The section on `command`, as the header names it.
fn section(command: &str) -> (&'static str, &'static str) {
    let title = match command {
        "stress" => "verify --stress",
        "soak" => "verify --soak",
        _ => command,
    };
    let is_named = |name: &str| title == name || title.starts_with(&format!("{name} "));
    let exact = sections().find(|&(named, _)| named == title);
    exact.or_else(|| sections().find(|(named, _)| named.split(", ").any(is_named))).expect(title)
}

/// All keys in `value`.
fn keys_in<'a>(value: &'a Value, keys: &mut BTreeSet<&'a str>) {
    match value {
        Value::Array(all) => all.iter().for_each(|value| keys_in(value, keys)),
        Value::Object(object) => {
            for (key, value) in object {
                keys.insert(key);
                if !NAMES.contains(&key.as_str()) {
                    keys_in(value, keys);
                }
            }
        }
        _ => {}
    }
}

/// Refuses a key in `value`, an output of `command`, that the page does not have.
pub(crate) fn documented(command: &str, value: &Value) {
    let (shared, _) = PAGE.split_once(EACH).expect("the page has this heading");
    let (title, text) = section(command);
    let others = sections().filter(|(other, _)| text.contains(&format!("as in `{other}`")));
    let known: BTreeSet<&str> =
        [text, shared].into_iter().chain(others.map(|(_, text)| text)).flat_map(words).collect();
    let mut keys = BTreeSet::new();
    keys_in(value, &mut keys);
    let missing: Vec<_> = keys.difference(&known).collect();
    assert!(missing.is_empty(), "docs/json.md, {title}: {missing:?}");
}

/// Refuses a key in a first column of the section on `command` that none of `outputs` has.
fn are_there(command: &str, outputs: &[Value]) {
    let mut keys = BTreeSet::new();
    outputs.iter().for_each(|value| keys_in(value, &mut keys));
    let rows = section(command).1.lines().filter_map(|line| line.strip_prefix("| `")?.split_once(" | "));
    for (first, _) in rows.filter(|(_, value)| !value.contains("over pictures:")) {
        for key in words(&format!("`{first}")).filter(|key| !key.is_empty()) {
            assert!(keys.contains(key), "docs/json.md, {command}: no output has {key}");
        }
    }
}

#[test]
fn every_key_of_the_page_is_in_an_output() {
    let lines = |output| {
        let (_, mut lines, summary) = headed_lines(&output);
        lines.push(summary);
        lines
    };
    let names: Vec<String> = (1..=24).map(|i| format!("e{i}")).collect();
    let readings = format!("{}\n{}", names.join(","), format!("{}\n", ["1"; 24].join(",")).repeat(60));
    let run = [
        lines(meissner(&["run", "--limit", "300", "--every", "100", "--stride", "2", "--json"])),
        lines(meissner(&["run", "--limit", "300", "--network", "force-tdnn", "--json"])),
        lines(meissner(&["run", "--limit", "300", "--network", "digits-past", "--every", "end", "--json"])),
        lines(meissner_reading(&["run", "-", "--network", "slip-lstm", "--json"], &readings)),
    ];
    let mut run = run.concat();
    // Of a value outside the range of the training only.
    run.push(serde_json::json!({ "outside_training": [] }));
    are_there("run", &run);
    let play = ["play", "--limit", "300", "--speed", "1000", "--json"];
    let stride = lines(meissner(&[&play[..], &["--stride", "2"]].concat()));
    let classes = lines(meissner(&[&play[..], &["--network", "digits-past"]].concat()));
    are_there("play", &[stride, classes].concat());
    let bench = ["bench", "--limit", "300", "--warmup", "0", "--json"];
    let of = |more: &[&str]| object(&meissner(&[&bench[..], more].concat()));
    are_there("bench", &[of(&[]), of(&["--network", "force-tdnn"]), of(&["--compare", "force-tdnn"])]);
    are_there("verify", &[object(&meissner(&["verify", "graphres", "--cases", "1", "--json"]))]);
    let recording = default_recording();
    for command in [&["info", recording.to_str().expect("text")][..], &["networks"]] {
        let output = object(&meissner(&[command, &["--json"]].concat()));
        documented(command[0], &output);
        are_there(command[0], &[output]);
    }
}
