//! What was given on the command line, according to clap.

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};

/// The arguments of a subcommand whose values are not their defaults: names, and how messages show
/// them.
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

    /// Whether nothing was given except some of `names`.
    pub(crate) fn is_within(&self, names: &[&str]) -> bool {
        self.0.iter().all(|(given, _)| names.contains(&given.as_str()))
    }
}

/// The name of an argument: that of the option, or that of the value in the usage.
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
