//! Figures of networks name their weights.
//!
//! Every table and picture of a shipped network has a comment, invisible to readers of the page:
//! date, machine and commit of the measurement, the beginnings of the fingerprints of its networks,
//! and the command.
//!
//! ```text
//! <!-- figures: 28 November 2026, 6f0abd1f, Xeon with AVX-512
//! tactigraph-past 01234567, graphres 89abcdef
//! $ meissner eval angle on/test.safetensors --network tactigraph-past -->
//! ```
//!
//! If a page has figures of weights that are not shipped, the comment is `figures of other weights:
//! DATE, COMMIT, MACHINE, of NETWORK, NETWORK`, without fingerprints.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use meissner_engine::frames::{Convolution, FrameNetwork};
use meissner_models::{AnyDescription, Weights};

use crate::book::{prose, text};
use crate::house::{files, root};

/// Pages without figures of shipped networks: results of one day, changes, experiments, choices and
/// promises.
const APART: [&str; 6] = [
    "CHANGELOG.md",
    "TRIED.md",
    "docs/decisions.md",
    "docs/sensors/README.md",
    "docs/what-you-can-rely-on.md",
    "models/weights/README.md",
];

/// A part of a page under one heading.
#[derive(Debug, Default)]
struct Part {
    heading: String,
    /// Shipped networks in tables with figures, and pictures.
    shown: BTreeSet<String>,
    /// Lines of comments with figures; comments about other weights have no fingerprints.
    told: Vec<String>,
}

impl Part {
    /// The names in its comments, with their fingerprints.
    fn networks(&self) -> BTreeMap<&str, &str> {
        let lines = self.told.iter().filter(|line| !line.starts_with("$ ") && !line.starts_with("figures"));
        lines.flat_map(|line| line.split(',')).filter_map(|told| told.trim().split_once(' ')).collect()
    }

    /// The networks whose figures are of other weights.
    fn others(&self) -> impl Iterator<Item = &str> {
        let lines = self.told.iter().filter_map(|line| line.strip_prefix("figures of other weights:"));
        lines.filter_map(|line| line.split_once(", of ")).flat_map(|(_, names)| names.split(", "))
    }
}

/// The parts of a page, without its blocks of code.
fn parts(text: &str, names: &[&str]) -> Vec<Part> {
    let mut parts = vec![Part::default()];
    let (mut in_comment, mut table) = (false, Vec::new());
    // The last line ends a table at the end of a page.
    for line in prose(text).chain([""]) {
        if !line.starts_with('|') && !table.is_empty() {
            let part = parts.last_mut().expect("there is a first part");
            part.shown.extend(shown(&table, names));
            table.clear();
        }
        if line.starts_with('#') {
            parts.push(Part { heading: line.to_owned(), ..Part::default() });
        }
        let part = parts.last_mut().expect("there is a first part");
        in_comment |= line.starts_with("<!-- figures:") || line.starts_with("<!-- figures of other weights:");
        if in_comment {
            in_comment = !line.ends_with("-->");
            let told = line.trim_start_matches("<!-- ").trim_end_matches("-->").trim();
            part.told.extend((!told.is_empty()).then(|| told.to_owned()));
        } else if line.starts_with('|') {
            table.push(line);
        } else if let Some((_, picture)) = line.split_once("![").and_then(|(_, at)| at.split_once("](")) {
            part.shown.insert(picture.split(')').next().unwrap_or_default().to_owned());
        }
    }
    parts
}

/// The networks that a table names, if it has figures: cells, except the first, that begin with a
/// digit.
fn shown(table: &[&str], names: &[&str]) -> Vec<String> {
    let is_figure = |cell: &str| cell.trim_start().starts_with(|c: char| c.is_ascii_digit());
    if !table.iter().any(|row| row.split('|').skip(2).any(is_figure)) {
        return Vec::new();
    }
    let is_named = |name: &&&str| table.iter().any(|row| row.contains(&format!("`{name}`")));
    names.iter().filter(is_named).map(|&name| name.to_owned()).collect()
}

