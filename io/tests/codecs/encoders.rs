//! The events that encoders refuse, and the state after a refusal.

use std::fs;
use std::io::{self, Write};

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, Place, encode, read, write};

use crate::support::{SENSOR, events};

/// The index and field of the refusal, and that nothing was written.
fn refusal(format: Format, sensor: Option<Sensor>, events: &[Event]) -> (usize, &'static str) {
    let mut bytes = Vec::new();
    let error = encode(format, sensor, events, &mut bytes).unwrap_err();
    assert!(bytes.is_empty());
    match error {
        IoError::CannotHold { index, field, .. } => (index, field),
        other => panic!("{other}"),
    }
}

#[test]
fn files_come_back_with_their_sensor() {
    let folder = tempfile::tempdir().unwrap();
    for format in [Format::Csv, Format::Npy, Format::Dat, Format::Evt3, Format::Es] {
        let path = folder.path().join("recording").with_extension(format.extension());
        write(&path, format, Some(SENSOR), &events()).unwrap();
        let recording = read(&path).unwrap();
        let sensor = (format != Format::Npy).then_some(SENSOR);
        assert_eq!((recording.format, recording.sensor, recording.events), (format, sensor, events()));
    }
}

#[test]
fn times_and_pixels_beyond_a_binary_format_are_refused_by_index_and_field() {
    let good = Event::new(0, 0, 0, true);
    for (format, most_t, side) in
        [(Format::Dat, (1_i64 << 32) - 1, 1_u16 << 14), (Format::Evt3, (1 << 40) - 1, 2048)]
    {
        let last = Event::new(most_t, side - 1, side - 1, true);
        encode(format, None, &[good, last], &mut io::sink()).unwrap();
        for (bad, field) in [
            (Event { t_us: -1, ..good }, "t_us"),
            (Event { t_us: most_t + 1, ..good }, "t_us"),
            (Event { x: side, ..good }, "x"),
            (Event { y: side, ..good }, "y"),
        ] {
            assert_eq!(refusal(format, None, &[good, bad]), (1, field));
        }
    }
}

#[test]
fn steps_back_that_a_reader_would_take_for_a_wrap_are_refused() {
    let at = |t_us| Event::new(t_us, 0, 0, true);
    let second = 1 << 24;
    assert_eq!(refusal(Format::Evt3, None, &[at(second + 5), at(second - 5)]), (1, "t_us"));
    assert_eq!(refusal(Format::Evt3, None, &[at(second - 1), at(second - 1 - (1 << 23))]), (1, "t_us"));
    assert_eq!(refusal(Format::Dat, None, &[at((1 << 31) + 7), at(7)]), (1, "t_us"));
    encode(Format::Dat, None, &[at((1 << 31) + 7), at(8)], &mut io::sink()).unwrap();
}

#[test]
fn events_beside_the_sensor_are_refused_by_every_encoder() {
    let bad = [Event::new(0, 3, 3, true), Event::new(0, 3, 4, true)];
    for format in [Format::Csv, Format::Npy, Format::Dat, Format::Evt3, Format::Es] {
        assert_eq!(refusal(format, Some(Sensor::new(4, 4)), &bad), (1, "y"));
    }
}

#[test]
fn a_sensor_that_a_header_cannot_name_is_refused() {
    for (format, sensor) in [
        (Format::Evt3, Sensor::new(2049, 10)),
        (Format::Dat, Sensor::new(10, 20_000)),
        (Format::Csv, Sensor::new(0, 10)),
    ] {
        let error = encode(format, Some(sensor), &[], &mut io::sink()).unwrap_err();
        assert!(matches!(error, IoError::Unsupported { .. }), "{error}");
    }
}

#[test]
fn formats_that_are_only_read_are_refused() {
    for format in Format::ALL.into_iter().filter(|f| !f.is_writable()) {
        let error = encode(format, None, &[], &mut io::sink()).unwrap_err();
        let expected =
            format!("unsupported: expected CSV, npy, DAT, EVT3 or ES to be written, found {format}");
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn a_refused_write_leaves_the_file_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept.dat");
    fs::write(&path, "before").unwrap();
    write(&path, Format::Dat, None, &[Event::new(-1, 0, 0, true)]).unwrap_err();
    assert_eq!(fs::read(&path).unwrap(), b"before");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent.raw");
    let error = read(&path).unwrap_err();
    assert!(matches!(&error, IoError::File { action: "read", path: named, .. } if *named == path), "{error}");
    let error = write(&path.join("below"), Format::Csv, None, &[]).unwrap_err();
    assert!(matches!(error, IoError::File { action: "create", .. }), "{error}");
}

#[test]
fn a_stream_that_fails_is_refused_with_the_bytes_written() {
    struct Full(usize);
    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let taken = bytes.len().min(self.0);
            self.0 -= taken;
            if taken == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(taken) }
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let error = encode(Format::Npy, None, &events(), &mut Full(200)).unwrap_err();
    assert!(matches!(error, IoError::Stream { action: "write", place: Place::Byte(200), .. }), "{error}");
}
