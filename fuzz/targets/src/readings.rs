//! Bytes as readings of electrodes: typed errors by line, or finite readings.

use std::io::BufReader;

use meissner_io::{ElectrodeSettings, Electrodes};

use crate::target::Verdict;

/// Readings of electrodes, in pieces and whole.
///
/// # Panics
/// If a promise is broken.
pub fn electrodes(bytes: &[u8]) -> Verdict {
    let read = |capacity| {
        let mut readings =
            Electrodes::new(BufReader::with_capacity(capacity, bytes), ElectrodeSettings::default());
        let (mut line, mut delivered, mut refused) = (0, Vec::new(), 0);
        while let Some(item) = readings.next() {
            match item {
                Ok(reading) => {
                    assert!(reading.line > line, "line {} after line {line}", reading.line);
                    assert!(reading.values.iter().all(|value| value.is_finite()));
                    line = reading.line;
                    delivered.push((reading, readings.follows()));
                }
                Err(error) => {
                    let message = error.to_string();
                    assert!(message.contains("expected"), "{message}");
                    refused += 1;
                }
            }
        }
        assert!(readings.next().is_none(), "an item behind the end");
        (delivered, refused, readings.warnings())
    };
    let (delivered, refused, warnings) = read(1 << 16);
    // Times may be infinite in seconds where they are finite in their unit, so they are compared as text.
    assert_eq!(format!("{:?}", (&delivered, refused, warnings)), format!("{:?}", read(5)));
    if refused == 0 { Verdict::Accepted } else { Verdict::Refused }
}
