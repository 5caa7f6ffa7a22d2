//! Tests of modules that are one file each.

mod judge {
    //! The frame of evaluations, with a made-up task.

    use std::collections::BTreeMap;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use meissner_models::{AnyDescription, TensorFile};
    use meissner_run::provenance::ModelCard;
    use rayon::ThreadPoolBuilder;

    use crate::error::EvaluateError;
    use crate::judge::{Judge, JudgedTrial, judge};
    use crate::regression::Regression;
    use crate::trainings::{EvaluatedNetwork, Request, Training, candidates};
    use crate::trials::{Cases, Trial};
    use crate::workers::{ProgressHandle, Workers};

    const CASES: usize = 5;

    /// A task whose networks predict the number of the case; the network called `refused` has no
    /// engine.
    struct Numbers {
        refused: &'static str,
        run: AtomicUsize,
    }

    impl Judge for Numbers {
        type Task = Regression;
        type Plan = ();
        type Engine = ();
        type Outcome = f32;
        type Figures = f32;
        type Network = Vec<f32>;

        fn plan(
            &self,
            candidate: &EvaluatedNetwork<AnyDescription>,
        ) -> Result<((), Vec<Trial>), EvaluateError> {
            let mut cases = Cases::default();
            cases.push("own", CASES);
            let all: Vec<usize> = (0..CASES).collect();
            Ok(((), cases.trials(&candidate.trainings, &all, |_| Ok(()))?))
        }

        fn engine(&self, description: &AnyDescription, (): &(), _: &Training) -> Result<(), EvaluateError> {
            let refused = description.name() == self.refused;
            if refused { Err(EvaluateError::twice(self.refused)) } else { Ok(()) }
        }

        fn outcome(&self, (): &(), (): &mut (), case: usize) -> Result<f32, EvaluateError> {
            self.run.fetch_add(1, Ordering::Relaxed);
            Ok(case as f32)
        }

        fn figures(&self, (): &(), mut judged: JudgedTrial<'_, f32>) -> f32 {
            judged.write(1, |&outcome| vec![outcome]);
            judged.into_outcomes().into_iter().sum()
        }

        fn network(&self, (): (), _: &mut ModelCard, judged: Vec<(Trial, f32)>) -> Vec<f32> {
            judged.into_iter().map(|(_, figures)| figures).collect()
        }

        fn more_cases(&self) -> usize {
            3
        }
    }

    /// The figures of two networks or an error, the number of cases that ran, and the numbers of
    /// done and expected cases.
    fn run(refused: &'static str) -> (Result<Vec<Vec<f32>>, EvaluateError>, usize, [u64; 2]) {
        let networks = ["tactigraph-past", "tactip-past"].map(str::to_owned);
        let request = Request { networks: &networks, ..Request::default() };
        let (candidates, _) = candidates::<Regression>(request).expect("they are shipped");
        let watch = ProgressHandle::default();
        let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
        let numbers = Numbers { refused, run: AtomicUsize::new(0) };
        let logits = TensorFile::new(BTreeMap::new());
        let workers = Workers::new(pool, watch.clone());
        let judged = judge(&numbers, &candidates, logits, &workers, |_, _| {});
        let figures =
            judged.map(|judged| judged.networks.into_iter().map(|network| network.result).collect());
        (figures, numbers.run.into_inner(), [watch.done(), watch.total()])
    }

    #[test]
    fn every_case_of_every_network_is_expected_before_the_first_and_judged() {
        let (figures, ran, [done, total]) = run("none");
        assert_eq!(figures.expect("both fit"), [[10.0], [10.0]]);
        assert_eq!((ran, done, total), (2 * CASES, 2 * CASES as u64, 2 * CASES as u64 + 3));
    }

    #[test]
    fn a_second_network_that_does_not_fit_is_refused_before_the_first_runs() {
        let (figures, ran, progress) = run("tactip-past");
        assert!(figures.is_err());
        assert_eq!((ran, progress), (0, [0, 0]));
    }
}

mod slip {
    use crate::slip::Slip;
    use crate::trainings::{HeldOut, Metadata, Scheme, Task};

    fn held_out(entries: &[(&str, &str)]) -> Result<Option<HeldOut>, String> {
        let entries = [&[("trained_on", "Basic")], entries].concat();
        let entries = entries.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        Slip::held_out(Metadata(&entries)).map_err(|error| error.to_string())
    }

