//! The objects that slip, the sets that they are in, and accuracies to compare with.
//!
//! Networks are trained on one set and evaluated on the others.

use std::fmt;

use super::SlipError;

/// A set of objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ObjectSet {
    /// The objects that networks are trained on.
    Basic,
    /// Solid objects.
    Solids,
    /// Small objects.
    Small,
    /// Textured objects.
    Textures,
}

impl ObjectSet {
    /// All sets, the one for training first.
    pub const ALL: [Self; 4] = [Self::Basic, Self::Solids, Self::Small, Self::Textures];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Basic => "Basic",
            Self::Solids => "Solids",
            Self::Small => "Small",
            Self::Textures => "Textures",
        }
    }

    /// Names of its objects.
    pub fn objects(self) -> &'static [&'static str] {
        match self {
            Self::Basic => &["case", "hd", "sponge", "pen"],
            Self::Solids => &["bottle", "cardboard"],
            Self::Small => &["brush", "screw"],
            Self::Textures => &["plate", "bubbles", "striped"],
        }
    }
}

impl fmt::Display for ObjectSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Names that the published data set misspells, and the right names.
const MISSPELT: &[(&str, &str)] = &[("strippes", "striped")];

/// An object that slips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its name.
    pub name: &'static str,
    /// The set that holds it.
    pub set: ObjectSet,
    /// Whether the recording misspells its name.
    pub misspelt: bool,
}

impl Object {
    /// The object that `recording` calls `name`.
    ///
    /// # Errors
    /// [`SlipError::Object`] where no set holds it.
    pub fn of(recording: &str, name: &str) -> Result<Self, SlipError> {
        let meant = MISSPELT.iter().find(|(misspelt, _)| *misspelt == name).map(|&(_, meant)| meant);
        let sought = meant.unwrap_or(name);
        for set in ObjectSet::ALL {
            if let Some(name) = set.objects().iter().find(|&&object| object == sought) {
                return Ok(Self { name, set, misspelt: meant.is_some() });
            }
        }
        let expected = ObjectSet::ALL.map(|set| format!("{set} ({})", set.objects().join(", ")));
        let (recording, found) = (recording.to_owned(), name.to_owned());
        Err(SlipError::Object { recording, expected: expected.join(", "), found })
    }
}

/// Accuracies of another method trained on [`ObjectSet::Basic`], as shares of windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Its name in plots.
    pub name: &'static str,
    /// What the method is.
    pub about: &'static str,
    /// Shares on the other sets.
    pub accuracies: [(ObjectSet, f64); 3],
    /// Known decimals of the shares in percent.
    pub decimals: usize,
}

/// The best figures of the paper, and those of a method without a network on the same windows.
pub const REFERENCES: [Reference; 2] = [
    Reference {
        name: "paper",
        about: "the paper's best, as it reports them",
        accuracies: [(ObjectSet::Solids, 0.8256), (ObjectSet::Small, 0.7241), (ObjectSet::Textures, 0.7380)],
        decimals: 2,
    },
    Reference {
        name: "SVM",
        about: "support-vector machine (RBF, C = 10) on the 5 x 24 readings, each scaled by its own range",
        accuracies: [(ObjectSet::Solids, 0.840), (ObjectSet::Small, 0.653), (ObjectSet::Textures, 0.712)],
        decimals: 1,
    },
];

impl Reference {
    /// Share on `set`; `None` for the set that the method is trained on.
    pub fn accuracy(&self, set: ObjectSet) -> Option<f64> {
        self.accuracies.iter().find(|(other, _)| *other == set).map(|&(_, share)| share)
    }
}

#[cfg(test)]
mod tests {
    use super::{Object, ObjectSet};

    #[test]
    fn every_object_is_in_one_set() {
        let mut all: Vec<&str> = ObjectSet::ALL.iter().flat_map(|set| set.objects()).copied().collect();
        for &name in &all {
            let object = Object::of("n/any1", name).unwrap();
            assert!(object.set.objects().contains(&name) && !object.misspelt, "{name}");
        }
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 11);
    }

    #[test]
    fn a_misspelt_object_is_the_one_that_is_meant() {
        let object = Object::of("s/strippes305", "strippes").unwrap();
        assert_eq!(object, Object { name: "striped", set: ObjectSet::Textures, misspelt: true });
    }

    #[test]
    fn another_object_is_refused_with_its_recording() {
        let error = Object::of("n/cup1", "cup").unwrap_err().to_string();
        assert!(
            error.contains("n/cup1") && error.contains("\"cup\"") && error.contains("striped"),
            "{error}"
        );
    }
}
