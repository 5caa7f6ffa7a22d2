//! Compares the page on network files with the parser: examples are accepted, and the keys, values
//! and defaults of each table are those of the parser.

use std::collections::{BTreeMap, BTreeSet};

use meissner_models::{AnyDescription, ProblemKind};

const PAGE: &str = include_str!("../../docs/network-files.md");

/// A row of a table "of | key | value | default | meaning": group, key, value, default.
struct Row<'a> {
    group: &'a str,
    key: &'a str,
    value: &'a str,
    default: &'a str,
}

/// The rows of keys between two headings of the page, without those of groups that have no key.
fn rows(section: &str) -> Vec<Row<'static>> {
    let text = PAGE.split("\n## ").find(|text| text.starts_with(section)).expect("a section of the page");
    let (mut found, mut group) = (Vec::new(), "");
    for line in text.lines().filter(|line| line.matches(" | ").count() + line.matches("| |").count() >= 4) {
        let cells: Vec<&str> =
            line.trim_matches('|').split('|').map(|cell| cell.trim().trim_matches('`')).collect();
        let [first, key, value, default, _] = cells[..] else { panic!("five cells: {line}") };
        group = if first.is_empty() { group } else { first };
        if key != "key" && !key.starts_with('-') && !key.is_empty() {
            // Text in code is a value of TOML.
            let is_code = line.contains(&format!("| `{default}` |"));
            found.push(Row {
                group,
                key,
                value,
                default: if is_code || default == "required" { default } else { "" },
            });
        }
    }
    found
}

/// `text` with `value` for `key` (or without) in the table from line `start`; lines keep their
/// numbers.
fn edited(text: &str, start: usize, key: &str, value: Option<&str>) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let length =
        lines[start + 1..].iter().position(|line| line.starts_with('[')).unwrap_or(lines.len() - start - 1);
    let of_table = start + 1..start + 1 + length;
    let there = of_table.clone().find(|&i| lines[i].starts_with(&format!("{key} = ")));
    let free = of_table.clone().find(|&i| lines[i].is_empty()).expect("a free line in each table");
    if let Some(there) = there {
        lines[there].clear();
    }
    if let Some(value) = value {
        lines[there.unwrap_or(free)] = format!("{key} = {value}");
    }
    lines.join("\n")
}

/// The problems of line `line` of `text`, counted from 0.
fn problems(text: &str, line: impl Fn(usize) -> bool) -> Vec<ProblemKind> {
    let Err(error) = AnyDescription::parse(text) else { return Vec::new() };
    error
        .problems()
        .iter()
        .filter(|problem| line(problem.line - 1))
        .map(|problem| problem.kind.clone())
        .collect()
}

/// The keys that the parser requests from the table that starts on line `start`.
fn asked(text: &str, start: usize) -> BTreeSet<String> {
    let unknown = problems(&edited(text, start, "zz", Some("1")), |_| true);
    let [ProblemKind::UnknownKey { key, expected }] = &unknown[..] else { panic!("{unknown:?}\n{text}") };
    assert_eq!(key, "zz");
    expected.split(", ").map(str::to_owned).collect()
}

/// The line of the table of `text` that contains the line `mark`.
fn table(text: &str, mark: &str) -> usize {
    let lines: Vec<&str> = text.lines().collect();
    let at = lines.iter().position(|line| *line == mark).unwrap_or_else(|| panic!("{mark}\n{text}"));
    (0..=at).rev().find(|&i| lines[i].starts_with('[')).expect("a table")
}

/// A table of `text` with the line `mark`, the groups of the page with its keys, and keys of these
/// that it lacks.
struct Case {
    text: &'static str,
    mark: &'static str,
    groups: &'static [&'static str],
    without: &'static [&'static str],
}

