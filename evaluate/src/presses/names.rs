//! Finds the recording that a name in a table means.

use std::collections::BTreeMap;

/// The list that `record` writes beside recordings.
pub(super) use meissner_run::record::TABLE as RECORDINGS;
use meissner_run::text::most_similar;

use super::scan::PressRecording;

/// Names of recordings: the place in the folder and the name of the file, each also without its
/// extension.
pub(super) struct Names<'a> {
    /// The recording; `None`: several recordings have this name.
    known: BTreeMap<&'a str, Option<usize>>,
    all: Vec<&'a str>,
    unreadable: &'a [String],
}

/// The reason why a name means no recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Miss {
    Unknown,
    Several,
    Unreadable,
}

impl<'a> Names<'a> {
    pub(super) fn new(recordings: &'a [PressRecording], unreadable: &'a [String]) -> Self {
        let mut known: BTreeMap<&str, Option<usize>> = BTreeMap::new();
        // A more specific name takes precedence.
        for form in [place, place_without, file, file_without] {
            let mut of_form: BTreeMap<&str, Option<usize>> = BTreeMap::new();
            for (index, recording) in recordings.iter().enumerate() {
                let entry = of_form.entry(form(&recording.name)).or_insert(Some(index));
                if *entry != Some(index) {
                    *entry = None;
                }
            }
            of_form.into_iter().for_each(|(name, index)| {
                known.entry(name).or_insert(index);
            });
        }
        let all = recordings.iter().map(|recording| recording.name.as_str()).collect();
        Self { known, all, unreadable }
    }

    /// The recording that `name` means. O(log recordings).
    pub(super) fn find(&self, name: &str) -> Result<usize, Miss> {
        let slashes = name.replace('\\', "/");
        let name = slashes.strip_prefix("./").unwrap_or(&slashes);
        match self.known.get(name).or_else(|| self.known.get(place_without(name))) {
            Some(found) => found.ok_or(Miss::Several),
            None if self.unreadable.iter().any(|bad| bad == name || place_without(bad) == name) => {
                Err(Miss::Unreadable)
            }
            None => Err(Miss::Unknown),
        }
    }

    /// The recording whose name is most similar to `name`. O(recordings).
    pub(super) fn similar(&self, name: &str) -> Option<&'a str> {
        let forms = self.all.iter().flat_map(|all| [*all, place_without(all)]);
        most_similar(name, forms)
    }

    /// A name of a recording.
    pub(super) fn example(&self) -> &'a str {
        self.all.first().copied().unwrap_or_default()
    }
}

fn place(name: &str) -> &str {
    name
}

/// The name without the extension of the file, and without that of the packed file in it.
fn place_without(name: &str) -> &str {
    let file_at = name.rfind('/').map_or(0, |at| at + 1);
    let stem = |name: &str| name[file_at..].rfind('.').filter(|&dot| dot > 0).map(|dot| file_at + dot);
    let Some(end) = stem(name) else { return name };
    let packed = ["gz", "zip"].iter().any(|packed| name[end + 1..].eq_ignore_ascii_case(packed));
    let inner = stem(&name[..end]).filter(|_| packed);
    &name[..inner.unwrap_or(end)]
}

fn file(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

fn file_without(name: &str) -> &str {
    file(place_without(name))
}
