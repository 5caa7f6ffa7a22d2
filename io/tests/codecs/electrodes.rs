//! Readings of electrodes, row by row.

use std::fs::File;
use std::io::{self, BufReader, Read, Write};

use meissner_io::limits::LINE_BYTES;
use meissner_io::{ElectrodeSettings, Electrodes, IoError, Place, Reading};
use proptest::prelude::*;

use crate::shared_files::shared;
use meissner_io_tests::codecs::Endless;

/// `prefix1` to `prefix24`.
fn header(prefix: &str) -> String {
    (1..=24).map(|e| format!("{prefix}{e}")).collect::<Vec<_>>().join(",")
}

/// 24 values from `first` on.
fn row(first: u32) -> String {
    (first..first + 24).map(|value| value.to_string()).collect::<Vec<_>>().join(",")
}

fn values(first: u32) -> [f32; 24] {
    std::array::from_fn(|e| (first + e as u32) as f32)
}

fn readings(text: &str) -> Electrodes<&[u8]> {
    Electrodes::new(text.as_bytes(), ElectrodeSettings::default())
}

fn read(text: &str) -> Result<Vec<Reading>, IoError> {
    readings(text).collect()
}

#[test]
fn rows_below_a_header_are_readings_with_their_lines() {
    let text = format!("{}\n{}\n\n# pause\n{}", header("ff_e"), row(0), row(100));
    let expected = [
        Reading { line: 2, values: values(0), time_s: None },
        Reading { line: 5, values: values(100), time_s: None },
    ];
    assert_eq!(read(&text).unwrap(), expected);
}

#[test]
fn columns_are_found_by_name_in_any_order_and_others_are_passed_over() {
    let mut names: Vec<String> = (1..=24).map(|e| format!("\"Electrode_{e}\"")).collect();
    let mut fields: Vec<String> = (0..24).map(|v| v.to_string()).collect();
    names.reverse();
    fields.reverse();
    let text = format!("label,{},PDC\r\nslip,{},x\r\n", names.join(" , "), fields.join(" , "));
    assert_eq!(read(&text).unwrap()[0].values, values(0));
}

#[test]
fn a_time_is_in_seconds_whatever_the_unit_of_its_column() {
    for (name, field) in
        [("t", "1.5"), ("time_ms", "1500"), ("timestamp_us", "1.5e6"), ("t_ns", "1500000000")]
    {
        let text = format!("{name},{}\n{field},{}\n", header("e"), row(0));
        let time_s = read(&text).unwrap()[0].time_s.unwrap();
        assert!((time_s - 1.5).abs() < 1e-15, "{name}: {time_s}");
    }
}

#[test]
fn a_header_that_lacks_an_electrode_or_has_two_fingers_is_refused() {
    let cases = [
        (header("e").replace("e7,", "x7,"), "one column `e7`, found 0"),
        (format!("{},ff_e3", header("ff_e")), "one column `ff_e3`, found 2"),
        (
            format!("{},{}", header("ff_e"), header("mf_e")),
            "columns e1 to e24 of one prefix, such as ff_e1, found the prefixes `ff_e`, `mf_e`",
        ),
        (format!("t,time_s,{}", header("e")), "at most one column of time, found 2"),
        (
            row(0),
            "columns e1 to e24 of one prefix, such as ff_e1, found `0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16..`",
        ),
    ];
    for (line, expected) in cases {
        let text = format!("{line}\n{}\n", row(0));
        let mut readings = readings(&text);
        let error = readings.next().unwrap().unwrap_err().to_string();
        assert_eq!(error, format!("CSV: header at line 1: expected {expected}"));
        assert!(readings.next().is_none());
    }
}

#[test]
fn after_a_row_that_is_refused_the_next_is_read() {
    let bad = [
        row(0).replace(",7,", ",x,"),
        row(0).replace(",7,", ",NaN,"),
        row(0).replace(",7,", ",inf,"),
        row(0).replace(",7,", ",1e39,"),
        row(0).replace(",7,", ",,"),
        row(0).replace(",7,", ","),
        row(0) + ",24",
    ];
    let text = format!("{}\n{}\n{}\n", header("e"), bad.join("\n"), row(5));
    let items: Vec<_> = readings(&text).collect();
    assert_eq!(items.len(), 8);
    for (index, item) in items[..7].iter().enumerate() {
        let line = index as u64 + 2;
        match item.as_ref().unwrap_err() {
            IoError::Malformed { place: Place::Line(at), .. } => assert_eq!(*at, line),
            error => panic!("{error}"),
        }
    }
    let messages: Vec<String> = items[..7].iter().map(|i| i.as_ref().unwrap_err().to_string()).collect();
    assert_eq!(messages[0], "CSV: field at line 2: expected a finite number in column `e8`, found `x`");
    assert_eq!(messages[1], "CSV: field at line 3: expected a finite number in column `e8`, found `NaN`");
    assert!(
        messages[5].starts_with("CSV: row at line 7: expected 24 fields, found 23 in"),
        "{}",
        messages[5]
    );
    assert_eq!(items[7].as_ref().unwrap().values, values(5));
}

