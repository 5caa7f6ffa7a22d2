//! Texts of events from many programs: orders of columns, separators, units of time, and texts that
//! are refused because they could be read in several ways.

use meissner_engine::{Event, Sensor};
use meissner_io::{
    ColumnOrder, CsvEvents, IoError, Place, ReadOptions, TextOptions, TimeUnit, decode, decode_with, read,
};
use proptest::prelude::*;

use meissner_io_tests::codecs::{any_event, strictly};

/// `count` events like those of a moving edge, 40 us apart.
fn scene(count: u16) -> Vec<Event> {
    let event = |i: u16| Event::new(i64::from(i) * 40, i * 7 % 128, i * 31 % 97, i.is_multiple_of(3));
    (0..count).map(event).collect()
}

/// `events` as text, one line each.
fn lines(events: &[Event], line: impl Fn(&Event) -> String) -> String {
    events.iter().map(|event| line(event) + "\n").collect()
}

fn options(columns: Option<&str>, time_unit: Option<TimeUnit>) -> ReadOptions {
    let columns = columns.map(|columns| columns.parse().unwrap());
    ReadOptions::default().text(TextOptions::default().columns(columns).time_unit(time_unit))
}

fn seconds(t_us: i64) -> String {
    format!("{}.{:06}000", t_us / 1_000_000, t_us % 1_000_000)
}

fn first(text: &str) -> Result<Event, IoError> {
    CsvEvents::new(text.as_bytes()).next().unwrap()
}

#[test]
fn x_y_t_p_with_blanks_and_minus_1_is_read_as_it_is() {
    let events = scene(500);
    let text = lines(&events, |e| format!("{} {} {} {}", e.x, e.y, e.t_us, if e.on { 1 } else { -1 }));
    assert_eq!(decode(text.as_bytes()).unwrap().events, events);
}

#[test]
fn t_x_y_p_in_seconds_with_a_point_is_read_as_it_is() {
    let events = scene(500);
    let text = lines(&events, |e| format!("{} {} {} {}", seconds(e.t_us), e.x, e.y, u8::from(e.on)));
    assert_eq!(decode(text.as_bytes()).unwrap().events, events);
    // Line by line, the first line must decide: at time 0 it could have another order.
    let arriving: Result<Vec<_>, _> =
        CsvEvents::new(&text.as_bytes()[text.find("0.00004").unwrap()..]).collect();
    assert_eq!(arriving.unwrap(), events[1..]);
}

#[test]
fn every_order_and_separator_is_told_by_the_values_of_a_recording() {
    let events = scene(500);
    for order in ["txyp", "xytp", "xypt", "tpxy", "ptxy", "pxyt"] {
        for separator in [",", ";", " ", "\t", ", ", "   "] {
            let field = |e: &Event, letter| match letter {
                't' => e.t_us.to_string(),
                'x' => e.x.to_string(),
                'y' => e.y.to_string(),
                _ => u8::from(e.on).to_string(),
            };
            let line =
                |e: &Event| order.chars().map(|letter| field(e, letter)).collect::<Vec<_>>().join(separator);
            let recording = decode(lines(&events, line).as_bytes()).unwrap();
            assert_eq!(recording.events, events, "{order} {separator:?}");
        }
    }
}

#[test]
fn a_header_is_found_by_its_names_with_any_separator_and_in_a_comment() {
    let event = [Event::new(5, 1, 2, true)];
    for text in [
        "x y t p\n1 2 5 1\n",
        "Y;x;on;Timestamp\n2;1;1;5\n",
        "# x y t p\n1 2 5 1\n",
        "# t[us], by hand\n#pol,ts,y,x\n1,5,2,1\n",
        "x\ty\tpolarity\ttime_us\n1\t2\t1\t5\n",
        "t_ns,x,y,p\n5000,1,2,1\n",
        "time_ms,x,y,p\n0.005,1,2,1\n",
        "ts_s x y p\n0.000005 1 2 1\n",
    ] {
        assert_eq!(decode(text.as_bytes()).unwrap().events, event, "{text}");
        let arriving: Result<Vec<_>, _> = CsvEvents::new(text.as_bytes()).collect();
        assert_eq!(arriving.unwrap(), event, "{text}");
    }
}

#[test]
fn a_line_with_width_and_height_before_the_events_names_the_sensor() {
    let recording = decode(b"240 180\n0.003811000 96 133 0\n0.003820001 11 2 1\n").unwrap();
    assert_eq!(recording.sensor, Some(Sensor::new(240, 180)));
    assert_eq!(recording.events, [Event::new(3811, 96, 133, false), Event::new(3820, 11, 2, true)]);
}

