//! Tables of labels: usual ones, and ones with errors.

use meissner_io::{IoError, LabelClock, LabelTable, LabelValues, Place};
use proptest::prelude::*;

fn table(text: &str) -> LabelTable {
    LabelTable::parse(text.as_bytes()).unwrap_or_else(|error| panic!("{error}: {text}"))
}

fn refusal(text: impl AsRef<[u8]>) -> String {
    match LabelTable::parse(text.as_ref()) {
        Ok(table) => panic!("expected an error, found {table:?}"),
        Err(error) => error.to_string(),
    }
}

fn numbers(table: &LabelTable, name: &str) -> Vec<Option<f64>> {
    let label = table.label(name).unwrap_or_else(|| panic!("a label {name} in {table:?}"));
    (0..table.rows()).map(|row| label.value(row)).collect()
}

fn named(table: &LabelTable) -> Vec<(&str, Option<&str>)> {
    table.labels.iter().map(|label| (label.name.as_str(), label.unit.as_deref())).collect()
}

#[test]
fn names_and_units_stand_in_the_header() {
    let table = table(
        "recording,t_us,roll_deg,force_N,x_mm,depth_um,torque_Nmm,speed_mm_s,force z [mN],share (%),plain,_n,tilt_x\n\
         a,1,2,3,4,5,6,7,8,9,10,11,12\n",
    );
    let expected = [
        ("roll", Some("deg")),
        ("force", Some("N")),
        ("x", Some("mm")),
        ("depth", Some("um")),
        ("torque", Some("Nmm")),
        ("speed", Some("mm/s")),
        ("force z", Some("mN")),
        ("share", Some("%")),
        ("plain", None),
        ("_n", None),
        ("tilt_x", None),
    ];
    assert_eq!(named(&table), expected);
    assert_eq!(table.clock, Some(LabelClock::Sensor));
    assert_eq!(table.recordings.as_deref(), Some(&["a".to_owned()][..]));
}

#[test]
fn times_of_every_unit_become_microseconds_without_floats() {
    for (name, text, us) in [
        ("t_s", "1.5", 1_500_000),
        ("t_ms", "1.5", 1_500),
        ("time_us", "12", 12),
        ("timestamp_ns", "1500", 2),
        ("host_us", "1717171717171717", 1_717_171_717_171_717),
        ("host_s", "1717171717.171717", 1_717_171_717_171_717),
        ("host_time_ns", "1717171717171717499", 1_717_171_717_171_717),
        ("t [ms]", "-3", -3_000),
    ] {
        let table = table(&format!("{name},x\n{text},0\n"));
        assert_eq!(table.times_us, [Some(us)], "{name}");
        let host = name.starts_with("host");
        assert_eq!(table.clock, Some(if host { LabelClock::Host } else { LabelClock::Sensor }), "{name}");
    }
}

#[test]
fn of_both_clocks_the_sensors_counts_beside_a_recording_and_the_hosts_without() {
    let with = table("recording,host_us,t_us,x\na,1,2,0\n");
    assert_eq!((with.clock, with.times_us), (Some(LabelClock::Sensor), vec![Some(2)]));
    let without = table("t_us,host_us,x\n2,1,0\n");
    assert_eq!((without.clock, without.times_us), (Some(LabelClock::Host), vec![Some(1)]));
}

#[test]
fn a_file_of_a_european_excel_is_read() {
    let text =
        "\u{feff}sep=;\r\nRecording;roll_deg;note\r\n\"a;b\";1,5;\"say \"\"hi\"\"\"\r\nc;-2,25;x\r\n;;\r\n";
    let table = table(text);
    assert_eq!(table.recordings.as_deref(), Some(&["a;b".to_owned(), "c".to_owned()][..]));
    assert_eq!(numbers(&table, "roll"), [Some(1.5), Some(-2.25)]);
    assert_eq!(
        table.label("note").map(|label| label.classes().to_vec()),
        Some(vec!["say \"hi\"".to_owned(), "x".to_owned()])
    );
    assert_eq!(table.lines, [3, 4]);
}

#[test]
fn tabs_at_the_ends_of_a_line_separate_empty_fields() {
    let table = table("\trecording\tx\ty\n0\ta\t1\t\n1\tb\t\t2\n");
    assert_eq!(numbers(&table, "x"), [Some(1.0), None]);
    assert_eq!(numbers(&table, "y"), [None, Some(2.0)]);
}

#[test]
fn comments_blank_lines_and_columns_without_a_name_are_passed_over() {
    let table = table("# by hand\n\n,recording,x,,\n0,a,1,9,\n% later\n1,b,2,9,\n");
    assert_eq!(numbers(&table, "x"), [Some(1.0), Some(2.0)]);
    assert_eq!(table.lines, [4, 6]);
}

