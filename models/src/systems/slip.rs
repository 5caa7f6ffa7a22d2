//! Direction of slip from 24 electrodes (`BioTac SP`): 7 classes, 11 objects, windows of readings.
//!
//! - [`CLASSES`]: the directions, in the order of outputs; [`WORDS`]: the same in words,
//! - [`SlipWindows`]: cuts readings into the windows with which a network is trained and evaluated,
//! - [`DecisionFilter`]: from classes of windows to a decision that is held until others agree,
//! - [`Object`] and [`ObjectSet`]: the objects that slip, and sets seen or not seen in training,
//! - [`REFERENCES`]: accuracies that a paper reports, or that are reached without a network,
//! - [`SlipError`]: networks and recordings that do not belong here.

use std::fmt;

use meissner_engine::representations::{
    ELECTRODES, RepresentationError, Sampling, Scaling, TACTILE_COLUMNS, TACTILE_ROWS, TactileForm,
    TactileWindow,
};
use thiserror::Error;

use crate::systems::{OutputsError, check_outputs};
use crate::{FrameDescription, FrameSource};

/// Classes by index: rotation anticlockwise and clockwise, east, north, south, no slip (touch),
/// west.
pub const CLASSES: [&str; 7] = ["aw", "cw", "e", "n", "s", "t", "w"];

/// The classes in words, in the same order.
pub const WORDS: [&str; CLASSES.len()] =
    ["anticlockwise", "clockwise", "east", "north", "south", "touch", "west"];

/// `class` in words, if `classes` are those of slip; `class` itself otherwise.
pub fn word<'a>(class: &'a str, classes: &[String]) -> &'a str {
    let index = CLASSES.iter().position(|&name| name == class).filter(|_| classes == CLASSES);
    index.map_or(class, |index| WORDS[index])
}

/// A network or a recording does not belong to direction of slip.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages explain the fields")]
#[non_exhaustive]
pub enum SlipError {
    /// The network does not read electrodes.
    #[error(
        "network {network}: expected a network over readings of electrodes (frames = \"tactile-image\" or \
         \"electrodes\"), found frames = {found:?}"
    )]
    NotReadings { network: String, found: &'static str },
    /// The network predicts other classes or values.
    #[error(transparent)]
    Outputs(#[from] OutputsError),
    /// No set contains the object of a recording.
    #[error("recording {recording}: expected an object of {expected}, found {found:?}")]
    Object { recording: String, expected: String, found: String },
    /// A window cannot take a reading.
    #[error(transparent)]
    Reading(#[from] RepresentationError),
}

/// A filter cannot have these settings.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[expect(missing_docs, reason = "the messages explain the fields")]
#[non_exhaustive]
pub enum DecisionError {
    /// No window would have to agree.
    #[error("windows that have to agree: expected at least 1, found {found}")]
    Hold { found: u32 },
    /// The least probability is not a probability.
    #[error("least probability of a window that votes: expected 0 to 1, found {found}")]
    LeastProbability { found: f32 },
}

/// A decision and its age.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// Index of the class.
    pub class: usize,
    /// Number of windows for which it has been held, including the window that made it; at least 1.
    pub held: u64,
}

/// Holds a decision: the class of the newest `hold` consecutive windows that all voted for one
/// class; none before the first such run. A window votes if its probability is at least
/// `least_probability`. A window that does not vote (also with NaN) ends the run and does not
/// change the decision. O(1) per window, without allocation.
///
/// ```
/// use meissner_models::systems::slip::DecisionFilter;
/// let mut filter = DecisionFilter::new(2, 0.5)?;
/// let windows = [(3, 0.9), (3, 0.8), (5, 0.9), (3, 0.7), (5, 0.9), (5, 0.6)];
/// let classes = windows.map(|(class, p)| filter.push(class, p).map(|d| d.class));
/// assert_eq!(classes, [None, Some(3), Some(3), Some(3), Some(3), Some(5)]);
/// # Ok::<(), meissner_models::systems::slip::DecisionError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionFilter {
    hold: u32,
    least_probability: f32,
    standing: Option<Decision>,
    candidate: usize,
    run: u32,
}

