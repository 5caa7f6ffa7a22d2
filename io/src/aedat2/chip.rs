//! The chips that AEDAT 2.0 can name.

use std::str::FromStr;

use meissner_engine::Sensor;

use crate::format::UnknownName;

/// A chip of AEDAT 2.0, whose addresses are known.
///
/// ```
/// use meissner_engine::Sensor;
/// use meissner_io::Chip;
///
/// assert_eq!("DAVIS346".parse::<Chip>()?.sensor(), Sensor::new(346, 260));
/// # Ok::<(), meissner_io::UnknownName>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chip {
    pub(super) sensor: Sensor,
    pub(super) is_davis: bool,
}

/// The names of the chips, for messages.
pub(super) const NAMES: &str = "DVS128, DAVIS128, DAVIS208, DAVIS240, DAVIS346 or DAVIS640";

impl Chip {
    pub(super) const DVS128: Self = Self { sensor: Sensor { width: 128, height: 128 }, is_davis: false };

    /// Its pixels.
    pub fn sensor(self) -> Sensor {
        self.sensor
    }

    /// The chip with this sensor; for 128 x 128 pixels, which two chips have, the DVS128.
    pub(super) fn of_sensor(sensor: Sensor) -> Option<Self> {
        CHIPS.iter().map(|&(name, _)| name).filter_map(Self::of_class).find(|chip| chip.sensor == sensor)
    }

    /// The chip of the class of this name.
    pub(super) fn of_class(name: &str) -> Option<Self> {
        let is_dvs128 = ["dvs128", "tmpdiff128"]
            .iter()
            .any(|chip| name.get(..chip.len()).is_some_and(|start| start.eq_ignore_ascii_case(chip)));
        Some(Self { sensor: sensor_of(name)?, is_davis: !is_dvs128 })
    }
}

impl FromStr for Chip {
    type Err = UnknownName;

    /// The chip of this name, in upper or lower case: `DVS128`, `DAVIS128`, `DAVIS208`, `DAVIS240`,
    /// `DAVIS346` or `DAVIS640`, also with letters after it, as in the classes of jAER
    /// (`DAVIS346blue`).
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        Self::of_class(name).ok_or_else(|| UnknownName::new("chip", NAMES, name))
    }
}

/// The beginnings of the names of chips in lower case, with their pixels.
const CHIPS: [(&str, [u16; 2]); 9] = [
    ("dvs128", [128, 128]),
    ("tmpdiff128", [128, 128]),
    ("davis128", [128, 128]),
    ("davis208", [208, 192]),
    ("davis240", [240, 180]),
    ("sbret10", [240, 180]),
    ("davis346", [346, 260]),
    ("davis640", [640, 480]),
    ("apsdvs", [240, 180]),
];

/// The sensor of the chip of this name.
pub(crate) fn sensor_of(chip: &str) -> Option<Sensor> {
    let name = chip.to_ascii_lowercase();
    let &(_, [width, height]) = CHIPS.iter().find(|(known, _)| name.starts_with(known))?;
    Some(Sensor { width, height })
}