/// Compares `cases` with the keys, values and defaults of their groups in `section`. Every group
/// must be in a case.
fn compare(section: &str, cases: &[Case]) {
    let rows = rows(section);
    let mut compared = BTreeSet::new();
    for Case { text, mark, groups, without } in cases {
        AnyDescription::parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let start = table(text, mark);
        let of_case: Vec<&Row<'_>> =
            rows.iter().filter(|row| groups.contains(&row.group) && !without.contains(&row.key)).collect();
        let keys: BTreeSet<String> = of_case.iter().map(|row| row.key.to_owned()).collect();
        assert_eq!(
            asked(text, start),
            keys,
            "{mark}, {groups:?}: what the parser asks for, and what the page has"
        );
        for Row { group, key, value, default } in of_case {
            let of = format!("{mark}, {group}, {key}");
            // A key that is valid only with other values is checked in a case with these values.
            let dated = edited(text, start, key, Some("1979-05-27"));
            let of_key = format!("{key} = 1979-05-27");
            let wrong = problems(&dated, |line| dated.lines().nth(line) == Some(&of_key));
            let expected = wrong.iter().find_map(|kind| match kind {
                ProblemKind::Value { key: of, expected, .. } if of == key => Some(expected.clone()),
                _ => None,
            });
            let Some(expected) = expected else { continue };
            assert_eq!(expected, *value, "{of}: the value that is expected, and the page's");
            let absent = edited(text, start, key, None);
            let missing = problems(&absent, |line| line == start);
            let is_missing = missing
                .iter()
                .any(|kind| matches!(kind, ProblemKind::MissingKey { key: of, .. } if of == key));
            assert_eq!(is_missing, *default == "required", "{of}: whether it is required\n{missing:?}");
            if !is_missing && !default.is_empty() {
                let given = AnyDescription::parse(&edited(text, start, key, Some(default))).expect(&of);
                let default = AnyDescription::parse(&absent).expect(&of);
                assert!(given == default, "{of}: the default");
            }
            compared.insert((*group, *key));
        }
    }
    let all: BTreeSet<_> = rows.iter().map(|row| (row.group, row.key)).collect();
    assert_eq!(all, compared, "the keys of the page, and those that were compared");
}

/// The quoted words of the page's value for `key` of `group`: the choices of the parser.
fn choices(section: &str, group: &str, key: &str) -> Vec<String> {
    let rows = rows(section);
    let row = rows.iter().find(|row| row.group == group && row.key == key).expect("a row");
    row.value.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The first cells of the tables of keys of `section`.
fn groups(section: &str) -> BTreeSet<String> {
    let text = PAGE.split("\n## ").find(|text| text.starts_with(section)).expect("a section of the page");
    text.lines().filter_map(|line| Some(line.strip_prefix("| `")?.split_once('`')?.0.to_owned())).collect()
}

const EVENTS: &str = r#"[network]
name = "events"

[graph]
kind = "knn"
k = 4
candidates = "past"
lifetime = "window"
scale = 0.5

[[layer]]
name = "conv1"
kind = "spline"
channels = 3
kernel = 2

[[layer]]
name = "conv2"
kind = "block"
conv = "spline"
channels = 3
kernel = 2

[[layer]]
name = "conv3"
kind = "pointnet"
channels = 3

[[layer]]
name = "conv4"
kind = "block"
conv = "pointnet"
channels = 3

[[layer]]
name = "pool1"
kind = "pool"
cell = ["1/8", "1/6"]
time = "1/2"
scale = 0.4

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "fc"
kind = "dense"
outputs = 2

[output]
names = ["a", "b"]
unit = "rad"

"#;

const RADIUS: &str = r#"[network]
name = "radius"

[graph]
kind = "radius"
r = 0.1
max = 4
candidates = "all"
scale = 0.5

[[filter]]
kind = "hot_pixel"
period_us = 10000
burst = 16

[[filter]]
kind = "refractory"
time_us = 1000

[[filter]]
kind = "activity_filter"
time_us = 1250

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "fc"
kind = "dense"
outputs = 2

[output]
classes = ["a", "b"]

"#;

const FRAMES: &str = r#"[network]
name = "frames"

[input]
kind = "image"
channels = 2
height = 16
width = 16
frames = "event-counts"
maximum = 8

[[layer]]
name = "conv"
kind = "conv"
channels = 16
kernel = 3

[[layer]]
name = "half"
kind = "max_pool"

[[layer]]
name = "twice"
kind = "upconv"
channels = 16

[[layer]]
name = "mean"
kind = "average_pool"
size = 2

[[layer]]
name = "excite"
kind = "squeeze_excite"

[[layer]]
name = "both"
kind = "concat"
with = "half"

[[layer]]
name = "state"
kind = "conv_lstm"
hidden = 2

[[layer]]
name = "total"
kind = "sum"

[[layer]]
name = "flat"
kind = "flatten"
from = "state"

[[layer]]
name = "average"
kind = "global_average"
from = "half"

[[layer]]
name = "joined"
kind = "concat"
from = "flat"
with = "average"

[[layer]]
name = "rest"
kind = "concat"
with = "total"

[[layer]]
name = "lstm"
kind = "lstm"
hidden = 3

[[layer]]
name = "last"
kind = "delay"
frames = 2

[[layer]]
name = "out"
kind = "dense"
outputs = 1

[output]
names = ["a"]
unit = "1"

"#;

/// A network of one dense layer over frames with the keys `input`.
macro_rules! framed {
    ($input:literal, $flatten:literal) => {
        concat!(
            "[network]\nname = \"framed\"\n\n[input]\n",
            $input,
            "\n\n",
            $flatten,
            "[[layer]]\nname = \"out\"\nkind = \"dense\"\noutputs = 1\n\n[output]\nnames = [\"a\"]\nunit = \"1\"\n\n"
        )
    };
    ($input:literal) => {
        framed!($input, "[[layer]]\nname = \"flat\"\nkind = \"flatten\"\n\n")
    };
}

const SLIDING: &str =
    framed!("kind = \"image\"\nchannels = 1\nheight = 8\nwidth = 8\nframes = \"signed\"\nspan_us = 9");
const PERIODS: &str =
    framed!("kind = \"image\"\nchannels = 1\nheight = 8\nwidth = 8\nframes = \"signed\"\nperiod_us = 9");
const TACTILE: &str = framed!(
    "kind = \"image\"\nchannels = 1\nheight = 12\nwidth = 11\nframes = \"tactile-image\"\nsteps = 5\nscaling = \"image\""
);
const ELECTRODES: &str =
    framed!("kind = \"vector\"\nvalues = 24\nframes = \"electrodes\"\nsteps = 5\nscaling = \"reading\"", "");
const PICTURE: &str = framed!(
    "kind = \"image\"\nchannels = 3\nheight = 8\nwidth = 8\nframes = \"picture\"\nmean = [0, 0, 0]\nstd = [1, 1, 1]\nforce_mean = 0\nforce_std = 1\npixel_mm = [0.1, 0.1]"
);

const fn case(
    text: &'static str,
    mark: &'static str,
    groups: &'static [&'static str],
    without: &'static [&'static str],
) -> Case {
    Case { text, mark, groups, without }
}

