//! Tactile images and sequences: the input of the direction-of-slip networks.
//!
//! Enters: readings of 24 electrodes. Leaves: sequences of readings or images of 12 x 11, scaled;
//! readings also in two ways, side by side. The order: check, (scale the reading,) lay it out,
//! (scale the image,) collect.

mod layout;
mod scaling;
mod window;

pub use layout::{
    ELECTRODE_COLUMNS, ELECTRODE_ROWS, ELECTRODES, TACTILE_CELLS, TACTILE_COLUMNS, TACTILE_ROWS,
    TactileLayout,
};
pub use scaling::Scaling;
pub use window::{Sampling, TactileForm, TactileSequence, TactileWindow};
