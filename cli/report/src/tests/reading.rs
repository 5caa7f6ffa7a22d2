use std::io::{BufReader, Read};

use proptest::prelude::*;

use super::{SUMMARY, header, outcomes, prediction, run};
use crate::decimated::Decimated;
use crate::read::Body;
use crate::stream::Stream;
use crate::{ReportError, Truth, Truths, read};

fn refused(text: &[u8]) -> String {
    match read("it", text, &Truths::default()) {
        Err(error @ ReportError::Other { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    }
}

fn stream(text: &str) -> Stream {
    match outcomes(text).expect("a result").remove(0).body {
        Body::Stream(stream) => *stream,
        Body::Object(_) => panic!("an object"),
    }
}

#[test]
fn what_is_no_result_is_refused_by_its_name() {
    let command = |command: &str| format!("{{\"header\":{{\"command\":\"{command}\"}},\"checks\":[]}}");
    for (text, found) in [
        (&b""[..], "an empty file"),
        (b"\n\n", "an empty file"),
        (b"t,x,y,p\n1,2,3,1\n", "a recording of events (CSV)"),
        (b"\x89PNG\r\n\x1a\n", "a picture (PNG)"),
        (b"<!DOCTYPE html>\n<html>", "a page of HTML"),
        (b"recording    a\nnetwork      b\n", "--json?"),
        (b"[{\"name\":\"a\"}]", "`meissner networks`"),
        (b"{\"on\":1,\"off\":2,\"span_us\":3}", "`meissner info`"),
        (b"{\"t_us\":1,\"value\":[2]}", "without the header"),
        (b"{\"a\":1}", "JSON without a header"),
        (b"{\"header\":{}}", "names no command"),
        (b"{\"header\":{\"command\":\"bench\"}}", "the rest is missing"),
        (b"{\"header\":{\"command\":\"bench\"},", "cut short"),
        (b"{a}", "no JSON"),
        (b"\x00\x01\xff\xfe", "unknown kind"),
        (command("simulate").as_bytes(), "a result of simulate"),
        (b"{\"header\":{\"command\":\"bench\",\"schema\":2},\"isa\":\"a\"}", "version 2"),
    ] {
        let message = refused(text);
        assert!(message.starts_with("it: expected") && message.contains(found), "{message}");
    }
}

#[test]
fn a_last_line_that_is_cut_short_is_told_and_the_rest_is_shown() {
    let text = run();
    let cut = &text[..text.len() - SUMMARY.len() - 20];
    let outcome = &outcomes(cut).expect("a result")[0];
    assert!(outcome.notes.iter().any(|note| note.contains("Line 4 is cut short")), "{:?}", outcome.notes);
    assert!(outcome.notes.iter().any(|note| note.contains("no summary")), "{:?}", outcome.notes);
    assert_eq!(stream(cut).predictions, 2);
    // A wrong line in the middle does not count as a cut.
    let wrong = text.replacen("\"value\"", "value", 1);
    let error = outcomes(&wrong).expect_err("a wrong line").to_string();
    assert!(error.starts_with("result.json, line 2"), "{error}");
}

#[test]
fn every_cut_of_a_result_gives_a_result_or_an_error() {
    let text = run();
    for end in 0..text.len() {
        let _ = outcomes(&text[..end]);
    }
}

#[test]
fn a_result_that_another_program_has_broken_into_lines_is_read() {
    let text = "{\n \"header\": {\n  \"command\": \"bench\"\n },\n \"isa\": \"avx2\"\n}\n";
    assert_eq!(outcomes(text).expect("a result")[0].command, "bench");
}

#[test]
fn each_input_of_a_play_is_a_result() {
    let lines = [
        header("play", "N"),
        header("play", "N"),
        r#"{"input":1,"at_us":5,"t_us":4,"value":[2.0],"state":"fresh"}"#.to_owned(),
        r#"{"summary":{"input":0,"events":1}}"#.to_owned(),
        r#"{"failed":{"input":1,"error":"layer conv1 is NaN"}}"#.to_owned(),
    ];
    let results = outcomes(&lines.join("\n")).expect("results");
    assert_eq!(results.len(), 2);
    assert!(results[1].name.ends_with("input 1") && results[1].notes[0].contains("conv1 is NaN"));
}

#[test]
fn angles_are_shown_in_degrees_and_compared_with_the_truth_between_its_times() {
    let text = format!("{}\n{}\n", header("run", "rad"), prediction(1500, 0.5));
    let mut truths = Truths::default();
    let half = 0.5_f64.to_degrees();
    truths.add(Truth {
        input: Some("press.es".to_owned()),
        output: "force".to_owned(),
        unit: Some("deg".to_owned()),
        points: vec![(2000.0, half + 2.0), (1000.0, half)],
    });
    let results = read("it", text.as_bytes(), &truths).expect("a result");
    let Body::Stream(stream) = &results[0].body else { panic!("a stream") };
    let value = &stream.values[0];
    assert_eq!(value.unit, "degrees");
    assert!((value.errors.0 - 1.0).abs() < 1e-9 && value.errors.1 == 1.0, "{:?}", value.errors);
}

#[test]
fn a_line_without_an_end_is_refused_in_bounded_memory() {
    let endless = header("run", "N") + "\n{\"t_us\":";
    let input = BufReader::new(endless.as_bytes().chain(std::io::repeat(b'1').take(1 << 30)));
    let error = read("it", input, &Truths::default()).expect_err("too long");
    assert!(matches!(error, ReportError::Long { line: 2, .. }), "{error}");
}

#[test]
fn a_million_predictions_are_kept_as_few_points_with_their_peaks() {
    let mut line = Decimated::default();
    for i in 0..1_000_000_u32 {
        line.push(f64::from(i), if i == 777_777 { 9.0 } else { f64::from(i % 7) / 7.0 });
    }
    let points = line.points();
    assert!((256..=514).contains(&points.len()), "{}", points.len());
    assert!(points.contains(&(777_777.0, 9.0)) && points.last().map(|last| last.0) == Some(999_999.0));
}

proptest! {
    #[test]
    fn decimation_keeps_order_and_extremes(values in proptest::collection::vec(-1e3..1e3_f64, 1..3000)) {
        let mut line = Decimated::default();
        values.iter().enumerate().for_each(|(x, &y)| line.push(x as f64, y));
        let points = line.points();
        prop_assert!(points.is_sorted_by(|a, b| a.0 <= b.0));
        prop_assert!(points.iter().all(|&(x, y)| values[x as usize] == y));
        for extreme in [f64::max, f64::min] {
            let of_points = points.iter().map(|point| point.1).reduce(extreme);
            prop_assert_eq!(of_points, values.iter().copied().reduce(extreme));
        }
    }

    #[test]
    fn any_bytes_give_a_result_or_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let mut text = header("run", "N").into_bytes();
        text.push(b'\n');
        let _ = read("it", &bytes[..], &Truths::default());
        text.extend(bytes);
        let _ = read("it", &text[..], &Truths::default());
    }
}
