//! Events in, words out; the layout stands in [`super`].
//!
//! Only single events (word 0x2) are written, in the order in which they come: vectors would be shorter, but
//! would reorder the events of a row. A silence of a whole period of 2^24 microseconds is written as the two
//! time words that make a reader see the wrap, so that the written times are absolute.

use std::io::{self, Write};

use meissner_engine::{Event, Sensor};

use super::{HIGH_RANGE, SIDE, TIME_BITS, word};
use crate::check::{Held, cannot_hold};
use crate::error::IoError;
use crate::format::Format;

/// Latest time that is written: 12.7 days, for which a file starts with 256 KiB of wraps.
const MAX_T_US: i64 = (1 << 40) - 1;

/// Refuses the events that the format cannot hold.
pub(crate) fn check(events: &[Event]) -> Result<(), IoError> {
    let held = Held { format: Format::Evt3, most_t_us: MAX_T_US, side: SIDE };
    let mut newest_us = 0;
    for (index, event) in events.iter().enumerate() {
        held.check(index, event)?;
        let same_period = newest_us >> (2 * TIME_BITS) == event.t_us >> (2 * TIME_BITS);
        let fall = (newest_us >> TIME_BITS) - (event.t_us >> TIME_BITS);
        if event.t_us < newest_us && (!same_period || fall >= i64::from(HIGH_RANGE / 2)) {
            let expected = "in order, or less than 2^23 us earlier in the same 2^24 us";
            let actual = format!("{} after {newest_us}", event.t_us);
            return Err(cannot_hold(Format::Evt3, index, "t_us", expected, actual));
        }
        newest_us = event.t_us;
    }
    Ok(())
}

/// Writes the header and the words of `events`, which [`check`] has passed.
pub(crate) fn encode(sensor: Option<Sensor>, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "% evt 3.0")?;
    match sensor {
        Some(Sensor { width, height }) => {
            writeln!(out, "% format EVT3;height={height};width={width}\n% geometry {width}x{height}")?;
        }
        None => writeln!(out, "% format EVT3")?,
    }
    writeln!(out, "% end")?;
    let mut state = State::default();
    for event in events {
        state.write(event, out)?;
    }
    Ok(())
}

/// What a reader knows so far.
#[derive(Default)]
struct State {
    period: i64,
    high: Option<u16>,
    low: Option<u16>,
    y: Option<u16>,
}

impl State {
    fn write(&mut self, event: &Event, out: &mut impl Write) -> io::Result<()> {
        while self.period < event.t_us >> (2 * TIME_BITS) {
            self.write_high(HIGH_RANGE - 1, out)?;
            self.write_high(0, out)?;
            self.period += 1;
        }
        self.write_high((event.t_us >> TIME_BITS) as u16 & (HIGH_RANGE - 1), out)?;
        let low = event.t_us as u16 & (HIGH_RANGE - 1);
        if self.low != Some(low) {
            put(word::TIME_LOW, low, out)?;
            self.low = Some(low);
        }
        if self.y != Some(event.y) {
            put(word::Y, event.y, out)?;
            self.y = Some(event.y);
        }
        put(word::X, event.x | u16::from(event.on) << 11, out)
    }

    fn write_high(&mut self, high: u16, out: &mut impl Write) -> io::Result<()> {
        if self.high != Some(high) {
            put(word::TIME_HIGH, high, out)?;
            self.high = Some(high);
            // Readers differ in whether the lower bits outlive this word: they are said again.
            self.low = None;
        }
        Ok(())
    }
}

fn put(kind: u16, value: u16, out: &mut impl Write) -> io::Result<()> {
    out.write_all(&(kind << 12 | value).to_le_bytes())
}
