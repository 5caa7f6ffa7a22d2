//! Events in, records out; the format stands in [`super`].

use std::io::{self, Write};

use meissner_engine::Event;

/// The records start at a multiple of this many bytes, as `numpy.save` does.
const ALIGNMENT: usize = 64;
/// Magic, version, and length of the header.
const FIXED: usize = 10;
/// Bytes of a record.
const STRIDE: usize = 13;

/// Writes the header and a record for each of `events`.
pub(crate) fn encode(events: &[Event], out: &mut impl Write) -> io::Result<()> {
    let mut header = format!(
        "{{'descr': [('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')], 'fortran_order': False, 'shape': ({},), }}",
        events.len()
    );
    let length = (FIXED + header.len() + 1).next_multiple_of(ALIGNMENT) - FIXED;
    header.extend(std::iter::repeat_n(' ', length - 1 - header.len()));
    header.push('\n');
    out.write_all(super::MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&(length as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    for event in events {
        let mut record = [0; STRIDE];
        record[..8].copy_from_slice(&event.t_us.to_le_bytes());
        record[8..10].copy_from_slice(&event.x.to_le_bytes());
        record[10..12].copy_from_slice(&event.y.to_le_bytes());
        record[12] = event.on.into();
        out.write_all(&record)?;
    }
    Ok(())
}
