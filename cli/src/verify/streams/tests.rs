//! A mismatch is written, and becomes an error.

use clap::Parser;
use meissner_engine::{Event, Sensor};
use meissner_run::provenance::ModelCard;
use meissner_verify::{Difference, Mismatch, Step, Stream, VerifyError};

use super::{Verified, report};
use crate::{Args, Command};

#[test]
fn a_mismatch_is_written_as_a_stream_that_replays_and_is_an_error_with_its_place() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let out = folder.path().join("failure.csv");
    let path = out.to_str().expect("temporary paths are text");
    let parsed = Args::parse_from(["meissner", "verify", "own.toml", "--failure", path]);
    let Command::Verify(args) = parsed.command else { panic!("another command") };
    let stream = Stream {
        sensor: Some(Sensor::new(4, 3)),
        capacity: Some(2),
        steps: vec![
            Step::Push(Event::new(0, 1, 2, true)),
            Step::Advance(9),
            Step::Push(Event::new(9, 0, 0, false)),
        ],
    };
    let difference =
        Difference::Row { layer: "conv2".to_owned(), row: 1, channel: 3, found: 0.5, expected: -0.0 };
    let mismatch = Mismatch { difference, input: 2, stream: stream.clone(), found_in: 80 };
    let mut verified = Verified::default();
    verified
        .note(&args, "random streams".to_owned(), Err(VerifyError::from(Box::new(mismatch))))
        .expect("the file can be written");
    let found = verified.mismatch.as_ref().expect("a mismatch");
    assert_eq!((found.layer.as_deref(), found.row, found.input, found.steps), (Some("conv2"), Some(1), 2, 3));
    let text = std::fs::read_to_string(&out).expect("it was written");
    assert_eq!(Stream::<Event>::parse(&text).expect("its own form"), stream, "{text}");

    let error = report(&args, &ModelCard::default(), &verified).expect_err("a mismatch");
    let (message, hint) = (error.to_string(), error.hint().expect("what to do next"));
    for part in ["random streams", "input 2", "layer conv2, row 1", "0.5 (0x3f000000)", "-0 (0x80000000)"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    assert!(hint.contains(&format!("meissner verify own.toml --replay {path}")), "{hint}");
}
