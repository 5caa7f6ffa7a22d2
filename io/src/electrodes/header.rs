//! The header of a text of electrodes: the content of each column.

use crate::error::{IoError, shown};
use crate::text::{Line, Separator};

/// Electrodes of the array.
pub const ELECTRODES: usize = 24;

/// The content of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    /// The electrode of this index, from 0.
    Electrode(usize),
    /// The time, in a unit of this many seconds.
    Time { seconds: f64 },
}

/// The columns of a text.
///
/// Invariant: each electrode has one column, and at most one column is the time.
#[derive(Debug)]
pub(super) struct Columns(
    /// Role and name, in lower case, of every column; `None`: the column is skipped.
    pub(super) Vec<Option<(Role, String)>>,
);

impl Columns {
    /// The columns that a header names.
    pub(super) fn from_header(line: Line<'_>) -> Result<Self, IoError> {
        let name = |field| String::from_utf8_lossy(field).to_ascii_lowercase();
        let names: Vec<String> = Separator::Comma.fields(line.text).map(name).collect();
        let electrodes = || names.iter().filter_map(|name| electrode(name));
        let refuse = |expected: String, actual: String| Err(line.malformed("header", expected, actual));
        let mut prefixes: Vec<&str> = electrodes().map(|(prefix, _)| prefix).collect();
        prefixes.sort_unstable();
        prefixes.dedup();
        let [prefix] = prefixes[..] else {
            if prefixes.is_empty() {
                return refuse(expected(), shown(line.text));
            }
            let first: Vec<String> = prefixes.iter().take(3).map(|p| shown(p.as_bytes())).collect();
            let dots = if prefixes.len() > first.len() { " .." } else { "" };
            return refuse(expected(), format!("the prefixes {}{dots}", first.join(", ")));
        };
        for index in 0..ELECTRODES {
            let found = electrodes().filter(|(_, e)| *e == index).count();
            if found != 1 {
                let name = format!("{prefix}{}", index + 1);
                return refuse(format!("one column {}", shown(name.as_bytes())), format!("{found}"));
            }
        }
        let times = names.iter().filter(|name| unit_of_time(name).is_some()).count();
        if times > 1 {
            return refuse("at most one column of time".to_owned(), format!("{times}"));
        }
        let roles = names.into_iter().map(|name| {
            let role = match electrode(&name) {
                Some((_, index)) => Role::Electrode(index),
                None => Role::Time { seconds: unit_of_time(&name)? },
            };
            Some((role, name))
        });
        Ok(Self(roles.collect()))
    }
}

/// The required content of a header.
pub(super) fn expected() -> String {
    format!("columns e1 to e{ELECTRODES} of one prefix, such as ff_e1")
}

/// Whether a line names at least half of the electrodes, and so is a header of electrodes.
pub(crate) fn names_electrodes(line: &[u8]) -> bool {
    let names = Separator::Comma.fields(line).filter_map(|name| str::from_utf8(name).ok());
    names.filter(|name| electrode(&name.to_ascii_lowercase()).is_some()).take(ELECTRODES / 2).count()
        == ELECTRODES / 2
}

/// The prefix of an electrode's name and its index from 0; `None`: `name` is not the name of an
/// electrode.
pub(crate) fn electrode(name: &str) -> Option<(&str, usize)> {
    let prefix = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let number: usize = name[prefix.len()..].parse().ok()?;
    let word = prefix.trim_end_matches(['_', ' ']);
    let before = word.strip_suffix("electrode").or_else(|| word.strip_suffix('e'))?;
    // `e` must be a separate word: `device3` is not an electrode.
    let apart = before.is_empty() || before.ends_with(|c: char| !c.is_ascii_alphanumeric());
    (apart && (1..=ELECTRODES).contains(&number)).then(|| (prefix, number - 1))
}

/// The unit of a column of time, in seconds; `None`: `name` is not the name of a column of time.
pub(crate) fn unit_of_time(name: &str) -> Option<f64> {
    let (stem, unit) = name.rsplit_once('_').unwrap_or((name, "s"));
    let seconds = match unit {
        "s" => 1.0,
        "ms" => 1e-3,
        "us" => 1e-6,
        "ns" => 1e-9,
        _ => return None,
    };
    matches!(stem, "t" | "time" | "timestamp").then_some(seconds)
}
