//! Every inconsistency of a description is reported by name and line.
//!
//! `problems.txt` is the table: a section (`##`) per changed description, a claim (`#`), then
//! changes and the report. A change is a diff's hunk without line numbers: its lines with two
//! spaces or `- ` are in the description, and its lines with two spaces or `+ ` replace them; `@@`
//! separates hunks. A `> ` is a line of the report, or states that the description is accepted.

use super::support;

use std::fmt::Write;

use meissner_models::description::ProblemKind;
use meissner_models::{AnyDescription, Description, DescriptionError, FrameDescription, Problem};
use support::{SMALL, SMALL_FRAMES, changed, listed, only_of, with_head};

const TABLE: &str = include_str!("problems.txt");
const ACCEPTED: &str = "accepted";

/// A changed description, and its expected report.
#[derive(Default)]
struct Case {
    hunks: Vec<Hunk>,
    expected: Vec<&'static str>,
}

/// Lines that are in a description, and those that replace them.
#[derive(Default)]
struct Hunk {
    old: Vec<&'static str>,
    new: Vec<&'static str>,
}

impl Case {
    /// `text` with every hunk applied at the first occurrence of its old lines.
    fn apply(&self, text: &str) -> String {
        let mut lines: Vec<&str> = text.lines().collect();
        for Hunk { old, new } in &self.hunks {
            let at = (0..=lines.len() - old.len()).find(|&at| lines[at..].starts_with(old));
            let at = at.unwrap_or_else(|| panic!("{old:?} must be in the description"));
            lines.splice(at..at + old.len(), new.iter().copied());
        }
        lines.iter().fold(String::new(), |text, line| text + line + "\n")
    }
}

/// Every case of the table with its section and claim.
fn cases() -> Vec<(&'static str, &'static str, Case)> {
    let (mut section, mut claim, mut case, mut cases) = ("", "", Case::default(), Vec::new());
    let mut lines = TABLE.lines().peekable();
    while let Some(line) = lines.next() {
        let (mark, rest) = line.split_at_checked(2).unwrap_or((line, ""));
        match mark {
            "##" => section = rest.trim(),
            "# " => claim = rest,
            "@@" => case.hunks.push(Hunk::default()),
            "> " => case.expected.push(rest),
            // Between claims; inside of a hunk, an empty line is one of both.
            "" if case.hunks.is_empty() => {}
            _ => {
                if case.hunks.is_empty() {
                    case.hunks.push(Hunk::default());
                }
                let hunk = case.hunks.last_mut().expect("there is one");
                if !mark.starts_with('+') {
                    hunk.old.push(rest);
                }
                if !mark.starts_with('-') {
                    hunk.new.push(rest);
                }
            }
        }
        if mark == "> " && lines.peek().is_none_or(|next| !next.starts_with("> ")) {
            cases.push((section, claim, std::mem::take(&mut case)));
        }
    }
    cases
}

/// The result of both parsers for a description; they must agree.
fn parse(section: &str, text: &str) -> Result<(), DescriptionError> {
    let parsed = match section {
        "frames" => FrameDescription::parse(text).map(drop),
        _ => Description::parse(text).map(drop),
    };
    assert_eq!(AnyDescription::parse(text).map(drop), parsed, "{text}");
    parsed
}

