//! Accuracies to compare with, as shares of the windows of each set that training did not see.

use super::ObjectSet;

/// Accuracies that somebody else's method reaches when it is trained on [`ObjectSet::Basic`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// A word for drawings.
    pub name: &'static str,
    /// What reaches them.
    pub about: &'static str,
    /// Share on Solids.
    pub solids: f64,
    /// Share on Small.
    pub small: f64,
    /// Share on Textures.
    pub textures: f64,
    /// Decimals that are known of the shares in percent.
    pub decimals: usize,
}

/// The best figures of the paper, and a method without a network on the same windows.
pub const REFERENCES: [Reference; 2] = [
    Reference {
        name: "paper",
        about: "the paper's best, as it reports them",
        solids: 0.8256,
        small: 0.7241,
        textures: 0.7380,
        decimals: 2,
    },
    Reference {
        name: "SVM",
        about: "support-vector machine (RBF, C = 10) on the 5 x 24 readings, each scaled by its own range",
        solids: 0.840,
        small: 0.653,
        textures: 0.712,
        decimals: 1,
    },
];

impl Reference {
    /// Share on `set`; `None` for the one that it is trained on.
    pub fn accuracy(&self, set: ObjectSet) -> Option<f64> {
        match set {
            ObjectSet::Basic => None,
            ObjectSet::Solids => Some(self.solids),
            ObjectSet::Small => Some(self.small),
            ObjectSet::Textures => Some(self.textures),
        }
    }
}