#[test]
fn a_line_that_is_too_long_ends_the_readings() {
    let text = format!("{}\n{}\n{}\n", header("e"), "1".repeat(LINE_BYTES as usize), row(0));
    let mut readings = readings(&text);
    assert!(matches!(readings.next(), Some(Err(IoError::TooLarge { place: Place::Line(2), .. }))));
    assert!(readings.next().is_none());
}

#[test]
fn a_line_without_end_is_refused_after_4096_bytes() {
    let lines = header("e") + "\n";
    let mut readings = Electrodes::new(
        BufReader::with_capacity(512, lines.as_bytes().chain(Endless { left: 2 * LINE_BYTES })),
        ElectrodeSettings::default(),
    );
    let error = readings.next().unwrap().unwrap_err();
    assert!(matches!(error, IoError::TooLarge { limit: LINE_BYTES, place: Place::Line(2), .. }), "{error}");
    assert!(readings.next().is_none());
}

#[test]
fn names_in_a_header_are_quoted_in_part_and_escaped() {
    let long = format!("\u{1b}{}_e", "a".repeat(3000));
    let apart = |e| format!("{}_e1", "b".repeat(e));
    let many = (1..80).map(apart).collect::<Vec<_>>().join(",");
    for line in [format!("{long}1"), format!("{long}1,{long}1"), many] {
        let error = readings(&line).next().unwrap().unwrap_err().to_string();
        assert!(error.len() < 300 && !error.contains('\u{1b}'), "{error}");
    }
    let names = header(&format!("{}_e", "c".repeat(120)));
    let error = readings(&format!("{names}\n{}", row(0).replace("23", "x"))).next().unwrap().unwrap_err();
    assert!(error.to_string().len() < 200, "{error}");
}

/// With any bit of a text flipped, and the text cut anywhere: finite rows in the order of their
/// lines, or an error with its line.
#[test]
fn a_text_that_was_cut_or_flipped_anywhere_gives_readings_or_errors_with_their_lines() {
    let text = format!("time_ms,{}\n0,{}\n1.5,{}\n", header("ff_e"), row(3000), row(17)).into_bytes();
    let check = |bytes: &[u8]| {
        let mut line = 1;
        for item in Electrodes::new(bytes, ElectrodeSettings::default()) {
            let found = match item {
                Ok(reading) => {
                    assert!(reading.values.iter().all(|value| value.is_finite()));
                    assert!(reading.time_s.is_none_or(f64::is_finite));
                    reading.line
                }
                Err(IoError::Malformed { place: Place::Line(line), expected, actual, .. }) => {
                    assert!(!expected.is_empty() && !actual.is_empty());
                    line
                }
                Err(error) => panic!("{error}"),
            };
            assert!((line..=line + 3).contains(&found), "{found} behind {line}");
            line = found;
        }
    };
    (0..text.len()).for_each(|length| check(&text[..length]));
    for bit in 0..8 * text.len() {
        let mut flipped = text.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        check(&flipped);
    }
}

#[test]
fn values_beyond_the_range_are_delivered_and_counted() {
    let text = format!("{}\n{}\n{}\n", header("e"), row(0).replace("0,1,2,", "-1,4096,4095,"), row(4090));
    let mut readings = readings(&text);
    let first = readings.next().unwrap().unwrap();
    assert_eq!((first.values[0], readings.warnings().values_out_of_range), (-1.0, 2));
    // 4096 to 4113.
    assert!(readings.next().unwrap().is_ok());
    assert_eq!(readings.warnings().values_out_of_range, 2 + 18);
    assert_eq!(readings.warnings().rows_off_rate, 0);
}

#[test]
fn intervals_that_are_not_those_of_the_rate_are_counted() {
    // Intervals: 10, 12 and 8 ms, which the tolerance of a fifth allows; 12.5, 7.5, -5 and 0 ms,
    // which it does not allow.
    let times_ms =
        [1e12, 1e12 + 10.0, 1e12 + 22.0, 1e12 + 30.0, 1e12 + 42.5, 1e12 + 50.0, 1e12 + 45.0, 1e12 + 45.0];
    let rows: Vec<String> = times_ms.iter().map(|t| format!("{t},{}", row(0))).collect();
    let text = format!("t_ms,{}\n{}\n", header("e"), rows.join("\n"));
    let mut counted = readings(&text);
    assert_eq!(counted.by_ref().flatten().count(), 8);
    assert_eq!(counted.warnings().rows_off_rate, 4);
    let settings = ElectrodeSettings::default().rate_hz(50.0).rate_tolerance(0.1);
    let mut counted = Electrodes::new(text.as_bytes(), settings);
    assert_eq!(counted.by_ref().flatten().count(), 8);
    assert_eq!(counted.warnings().rows_off_rate, 7);
}

#[test]
fn across_a_refused_row_no_interval_is_judged() {
    let text = format!("t_ms,{}\n0,{}\n10,x\n20,{}\n30,{}\n", header("e"), row(0), row(0), row(0));
    let mut readings = readings(&text);
    assert_eq!(readings.by_ref().flatten().count(), 3);
    assert_eq!(readings.warnings().rows_off_rate, 0);
}

