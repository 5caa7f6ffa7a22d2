//! The form of the help, and the reading of arguments.

mod arguments;
mod reports;

use clap::{Arg, Command};

use meissner_evaluate::TaskName;

use crate::args::{
    APPROXIMATIONS, ELECTRODES, Every, FRAMES, INPUT, MEASUREMENT, NETWORK, OUTPUT, PREDICTIONS, QUEUE,
    READING, REMEMBERS, REUSES, STATE,
};
use crate::program;
use crate::simulate::{CAMERA, MARKERS};

/// The heading of each option, in all subcommands.
const HEADINGS: &[(&str, &[&str])] = &[
    (
        INPUT,
        &[
            "sensor",
            "limit",
            "late",
            "restart",
            "from",
            "for",
            "events",
            "strict",
            "columns",
            "time-unit",
            "salvage",
            "format",
            "chip",
            "stream",
            "reconnect",
            "replay",
            "interval",
            "indenters",
            "newtons",
            "saw-teeth",
            "optics",
            "width",
            "size",
            "coarseness",
            "goal",
            "slower",
            "stale",
            "drop",
            "labels",
            "offset",
            "max-gap",
            "ages",
            "youngest",
            "truth",
        ],
    ),
    (
        NETWORK,
        &[
            "network",
            "weights",
            "map",
            "span",
            "capacity",
            "compare",
            "compare-weights",
            "compare-map",
            "ignore-preparation",
            "trainings",
            "folds",
            "outputs",
            "grid",
            "hidden",
        ],
    ),
    (PREDICTIONS, &["ahead", "mode", "every", "report-every", "deadline", "verify"]),
    (QUEUE, &["speed", "queue", "overload", "packet", "pin"]),
    (
        MEASUREMENT,
        &[
            "period",
            "slice",
            "burst-rate",
            "sweep",
            "repeat",
            "warmup",
            "state",
            "only",
            "timed-events",
            "quick",
            "seed",
            "threads",
            "cases",
            "checkpoint-every",
            "disturb-every",
            "memory-growth",
            "stress",
            "soak",
            "presses",
            "each",
            "planes",
            "pictures",
            "recordings",
            "seconds",
            "rate",
        ],
    ),
    (STATE, &["save-state", "save-every", "resume"]),
    (FRAMES, &["no-skip", "convolution", "longest-silence", "video", "overlay", "full-scale", "reference"]),
    (ELECTRODES, &["sampling", "hold", "least-probability"]),
    (
        APPROXIMATIONS,
        &[
            "tolerance",
            "neighbours",
            "activity-filter",
            "refractory",
            "rate-limit",
            "stride",
            "stale-events",
            "stale-time",
        ],
    ),
    (MARKERS, &["radius", "edge", "marker", "ground"]),
    (
        CAMERA,
        &[
            "ideal",
            "lux",
            "dark-lux",
            "threshold-on",
            "threshold-off",
            "threshold-spread",
            "cutoff-max-hz",
            "leak-hz",
            "shot-hz",
            "hot-share",
            "latency",
            "jitter",
        ],
    ),
    (
        OUTPUT,
        &[
            "json",
            "csv",
            "svg",
            "dot",
            "logits",
            "mcap",
            "port",
            "no-browser",
            "view",
            "out",
            "to",
            "failure",
            "list",
            "markdown",
            "force",
            "records",
            "split-on-silence",
            "name",
        ],
    ),
];

/// Options with another heading in some subcommand.
const ELSEWHERE: &[(&str, &str, &str)] = &[
    ("run", "threads", PREDICTIONS),
    ("bench", "threads", PREDICTIONS),
    ("play", "repeat", INPUT),
    ("eval digits", "stride", NETWORK),
    ("eval angle", "stride", NETWORK),
    ("eval touch", "stride", NETWORK),
    ("record", "activity-filter", OUTPUT),
    ("prepare digits", "folds", OUTPUT),
    ("prepare touch", "folds", OUTPUT),
    ("prepare presses", "folds", OUTPUT),
    ("prepare windows", "seed", INPUT),
    ("fit", "ages", NETWORK),
    ("fit", "shift", NETWORK),
    ("simulate markers", "refractory", CAMERA),
    ("simulate images", "refractory", CAMERA),
];

/// All subcommands that do something, with their names.
fn each(command: &Command, name: &str, all: &mut Vec<(String, Command)>) {
    if command.get_subcommands().next().is_none() {
        all.push((name.to_owned(), command.clone()));
    }
    for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
        each(inner, format!("{name} {}", inner.get_name()).trim(), all);
    }
}

fn subcommands() -> Vec<(String, Command)> {
    let mut command = program();
    command.build();
    let mut all = Vec::new();
    each(&command, "", &mut all);
    assert!(all.len() > 15, "{}", all.len());
    all
}

#[test]
fn the_arguments_are_consistent() {
    program().debug_assert();
}

#[test]
fn every_option_stands_under_its_heading() {
    for (name, command) in subcommands() {
        let options = command.get_arguments().filter_map(|arg| Some((arg.get_long()?, arg)));
        for (option, arg) in options.filter(|(option, _)| !["help", "version"].contains(option)) {
            let elsewhere = ELSEWHERE.iter().find(|(of, long, _)| *of == name && *long == option);
            let heading = HEADINGS.iter().find(|(_, options)| options.contains(&option));
            let expected = elsewhere.map(|(_, _, heading)| heading).or(heading.map(|(heading, _)| heading));
            let expected = expected.unwrap_or_else(|| panic!("{name} --{option}: add it to a heading here"));
            assert_eq!(arg.get_help_heading(), Some(*expected), "{name} --{option}");
        }
    }
}

