//! The descriptions and weights that come with the crate, by name.
//!
//! Every description is always included. Weights are included if the cargo feature with the
//! network's name is on; by default, all are on.

use crate::description::frames::FrameDescription;
use crate::description::{AnyDescription, Description, DescriptionError};
use crate::error::ModelError;
use crate::weights::Weights;
use crate::weights::card::Card;

/// The default network: small enough for a laptop, with the published one's shape.
pub const DEFAULT_NETWORK: &str = "tactigraph-past";

/// A description with its weights.
struct Shipped {
    name: &'static str,
    description: &'static str,
    /// `None` if the feature with the network's name is off.
    weights: Option<&'static [u8]>,
}

/// A network by its name, with its weights.
macro_rules! shipped {
    ($name:tt, $weights:path) => {
        Shipped {
            name: $name,
            description: include_str!(concat!("../networks/", $name, ".toml")),
            #[cfg(feature = $name)]
            weights: Some($weights),
            #[cfg(not(feature = $name))]
            weights: None,
        }
    };
}

/// Networks over events.
static EVENTS: [Shipped; 15] = [
    shipped!("digits-all", meissner_weights_digits::DIGITS_ALL),
    shipped!("digits-frozen", meissner_weights_digits::DIGITS_PAST),
    shipped!("digits-past", meissner_weights_digits::DIGITS_PAST),
    shipped!("force-graph", meissner_weights_force::FORCE_GRAPH),
    shipped!("graphres", meissner_weights_angle::GRAPHRES),
    shipped!("graphres-published", meissner_weights_angle::GRAPHRES_PUBLISHED),
    shipped!("tactigraph", meissner_weights_angle::TACTIGRAPH),
    shipped!("tactigraph-frozen", meissner_weights_angle::TACTIGRAPH_FROZEN),
    shipped!("tactigraph-past", meissner_weights_angle::TACTIGRAPH_PAST),
    shipped!("tactip", meissner_weights_angle::TACTIP),
    shipped!("tactip-past", meissner_weights_angle::TACTIP_PAST),
    shipped!("tactip-shear", meissner_weights_angle::TACTIP_SHEAR),
    shipped!("touch-containers", meissner_weights_touch::TOUCH_CONTAINERS),
    shipped!("touch-letters", meissner_weights_touch::TOUCH_LETTERS),
    shipped!("touch-objects", meissner_weights_touch::TOUCH_OBJECTS),
];

/// Frame networks.
static FRAMES: [Shipped; 13] = [
    shipped!("canf", meissner_weights_area::CANF),
    shipped!("canf-live", meissner_weights_area::CANF_LIVE),
    shipped!("canf-plain", meissner_weights_area::CANF_PLAIN),
    shipped!("event-frame-cnn", meissner_weights_angle::EVENT_FRAME_CNN),
    shipped!("force-cnnlstm", meissner_weights_force::FORCE_CNNLSTM),
    shipped!("force-convlstm", meissner_weights_force::FORCE_CONVLSTM),
    shipped!("force-lstm", meissner_weights_force::FORCE_LSTM),
    shipped!("force-tdnn", meissner_weights_force::FORCE_TDNN),
    shipped!("slip-best", meissner_weights_slip::SLIP_BEST),
    shipped!("slip-lstm", meissner_weights_slip::SLIP_LSTM),
    shipped!("slip-regularised", meissner_weights_slip::SLIP_REGULARISED),
    shipped!("slip-tuned", meissner_weights_slip::SLIP_TUNED),
    shipped!("tactip-frames", meissner_weights_angle::TACTIP_FRAMES),
];

static EVENT_NAMES: [&str; EVENTS.len()] = names(&EVENTS);
static FRAME_NAMES: [&str; FRAMES.len()] = names(&FRAMES);

const fn names<const N: usize>(shipped: &[Shipped; N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut i = 0;
    while i < N {
        names[i] = shipped[i].name;
        i += 1;
    }
    names
}

/// The description of `name` in `list`, as `parse` reads it.
fn description<T>(
    list: &[Shipped],
    name: &str,
    parse: impl Fn(&str) -> Result<T, DescriptionError>,
) -> Option<T> {
    let shipped = list.iter().find(|shipped| shipped.name == name)?;
    Some(parse(shipped.description).expect("shipped descriptions are consistent"))
}

impl Description {
    /// The description of a network over events that comes with the crate.
    ///
    /// # Panics
    /// Never: the tests parse every one.
    pub fn shipped(name: &str) -> Option<Self> {
        description(&EVENTS, name, Self::parse)
    }

    /// The text of that description.
    pub fn shipped_text(name: &str) -> Option<&'static str> {
        EVENTS.iter().find(|shipped| shipped.name == name).map(|shipped| shipped.description)
    }

    /// Names that [`Self::shipped`] knows.
    pub fn shipped_names() -> &'static [&'static str] {
        &EVENT_NAMES
    }
}

impl FrameDescription {
    /// The description of a frame network that comes with the crate.
    ///
    /// # Panics
    /// Never: the tests parse every one.
    pub fn shipped(name: &str) -> Option<Self> {
        description(&FRAMES, name, Self::parse)
    }

    /// Names that [`Self::shipped`] knows.
    pub fn shipped_names() -> &'static [&'static str] {
        &FRAME_NAMES
    }
}

impl AnyDescription {
    /// The description of a network of either kind that comes with the crate.
    pub fn shipped(name: &str) -> Option<Self> {
        let frames = || FrameDescription::shipped(name).map(Self::Frames);
        Description::shipped(name).map(Self::Events).or_else(frames)
    }

    /// The text of the description file of a network that comes with the crate.
    pub fn shipped_text(name: &str) -> Option<&'static str> {
        Shipped::find(name).map(|shipped| shipped.description)
    }

    /// Names that [`Self::shipped`] knows: networks over events, then frame networks.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> {
        EVENT_NAMES.iter().chain(&FRAME_NAMES).copied()
    }
}

impl Shipped {
    fn find(name: &str) -> Option<&'static Self> {
        EVENTS.iter().chain(&FRAMES).find(|shipped| shipped.name == name)
    }
}

impl Weights {
    /// Weights of a network that comes with the crate. "digits-frozen" has those of "digits-past".
    /// `None` for another name, and if the build [left them out](Self::left_out).
    ///
    /// # Panics
    /// Never: the tests read every file.
    pub fn shipped(name: &str) -> Option<Self> {
        Some(Self::from_bytes(Shipped::find(name)?.weights?).expect("shipped weights are readable"))
    }

    /// The reason why [`Self::shipped`] has no weights for a network that comes with the crate: the
    /// build left out the feature of that name. `None` if it has them, and for another name.
    pub fn left_out(name: &str) -> Option<ModelError> {
        let shipped = Shipped::find(name).filter(|shipped| shipped.weights.is_none())?;
        Some(ModelError::LeftOut { network: shipped.name })
    }
}

impl Card {
    /// The card of the weights of a network that comes with the crate. `None` as for
    /// [`Weights::shipped`].
    ///
    /// # Panics
    /// Never: the tests read every card.
    pub fn shipped(name: &str) -> Option<Self> {
        Some(Weights::shipped(name)?.card().expect("shipped weights have a card"))
    }
}
