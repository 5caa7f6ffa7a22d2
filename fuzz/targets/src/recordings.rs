//! Bytes as recordings: a typed error, or events that keep their promises and survive being written and read again.

use std::io::BufReader;

use meissner_engine::{Event, Sensor};
use meissner_io::limits::{EXPANSION, PACKET_BYTES};
use meissner_io::{
    CsvEvents, Format, IoError, ReadOptions, Recording, TextOptions, TimeUnit, decode, decode_as,
    decode_with, encode,
};

use crate::choices::Choices;
use crate::target::Verdict;

/// Longest message of an error: what a file says is quoted in part.
const MESSAGE_BYTES: usize = 8 << 10;
/// Events that are written and read again.
const REWRITTEN: usize = 4096;

/// AEDAT4.
///
/// # Panics
/// If a promise is broken, as every function here.
pub fn aedat4(bytes: &[u8]) -> Verdict {
    decoded(Format::Aedat4, bytes)
}

/// EVT2.
pub fn evt2(bytes: &[u8]) -> Verdict {
    decoded(Format::Evt2, bytes)
}

/// EVT3.
pub fn evt3(bytes: &[u8]) -> Verdict {
    decoded(Format::Evt3, bytes)
}

/// DAT.
pub fn dat(bytes: &[u8]) -> Verdict {
    decoded(Format::Dat, bytes)
}

/// N-MNIST.
pub fn nmnist(bytes: &[u8]) -> Verdict {
    decoded(Format::Nmnist, bytes)
}

/// npy.
pub fn npy(bytes: &[u8]) -> Verdict {
    decoded(Format::Npy, bytes)
}

/// CSV, whole and line by line: where the reader's buffer ends reaches nothing, and a bad line costs one item. What the
/// options say is read the same from a stream and from a file.
///
/// # Panics
/// If a promise is broken.
pub fn csv(bytes: &[u8]) -> Verdict {
    let columns = "txyp".parse().ok();
    let said = TextOptions { columns, time_unit: Some(TimeUnit::Microseconds) };
    for options in [TextOptions::default(), said] {
        let items = |capacity| -> Vec<Result<Event, String>> {
            let items = CsvEvents::with_options(BufReader::with_capacity(capacity, bytes), options);
            items.map(|item| item.map_err(|error| error.to_string())).collect()
        };
        let (whole, pieces) = (items(1 << 16), items(7));
        // How much of an overlong line has been seen depends on the buffer.
        let known = |items: &[Result<Event, String>]| {
            items.iter().take_while(|item| item.is_ok()).cloned().collect::<Vec<_>>()
        };
        assert_eq!((whole.len(), known(&whole)), (pieces.len(), known(&pieces)));
        let lines = bytes.split(|&b| b == b'\n').count();
        assert!(whole.len() <= lines, "{} items of {lines} lines", whole.len());
        let asked = ReadOptions { format: Some(Format::Csv), text: options, salvage: false };
        let read = decode_with(bytes, &asked).map(|recording| recording.events);
        if options == said {
            assert_eq!(read.ok(), whole.into_iter().collect::<Result<Vec<_>, _>>().ok());
        }
    }
    decoded(Format::Csv, bytes)
}

/// Whatever the content is found to be.
///
/// # Panics
/// If a promise is broken.
pub fn any_recording(bytes: &[u8]) -> Verdict {
    match decode(bytes) {
        Ok(recording) => {
            assert_eq!(decode_as(recording.format, bytes).ok().as_ref(), Some(&recording));
            keeps_its_promises(bytes, &recording);
            Verdict::Accepted
        }
        Err(error) => refused(&error),
    }
}

/// Events made of the bytes, written and read again: refused before anything is written, or equal.
pub fn convert(bytes: &[u8]) -> Verdict {
    let mut choices = Choices::new(bytes);
    let sensor = choices.flag().then(|| Sensor::new(choices.u16(), choices.u16()));
    let far = choices.flag();
    let mut now = 0_i64;
    let mut events = Vec::new();
    while !choices.is_empty() && events.len() < REWRITTEN {
        let step = if far { choices.u64() as i64 } else { i64::from(choices.u16() as i16) };
        now = now.wrapping_add(step);
        let (x, y) = (choices.u16(), choices.u16());
        let on = choices.flag();
        events.push(Event::new(now, x, y, on));
    }
    if rewritten(sensor, &events) > 0 { Verdict::Accepted } else { Verdict::Refused }
}

fn decoded(format: Format, bytes: &[u8]) -> Verdict {
    salvaged(format, bytes);
    match decode_as(format, bytes) {
        Ok(recording) => {
            assert_eq!(recording.format, format);
            keeps_its_promises(bytes, &recording);
            Verdict::Accepted
        }
        Err(error) => refused(&error),
    }
}

/// What is whole in a file that is cut short: all of a file that is not, and less than a line or word more than the rest.
fn salvaged(format: Format, bytes: &[u8]) {
    let asked = ReadOptions { format: Some(format), salvage: true, ..ReadOptions::default() };
    let salvaged = decode_with(bytes, &asked);
    match &salvaged {
        Ok(recording) => keeps_its_promises(bytes, recording),
        Err(error) => drop(refused(error)),
    }
    // A last line without a line feed is no whole one, and may be what tells the order of the columns.
    if format != Format::Csv
        && let Ok(whole) = decode_as(format, bytes)
    {
        assert_eq!(salvaged.ok().map(|recording| recording.events), Some(whole.events));
    }
}

fn refused(error: &IoError) -> Verdict {
    let message = error.to_string();
    assert!(message.contains("expected"), "{message}");
    assert!(message.len() <= MESSAGE_BYTES, "a message of {} bytes", message.len());
    Verdict::Refused
}

fn keeps_its_promises(bytes: &[u8], recording: &Recording) {
    let Recording { format, sensor, events, .. } = recording;
    let length = bytes.len() as u64;
    let most = match format {
        Format::Aedat4 => (PACKET_BYTES + length * EXPANSION) / 16,
        _ => length * 6,
    };
    assert!(events.len() as u64 <= most, "{} events of {length} bytes", events.len());
    if let Some(sensor) = sensor {
        assert!(events.iter().all(|e| sensor.contains(e.x, e.y)), "an event beside {sensor}");
    }
    rewritten(*sensor, &events[..events.len().min(REWRITTEN)]);
}

/// Writes `events` in every format that can hold them and reads them again; how many formats did.
fn rewritten(sensor: Option<Sensor>, events: &[Event]) -> usize {
    let held = [Format::Csv, Format::Npy, Format::Dat, Format::Evt3].into_iter().filter(|&format| {
        let mut bytes = Vec::new();
        if let Err(error) = encode(format, sensor, events, &mut bytes) {
            refused(&error);
            assert!(bytes.is_empty(), "{format}: written before it was refused");
            return false;
        }
        let again = decode_as(format, &bytes).unwrap_or_else(|e| panic!("{format}, written here: {e}"));
        assert_eq!(again.events, events, "{format}");
        if format != Format::Npy {
            assert_eq!(again.sensor, sensor, "{format}");
        }
        true
    });
    held.count()
}