#[test]
fn a_text_that_can_be_read_in_several_ways_is_refused_with_its_line_and_the_ways() {
    for (text, readings) in [
        ("# by hand\n14 27 38 1\n15 28 39 1\n", "txyp or xytp"),
        ("3;4;5;0\n3;4;5;0\n", "txyp or xytp"),
        // 32 lines of one pixel: either of two columns rises.
        (&"7,7,7,1\n".repeat(32), "txyp or xytp"),
    ] {
        let error = decode(text.as_bytes()).unwrap_err();
        let IoError::Undecided { what, line, readings: found, .. } = &error else { panic!("{error}") };
        assert_eq!((*what, found.as_str()), ("order of the columns", readings), "{text}");
        assert!(text.contains(line.trim_matches('`')) && error.to_string().contains(line), "{error}");
        let said = decode_with(text.as_bytes(), options(Some("xytp"), None)).unwrap();
        assert_eq!(said.events.len(), text.lines().filter(|line| !line.starts_with('#')).count());
    }
}

/// One late event among small times: in the order t, x, y, p, nearly every event would be late.
#[test]
fn columns_in_another_order_are_never_taken_for_late_events() {
    let mut events = scene(842);
    events[400].t_us -= 90;
    let text = lines(&events, |e| format!("{},{},{},{}", e.x, e.y, e.t_us, u8::from(e.on)));
    let error = decode(text.as_bytes()).unwrap_err();
    assert!(matches!(error, IoError::Undecided { .. }), "{error}");
    let recording = decode_with(text.as_bytes(), options(Some("xytp"), None)).unwrap();
    assert_eq!(recording.events, events);
    // Beyond 65535 the time cannot be a pixel, late or not.
    let text = lines(&events, |e| format!("{},{},{},{}", e.x, e.y, e.t_us + 70_000, u8::from(e.on)));
    assert_eq!(decode(text.as_bytes()).unwrap().events[400].t_us, events[400].t_us + 70_000);
}

#[test]
fn a_fraction_that_may_be_of_seconds_or_milliseconds_is_refused_until_the_unit_is_said() {
    let text = "0.5 3 4 1\n1.25 3 5 0\n";
    let error = decode(text.as_bytes()).unwrap_err();
    assert!(
        matches!(error, IoError::Undecided { what: "unit of time", place: Place::Line(1), .. }),
        "{error}"
    );
    let error = first(text).unwrap_err();
    assert!(matches!(error, IoError::Undecided { what: "unit of time", .. }), "{error}");
    for (unit, times) in [(TimeUnit::Seconds, [500_000, 1_250_000]), (TimeUnit::Milliseconds, [500, 1_250])] {
        let recording = decode_with(text.as_bytes(), options(None, Some(unit))).unwrap();
        assert_eq!(recording.events.iter().map(|e| e.t_us).collect::<Vec<_>>(), times);
    }
}

#[test]
fn times_with_and_without_a_point_are_not_taken_for_one_unit() {
    let error = strictly(b"t,x,y,p\n10,1,2,1\n12.34567,1,2,1\n14,1,2,1\n").unwrap_err();
    assert!(error.to_string().contains("line 3") && error.to_string().contains("microseconds"), "{error}");
    let arriving: Vec<_> = CsvEvents::new("t,x,y,p\n0.00001,1,2,1\n12,1,2,1\n".as_bytes()).collect();
    assert!(arriving[0].is_ok() && arriving[1].is_err());
}

#[test]
fn what_is_finer_than_a_microsecond_is_rounded_to_the_nearest_without_a_float() {
    let text = "t_s,x,y,p\n1468940293.9229854999,0,0,1\n1468940293.9229855,0,0,1\n9007199254.740993,0,0,1\n";
    let times: Vec<_> = decode(text.as_bytes()).unwrap().events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [1_468_940_293_922_985, 1_468_940_293_922_986, 9_007_199_254_740_993]);
    // Halves, away from zero.
    let text = "t_us,x,y,p\n-2.5,0,0,1\n-1.4999,0,0,1\n-0.5,0,0,1\n0.4999,0,0,1\n0.5,0,0,1\n1.5,0,0,1\n";
    let times: Vec<_> = decode(text.as_bytes()).unwrap().events.iter().map(|e| e.t_us).collect();
    assert_eq!(times, [-3, -1, -1, 0, 1, 2]);
    let error = decode(b"t_s,x,y,p\n9223372036854.775808,0,0,1\n").unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "time t", .. }), "{error}");
}

