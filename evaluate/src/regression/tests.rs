use std::path::Path;

use meissner_engine::{Engine, Event, Sensor};
use meissner_models::{Description, TensorFile, Weights};
use meissner_run::predictor::Mode;
use rayon::ThreadPoolBuilder;

use super::{Options, Report, evaluate};
use crate::error::{EvaluateError, Result, StreamsError};
use crate::trainings::{Evaluation, Request};
use crate::workers::Workers;

const SENSOR: Sensor = Sensor { width: 346, height: 260 };

/// Two presses: contact at 10 ms, end at 40 and at 60 ms; events that wander over the sensor.
fn streams() -> [Vec<Event>; 2] {
    let stream = |seed: u16, count: i64| {
        let event = |i: i64| {
            let (x, y) = (97 * i as u16 + 13 * seed, 61 * i as u16 + 7 * seed);
            Event::new(500 * i + i64::from(seed), x % SENSOR.width, y % SENSOR.height, i % 3 == 0)
        };
        (0..count).map(event).collect()
    };
    [stream(1, 70), stream(2, 100)]
}

/// A file with `labels`. Its angles are in degrees if `units` name degrees.
fn file(labels: &[&str], units: Option<&str>) -> Vec<u8> {
    let metadata =
        [Some(("sensor", "[346, 260]")), units.map(|units| ("units", units))].into_iter().flatten();
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_owned())).collect();
    let mut file = TensorFile::new(metadata);
    let events = streams().concat();
    let mut add = |name, value: fn(&Event) -> i64| {
        file.i64(name, &[events.len()], &events.iter().map(value).collect::<Vec<_>>());
    };
    add("t_us", |event| event.t_us);
    add("x", |event| event.x.into());
    add("y", |event| event.y.into());
    add("on", |event| event.on.into());
    file.i64("start", &[3], &[0, 70, 170]);
    file.i64("truth.start", &[3], &[0, 3, 6]);
    file.i64("truth.t_us", &[6], &[0, 10_000, 40_000, 0, 10_000, 60_000]);
    for &name in labels {
        let values = if name == "depth" {
            [0.0, 0.0, 5.0, 0.0, 0.0, 9.0]
        } else {
            let in_unit =
                if units.is_some_and(|units| units.contains("deg")) { 1_f32.to_degrees() } else { 1.0 };
            [0.1, 0.1, 0.1, -0.05, -0.05, -0.05].map(|angle| angle * in_unit)
        };
        file.f32(&format!("truth.{name}"), &[6], &values);
    }
    file.into_bytes()
}

fn workers(threads: usize) -> Workers {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").into()
}

fn judged(path: &Path, network: &str, how: (Mode, usize)) -> Evaluation<Report> {
    try_judged(path, network, how).expect("it is judged")
}

fn try_judged(path: &Path, network: &str, (mode, threads): (Mode, usize)) -> Result<Evaluation<Report>> {
    let networks = [network.to_owned()];
    let request = Request { networks: &networks, ..Request::default() };
    let options = Options { request, stride: Some(1), every_us: 10_000, mode, embeds: false };
    evaluate(path, &options, &workers(threads), |_, _| {})
}

fn written(labels: &[&str]) -> tempfile::TempPath {
    written_in(labels, None)
}

fn written_in(labels: &[&str], units: Option<&str>) -> tempfile::TempPath {
    let file_of =
        tempfile::NamedTempFile::new().expect("there is a place for temporary files").into_temp_path();
    std::fs::write(&file_of, file(labels, units)).expect("it can be written");
    file_of
}