#[test]
fn a_column_of_texts_or_called_class_is_of_classes_in_natural_order() {
    let table = table("file,class,material\na,10,wood2\nb,2,wood10\nc,10,1\nd,,wood2\n");
    let LabelValues::Classes { names, of } = &table.labels[0].values else { panic!("{table:?}") };
    assert_eq!(
        (names.as_slice(), of.as_slice()),
        (&["2".to_owned(), "10".to_owned()][..], &[Some(1), Some(0), Some(1), None][..])
    );
    assert_eq!(table.labels[1].classes(), ["1", "wood2", "wood10"]);
}

#[test]
fn missing_values_and_texts_among_numbers_are_told_apart() {
    let table = table("file,x\na,1\nb,nan\nc,\nd,oops\ne,inf\nf,2\n");
    assert_eq!(numbers(&table, "x"), [Some(1.0), None, None, None, None, Some(2.0)]);
    assert_eq!(table.labels[0].refused, [(3, "oops".to_owned())]);
}

#[test]
fn words_for_nothing_are_missing_among_numbers_and_classes_among_texts() {
    let table = table("file,x,slip,only\na,1,none,none\nb,none,left,\nc,N/A,left,none\n");
    assert_eq!(numbers(&table, "x"), [Some(1.0), None, None]);
    assert!(table.labels[0].refused.is_empty(), "{table:?}");
    assert_eq!(table.labels[1].classes(), ["left", "none"]);
    assert_eq!(table.labels[2].classes(), ["none"]);
}

#[test]
fn errors_name_line_and_column() {
    for (text, parts) in [
        ("", vec!["header", "line 1", "the end"]),
        ("recording,x\n", vec!["row", "line 2"]),
        ("x,y\n1,2\n", vec!["header", "line 1", "recording or a time"]),
        ("recording,t_us\na,1\n", vec!["header", "and a label"]),
        ("recording,t,x\na,1,2\n", vec!["line 1", "with its unit", "column 2"]),
        ("recording,x_mm,x_um\na,1,2\n", vec!["line 1", "different names", "column 3"]),
        ("recording,file,x\na,b,2\n", vec!["line 1", "one column of recordings", "column 2"]),
        ("recording,x\na,1,2\n", vec!["line 2", "2 fields", "3 in"]),
        ("recording,x\na\n", vec!["line 2", "2 fields", "1 in"]),
        ("recording,x\n,1\n", vec!["line 2", "the name of a recording"]),
        ("t_us,x\n,1\n", vec!["line 2", "a time"]),
        ("recording,t_us,x\na,soon,1\n", vec!["line 2", "time", "`soon` in column 2"]),
        ("t_s,x\n99999999999999999999,1\n", vec!["line 2", "63 bits"]),
        ("recording,x\n\"a,1\n", vec!["line 2", "a quote at the field's end", "column 1"]),
        ("recording,x\n\"a\"b,1\n", vec!["line 2", "between a quote and the separator"]),
    ] {
        let message = refusal(text);
        for part in parts {
            assert!(message.contains(part), "{part}: {message}");
        }
    }
    assert!(refusal(b"\xff\xfer\0e\0").contains("UTF-16"));
    assert!(refusal(b"PK\x03\x04 a workbook").contains("zip"));
    assert!(refusal(format!("recording,x\na,{}\n", "1".repeat(5000))).contains("too large"));
}

proptest! {
    #[test]
    fn any_bytes_are_a_table_or_an_error_that_says_what_was_expected(
        bytes in prop_oneof![
            prop::collection::vec(any::<u8>(), 0..400),
            "(recording|t_us|host_ms|x_mm|class|\"|;|,|\t|\n|\r|#|[0-9.e+-]|nan|a){0,120}".prop_map(String::into_bytes),
            "recording,t_us,x_mm\n((a|b|\"|,|;|\n|[0-9.-]){1,8}(,|\n)){0,40}".prop_map(String::into_bytes),
        ],
    ) {
        match LabelTable::parse(&bytes) {
            Ok(table) => {
                prop_assert!(table.rows() > 0 && !table.labels.is_empty());
                prop_assert_eq!(table.times_us.len(), table.rows());
                prop_assert!(table.lines.windows(2).all(|pair| pair[0] < pair[1]));
                for label in &table.labels {
                    for row in 0..table.rows() {
                        let value = label.value(row);
                        prop_assert!(value.is_none_or(f64::is_finite));
                        let is_class = !label.classes().is_empty();
                        prop_assert!(value.is_none_or(|value| !is_class || (value as usize) < label.classes().len()));
                    }
                }
            }
            Err(IoError::Malformed { place: Place::Line(line), expected, .. }) => {
                prop_assert!(!expected.is_empty() && line > 0);
            }
            Err(IoError::TooLarge { place: Place::Line(line), .. }) => prop_assert!(line > 0),
            // The whole input is of another kind.
            Err(error) => {
                let is_other = matches!(error, IoError::OtherKind { .. } | IoError::Unsupported { .. });
                prop_assert!(is_other && error.to_string().contains("expected"), "{}", error);
            }
        }
    }
}
