//! CSV, whole and line by line.

use std::error::Error;
use std::io::{self, BufReader, Read, Write};

use meissner_engine::{Event, Sensor};
use meissner_io::limits::LINE_BYTES;
use meissner_io::{CsvEvents, Format, IoError, Place, decode};
use proptest::prelude::*;

use meissner_io_tests::codecs::{Endless, any_event, encoded};

fn read(text: &str) -> Result<Vec<Event>, IoError> {
    CsvEvents::new(text.as_bytes()).collect()
}

#[test]
fn without_a_header_the_columns_are_t_x_y_p() {
    assert_eq!(read("5,1,2,1\n6,3,4,0").unwrap(), [Event::new(5, 1, 2, true), Event::new(6, 3, 4, false)]);
}

#[test]
fn a_header_names_the_columns_in_any_order_and_others_are_passed_over() {
    let text = "\"P\", y ,label,Timestamp,x\r\n-1,2,edge,5,1\r\n+1,2,,6,1\r\n";
    assert_eq!(read(text).unwrap(), [Event::new(5, 1, 2, false), Event::new(6, 1, 2, true)]);
}

#[test]
fn polarity_is_0_or_1_or_minus_1_or_plus_1_or_a_boolean() {
    let text = "t,x,y,on\n0,0,0,0\n0,0,0,-1\n0,0,0,False\n0,0,0,1\n0,0,0,+1\n0,0,0,True\n0,0,0,1.0\n";
    let on: Vec<_> = read(text).unwrap().iter().map(|e| e.on).collect();
    assert_eq!(on, [false, false, false, true, true, true, true]);
    let error = read("t,x,y,p\n0,0,0,2").unwrap_err();
    assert_eq!(error.to_string(), "CSV: polarity p at line 2: expected 0, 1, -1 or +1, found `2`");
}

#[test]
fn comments_blank_lines_a_byte_order_mark_spaces_and_quotes_are_accepted() {
    let text = "\u{feff}# by hand\n\nt,x,y,p\n  5 ,\t1, 2 ,\"1\"\n\n# between\n6,1,2,1\n";
    assert_eq!(read(text).unwrap().len(), 2);
}

#[test]
fn a_whole_number_with_a_point_is_a_time_and_a_fraction_is_refused_by_its_unit() {
    assert_eq!(read("12.000,0,0,1").unwrap()[0].t_us, 12);
    assert_eq!(read("-12,0,0,1").unwrap()[0].t_us, -12);
    let error = read("t,x,y,p\n1,0,0,1\n0.0125,0,0,1").unwrap_err();
    assert_eq!(
        error.to_string(),
        "CSV: time t at line 3: expected a whole number of microseconds (a fraction suggests seconds), found `0.0125`"
    );
}

#[test]
fn times_beyond_64_bits_and_pixels_beyond_16_bits_are_refused() {
    assert_eq!(read("9223372036854775807,0,0,1").unwrap()[0].t_us, i64::MAX);
    assert_eq!(read("-9223372036854775808,0,0,1").unwrap()[0].t_us, i64::MIN);
    for line in [
        "9223372036854775808,0,0,1",
        ".0,0,0,1",
        "-,0,0,1",
        "1.0.0,0,0,1",
        "0,65536,0,1",
        "0,0,-1,1",
        "0,,0,1",
        "1e,0,0,1",
        "1e19,0,0,1",
        "0,1e5,0,1",
        "0,1e-1,0,1",
        "0,0,0,",
    ] {
        let read = read(&format!("t,x,y,p\n{line}"));
        assert!(matches!(read, Err(IoError::Malformed { place: Place::Line(2), .. })), "{line}");
    }
}

#[test]
fn a_line_with_too_few_or_too_many_fields_is_refused() {
    let error = read("5,1,2,1\n6,1\n").unwrap_err();
    assert_eq!(error.to_string(), "CSV: line at line 2: expected 4 fields, found 2 in `6,1`");
    assert!(read("5,1,2,1,9\n").is_err());
}

#[test]
fn a_header_that_lacks_a_column_or_has_it_twice_is_refused() {
    for header in ["t_h,x,y,p", "t,x,y", "t,time,x,y,p"] {
        let error = read(&format!("{header}\n0,0,0,0,0\n")).unwrap_err();
        assert!(matches!(error, IoError::Malformed { place: Place::Line(1), .. }), "{error}");
    }
}

#[test]
fn a_comment_names_the_sensor_and_events_beside_it_are_refused() {
    let recording = decode(b"# sensor 346x260\nt,x,y,p\n0,345,259,1\n").unwrap();
    assert_eq!(recording.sensor, Some(Sensor::new(346, 260)));
    let error = decode(b"# sensor 346x260\n0,346,0,1\n").unwrap_err();
    assert!(matches!(error, IoError::OutsideSensor { place: Place::Line(2), x: 346, .. }), "{error}");
    let error = decode(b"# sensor 0x260\n0,0,0,1\n").unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "sensor in a comment", .. }), "{error}");
}

#[test]
fn an_event_is_there_as_soon_as_its_line_is() {
    let (reader, mut writer) = io::pipe().unwrap();
    let mut events = CsvEvents::new(BufReader::new(reader));
    // If the reader read beyond the line, this would wait forever: the pipe contains nothing more.
    for t in 0..5 {
        writeln!(writer, "{t},1,2,1").unwrap();
        assert_eq!(events.next().unwrap().unwrap(), Event::new(t, 1, 2, true));
    }
    drop(writer);
    assert!(events.next().is_none());
}

#[test]
fn nothing_is_read_before_the_first_event_is_asked_for() {
    struct Untouched;
    impl Read for Untouched {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            panic!("read")
        }
    }
    assert_eq!(CsvEvents::new(BufReader::new(Untouched)).sensor(), None);
}

#[test]
fn a_live_stream_goes_on_after_a_bad_line() {
    let mut events = CsvEvents::new("5,1,2,1\nnoise\n6,1,2,1\n".as_bytes());
    assert!(events.next().unwrap().is_ok());
    assert!(events.next().unwrap().is_err());
    assert_eq!(events.next().unwrap().unwrap().t_us, 6);
    assert!(events.next().is_none());
}

#[test]
fn a_failing_reader_ends_the_events_with_its_error() {
    struct Failing;
    impl Read for Failing {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("unplugged"))
        }
    }
    let mut events = CsvEvents::new(BufReader::new("5,1,2,1\n6,".as_bytes().chain(Failing)));
    assert!(events.next().unwrap().is_ok());
    let error = events.next().unwrap().unwrap_err();
    assert_eq!(error.to_string(), "CSV: cannot read at line 2");
    assert_eq!(error.source().expect("why").to_string(), "unplugged");
    assert!(events.next().is_none());
}

#[test]
fn a_line_without_end_is_refused_after_4096_bytes() {
    let mut events = CsvEvents::new(BufReader::with_capacity(512, Endless { left: 2 * LINE_BYTES }));
    let error = events.next().unwrap().unwrap_err();
    assert!(
        matches!(error, IoError::TooLarge { limit: 4096, at_least: true, place: Place::Line(1), .. }),
        "{error}"
    );
    assert!(events.next().is_none());
}

proptest! {
    #[test]
    fn every_event_comes_back(
        events in prop::collection::vec(any_event(any::<i64>(), u16::MAX), 0..50),
        named in any::<bool>(),
    ) {
        let sensor = named.then_some(Sensor::new(u16::MAX, u16::MAX));
        let recording = decode(&encoded(Format::Csv, sensor, &events)).unwrap();
        prop_assert_eq!((recording.sensor, recording.events), (sensor, events));
    }
}
