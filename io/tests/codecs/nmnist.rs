//! N-MNIST: five bytes an event, no header.

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, Place, ReadOptions, decode, decode_with};
use proptest::prelude::*;

use crate::support::{any_event, nmnist};

#[test]
fn polarity_is_the_top_bit_of_a_time_of_23_bits() {
    let recording = decode(&[33, 2, 0xff, 0xff, 0xff, 0, 0, 0x00, 0x01, 0x02]).unwrap();
    assert_eq!((recording.format, recording.sensor), (Format::Nmnist, Some(Sensor::new(34, 34))));
    assert_eq!(recording.events, [Event::new(0x007f_ffff, 33, 2, true), Event::new(0x102, 0, 0, false)]);
}

#[test]
fn a_pixel_beside_the_sensor_is_refused_with_its_byte_by_a_strict_reader() {
    let strict = ReadOptions::from(Format::Nmnist).strict(true);
    let error = decode_with(&[0, 0, 0, 0, 0, 34, 0, 0, 0, 0], strict).unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { place: Place::Byte(5), x: 34, .. }), "{error}");
}

#[test]
fn a_cut_event_is_refused_with_its_byte() {
    let error = decode_with(&[0; 13], Format::Nmnist).unwrap_err();
    assert_eq!(
        error.to_string(),
        "N-MNIST: the last event at byte 10 is cut short: expected 5 bytes, found 3"
    );
}

proptest! {
    #[test]
    fn every_event_comes_back(events in prop::collection::vec(any_event(0..1_i64 << 23, 34), 1..50)) {
        prop_assert_eq!(decode(&nmnist(&events)).unwrap().events, events);
    }
}
