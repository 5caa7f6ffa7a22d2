//! The arguments on the command line, according to clap.

use std::ffi::{OsStr, OsString};

use clap::error::{ContextKind, ContextValue};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};
use meissner_models::DEFAULT_NETWORK;

/// The arguments of a subcommand that were given, not defaults: names, and their form in messages.
#[derive(Debug)]
pub(crate) struct Given(Vec<(String, String)>);

impl Given {
    /// The arguments in `matches` of the innermost subcommand of `command`.
    pub(crate) fn of(command: &Command, matches: &ArgMatches) -> Self {
        let inner =
            matches.subcommand().and_then(|(name, inner)| Some((command.find_subcommand(name)?, inner)));
        match inner {
            Some((command, matches)) => Self::of(command, matches),
            None => Self(command.get_arguments().filter_map(|arg| given(arg, matches)).collect()),
        }
    }

    /// The first of `names` that was given, with its value if it has a default: `--late clamp`.
    pub(crate) fn first(&self, names: &[&str]) -> Option<&str> {
        let find = |name: &&str| self.0.iter().find(|(given, _)| given == name);
        names.iter().find_map(find).map(|(_, shown)| shown.as_str())
    }

    /// The first given argument that is not in `names`, in the form of [`Self::first`].
    pub(crate) fn beyond(&self, names: &[&str]) -> Option<&str> {
        let is_other = |(given, _): &&(String, String)| !names.contains(&given.as_str());
        self.0.iter().find(is_other).map(|(_, shown)| shown.as_str())
    }

    /// Whether nothing was given except some of `names`.
    pub(crate) fn is_within(&self, names: &[&str]) -> bool {
        self.beyond(names).is_none()
    }
}

/// The name of an argument: the option's name, or the value's name in the usage.
pub(crate) fn name(arg: &Arg) -> String {
    let value = || arg.get_value_names().and_then(|names| Some(names.first()?.to_string()));
    arg.get_long().map(|long| format!("--{long}")).or_else(value).unwrap_or_default()
}

fn given(arg: &Arg, matches: &ArgMatches) -> Option<(String, String)> {
    let id = arg.get_id().as_str();
    if matches.value_source(id) != Some(ValueSource::CommandLine) {
        return None;
    }
    let (name, defaults) = (name(arg), arg.get_default_values());
    if defaults.is_empty() || !arg.get_action().takes_values() {
        return Some((name.clone(), name));
    }
    let values: Vec<_> = matches.get_raw(id)?.collect();
    let differ = !values.iter().copied().eq(defaults.iter().map(clap::builder::OsStr::as_os_str));
    let shown = values.iter().map(|value| value.to_string_lossy()).collect::<Vec<_>>().join(",");
    differ.then(|| (name.clone(), format!("{name} {shown}")))
}

/// `words`, beginning with the program, translated to the words of this version.
pub(crate) fn renamed(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = words.collect();
    let word = |at: usize| words.get(at).and_then(|word| word.to_str());
    match word(1) {
        Some("help") if matches!(word(2), Some("stress" | "soak")) => words[2] = "verify".into(),
        Some("stress") => drop(words.splice(1..2, ["verify", "--stress"].map(OsString::from))),
        Some("soak") => {
            let (network, rest) = soak(words.drain(2..));
            words.splice(1.., ["verify".into(), network, "--soak".into()].into_iter().chain(rest));
        }
        _ => {}
    }
    words
}

/// The network, and the other arguments, of `soak`.
fn soak(mut words: impl Iterator<Item = OsString>) -> (OsString, Vec<OsString>) {
    let (mut network, mut rest) = (DEFAULT_NETWORK.into(), Vec::new());
    while let Some(word) = words.next() {
        let (option, value) = match word.to_str().and_then(|word| word.split_once('=')) {
            Some((option, value)) => (OsStr::new(option), Some(value.into())),
            None => (word.as_os_str(), None),
        };
        match (option.to_str(), value) {
            (Some("--network"), value) => network = value.or_else(|| words.next()).unwrap_or_default(),
            (Some("--json"), Some(file)) => rest.extend(["--out".into(), file]),
            (Some("--json"), None) => rest.push("--out".into()),
            _ => rest.push(word),
        }
    }
    (network, rest)
}

/// `error` of reading `words`, with a tip if a file follows `--json`.
pub(crate) fn with_tip(mut error: clap::Error, words: &[OsString]) -> clap::Error {
    if let Some(ContextValue::String(found)) = error.get(ContextKind::InvalidArg)
        && words.windows(2).any(|two| two[0] == "--json" && two[1] == found.as_str())
    {
        let tip = "--json takes no file: it prints to standard output, and --out FILE writes to a file";
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}