/// The fingerprint of a network with its shipped weights.
fn fingerprint(name: &str) -> u64 {
    let weights = Weights::shipped(name).expect("weights are shipped");
    match AnyDescription::shipped(name).expect("a shipped network") {
        AnyDescription::Events(description) => {
            description.network(&weights).expect("shipped weights fit").fingerprint()
        }
        AnyDescription::Frames(description) => {
            let parts = description.network_parts(&weights).expect("shipped weights fit");
            FrameNetwork::new(parts, Convolution::Direct).expect("a network").fingerprint()
        }
    }
}

#[test]
fn every_figure_of_a_network_is_of_its_shipped_weights() {
    let names: Vec<&str> = AnyDescription::shipped_names().collect();
    let expected: BTreeMap<&str, String> =
        names.iter().map(|&name| (name, format!("{:016x}", fingerprint(name))[..8].to_owned())).collect();
    let (results, all) = (root().join("benches/results"), files(&root(), "md"));
    let is_apart =
        |page: &Path| page.starts_with(&results) || APART.iter().any(|apart| page.ends_with(apart));
    let (mut faults, mut comments) = (Vec::new(), 0);
    for page in all.iter().filter(|page| !is_apart(page)) {
        let at = page.strip_prefix(root()).expect("below the root").display();
        for part in parts(&text(page), &names) {
            let place = format!("{at}, {}", part.heading);
            // Drawings of an idea show no weights.
            let shown: Vec<&String> =
                part.shown.iter().filter(|name| !name.starts_with("concepts/")).collect();
            if part.told.is_empty() && shown.is_empty() {
                continue;
            }
            comments += part.told.iter().filter(|line| line.starts_with("figures")).count();
            let told = part.networks();
            if part.told.is_empty() {
                faults.push(format!("{place}: no comment says what made the figures of {shown:?}"));
                continue;
            }
            if !part.told.iter().any(|line| line.starts_with("$ ")) {
                faults.push(format!("{place}: no comment names a command"));
            }
            let is_told = |name: &str| told.contains_key(name) || part.others().any(|other| other == name);
            for name in shown.into_iter().filter(|name| names.contains(&name.as_str()) && !is_told(name)) {
                faults.push(format!("{place}: {name} {} is missing in the comment", expected[name.as_str()]));
            }
            for (name, found) in told {
                match expected.get(name) {
                    Some(expected) if expected == found => {}
                    Some(expected) => faults.push(format!(
                        "{place}: the figures of {name} are of weights {found}, shipped are {expected}"
                    )),
                    None => faults.push(format!("{place}: {name} is no shipped network")),
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(comments >= 20, "{comments} comments");
}

#[test]
fn a_comment_is_read_line_by_line_and_only_outside_of_code() {
    let text = "\
# Page
| `canf` | 3 |
<!-- figures: 1 May 2026, abc, a machine
canf 0123, canf-live 4567
$ meissner eval area --network canf -->
```
| `canf` | 4 |
```
## Next
![a](b/c.svg) | `canf` 5
<!-- figures of other weights: 1 April 2026, of canf, canf-live -->
| `canf-live` | none |

| figure | `canf` |
|---|---|
| time | 5 ms |
";
    let parts = parts(text, &["canf", "canf-live"]);
    let [_, page, next] = &parts[..] else { panic!("{parts:?}") };
    assert_eq!(page.shown, ["canf".to_owned()].into());
    assert_eq!(page.networks(), [("canf", "0123"), ("canf-live", "4567")].into());
    assert_eq!(page.told.len(), 3);
    assert_eq!(next.shown, ["b/c.svg", "canf"].map(str::to_owned).into());
    assert_eq!(next.told, ["figures of other weights: 1 April 2026, of canf, canf-live"]);
    assert!(next.networks().is_empty() && next.others().eq(["canf", "canf-live"]));
}