#[test]
fn every_inconsistency_of_the_table_is_reported_by_name_and_line() {
    let head = with_head();
    let mut wrong = String::new();
    for (section, claim, case) in cases() {
        let text = case.apply(match section {
            "events" => SMALL,
            "head" => &head,
            "frames" => SMALL_FRAMES,
            _ => panic!("no description is called {section:?}"),
        });
        let found: Vec<String> = match parse(section, &text) {
            Ok(()) => vec![ACCEPTED.to_owned()],
            Err(error) => listed(&error).iter().map(ToString::to_string).collect(),
        };
        if found != case.expected {
            writeln!(wrong, "{claim}: expected {:#?}, found {found:#?} for\n{text}", case.expected)
                .expect("a string");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

fn problems(text: &str) -> Vec<Problem> {
    listed(&Description::parse(text).expect_err("the description must be refused"))
}

#[test]
fn text_that_is_not_toml_is_reported_with_its_line() {
    let found = problems(&changed("k = 4", "k = = 4"));
    assert_eq!(found[0].line, 6);
    assert!(matches!(found[0].kind, ProblemKind::Syntax(_)));
}

#[test]
fn a_description_of_the_other_kind_is_called_by_its_name() {
    let error = Description::parse(SMALL_FRAMES).expect_err("a frame network");
    assert_eq!(
        error.to_string(),
        "line 4: expected a network over events, with a table [graph], found a frame network, with a table [input]"
    );
    let error = FrameDescription::parse(SMALL).expect_err("a network over events");
    assert!(error.to_string().starts_with("line 4: expected a frame network"), "{error}");
}

#[test]
fn a_file_without_layers_is_refused() {
    let (head, _) = SMALL_FRAMES.split_once("[[layer]]").expect("layers");
    let text = format!("layer = []\n{head}[output]\nnames = [\"a\"]\nunit = \"b\"\n");
    let error = parse("frames", &text).expect_err("no layers");
    assert_eq!(only_of(&listed(&error)), "line 1: expected at least one layer, found none");
}

#[test]
fn a_network_that_asks_for_a_terabyte_is_refused_at_the_layer_with_which_it_is_too_large() {
    // The weights of each layer are within bounds: 2^26 values.
    let mut text = SMALL.split("[[layer]]").next().map(str::to_owned).unwrap_or_default();
    let layer = |i| {
        format!("[[layer]]\nname = \"c{i}\"\nkind = \"spline\"\nchannels = 2896\nkernel = 2\nnorm = false\n")
    };
    text.extend((0..1000).map(layer));
    text += "[[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [1, 1]\n\
             [[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n\
             [output]\nnames = [\"roll\"]\nunit = \"rad\"\n";
    let found = only_of(&problems(&text));
    let expected =
        "layer \"c5\": expected at most 268435456 parameters in the network up to this layer, found";
    assert!(found.contains(expected), "{found}");
}

#[test]
fn more_layers_than_anyone_writes_are_refused_without_deep_recursion() {
    let mut text = SMALL.split("[[layer]]").next().map(str::to_owned).unwrap_or_default();
    let layer = |i| format!("[[layer]]\nname = \"c{i}\"\nkind = \"spline\"\nchannels = 1\nkernel = 2\n");
    text.extend((0..1025).map(layer));
    let found = problems(&text);
    assert!(found.iter().any(|p| p.to_string().contains("at most 1024 layers, found 1025")), "{found:#?}");

    let layer = |i| format!("[[layer]]\nname = \"c{i}\"\nkind = \"conv\"\nchannels = 1\nkernel = 1\n\n");
    let layers: String = (0..1025).map(layer).collect();
    let text = SMALL_FRAMES.replacen("[[layer]]", &format!("{layers}[[layer]]"), 1);
    let found = listed(&parse("frames", &text).expect_err("1030 layers"));
    assert!(found.iter().any(|p| p.to_string().contains("at most 1024 layers, found 1030")), "{found:#?}");
}

#[test]
fn a_window_fills_as_many_cells_in_time_as_the_readout_has_grids() {
    let cells = changed("cell = [\"1/8\", \"1/6\"]", "cell = [\"1/8\", \"1/6\"]\ntime = \"1/3\"");
    let by_time = cells.replace("kind = \"readout\"", "kind = \"readout\"\nby_time = true");
    let table = Description::parse(&by_time).expect("consistent").to_table();
    let grid = table.lines().find(|line| line.starts_with("grid")).expect("the readout is listed");
    assert!(grid.contains("x4 "), "a window fills 4 cells of a third of it: {grid}");
}

#[test]
fn classes_stand_instead_of_names_and_unit() {
    let with = |output: &str| {
        let text = SMALL.replace("outputs = 1", "outputs = 2");
        Description::parse(&text.replace("names = [\"roll\"]\nunit = \"rad\"\n", output)).expect("consistent")
    };
    let told = with("classes = [\"left\", \"right\"]\n");
    assert_eq!(told.classes().expect("classes"), ["left", "right"]);
    assert_eq!(told.outputs().1, ["logit", "logit"]);
    assert_eq!(with("names = [\"a\", \"b\"]\nunit = [\"mm\", \"deg\"]\n").outputs().1, ["mm", "deg"]);
    assert_eq!(with("names = [\"a\", \"b\"]\nunit = \"N\"\n").classes(), None);
}