/// Whether each reading follows the one before it, and the numbers of gaps, repeated and earlier
/// times.
fn followed(text: &str) -> (Vec<bool>, [u64; 3]) {
    let mut readings = readings(text);
    let mut follows = vec![];
    while let Some(item) = readings.next() {
        follows.extend(item.is_ok().then(|| readings.follows()));
    }
    let warnings = readings.warnings();
    (follows, [warnings.gaps, warnings.times_repeated, warnings.times_backwards])
}

#[test]
fn a_reading_behind_a_refused_row_a_gap_or_a_step_back_in_time_does_not_follow() {
    // Intervals: 10, 50, 51, 0 and -1 ms; then 10 ms across a refused row.
    let times_ms = ["0", "10", "60", "111", "111", "110", "x", "120", "130"];
    let rows = times_ms.map(|t| format!("{t},{}\n", row(0))).concat();
    let (follows, counts) = followed(&format!("t_ms,{}\n{rows}", header("e")));
    assert_eq!(follows, [false, true, true, false, true, false, false, true]);
    assert_eq!(counts, [1, 1, 1]);
    let rows =
        [row(0), "# a comment parts nothing\n".to_owned(), row(1), "1,2".to_owned(), row(2)].join("\n");
    assert_eq!(followed(&format!("{}\n{rows}", header("e"))), (vec![false, true, false], [0; 3]));
}

#[test]
fn the_longest_gap_is_a_setting() {
    let text = format!("t_ms,{}\n0,{}\n20,{}\n41,{}\n", header("e"), row(0), row(0), row(0));
    let settings = ElectrodeSettings::default().longest_gap(2.0);
    let mut readings = Electrodes::new(text.as_bytes(), settings);
    let follows: Vec<bool> = std::iter::from_fn(|| readings.next().map(|_| readings.follows())).collect();
    assert_eq!((follows, readings.warnings().gaps), (vec![false, true, false], 1));
}

#[test]
fn an_input_without_a_header_is_refused_and_one_without_rows_is_not() {
    for (text, line) in [("", 1), ("\n# by hand\n", 3), ("# by hand", 2)] {
        let mut readings = readings(text);
        let error = readings.next().unwrap().unwrap_err().to_string();
        let expected = "expected columns e1 to e24 of one prefix, such as ff_e1, found the end of the input";
        assert_eq!(error, format!("CSV: header at line {line}: {expected}"));
        assert!(readings.next().is_none());
    }
    for end in ["", "\n", "\r\n"] {
        assert_eq!(read(&format!("{}{end}", header("e"))).unwrap(), []);
    }
}

#[test]
fn a_reading_is_there_as_soon_as_its_line_is() {
    let (reader, mut writer) = io::pipe().unwrap();
    let mut readings = Electrodes::new(BufReader::new(reader), ElectrodeSettings::default());
    writeln!(writer, "{}", header("e")).unwrap();
    // If the reader read beyond the line, this would wait forever: the pipe contains nothing more.
    for first in 0..5 {
        writeln!(writer, "{}", row(first)).unwrap();
        assert_eq!(readings.next().unwrap().unwrap().values, values(first));
    }
    drop(writer);
    assert!(readings.next().is_none());
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn every_recording_of_slips_is_read_without_a_warning() {
    let folder = shared("data/biotac_dos");
    let (mut files, mut rows, mut range) = (0, 0, f32::INFINITY..=f32::NEG_INFINITY);
    for class in ["n", "s", "e", "w", "cw", "aw", "t"] {
        for file in folder.join(class).read_dir().unwrap() {
            let input = BufReader::new(File::open(file.unwrap().path()).unwrap());
            let mut readings = Electrodes::new(input, ElectrodeSettings::default());
            for reading in readings.by_ref() {
                let values = reading.unwrap().values;
                let least = values.into_iter().fold(*range.start(), f32::min);
                range = least..=values.into_iter().fold(*range.end(), f32::max);
                rows += 1;
            }
            assert_eq!(readings.warnings(), meissner_io::ElectrodeWarnings::default());
            files += 1;
        }
    }
    assert_eq!((files, rows, range), (306, 84_622, 1911.0..=3745.0));
}

proptest! {
    #[test]
    fn any_finite_values_are_read_to_the_bit(
        rows in prop::collection::vec(prop::array::uniform24(any::<f32>().prop_filter("finite", |v| v.is_finite())), 0..4)
    ) {
        let line = |values: &[f32; 24]| values.map(|v| v.to_string()).join(",");
        let text = format!("{}\n{}", header("e"), rows.iter().map(line).collect::<Vec<_>>().join("\n"));
        let read: Vec<_> = readings(&text).map(|r| r.unwrap().values.map(f32::to_bits)).collect();
        prop_assert_eq!(read, rows.iter().map(|r| r.map(f32::to_bits)).collect::<Vec<_>>());
    }

    #[test]
    fn any_text_gives_errors_or_readings(text in "[e0-9,.#\n -]{0,200}") {
        let text = format!("{}\n{text}", header("e"));
        prop_assert!(readings(&text).count() <= text.lines().count());
    }
}
