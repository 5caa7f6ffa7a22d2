//! The tasks by name, so that everything that offers tasks offers the same ones.

/// A task that networks are judged on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskName {
    /// Digits in front of a moving event camera.
    Digits,
    /// Objects under a tactile skin.
    Objects,
    /// Containers under a tactile skin.
    Containers,
    /// Direction of slip.
    Slip,
    /// Angles of a contact, and other quantities of presses.
    Angle,
    /// Contact area and normal force.
    Area,
    /// Force of a grasp.
    Force,
}

impl TaskName {
    /// All tasks.
    pub const ALL: [Self; 7] =
        [Self::Digits, Self::Objects, Self::Containers, Self::Slip, Self::Angle, Self::Area, Self::Force];

    /// Its name, one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Digits => "digits",
            Self::Objects => "objects",
            Self::Containers => "containers",
            Self::Slip => "slip",
            Self::Angle => "angle",
            Self::Area => "area",
            Self::Force => "force",
        }
    }

    /// The task called `name`.
    pub fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|task| task.name() == name)
    }
}