#[test]
fn every_example_of_the_page_is_accepted() {
    let blocks: Vec<&str> =
        PAGE.split("```toml\n").skip(1).filter_map(|text| text.split("```").next()).collect();
    let (whole, parts): (Vec<&str>, Vec<&str>) = blocks.iter().partition(|text| text.contains("[network]"));
    assert_eq!((whole.len(), parts.len()), (3, 2));
    for text in &whole {
        AnyDescription::parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    }
    // The part is an output of three classes; it replaces the output of an example that has three.
    let head = whole.iter().find(|text| text.contains("[[head]]")).expect("an example with a head");
    let (before, _) = head.split_once("[output]").expect("an output");
    AnyDescription::parse(&(before.to_owned() + parts[0])).expect("the part instead of an output");
    AnyDescription::parse(&(parts[1].to_string() + head)).expect("filters before a network");
}

#[test]
fn the_keys_values_and_defaults_of_networks_over_events_are_those_that_the_parser_asks_for() {
    const BLOCK: &[&str] = &["any", "block"];
    const SPLINE: &[&str] = &["any", "block", "spline"];
    let all = [
        case(EVENTS, "name = \"events\"", &["[network]"], &[]),
        case(EVENTS, "kind = \"knn\"", &["[graph]"], &["r", "max"]),
        case(RADIUS, "kind = \"radius\"", &["[graph]"], &["k"]),
        case(EVENTS, "kind = \"spline\"", SPLINE, &["conv"]),
        case(EVENTS, "name = \"conv2\"", SPLINE, &[]),
        case(EVENTS, "kind = \"pointnet\"", BLOCK, &["conv"]),
        case(EVENTS, "name = \"conv4\"", BLOCK, &[]),
        case(EVENTS, "kind = \"pool\"", &["any", "pool"], &[]),
        case(EVENTS, "kind = \"readout\"", &["any", "readout"], &[]),
        case(EVENTS, "kind = \"dense\"", &["any", "dense"], &[]),
        case(EVENTS, "unit = \"rad\"", &["[output]"], &[]),
        case(RADIUS, "classes = [\"a\", \"b\"]", &["[output]"], &[]),
    ];
    compare("Networks over events", &all);
    let found = groups("Networks over events");
    let mut kinds = choices("Networks over events", "any", "kind");
    kinds.extend(choices("Networks over events", "block", "conv"));
    kinds.extend(["[network]", "[graph]", "[output]"].map(str::to_owned));
    assert_eq!(found, kinds.into_iter().collect(), "what the tables are of, and what there is");
}