#[test]
fn errors_at_the_end_are_those_of_the_engine_in_degrees() {
    let path = written(&["roll", "pitch", "depth"]);
    let Evaluation { report, .. } = judged(&path, "tactigraph-past", (Mode::Incremental, 1));
    assert_eq!(report.times_us, [0, 10_000, 20_000, 30_000, 40_000, 50_000]);
    let judged = report.networks[0].result.figures.as_ref().expect("there are presses");
    let (description, weights) = (
        Description::shipped("tactigraph-past").expect("shipped"),
        Weights::shipped("tactigraph-past").expect("shipped"),
    );
    let mut engine = Engine::new(description.network(&weights).expect("they fit"), SENSOR).expect("a sensor");
    let mut errors = [0.0; 2];
    for (events, (end, truth)) in streams().iter().zip([(40_000, 0.1), (60_000, -0.05)]) {
        engine.reset();
        events.iter().filter(|event| event.t_us <= end).for_each(|&event| {
            engine.push(event);
        });
        engine.advance(end);
        let values = engine.predict().expect("it predicts").values.to_vec();
        for (error, value) in errors.iter_mut().zip(values) {
            *error += (f64::from(value) - f64::from(truth as f32)).abs().to_degrees() / 2.0;
        }
    }
    for (output, error) in judged.mean.outputs.iter().zip(errors) {
        assert!((output.mean_absolute.mean - error).abs() < 1e-9, "{}: {error}", output.name);
        assert_eq!((output.unit.as_str(), output.mean_absolute_at.len()), ("deg", 6));
        // At the last time both presses are over.
        assert_eq!(output.mean_absolute_at[5], output.mean_absolute);
    }
    let angles = judged.mean.angles.as_ref().expect("there are two angles").mean_absolute.mean;
    assert!((angles - errors.iter().sum::<f64>() / 2.0).abs() < 1e-9);
    // Each press has predictions at 0, at contact, every 10 ms, and at the end.
    assert_eq!((judged.mean.work.events, judged.mean.work.predictions), (70 + 100, 5 + 7));
}