impl DecisionFilter {
    /// A filter without a decision. With a `hold` of 1 and a `least_probability` of 0, every window
    /// decides.
    ///
    /// # Errors
    /// A `hold` of 0; a `least_probability` that is not from 0 to 1.
    pub fn new(hold: u32, least_probability: f32) -> Result<Self, DecisionError> {
        if hold == 0 {
            return Err(DecisionError::Hold { found: hold });
        }
        if !(0.0..=1.0).contains(&least_probability) {
            return Err(DecisionError::LeastProbability { found: least_probability });
        }
        Ok(Self { hold, least_probability, standing: None, candidate: 0, run: 0 })
    }

    /// Takes the next window's most probable class and its probability; returns the decision after
    /// it, if any.
    pub fn push(&mut self, class: usize, probability: f32) -> Option<Decision> {
        if probability >= self.least_probability {
            let agrees = self.run > 0 && self.candidate == class;
            self.run = if agrees { self.hold.min(self.run.saturating_add(1)) } else { 1 };
            self.candidate = class;
        } else {
            self.run = 0;
        }
        if let Some(standing) = &mut self.standing {
            standing.held = standing.held.saturating_add(1);
        }
        if self.run == self.hold && self.standing.is_none_or(|standing| standing.class != self.candidate) {
            self.standing = Some(Decision { class: self.candidate, held: 1 });
        }
        self.standing
    }

    /// Forgets the decision and all windows, as after [`Self::new`].
    pub fn reset(&mut self) {
        self.standing = None;
        self.candidate = 0;
        self.run = 0;
    }
}

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
    /// The set that contains it.
    pub set: ObjectSet,
    /// Whether the recording misspells its name.
    pub misspelt: bool,
}

impl Object {
    /// The object with the name `name` in `recording`.
    ///
    /// # Errors
    /// [`SlipError::Object`] if no set contains it.
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
    /// Description of the method.
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
    /// Share on `set`; `None` for the training set of the method.
    pub fn accuracy(&self, set: ObjectSet) -> Option<f64> {
        self.accuracies.iter().find(|(other, _)| *other == set).map(|&(_, share)| share)
    }
}

/// Cuts windows for a network.
///
/// Windows are consecutive and disjoint, as in the paper, whatever sampling a running network uses;
/// readings at the end that do not fill a window are left out.
#[derive(Clone, Debug)]
pub struct SlipWindows {
    window: TactileWindow,
    steps: usize,
    shape: &'static [usize],
}

impl SlipWindows {
    /// Cuts windows as `description` reads them.
    ///
    /// # Errors
    /// [`SlipError::NotReadings`], [`SlipError::Outputs`] for a network of another system.
    pub fn new(description: &FrameDescription) -> Result<Self, SlipError> {
        let (form, readings) = match *description.source() {
            FrameSource::TactileImage(readings) => (TactileForm::Image, readings),
            FrameSource::Electrodes(readings) => (TactileForm::Reading, readings),
            other => {
                let (network, found) = (description.name().to_owned(), other.word());
                return Err(SlipError::NotReadings { network, found });
            }
        };
        check_outputs(description.name(), description.outputs().0, &CLASSES)?;
        let window = TactileWindow::new(readings.steps, Sampling::Consecutive, readings.scaling, form)?;
        let shape: &[usize] = match (form, readings.scaling) {
            (TactileForm::Image, _) => &[1, TACTILE_ROWS, TACTILE_COLUMNS],
            (TactileForm::Reading, Scaling::ReadingAndRange { .. }) => &[2 * ELECTRODES],
            (TactileForm::Reading, _) => &[ELECTRODES],
        };
        Ok(Self { window, steps: readings.steps, shape })
    }

    /// Number of readings in a window.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// A frame's shape: (1, 12, 11) for images, (24) for readings, (48) if scaled twice.
    pub fn frame_shape(&self) -> &'static [usize] {
        self.shape
    }

    /// Number of values of a frame.
    pub fn frame_len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Appends the windows of `stretch` to `frames`, (windows, steps, frame), window k from reading
    /// k `steps`; returns their number.
    ///
    /// # Errors
    /// [`SlipError::Reading`] for a reading that is not finite or that the scaling makes infinite.
    pub fn cut<'a>(
        &mut self,
        stretch: impl IntoIterator<Item = &'a [f32; ELECTRODES]>,
        frames: &mut Vec<f32>,
    ) -> Result<usize, SlipError> {
        self.window.reset();
        let mut windows = 0;
        for reading in stretch {
            if let Some(sequence) = self.window.push(reading)? {
                frames.extend_from_slice(sequence.values);
                windows += 1;
            }
        }
        Ok(windows)
    }
}