#[test]
fn the_first_line_of_a_stream_decides_or_is_refused() {
    // As documented, if commas separate and nothing contradicts it.
    assert_eq!(first("5,1,2,1\n").unwrap(), Event::new(5, 1, 2, true));
    // Only one order is possible.
    assert_eq!(first("1 2 1589163005561252 -1\n").unwrap(), Event::new(1_589_163_005_561_252, 1, 2, false));
    assert_eq!(
        first("120,80,1,1589163005561252\n").unwrap(),
        Event::new(1_589_163_005_561_252, 120, 80, true)
    );
    let mut ambiguous = CsvEvents::new("5 1 2 1\n6 1 2 1\n".as_bytes());
    assert!(matches!(ambiguous.next(), Some(Err(IoError::Undecided { place: Place::Line(1), .. }))));
    assert!(ambiguous.next().is_none(), "the order does not become known behind it");
    let said = TextOptions::default().columns("txyp".parse::<ColumnOrder>().unwrap());
    let events: Result<Vec<_>, _> = CsvEvents::with_options("5 1 2 1\n6 1 2 1\n".as_bytes(), said).collect();
    assert_eq!(events.unwrap().len(), 2);
}

#[test]
fn a_bad_first_line_decides_nothing() {
    // The second line is outside of the sensor as t, x, y, p, and could be p, t, x, y.
    let mut events = CsvEvents::new("# sensor 346x260\n5,1\n0,346,0,1\n7,1,2,1\n".as_bytes());
    assert!(matches!(events.next(), Some(Err(IoError::Malformed { .. }))));
    assert!(matches!(events.next(), Some(Err(IoError::OutsideSensor { .. }))));
    assert_eq!(events.next().unwrap().unwrap(), Event::new(7, 1, 2, true));
}

#[test]
fn options_stand_in_place_of_a_header_and_pass_columns_over() {
    let recording =
        decode_with(b"a,b,c,d,e\n1,2,9,5000,0\n", options(Some("xy_tp"), Some(TimeUnit::Nanoseconds)));
    assert_eq!(recording.unwrap().events, [Event::new(5, 1, 2, false)]);
    let text = b"1;2;-;0.01;0\n3;4;-;0.02;1\n";
    assert!(matches!(decode(text), Err(IoError::UnknownFormat { .. })), "five columns say nothing");
    let recording = decode_with(text, options(Some("xy_tp"), Some(TimeUnit::Milliseconds)));
    assert_eq!(recording.unwrap().events, [Event::new(10, 1, 2, false), Event::new(20, 3, 4, true)]);
    let error = decode_with(b"1,2,3,1\n", options(Some("xy_tp"), None)).unwrap_err();
    assert!(error.to_string().contains("expected 5 fields"), "{error}");
    for wrong in ["", "txy", "txypp", "txyq", "ttxyp", "txyp ", "TXYP"] {
        assert!(wrong.parse::<ColumnOrder>().is_err(), "{wrong}");
    }
    assert_eq!("xy_tp".parse::<ColumnOrder>().unwrap().to_string(), "xy_tp");
}

#[test]
fn a_file_is_found_to_be_such_a_text() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("events.txt");
    for text in ["0.003811000 96 133 0\n", "# x y t p\n\n1 2 5 1\n", "240 180\n0.25311 3 4 1\n"] {
        std::fs::write(&path, text).unwrap();
        assert_eq!(read(&path).unwrap().events.len(), 1, "{text}");
    }
    for text in ["a line of prose\n", "1 2 3\n", "1 2 3 4 5\n", "240 180\n", "a/b.png\nc.png\n"] {
        std::fs::write(&path, text).unwrap();
        assert!(matches!(read(&path), Err(IoError::UnknownFormat { .. })), "{text}");
    }
}

#[test]
fn two_lines_that_fit_only_another_order_are_refused_not_half_read() {
    let text = b"0 0 0 0\n2 2 0 2\n";
    let error = decode(text).unwrap_err();
    assert!(matches!(error, IoError::Undecided { .. }), "{error}");
    assert!(error.to_string().contains("txyp or xypt"), "{error}");
    let events = decode_with(text, options(Some("xypt"), Some(TimeUnit::Microseconds))).unwrap().events;
    assert_eq!(events, [Event::new(0, 0, 0, false), Event::new(2, 2, 2, false)]);
}