#[test]
fn the_keys_values_and_defaults_of_filters_are_those_that_the_parser_asks_for() {
    let all = [
        case(RADIUS, "kind = \"hot_pixel\"", &["any", "hot_pixel"], &[]),
        case(RADIUS, "kind = \"refractory\"", &["any", "refractory"], &[]),
        case(RADIUS, "kind = \"activity_filter\"", &["any", "activity_filter"], &[]),
    ];
    compare("Filters", &all);
    let kinds = choices("Filters", "any", "kind");
    let found = groups("Filters");
    assert_eq!(found, kinds.into_iter().collect(), "what the tables are of, and what there is");
}

#[test]
fn the_keys_values_and_defaults_of_frame_networks_are_those_that_the_parser_asks_for() {
    const VALUES: &[&str] = &["values"];
    let all = [
        case(FRAMES, "kind = \"image\"", &["[input]", "event-counts"], VALUES),
        case(SLIDING, "kind = \"image\"", &["[input]", "signed"], VALUES),
        case(PERIODS, "kind = \"image\"", &["[input]", "signed"], VALUES),
        case(TACTILE, "kind = \"image\"", &["[input]", "tactile-image"], VALUES),
        case(ELECTRODES, "kind = \"vector\"", &["[input]", "electrodes"], &["channels", "height", "width"]),
        case(PICTURE, "kind = \"image\"", &["[input]", "picture"], VALUES),
        case(FRAMES, "kind = \"conv\"", &["any", "conv"], &[]),
        case(FRAMES, "kind = \"upconv\"", &["any", "upconv"], &[]),
        case(FRAMES, "kind = \"max_pool\"", &["any", "max_pool"], &[]),
        case(FRAMES, "kind = \"average_pool\"", &["any", "average_pool"], &[]),
        case(FRAMES, "kind = \"global_average\"", &["any", "global_average"], &[]),
        case(FRAMES, "kind = \"sum\"", &["any", "sum"], &[]),
        case(FRAMES, "kind = \"concat\"", &["any", "concat"], &[]),
        case(FRAMES, "kind = \"squeeze_excite\"", &["any", "squeeze_excite"], &[]),
        case(FRAMES, "kind = \"conv_lstm\"", &["any", "conv_lstm"], &[]),
        case(FRAMES, "kind = \"lstm\"", &["any", "lstm"], &[]),
        case(FRAMES, "kind = \"delay\"", &["any", "delay"], &[]),
        case(FRAMES, "kind = \"flatten\"", &["any", "flatten"], &[]),
        case(FRAMES, "kind = \"dense\"", &["any", "dense"], &[]),
    ];
    compare("Frame networks", &all);
    let mut kinds = choices("Frame networks", "any", "kind");
    kinds.extend(choices("Frame networks", "[input]", "frames"));
    kinds.push("[input]".to_owned());
    assert_eq!(
        groups("Frame networks"),
        kinds.into_iter().collect(),
        "what the tables are of, and what there is"
    );
    assert_eq!(asked(FRAMES, 0), BTreeSet::from(["name".to_owned()]), "the table [network]");
}

#[test]
fn the_page_has_every_table_of_both_kinds_of_networks() {
    let mut tables: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let (mut found, mut file) = (PAGE.lines().skip_while(|line| !line.starts_with("| file |")).skip(2), "");
    while let Some(line) = found.next().filter(|line| line.starts_with('|')) {
        let cells: Vec<&str> = line.split('|').map(|cell| cell.trim().trim_matches('`')).collect();
        file = if cells[1].is_empty() { file } else { cells[1] };
        tables.entry(file).or_default().insert(cells[2].to_owned());
    }
    for (name, text) in [("network over events", EVENTS), ("frame network", FRAMES)] {
        let unknown = AnyDescription::parse(&format!("zz = 1\n{text}")).expect_err("an unknown table");
        let [ProblemKind::UnknownKey { expected, .. }] =
            &unknown.problems().iter().map(|p| p.kind.clone()).collect::<Vec<_>>()[..]
        else {
            panic!("{unknown}")
        };
        assert_eq!(tables[name], expected.split(", ").map(str::to_owned).collect(), "{name}");
    }
}
