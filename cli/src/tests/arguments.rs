//! Words of the command line, and errors.

mod error {
    use std::error::Error;
    use std::io;
    use std::path::PathBuf;

    use meissner_engine::{EngineError, Sensor};

    use crate::error::CliError;

    #[test]
    fn a_network_without_an_incremental_form_is_told_the_option_that_runs_it() {
        let hint = CliError::from(EngineError::NotIncremental("a".to_owned())).hint();
        assert!(hint.is_some_and(|hint| hint.contains("--mode batch")));
    }

    #[test]
    fn an_error_of_the_program_does_not_repeat_its_source() {
        let denied = || io::Error::new(io::ErrorKind::PermissionDenied, "denied");
        let path = PathBuf::from("some.file");
        let engine = || EngineError::Sensor(Sensor::new(0, 1));
        for error in [
            engine().into(),
            CliError::Resume { path: path.clone(), source: engine() },
            CliError::write(&path, denied()),
            CliError::Output(denied()),
        ] {
            let mut outer: &dyn Error = &error;
            while let Some(source) = outer.source() {
                assert!(!outer.to_string().contains(&source.to_string()), "{outer}: {source}");
                outer = source;
            }
        }
    }
}

mod given {
    use crate::given::renamed;

    #[test]
    fn former_subcommands_are_forms_of_verify() {
        for (former, now) in [
            ("stress --quick", "verify --stress --quick"),
            ("soak --events 9", "verify tactigraph-past --soak --events 9"),
            ("soak a.csv b.csv --network graphres --json x", "verify graphres --soak a.csv b.csv --out x"),
            ("soak --network=graphres --json=x --sensor=8x8", "verify graphres --soak --out x --sensor=8x8"),
            ("help soak", "help verify"),
            ("help run", "help run"),
            ("run stress --json", "run stress --json"),
        ] {
            let words = renamed(format!("meissner {former}").split(' ').map(Into::into));
            let words: Vec<_> = words.iter().filter_map(|word| word.to_str()).collect();
            assert_eq!(words.join(" "), format!("meissner {now}"));
        }
    }
}

mod play {
    use std::time::Duration;

    use crate::args::positive;
    use crate::args::{length, period};
    use crate::play::Policy;

    #[test]
    fn policies_have_names_and_numbers() {
        assert_eq!("drop-oldest".parse(), Ok(Policy::DropOldest));
        assert_eq!("thin:4".parse(), Ok(Policy::Thin(4)));
        assert_eq!("filter:1250us".parse(), Ok(Policy::Activity(1250)));
        assert_eq!("refractory:1ms".parse(), Ok(Policy::Refractory(1000)));
        assert_eq!("rate:400000".parse(), Ok(Policy::Rate(400_000)));
        for wrong in
            ["", "drop", "thin", "thin:", "thin:0", "filter:1250", "filter:0us", "rate:-1", "block:1"]
        {
            assert!(wrong.parse::<Policy>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_deadline_may_be_0_and_a_period_may_not() {
        assert_eq!(length("10ms"), Ok(Duration::from_millis(10)));
        assert_eq!(length("0us"), Ok(Duration::ZERO));
        assert!(period("0ms").is_err() && period("5").is_err());
        assert!(positive("0").is_err() && positive("nan").is_err() && positive("0.5") == Ok(0.5));
    }
}

mod verify {
    use crate::verify::count;

    #[test]
    fn a_count_is_a_whole_number_above_0_with_or_without_an_exponent() {
        assert_eq!(count("1e8"), Ok(100_000_000));
        assert_eq!(count("2.5e1"), Ok(25));
        assert_eq!(count("17"), Ok(17));
        for wrong in ["", "0", "-1", "1.5", "1e-3", "inf", "NaN", "1e17", "many"] {
            assert!(count(wrong).is_err(), "{wrong}");
        }
    }
}

mod verify_streams {
    use clap::Parser;
    use meissner_engine::{Event, Sensor};
    use meissner_run::provenance::ModelCard;
    use meissner_verify::{Difference, Mismatch, Step, Stream, VerifyError};

    use crate::verify::streams::{Verified, report};
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
        assert_eq!(
            (found.layer.as_deref(), found.row, found.input, found.steps),
            (Some("conv2"), Some(1), 2, 3)
        );
        let text = std::fs::read_to_string(&out).expect("it was written");
        assert_eq!(Stream::<Event>::parse(&text).expect("its own form"), stream, "{text}");

        let error = report(&args, &ModelCard::default(), &verified).expect_err("a mismatch");
        let (message, hint) = (error.to_string(), error.hint().expect("what to do next"));
        for part in ["random streams", "input 2", "layer conv2, row 1", "0.5 (0x3f000000)", "-0 (0x80000000)"]
        {
            assert!(message.contains(part), "{part}: {message}");
        }
        assert!(hint.contains(&format!("meissner verify own.toml --replay {path}")), "{hint}");
    }
}
