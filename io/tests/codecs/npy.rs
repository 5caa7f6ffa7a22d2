//! `NumPy` structured arrays, read and written.

use meissner_engine::Event;
use meissner_io::{Format, IoError, Place, decode, decode_with};
use proptest::prelude::*;

use meissner_io_tests::codecs::{SENSOR, any_event, encoded, strictly};

/// A file of version 1 with this dictionary and these records.
fn npy(dictionary: &str, records: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((dictionary.len() as u16).to_le_bytes());
    bytes.extend(dictionary.as_bytes());
    bytes.extend(records);
    bytes
}

fn of_fields(fields: &str, records: &[u8]) -> Vec<u8> {
    npy(&format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': (1,), }}\n"), records)
}

#[test]
fn fields_are_found_by_name_in_any_order_and_integer_type() {
    let big = of_fields(
        "('on', '|b1'), ('y', '>i2'), ('x', '>u4'), ('t', '>i8')",
        &[1, 0, 9, 0, 0, 0, 7, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xfe],
    );
    assert_eq!(decode(&big).unwrap().events, [Event::new(-2, 7, 9, true)]);
    let little = of_fields(
        "('t', '<i4'), ('p', '|i1'), ('x', '|u1'), ('y', '<i8')",
        &[0xfd, 0xff, 0xff, 0xff, 0xff, 200, 9, 0, 0, 0, 0, 0, 0, 0],
    );
    assert_eq!(decode(&little).unwrap().events, [Event::new(-3, 200, 9, false)]);
}

#[test]
fn padding_titles_and_other_fields_are_passed_over() {
    let fields = "(('Time', 't'), '<u2'), ('', '|V3'), ('w', '<f8'), ('s', '<U2'), ('x', 'u1'), ('y', 'u1'), ('p', 'u1')";
    let mut record = vec![5, 1];
    record.extend([0xee; 3 + 8 + 8]);
    record.extend([7, 8, 1]);
    assert_eq!(decode(&of_fields(fields, &record)).unwrap().events, [Event::new(261, 7, 8, true)]);
}

#[test]
fn what_numpy_writes_for_an_aligned_array_is_read() {
    // np.zeros(1, np.dtype([('t', 'i8'), ('x', 'u2'), ('y', 'u2'), ('p', 'bool')], align=True))
    let fields = "('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|b1'), ('', '|V3')";
    assert_eq!(decode(&of_fields(fields, &[0; 16])).unwrap().events, [Event::new(0, 0, 0, false)]);
}

#[test]
fn a_missing_field_is_named() {
    let error = decode(&of_fields("('t', '<i8'), ('x', '<u2'), ('y', '<u2')", &[0; 12])).unwrap_err();
    assert!(error.to_string().contains("field p (polarity)"), "{error}");
}

#[test]
fn a_time_that_is_a_float_is_refused() {
    let error =
        decode(&of_fields("('t', '<c8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')", &[0; 13])).unwrap_err();
    assert!(matches!(&error, IoError::Malformed { what: "field t (time)", .. }), "{error}");
}

#[test]
fn values_that_no_event_has_are_refused_with_their_byte_by_a_strict_reader() {
    let fields = "('t', '<u8'), ('x', '<i4'), ('y', '<u2'), ('p', '|u1')";
    let start = of_fields(fields, &[]).len();
    for (at, what) in [(7, "time t"), (11, "column x"), (14, "polarity p")] {
        let mut record = [0; 15];
        record[at] = 0x80;
        let error = strictly(&of_fields(fields, &record)).unwrap_err();
        let IoError::Malformed { what: found, place: Place::Byte(byte), .. } = error else {
            panic!("{error}")
        };
        let offset = [("time t", 0), ("column x", 8), ("polarity p", 14)].into_iter().find(|o| o.0 == what);
        assert_eq!((found, byte as usize), (what, start + offset.unwrap().1));
    }
}

#[test]
fn an_array_that_is_not_structured_or_not_of_one_dimension_is_refused() {
    for dictionary in [
        "{'descr': '<i8', 'fortran_order': False, 'shape': (3, 4), }",
        "{'descr': [('t', '<i8')], 'fortran_order': False, 'shape': (3, 4), }",
        "{'descr': [('t', '<i8')], 'fortran_order': False, 'shape': (), }",
        "{'descr': [('t', '|O')], 'fortran_order': False, 'shape': (1,), }",
        "{'descr': [('t', [('a', '<i8')])], 'fortran_order': False, 'shape': (1,), }",
        "{'descr': [('t', '<i8', (2,))], 'fortran_order': False, 'shape': (1,), }",
        "{'descr': __import__('os'), 'shape': (1,), }",
        "{'shape': (1,), }",
        "",
    ] {
        let error = decode(&npy(dictionary, &[0; 96])).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "header", .. }), "{dictionary}: {error}");
    }
}

#[test]
fn lengths_of_2_to_the_63_are_refused() {
    let fields = "('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')";
    for count in ["9223372036854775808", "18446744073709551615", "1000000000000"] {
        let file = npy(&format!("{{'descr': [{fields}], 'shape': ({count},)}}"), &[0; 13]);
        let error = decode(&file).unwrap_err();
        assert!(matches!(error, IoError::Truncated { what: "array", actual: 13, .. }), "{error}");
    }
    let huge = of_fields(&format!("('a', 'V4294967295'), {fields}"), &[0; 13]);
    assert!(matches!(decode(&huge).unwrap_err(), IoError::Truncated { .. }));
    let beyond = of_fields(&format!("('a', 'V9223372036854775808'), {fields}"), &[0; 13]);
    assert!(matches!(decode(&beyond).unwrap_err(), IoError::Malformed { .. }));
    let header = b"\x93NUMPY\x02\x00\xff\xff\xff\xff{";
    let error = decode(header).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { limit: 65536, actual: 0xffff_ffff, .. }), "{error}");
}

#[test]
fn bytes_after_the_array_are_refused() {
    let mut bytes = encoded(Format::Npy, None, &[Event::new(1, 2, 3, true)]);
    bytes.push(0);
    let error = decode(&bytes).unwrap_err();
    assert!(
        matches!(&error, IoError::Malformed { what: "array", actual, .. } if actual == "14 bytes of events")
    );
}

#[test]
fn the_records_start_at_a_multiple_of_64_bytes() {
    for count in [0, 1, 10, 100_000] {
        let bytes = encoded(Format::Npy, Some(SENSOR), &vec![Event::new(0, 0, 0, true); count]);
        assert_eq!((bytes.len() - 13 * count) % 64, 0);
        assert_eq!(bytes[bytes.len() - 13 * count - 1], b'\n');
    }
}

#[test]
fn the_magic_is_checked_where_the_format_is_given() {
    assert!(matches!(decode_with(b"\x93NUMPX\x01\x00", Format::Npy).unwrap_err(), IoError::Malformed { .. }));
}

proptest! {
    #[test]
    fn every_event_comes_back(events in prop::collection::vec(any_event(any::<i64>(), u16::MAX), 0..50)) {
        prop_assert_eq!(decode(&encoded(Format::Npy, None, &events)).unwrap().events, events);
    }
}