    #[test]
    fn a_fold_states_the_part_that_it_held_out() {
        assert_eq!(held_out(&[("seed", "1")]), Ok(None));
        let part = |scheme, window| Ok(Some(HeldOut { scheme, parts: vec![("n/pen1".to_owned(), window)] }));
        let recordings = part(Scheme::Recordings, None);
        assert_eq!(held_out(&[("held_out", "[\"n/pen1\"]")]), recordings);
        assert_eq!(held_out(&[("scheme", "recordings"), ("held_out", "[\"n/pen1\"]")]), recordings);
        let windows = part(Scheme::Windows, Some(3));
        assert_eq!(held_out(&[("scheme", "windows"), ("held_out_windows", "[[\"n/pen1\", 3]]")]), windows);
    }

    #[test]
    fn a_fold_in_another_form_is_refused_with_the_expected_form() {
        for (entries, expected) in [
            (&[("scheme", "objects")][..], "\"recordings\" or \"windows\""),
            (&[("scheme", "windows"), ("held_out", "[]")], "held_out_windows"),
            (&[("held_out", "n/pen1")], "JSON list of recordings"),
            (&[("held_out", "[]"), ("held_out_windows", "[]")], "scheme"),
        ] {
            let error = held_out(entries).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}

mod streams {
    use meissner_models::TensorFile;

    use crate::streams::Streams;

    /// Two streams of two events each.
    fn file() -> Vec<u8> {
        let mut file = TensorFile::new([("sensor".to_owned(), "[8, 6]".to_owned())].into());
        for (name, values) in
            [("t_us", [5, 9, -7, -7]), ("x", [0, 7, 1, 2]), ("y", [5, 0, 3, 3]), ("on", [0, 1, 1, 0])]
        {
            file.i64(name, &[4], &values);
        }
        file.i64("start", &[3], &[0, 2, 4]);
        file.into_bytes()
    }

    /// Reads `bytes`. Accepted events lie on their sensor; an error states the reason in brief.
    fn check(bytes: &[u8]) -> bool {
        match Streams::from_bytes(bytes) {
            Ok(streams) => {
                let events: Vec<_> = streams.parts().concat();
                assert!(events.iter().all(|event| streams.sensor.contains(event.x, event.y)));
                assert_eq!(streams.ends().last(), Some(events.len()).filter(|_| !streams.parts().is_empty()));
                true
            }
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains("expected") && text.len() < 500, "{text:.600}");
                false
            }
        }
    }

    #[test]
    fn a_file_of_streams_that_was_cut_flipped_or_made_up_anywhere_is_read_or_refused() {
        let whole = file();
        assert!(check(&whole));
        (0..whole.len()).for_each(|length| assert!(!check(&whole[..length]), "cut at {length}"));
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            check(&flipped);
        }
        for at in 0..=whole.len() - 8 {
            for length in [1_u64 << 63, u64::MAX, u64::from(u32::MAX), 0] {
                let mut wrong = whole.clone();
                wrong[at..at + 8].copy_from_slice(&length.to_le_bytes());
                check(&wrong);
            }
        }
    }
}

mod truth {
    use meissner_models::TensorFile;
    use safetensors::SafeTensors;

    use crate::error::StreamsError;
    use crate::streams::Truth;

    fn read(
        t_us: &[i64],
        start: &[i64],
        depth: &[f32],
        streams: usize,
    ) -> Result<Option<Truth>, StreamsError> {
        let mut file = TensorFile::new([].into());
        file.i64("truth.t_us", &[t_us.len()], t_us);
        file.i64("truth.start", &[start.len()], start);
        file.f32("truth.depth", &[depth.len()], depth);
        let bytes = file.into_bytes();
        Truth::of_events(&SafeTensors::deserialize(&bytes).expect("a valid file"), streams)
    }

    #[test]
    fn a_label_is_linear_between_its_times_and_constant_outside_them_within_its_stream() {
        let truth = read(&[-10, 0, 20, 5, 6], &[0, 3, 5], &[0.0, 0.0, 4.0, 9.0, 7.0], 2);
        let truth = truth.expect("it fits").expect("there are labels");
        let depth = |stream, t_us| truth.at("depth", stream, t_us).expect("there is such a label");
        assert_eq!(
            [-99, -10, 0, 5, 19, 20, 99].map(|t_us| depth(0, t_us)),
            [0.0, 0.0, 0.0, 1.0, 3.8, 4.0, 4.0]
        );
        assert_eq!([i64::MIN, 5, 6, i64::MAX].map(|t_us| depth(1, t_us)), [9.0, 9.0, 7.0, 7.0]);
        assert_eq!((truth.span_us(0), truth.span_us(1)), ([-10, 20], [5, 6]));
        assert_eq!([0, 1].map(|stream| truth.rises_us("depth", stream)), [Some(0), Some(5)]);
        assert_eq!((truth.at("force", 0, 0), truth.rises_us("force", 0)), (None, None));
    }