#[test]
fn options_that_fit_some_networks_or_forms_exist() {
    let of_kinds = crate::run::OPTIONS_OF_KINDS.iter().flat_map(|(options, _)| *options);
    let lists = [
        ("run", of_kinds.copied().collect::<Vec<_>>()),
        ("play", REUSES.to_vec()),
        ("bench", [crate::bench::FOR_EVENTS, REMEMBERS].concat()),
        ("verify", [crate::verify::FOR_EVENTS, crate::verify::OF_STRESS, READING].concat()),
    ];
    for (name, options) in lists {
        let (_, command) = subcommands().into_iter().find(|(of, _)| of == name).expect(name);
        let all: Vec<String> = command.get_arguments().map(crate::given::name).collect();
        for option in options {
            assert!(all.iter().any(|name| name == option), "{name} {option}");
        }
    }
}

#[test]
fn the_short_help_of_an_option_is_one_sentence_of_less_than_80_characters() {
    for (name, command) in subcommands() {
        for arg in command.get_arguments() {
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            assert!(!help.is_empty() && help.chars().count() < 80, "{name}, {}: {help:?}", arg.get_id());
            assert!(!help.contains(". "), "{name}, {}: {help:?}", arg.get_id());
        }
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        assert!(!about.is_empty() && about.chars().count() < 80, "{name}: {about:?}");
    }
}

#[test]
fn a_paragraph_of_the_help_of_an_option_is_short() {
    let length = |arg: &Arg| {
        let help = arg.get_long_help().map(ToString::to_string).unwrap_or_default();
        help.split("\n\n").map(|paragraph| paragraph.chars().count()).max().unwrap_or(0)
    };
    for (name, command) in subcommands() {
        for arg in command.get_arguments() {
            assert!(length(arg) < 500, "{name}, {}: {} characters", arg.get_id(), length(arg));
        }
    }
}

#[test]
fn at_80_columns_no_line_of_any_help_is_longer_and_no_word_is_broken() {
    for (name, command) in subcommands() {
        for long in [false, true] {
            let help = |columns: usize| {
                let mut command = command.clone().term_width(columns);
                let help = if long { command.render_long_help() } else { command.render_help() };
                help.to_string()
            };
            let (narrow, endless) = (help(80), help(0));
            for line in narrow.lines() {
                assert!(line.chars().count() <= 80, "{name}: {line}");
            }
            let words = |help: &str| help.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
            assert_eq!(words(&narrow), words(&endless), "{name}");
        }
    }
}

#[test]
fn every_help_says_what_the_exit_statuses_mean() {
    for (name, mut command) in subcommands() {
        for help in [command.render_help(), command.render_long_help()] {
            let help = help.to_string();
            assert!(help.contains("Exit status:") && help.contains("bad usage"), "{name}: {help}");
        }
    }
}

#[test]
fn every_reads_events_and_times_and_refuses_nothing_and_less() {
    assert_eq!("event".parse(), Ok(Every::Events(1)));
    assert_eq!("end".parse(), Ok(Every::End));
    assert_eq!("100".parse(), Ok(Every::Events(100)));
    for (text, us) in [("1000us", 1000), ("1ms", 1000), ("1.5ms", 1500), ("2s", 2_000_000)] {
        assert_eq!(text.parse(), Ok(Every::StreamUs(us)));
    }
    for wrong in ["", "0", "0us", "-1", "-5us", "1min", "us", "events", "1.5", "99999999999999999999"] {
        let message = wrong.parse::<Every>().expect_err(wrong);
        assert!(message.contains("a number of events such as 100, or a time with its unit"), "{message}");
    }
}

#[test]
fn every_is_shown_as_it_is_read() {
    for text in ["event", "end", "100", "10ms", "1500us", "2s"] {
        assert_eq!(text.parse::<Every>().map(|every| every.to_string()).as_deref(), Ok(text));
    }
}

/// Python has one function for each: its match over the tasks is exhaustive.
#[test]
fn eval_pareto_and_prepare_know_every_task() {
    let names: Vec<String> = subcommands().into_iter().map(|(name, _)| name).collect();
    let has = |command: &str, task: &str| {
        names.iter().any(|name| name.starts_with(command) && name.ends_with(task))
    };
    for task in TaskName::ALL {
        // The tasks with skins share one subcommand; pictures need no preparation.
        let (word, prepared) = match task {
            TaskName::Objects | TaskName::Containers | TaskName::Letters => ("touch", Some("touch")),
            TaskName::Digits | TaskName::Slip => (task.name(), Some(task.name())),
            TaskName::Angle | TaskName::Force => (task.name(), Some("graphs")),
            TaskName::Area => (task.name(), None),
        };
        assert!(has("eval ", word) && has("pareto ", word), "{task:?}: {names:?}");
        assert!(prepared.is_none_or(|word| has("prepare ", word)), "{task:?}: {names:?}");
    }
}
