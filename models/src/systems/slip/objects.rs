//! The objects that slip, and the sets that they are in: networks are trained on one set and judged on the others.

use std::fmt;

use super::SlipError;

/// A set of objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ObjectSet {
    /// What networks are trained on.
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

/// Names of the published data set that are misspelt, and what is meant.
const MISSPELT: &[(&str, &str)] = &[("strippes", "striped")];

/// An object that slips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its name.
    pub name: &'static str,
    /// The set that holds it.
    pub set: ObjectSet,
    /// Whether a recording has it under another spelling.
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
