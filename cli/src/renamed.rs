//! Command lines of the version before: `stress` and `soak` were subcommands, and `--json` took a
//! file in `soak`, `eval`, `pareto` and `simulate loop`. This file goes with the next version.

use std::ffi::{OsStr, OsString};

use clap::error::{ContextKind, ContextValue};
use meissner_models::DEFAULT_NETWORK;

/// `words`, the first of which is the program, in the words of this version.
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

#[cfg(test)]
mod tests {
    use super::renamed;

    #[test]
    fn former_subcommands_are_forms_of_verify() {
        for (former, now) in [
            ("stress --quick", "verify --stress --quick"),
            ("soak --events 9", "verify tactigraph-past --soak --events 9"),
            ("soak a.csv b.csv --network graphres --json x", "verify graphres --soak a.csv b.csv --out x"),
            ("soak --network=graphres --json=x --sensor=8x8", "verify graphres --soak --out x --sensor=8x8"),
            ("help soak", "help verify"),
            ("help run", "help run"),
            ("run stress --json", "run stress --json"),
        ] {
            let words = renamed(format!("meissner {former}").split(' ').map(Into::into));
            let words: Vec<_> = words.iter().filter_map(|word| word.to_str()).collect();
            assert_eq!(words.join(" "), format!("meissner {now}"));
        }
    }
}
