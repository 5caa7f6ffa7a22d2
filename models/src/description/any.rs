//! Common parts of descriptions of all kinds: parsing, loading, names of classes and tensors,
//! reports.

use std::fmt;
use std::path::Path;

use super::Description;
use super::document::{INPUT, LOGIT, checked, text};
use super::frames::FrameDescription;
use super::problem::DescriptionError;
use super::table::Table;
use super::tensors::{Needed, unused};
use crate::draw::Needs;
use crate::error::ModelError;
use crate::inspect::picture;
use crate::inspect::view::View;
use crate::weights::Weights;

/// A checked description of either kind of network. A table `[input]` marks a frame network.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyDescription {
    /// A network over the graph of events.
    Events(Description),
    /// A network over frames.
    Frames(FrameDescription),
}

impl From<Description> for AnyDescription {
    fn from(description: Description) -> Self {
        Self::Events(description)
    }
}

impl From<FrameDescription> for AnyDescription {
    fn from(description: FrameDescription) -> Self {
        Self::Frames(description)
    }
}

/// The result of an expression for the description of either kind.
macro_rules! either {
    ($any:expr, $description:ident => $result:expr) => {
        match $any {
            AnyDescription::Events($description) => $result,
            AnyDescription::Frames($description) => $result,
        }
    };
}

impl AnyDescription {
    fn check(root: Table<'_, '_>) -> Option<Self> {
        match root.line_of(INPUT) {
            Some(_) => FrameDescription::check(root).map(Self::Frames),
            None => Description::check(root).map(Self::Events),
        }
    }

    /// Name, for reports.
    pub fn name(&self) -> &str {
        either!(self, description => description.name())
    }

    /// Names of the predicted values, and the unit of each.
    pub fn outputs(&self) -> (&[String], &[String]) {
        either!(self, description => description.outputs())
    }

    /// The metadata `preparation` of weights trained for it; `None` if frames do not come from
    /// electrodes.
    pub fn preparation(&self) -> Option<String> {
        match self {
            Self::Events(description) => Some(description.preparation()),
            Self::Frames(description) => description.preparation(),
        }
    }

    pub(crate) fn needed(&self) -> Vec<Needed> {
        either!(self, description => description.needed())
    }

    fn view(&self) -> View<'_> {
        either!(self, description => description.view())
    }
}

macro_rules! common {
    ($($description:ty),*) => {$(
        impl $description {
            /// Checks the text of a description file.
            ///
            /// # Errors
            /// Every inconsistency with layer and line, except those that follow from others.
            pub fn parse(text: &str) -> Result<Self, DescriptionError> {
                checked(text, Self::check)
            }

            /// Reads and checks a description file.
            ///
            /// # Errors
            /// [`ModelError::Read`] for a file that is not text, [`ModelError::Large`] beyond 256
            /// KiB, [`ModelError::Description`] as [`Self::parse`].
            pub fn load(path: impl AsRef<Path>) -> Result<Self, ModelError> {
                Ok(Self::parse(&text(path.as_ref())?)?)
            }

            /// Names of the classes whose logits are predicted; `None` for other values.
            pub fn classes(&self) -> Option<&[String]> {
                let (names, units) = self.outputs();
                units.iter().all(|unit| unit == LOGIT).then_some(names)
            }

            /// Names of predicted values with units, such as "roll, pitch (rad)".
            pub fn labelled_outputs(&self) -> String {
                let (names, units) = self.outputs();
                match units {
                    [first, rest @ ..] if rest.iter().all(|unit| unit == first) => {
                        format!("{} ({first})", names.join(", "))
                    }
                    _ => {
                        let each = names.iter().zip(units).map(|(name, unit)| format!("{name} ({unit})"));
                        each.collect::<Vec<_>>().join(", ")
                    }
                }
            }

            /// Names and shapes of the tensors that the network needs, running statistics included.
            pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
                self.needed().into_iter().map(|tensor| (tensor.name, tensor.shape)).collect()
            }

            /// Names in `weights` that the network does not read, in order.
            ///
            /// # Errors
            /// The errors of making the network if names fit more than one way or a map does not
            /// fit.
            pub fn unused_tensors(&self, weights: &Weights) -> Result<Vec<String>, ModelError> {
                unused(self.name(), &self.needed(), weights)
            }

            /// The table of `meissner inspect`: the input, a line for each layer, the totals.
            pub fn to_table(&self) -> String {
                self.to_string()
            }

            /// The network in the DOT language of Graphviz.
            pub fn to_dot(&self) -> String {
                picture::dot(&self.view())
            }

            /// The network as a standalone SVG picture.
            #[cfg(feature = "svg")]
            pub fn to_svg(&self) -> String {
                picture::svg(&self.view())
            }
        }

        impl fmt::Display for $description {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.view().fmt(f)
            }
        }

        #[expect(private_interfaces, reason = "the trait cannot be named outside")]
        impl Needs for $description {
            fn network_name(&self) -> &str {
                self.name()
            }

            fn needed_tensors(&self) -> Vec<Needed> {
                self.needed()
            }
        }
    )*};
}
common!(Description, FrameDescription, AnyDescription);