proptest! {
    /// For any values: the written events, or a refusal, but never other events.
    #[test]
    fn no_order_is_guessed(
        events in prop::collection::vec(any_event(0..500_i64, 300), 1..60),
        order in 0..6_usize,
        blanks in any::<bool>(),
    ) {
        let order = ["txyp", "xytp", "xypt", "tpxy", "ptxy", "pxyt"][order];
        let mut events = events;
        events.sort_by_key(|e| e.t_us);
        let separator = if blanks { " " } else { "," };
        let field = |e: &Event, letter| match letter {
            't' => e.t_us.to_string(),
            'x' => e.x.to_string(),
            'y' => e.y.to_string(),
            _ => u8::from(e.on).to_string(),
        };
        let line = |e: &Event| order.chars().map(|l| field(e, l)).collect::<Vec<_>>().join(separator);
        let text = lines(&events, line);
        // A few lines with commas are t, x, y, p if this is possible: this is documented.
        let documented = !blanks && events.len() < 16;
        if let Ok(recording) = decode(text.as_bytes()) && recording.events != events {
            prop_assert!(documented, "{}", text);
            let as_txyp = decode_with(text.as_bytes(), options(Some("txyp"), Some(TimeUnit::Microseconds)));
            prop_assert_eq!(recording.events, as_txyp.unwrap().events);
        }
        let said = decode_with(text.as_bytes(), options(Some(order), Some(TimeUnit::Microseconds))).unwrap();
        prop_assert_eq!(said.events, events);
    }
}

#[test]
fn numbers_with_an_exponent_are_read_in_every_column() {
    // `str(float)` of Python below 1e-4, as v2e writes; the decimals show that the times are
    // seconds.
    let text = b"0.0 0 0 0\n1.9999999949504854e-06 1 3 1\n1e-05 2 6 0\n0.00011 3 9 1\n0.25 4 12 0\n";
    let recording = decode(text).unwrap();
    assert_eq!(recording.events.iter().map(|e| e.t_us).collect::<Vec<_>>(), [0, 2, 10, 110, 250_000]);
    assert!(recording.left_out.is_empty());
    // `numpy.savetxt` with its default.
    let lines: Vec<String> = (0..40_u32)
        .map(|i| format!("{:.18e} {:.18e} {:.18e} {:.18e}", 1e-3 + f64::from(i) * 1e-5, i, 3 * i, i % 2))
        .map(|line| line.replace("e0", "e+00").replace("e1 ", "e+01 ").replace("e2 ", "e+02 "))
        .collect();
    let text = lines.join("\n");
    let expected: Vec<_> =
        (0..40).map(|i| Event::new(1000 + i64::from(i) * 10, i, 3 * i, i % 2 == 1)).collect();
    for options in [options(None, None), options(Some("txyp"), Some(TimeUnit::Seconds))] {
        assert_eq!(decode_with(text.as_bytes(), options).unwrap().events, expected);
    }
    let said = TextOptions::default().columns("txyp".parse::<ColumnOrder>().unwrap());
    let said = said.time_unit(TimeUnit::Seconds);
    let arriving: Result<Vec<_>, _> = CsvEvents::with_options(text.as_bytes(), said).collect();
    assert_eq!(arriving.unwrap(), expected);
    // Whole microseconds of a float.
    let whole = decode(b"t,x,y,p\n1.5e+06,1.2e+01,2e0,-1.0e+00\n1500001.0,12,2,1e0\n").unwrap();
    assert_eq!(whole.events, [Event::new(1_500_000, 12, 2, false), Event::new(1_500_001, 12, 2, true)]);
    // Three decimals can be milliseconds, whatever digits a float adds.
    let error =
        decode(b"t,x,y,p\n1.234000000000000000e+00,1,2,1\n2.345000000000000195e+00,1,2,1\n").unwrap_err();
    assert!(matches!(error, IoError::Undecided { what: "unit of time", .. }), "{error}");
}

#[test]
fn headers_and_comments_of_other_programs_name_the_sensor() {
    for (text, sensor) in [
        ("t,x@346,y@260,on\n1000,3,7,1\n", [346, 260]),
        ("# t,x@346,y@260,on\n1000,3,7,1\n", [346, 260]),
        ("x@640;y@480;p;t_us\n3;7;1;1000\n", [640, 480]),
        ("%geometry:320,240\n3,7,1,1000\n", [320, 240]),
        ("%geometry:320,240\nx,y,p,t\n3,7,1,1000\n", [320, 240]),
        ("% geometry 1280x720\n1000,3,7,1\n", [1280, 720]),
    ] {
        let recording = decode(text.as_bytes()).unwrap();
        assert_eq!(recording.sensor.map(|s| [s.width, s.height]), Some(sensor), "{text}");
        assert_eq!(recording.events, [Event::new(1000, 3, 7, true)], "{text}");
        let mut arriving = CsvEvents::new(text.as_bytes());
        assert_eq!(arriving.next().unwrap().unwrap(), recording.events[0], "{text}");
        assert_eq!(arriving.sensor(), recording.sensor, "{text}");
    }
    assert_eq!(decode(b"%geometry:any\nt,x,y,p\n1,2,3,1\n").unwrap().sensor, None);
    let error = decode(b"t,x@0,y@260,on\n1000,3,7,1\n").unwrap_err();
    assert!(error.to_string().contains("1 to 65535 pixels"), "{error}");
}
