//! The text header of AEDAT 2.0 and the chips that it can name.
//!
//! Each line starts with `#` and ends with a line feed. The header ends after a line `# End of ASCII Header`, or before the
//! first line of another form: a line of an old header has no control characters, and a time has zeros.

use meissner_engine::Sensor;

use std::str::FromStr;

use crate::bytes::Bytes;
use crate::codec::ReadOptions;
use crate::error::{IoError, shown};
use crate::format::UnknownName;
use crate::limits::JAER_HEADER_BYTES;

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT2.0";

/// Longest rest of a file that is examined as a line of its header.
const LINE_BYTES: usize = 1 << 16;

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
const NAMES: &str = "DVS128, DAVIS128, DAVIS208, DAVIS240, DAVIS346 or DAVIS640";

impl Chip {
    pub(super) const DVS128: Self = Self { sensor: Sensor { width: 128, height: 128 }, is_davis: false };

    /// Its pixels.
    pub fn sensor(self) -> Sensor {
        self.sensor
    }

    /// The chip with this sensor; of the two with 128 x 128 pixels the DVS128.
    pub(super) fn of_sensor(sensor: Sensor) -> Option<Self> {
        CHIPS.iter().map(|&(name, _)| name).filter_map(Self::of_class).find(|chip| chip.sensor == sensor)
    }

    /// The chip of the class of this name.
    fn of_class(name: &str) -> Option<Self> {
        let is_dvs128 = ["dvs128", "tmpdiff128"]
            .iter()
            .any(|chip| name.get(..chip.len()).is_some_and(|start| start.eq_ignore_ascii_case(chip)));
        Some(Self { sensor: sensor_of(name)?, is_davis: !is_dvs128 })
    }
}

impl FromStr for Chip {
    type Err = UnknownName;

    /// The chip of this name, in upper or lower case: `DVS128`, `DAVIS128`, `DAVIS208`, `DAVIS240`, `DAVIS346` or `DAVIS640`, also with
    /// letters behind it, as the classes of jAER have them (`DAVIS346blue`).
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

/// The content of a header, and where it ends.
#[derive(Debug)]
pub(crate) struct Header {
    /// First byte after the header.
    pub(super) end: usize,
    /// The chip; `None`: neither the header nor the caller names one.
    pub(super) chip: Option<Chip>,
    /// Whether no record follows.
    pub(super) is_empty: bool,
    pub(super) strict: bool,
}

impl Header {
    /// Reads the header at the start of `file`.
    pub(super) fn parse(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError> {
        let asked = options.chip;
        let of_sensor = || options.sensor.and_then(Chip::of_sensor);
        let magic = file.get("magic", 0, MAGIC.len())?;
        if magic != MAGIC {
            return Err(file.malformed("magic", 0, shown(MAGIC), shown(magic)));
        }
        let mut header = Self { end: 0, chip: None, is_empty: true, strict: options.strict };
        let mut is_ended = false;
        while let Some(line) = line(&file.data[header.end..]).filter(|_| !is_ended) {
            let start = header.end;
            header.end += line.len();
            if header.end as u64 > JAER_HEADER_BYTES {
                return Err(file.too_large("header", 0, JAER_HEADER_BYTES, header.end as u64, true));
            }
            let text = String::from_utf8_lossy(&line[1..]);
            let text = text.trim();
            is_ended = text.eq_ignore_ascii_case("End of ASCII Header");
            if let Some(class) = text.strip_prefix("AEChip:") {
                let class = class.trim();
                let name = class.rsplit('.').next().unwrap_or_default();
                header.chip = asked.or_else(|| Chip::of_class(name)).or_else(of_sensor);
                if header.chip.is_none() {
                    return Err(file.malformed("AEChip", start, NAMES, shown(class.as_bytes())));
                }
            }
        }
        header.chip = header.chip.or(asked).or_else(of_sensor);
        let tail = &file.data[header.end..];
        header.is_empty = tail.len() < super::STRIDE;
        if header.end == 0 || (!is_ended && is_cut(tail)) {
            let what = "the header's last line, which has no line feed,";
            return Err(file.truncated(what, header.end, tail.len() as u64 + 1, false));
        }
        Ok(header)
    }
}

/// The first line of `bytes` with its line feed, if it is one of a header.
fn line(bytes: &[u8]) -> Option<&[u8]> {
    if !bytes.starts_with(b"#") {
        return None;
    }
    let end = bytes.iter().position(|&b| b < b' ' && b != b'\t')?;
    match &bytes[end..] {
        [b'\n', ..] => Some(&bytes[..=end]),
        [b'\r', b'\n', ..] => Some(&bytes[..end + 2]),
        _ => None,
    }
}

/// Whether `tail`, the rest of a file behind the last complete line, is the beginning of a line.
fn is_cut(tail: &[u8]) -> bool {
    tail.starts_with(b"#") && tail.len() < LINE_BYTES && !tail.iter().any(u8::is_ascii_control)
}
