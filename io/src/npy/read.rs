//! Records in, events out; the format stands in [`super`].

use meissner_engine::Event;

use super::header::{Field, Kind, Layout};
use crate::bytes::{Bytes, array};
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::recording::{Recording, Salvage};

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let format = Format::Npy;
    let file = Bytes::new(format, bytes, Place::Byte(0));
    let layout = Layout::parse(file)?;
    let records = &bytes[layout.start..];
    let promised = layout.count.saturating_mul(layout.stride as u64);
    let there = records.len() as u64;
    let salvaged = (there < promised && salvage).then(|| {
        let rest = records.len().checked_rem(layout.stride).unwrap_or(0);
        let place = file.place(bytes.len() - rest);
        Salvage { what: "array", place, bytes_not_read: rest as u64 }
    });
    if there < promised && !salvage {
        return Err(IoError::Truncated {
            format,
            what: "array",
            place: file.place(layout.start),
            expected: promised,
            actual: there,
        });
    }
    if there > promised {
        let expected = format!("the end of the file after {} events", layout.count);
        return Err(file.malformed("array", layout.start, expected, format!("{there} bytes of events")));
    }

    let mut events = Vec::with_capacity((layout.count as usize).min(records.len()));
    for (index, record) in records.chunks_exact(layout.stride).enumerate() {
        let event = event(&layout, record).map_err(|fault| {
            let (what, field, expected) = match fault {
                Fault::Time => ("time t", layout.t, "a time from -2^63 to 2^63 - 1"),
                Fault::X => ("column x", layout.x, "0 to 65535"),
                Fault::Y => ("row y", layout.y, "0 to 65535"),
                Fault::Polarity => ("polarity p", layout.p, "0, 1 or -1"),
            };
            let at = layout.start + index * layout.stride + field.offset;
            file.malformed(what, at, expected, value(field, record).to_string())
        })?;
        events.push(event);
    }
    Ok(Recording { format, sensor: None, events, other_streams: Vec::new(), salvaged })
}

/// The field of a record that holds what an event cannot.
enum Fault {
    Time,
    X,
    Y,
    Polarity,
}

fn event(layout: &Layout, record: &[u8]) -> Result<Event, Fault> {
    Ok(Event {
        t_us: value(layout.t, record).try_into().map_err(|_| Fault::Time)?,
        x: value(layout.x, record).try_into().map_err(|_| Fault::X)?,
        y: value(layout.y, record).try_into().map_err(|_| Fault::Y)?,
        on: match value(layout.p, record) {
            1 => true,
            0 | -1 => false,
            _ => return Err(Fault::Polarity),
        },
    })
}

/// The value of a field; wide enough for every integer type.
#[inline]
fn value(field: Field, record: &[u8]) -> i128 {
    let bytes = &record[field.offset..];
    let Kind::Integer { bytes: width, signed, big_endian } = field.kind else {
        return bytes[0].into();
    };
    let unsigned = match (width, big_endian) {
        (1, _) => bytes[0].into(),
        (2, false) => u16::from_le_bytes(array(bytes)).into(),
        (2, true) => u16::from_be_bytes(array(bytes)).into(),
        (4, false) => u32::from_le_bytes(array(bytes)).into(),
        (4, true) => u32::from_be_bytes(array(bytes)).into(),
        (_, false) => u64::from_le_bytes(array(bytes)),
        (_, true) => u64::from_be_bytes(array(bytes)),
    };
    if signed {
        // Shifted up and back down, the sign bit of the narrow type fills the upper bits.
        let shift = 64 - 8 * width as u32;
        i128::from((unsigned << shift) as i64 >> shift)
    } else {
        unsigned.into()
    }
}
