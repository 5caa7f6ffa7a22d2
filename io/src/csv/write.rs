//! Events in, lines out; the format stands in [`super`].

use std::io::{self, Write};

use meissner_engine::{Event, Sensor};

/// Writes the geometry as a comment where it is known, the header, and a line for each of `events`.
pub(crate) fn encode(sensor: Option<Sensor>, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    if let Some(sensor) = sensor {
        writeln!(out, "# sensor {sensor}")?;
    }
    writeln!(out, "t,x,y,p")?;
    for Event { t_us, x, y, on } in events {
        writeln!(out, "{t_us},{x},{y},{}", u8::from(*on))?;
    }
    Ok(())
}