#[test]
fn labels_are_compared_in_their_units() {
    let judged = |units| {
        let path = written_in(&["roll", "pitch", "depth"], units);
        try_judged(&path, "tactigraph-past", (Mode::Incremental, 1))
    };
    let errors = |units| {
        let report = judged(units).expect("it is judged").report;
        let judged = report.networks[0].result.figures.as_ref().expect("there are presses");
        judged.mean.outputs.iter().map(|output| output.mean_absolute.mean).collect::<Vec<_>>()
    };
    let expected = errors(None);
    for units in [r#"{"roll": "rad", "pitch": "rad", "depth": "mm"}"#, r#"{"roll": "deg", "pitch": "deg"}"#] {
        for (error, expected) in errors(Some(units)).into_iter().zip(&expected) {
            assert!((error - expected).abs() < 1e-5, "{units}: {error} instead of {expected}");
        }
    }
    let refused = judged(Some(r#"{"roll": "mm"}"#)).err().expect("a length is no angle").to_string();
    assert!(refused.contains("labels roll in deg, as tactigraph-past predicts, found mm"), "{refused}");
    let refused = judged(Some("[1]")).err().expect("no units");
    assert!(matches!(refused, EvaluateError::Streams { source: StreamsError::Units(_), .. }), "{refused}");
}

#[test]
fn threads_and_the_mode_change_no_figure_and_no_bit_of_the_outputs() {
    let path = written(&["roll", "pitch", "depth"]);
    let of = |how| {
        let Evaluation { report, logits, .. } = judged(&path, "tactigraph-past", how);
        let judged =
            report.networks.into_iter().next().and_then(|network| network.result.figures).expect("presses");
        let figures: Vec<_> = judged
            .mean
            .outputs
            .into_iter()
            .map(|output| (output.mean_absolute, output.mean_absolute_at))
            .collect();
        (figures, judged.mean.settled_share, logits.into_bytes())
    };
    let first = of((Mode::Incremental, 1));
    assert!(of((Mode::Incremental, 2)) == first && of((Mode::Batch, 1)) == first);
}

#[test]
fn a_frame_network_over_a_sliding_window_is_judged_on_the_same_presses() {
    let path = written(&["roll", "pitch"]);
    let Evaluation { report, .. } = judged(&path, "event-frame-cnn", (Mode::Incremental, 1));
    let judged = report.networks[0].result.figures.as_ref().expect("there are presses");
    // Without depth, contact is the first time of the truth.
    assert_eq!(report.times_us.last(), Some(&60_000));
    assert!(judged.mean.work.multiply_adds > 0 && judged.mean.work.rows == 0);
    assert!(judged.mean.outputs.iter().all(|output| output.mean_absolute.mean > 0.0));
}

#[test]
fn presses_without_labels_and_networks_of_other_quantities_are_refused() {
    let refused = |labels: &[&str], network: &str, expected: &str| {
        let path = written(labels);
        let networks = [network.to_owned()];
        let request = Request { networks: &networks, ..Request::default() };
        let options =
            Options { request, stride: None, every_us: 1_000, mode: Mode::Incremental, embeds: false };
        let Err(error) = evaluate(&path, &options, &workers(1), |_, _| {}) else { panic!("{expected}") };
        let text = meissner_run::error::chain(&error);
        assert!(text.contains(expected), "{text}");
    };
    refused(&[], "tactigraph-past", "truth.t_us: expected labels along time");
    refused(
        &["roll", "depth"],
        "tactigraph-past",
        "expected networks that predict labels of the file: depth, roll, found tactigraph-past, which predicts pitch",
    );
    refused(&["roll", "pitch"], "digits-past", "found digits-past, which predicts classes");
    refused(
        &["force"],
        "force-lstm",
        "expected networks over events, or over signed frames of a sliding window",
    );
}

mod press {
    use crate::regression::press::Quantity;
    use crate::regression::press::{TimedPrediction, due, newest, settled};

    #[test]
    fn predictions_are_due_around_contact_and_at_the_end_once() {
        let times = |start, contact, end| due(start, contact, end, 10).collect::<Vec<_>>();
        assert_eq!(times(-25, 0, 25), [-20, -10, 0, 10, 20, 25]);
        assert_eq!(times(5, 5, 25), [5, 15, 25]);
        assert_eq!(times(5, 5, 5), [5]);
    }

    #[test]
    fn a_reader_has_a_prediction_only_after_its_latency() {
        let found = |t_us: i64, available_us: f64, value| TimedPrediction {
            t_us,
            available_us,
            values: vec![value],
            unlike: None,
        };
        let predictions = [found(0, 900.0, 5.0), found(1_000, 3_500.0, 1.0)];
        // At 0 there is none; at 1, 2 and 3 ms the first, at 4 ms the second.
        let errors = newest(&predictions, 0, 4_000, |held, _| held.errors(&[0.0])).expect("one came in time");
        assert_eq!(errors, [4.0 * 4.0 / 4.0]);
        assert!(newest(&predictions, 0, 500, |held, _| held.errors(&[0.0])).is_none());
    }

    #[test]
    fn an_angle_has_settled_after_its_last_large_error() {
        let quantity = |unit: &str| Quantity { name: "a".to_owned(), unit: unit.to_owned(), scale: 1.0 };
        let (angle, depth) = (quantity("deg"), quantity("mm"));
        let at = |errors: &[f64], quantity: &Quantity| {
            let errors: Vec<_> = errors.iter().map(|&error| vec![error]).collect();
            settled(&errors, std::slice::from_ref(quantity))
        };
        assert_eq!(at(&[0.5, 2.0, 1.0, 0.1], &angle), Some(2));
        assert_eq!(
            [at(&[0.5, 0.9], &angle), at(&[0.1, 1.1], &angle), at(&[], &angle)],
            [Some(0), None, None]
        );
        assert_eq!(at(&[0.1], &depth), None);
    }
}

mod embedding {
    use crate::regression::embedding;
    use meissner_kernels::random::Random;

    #[test]
    fn two_groups_stay_apart_and_the_same_presses_give_the_same_points() {
        let mut random = Random::new(3);
        let readouts: Vec<Vec<f32>> = (0..60)
            .map(|i| (0..5).map(|_| random.symmetric() + if i < 30 { 0.0 } else { 20.0 }).collect())
            .collect();
        let points = embedding(&readouts).expect("enough presses");
        assert_eq!(Some(&points), embedding(&readouts).as_ref());
        let distance = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).hypot(a.1 - b.1);
        for (i, &point) in points.iter().enumerate() {
            let others = (0..60).filter(|&j| j != i);
            let nearest =
                others.min_by(|&a, &b| distance(point, points[a]).total_cmp(&distance(point, points[b])));
            assert_eq!(nearest.map(|j| j < 30), Some(i < 30), "press {i}");
        }
    }

    #[test]
    fn a_few_presses_have_no_embedding() {
        assert!(embedding(&[]).is_none() && embedding(&vec![vec![1.0]; 6]).is_none());
        assert_eq!(embedding(&vec![vec![1.0]; 7]).map(|points| points.len()), Some(7), "equal ones too");
    }
}