    #[test]
    fn labels_that_do_not_fit_are_refused_by_name() {
        let refused = |t_us: &[i64], start: &[i64], depth: &[f32], expected: &str| {
            let error = read(t_us, start, depth, start.len() - 1).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        };
        refused(&[0, 0], &[0, 2], &[1.0, 2.0], "truth.t_us 1: expected a time above 0, found 0");
        refused(
            &[0, 1],
            &[0, 0, 2],
            &[1.0, 2.0],
            "truth.start 0: expected a time for each stream, found none",
        );
        refused(&[0, 1], &[0, 3], &[1.0, 2.0], "truth.start 1: expected 2 to 2, found 3");
        refused(
            &[0, 1],
            &[0, 2],
            &[1.0, f32::INFINITY],
            "truth.depth 1: expected a finite number, found inf",
        );
        let other = read(&[0], &[0, 1], &[1.0], 2).expect_err("another number of streams").to_string();
        assert!(other.contains("truth.start: expected I64 (3), found I64 [2]"), "{other}");
        assert!(read(&[0, 1], &[0, 2], &[1.0], 1).expect("no tensor has the shape of the times").is_none());
    }
}

mod dome {
    use std::collections::BTreeSet;
    use std::f64::consts::PI;

    use meissner_engine::Sensor;
    use meissner_kernels::random::Random;

    use crate::prepare::dome::{planes, record, rising_time};

    #[test]
    fn the_depth_rises_as_the_smooth_step_says() {
        for i in 0..=10 {
            let time = f64::from(i) / 10.0;
            let share = time * time * (3.0 - 2.0 * time);
            assert!((rising_time(share) - time).abs() < 1e-9, "{share}");
        }
    }

    #[test]
    fn planes_of_the_plan_are_200_and_others_lean_by_at_most_9_degrees_in_every_direction() {
        let plan = planes(None, &mut Random::new(0));
        assert_eq!((plan.len(), plan[0], plan[21].0), (200, (0.0, 0.0), PI / 180.0));
        let others = planes(Some(1000), &mut Random::new(3));
        let degrees = others.iter().map(|(tilt, azimuth)| (tilt.to_degrees(), azimuth.to_degrees()));
        assert!(degrees.clone().all(|(tilt, _)| (0.0..=9.0).contains(&tilt)));
        let tens: BTreeSet<_> = degrees.map(|(_, azimuth)| (azimuth / 10.0) as u32).collect();
        assert!(tens.into_iter().eq(0..36));
        assert_eq!(others, planes(Some(1000), &mut Random::new(3)));
        assert_ne!(others, planes(Some(1000), &mut Random::new(4)));
    }

    #[test]
    fn a_recorded_press_fills_the_image_and_moves_every_ring() {
        let recorded = record(0.1, 0.7, Sensor::new(346, 260));
        assert_eq!(recorded.len(), 31);
        for (i, at) in recorded.iter().enumerate() {
            assert!((at.depth_mm - 0.5 * i as f64).abs() < 1e-9);
            assert!(
                at.markers.iter().all(|&[x, y]| (0.0..345.0).contains(&x) && (0.0..259.0).contains(&y)),
                "{i}"
            );
        }
        assert!(recorded.windows(2).all(|pair| pair[1].force_n >= pair[0].force_n - 0.05));
        let moved = |i: usize| {
            let [from, to] = [&recorded[0].markers[i], &recorded[30].markers[i]];
            (to[0] - from[0]).hypot(to[1] - from[1])
        };
        // The first marker of each ring except the top.
        assert!((1..=7).all(|ring| moved(1 + 3 * ring * (ring - 1)) > 1.0));
    }
}

mod grasp {
    use rayon::ThreadPoolBuilder;

    use crate::prepare::grasps;
    use crate::streams::Streams;

    #[test]
    fn a_file_of_grasps_is_read_again_and_has_the_same_bytes_on_any_number_of_threads() {
        let bytes = |threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            grasps(2, 9, &pool).expect("recordings").file.into_bytes()
        };
        let one = bytes(1);
        assert!(one == bytes(2), "the bytes of two threads differ");
        let streams = Streams::from_bytes(&one).expect("a file of streams");
        assert_eq!(streams.parts().len(), 2);
        let labels = streams.labels(1).expect("labels");
        assert_eq!(labels.t_us.last(), Some(&410_000));
        let names: Vec<&str> = labels.values.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["area", "bolt", "depth", "force", "phase"]);
    }
}
