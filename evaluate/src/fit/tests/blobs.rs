//! Results of fits, and that an engine predicts the same.

use std::path::Path;
use std::sync::Arc;

use meissner_engine::{BatchEngine, Engine, Event, Search};
use meissner_models::{Description, Tensor, Weights, draw};

use super::{Folder, Options, PRESS_US, SENSOR, SMALL, places, workers};
use crate::fit::readouts::Readouts;
use crate::fit::samples::{Samples, Target};
use crate::fit::{Fitted, Head};
use crate::presses::{Options as ReadOptions, Presses};

fn engine(fitted: &Fitted) -> Engine {
    let description = Description::parse(&fitted.description).expect("a description");
    let weights = Weights::from_bytes(&fitted.weights).expect("weights");
    Engine::new(description.network(&weights).expect("they fit"), SENSOR).expect("an engine")
}

#[test]
fn a_place_is_found_and_a_number_that_no_event_knows_is_not() {
    let folder = places(30);
    let report = folder.fit(&folder.options(), 2).expect("it can be fitted").report;
    let names: Vec<(&str, &str)> =
        report.outputs.iter().map(|of| (of.name.as_str(), of.unit.as_str())).collect();
    assert_eq!(names, [("x", "mm"), ("tilt", "deg"), ("unknown", "1")]);
    let [x, tilt, unknown] = &report.outputs[..] else { panic!("three outputs") };
    for found in [x, tilt] {
        assert!(found.in_events && found.error.mean < 0.5 * found.constant.mean, "{found:?}");
        assert!(found.error.interval[0] < found.error.mean && found.error.mean < found.error.interval[1]);
        assert!(found.before.is_none(), "the network predicts roll");
    }
    assert!(!unknown.in_events && unknown.advice.contains("not in the events"), "{unknown:?}");
    let presses: Vec<usize> = x.curve.iter().map(|point| point.presses).collect();
    assert_eq!(presses, [5, 10, 20]);
    assert!(x.curve[0].error.mean > x.error.mean, "{:?}", x.curve);
    let at_ages: usize = x.ages.iter().map(|age| age.instants).sum();
    assert_eq!((at_ages, report.data.instants), (150, 150));
    assert_eq!((report.sensor.size, report.sensor.trained_size), ([48, 36], None));
    // Cells of 8 x 9 pixels are halved; a row has 4 channels of the layers and 4 that count.
    assert_eq!(report.base.readout, 12 * 8 * 8);
    let given = Options { grid: Some([6, 4]), ..folder.options() };
    assert_eq!(folder.fit(&given, 2).expect("it can be fitted").report.base.readout, 6 * 4 * 8);
}

#[test]
fn an_engine_and_a_batch_predict_what_was_fitted_bit_for_bit() {
    let folder = places(12);
    for hidden in [0, 8] {
        predicts_what_was_fitted(&folder, hidden);
    }
}

fn predicts_what_was_fitted(folder: &Folder, hidden: usize) {
    let options = Options { hidden, ..folder.options() };
    let fitted = folder.fit(&options, 1).expect("it can be fitted");
    let presses = Presses::read(folder.path(), &ReadOptions::default()).expect("presses");
    let mut engine = engine(&fitted);
    let mut batch = BatchEngine::new(Arc::clone(engine.network()), SENSOR).expect("a batch");
    batch = batch.with_search(Search::Grid);
    let weights = Weights::from_bytes(&fitted.weights).expect("weights");
    let tensor = |name: String| weights.get(&name)?.values().map(<[f32]>::to_vec);
    let names = ["fitted1", "fitted2", "fitted3", "fitted"];
    let layers: Vec<(Vec<f32>, Vec<f32>)> = names
        .iter()
        .filter_map(|name| Some((tensor(format!("{name}.weight"))?, tensor(format!("{name}.bias"))?)))
        .collect();
    assert!([1, 3, 4].contains(&layers.len()), "{}", fitted.description);
    let mut errors = 0.0;
    for press in 0..12 {
        let events = presses.events(press).expect("it can be read again");
        engine.reset();
        engine.push_slice(&events);
        engine.advance(PRESS_US);
        let prediction = engine.predict().expect("numbers");
        assert!(
            prediction.unlike.is_some_and(|unlike| unlike <= 1.0),
            "a window that was fitted: {prediction:?}"
        );
        let predicted = prediction.values.to_vec();
        batch.reset();
        batch.push_slice(&events);
        batch.advance(PRESS_US);
        assert_eq!(batch.predict().expect("numbers").values, predicted);
        let mut by_hand: Vec<f64> = engine.readout().concat().iter().map(|&x| f64::from(x)).collect();
        for (place, (weight, bias)) in layers.iter().enumerate() {
            let sum = |(row, bias): (&[f32], &f32)| {
                let products = row.iter().zip(&by_hand).map(|(w, x)| f64::from(*w) * x);
                let sum = f64::from(*bias) + products.sum::<f64>();
                if (1..layers.len() - 1).contains(&place) && sum < 0.0 { sum.exp_m1() } else { sum }
            };
            by_hand = weight.chunks(by_hand.len()).zip(bias).map(sum).collect();
        }
        for (by_hand, &value) in by_hand.iter().zip(&predicted) {
            let difference = (by_hand - f64::from(value)).abs();
            assert!(difference < 1e-2 * by_hand.abs().max(1.0), "{by_hand} {value}");
        }
        let truth = presses.rows_of(press).last().expect("labels").values[0];
        errors += (f64::from(predicted[0]) - truth).abs() / 12.0;
    }
    // The head predicts the presses that it was fitted to better than held-out ones.
    assert!(errors < fitted.report.outputs[0].error.mean, "{errors}: {:?}", fitted.report.outputs[0]);
}

#[test]
fn the_number_of_threads_changes_no_bit_and_the_seed_some() {
    let folder = places(12);
    let [one, two] = [1, 2].map(|threads| folder.fit(&folder.options(), threads).expect("it can be fitted"));
    assert_eq!(one.weights, two.weights);
    let json = |fitted: &Fitted| serde_json::to_string(&fitted.report).expect("JSON");
    assert_eq!(json(&one), json(&two));
    let other = folder.fit(&Options { seed: 1, ..folder.options() }, 2).expect("it can be fitted");
    assert_ne!(one.weights, other.weights);
}

#[test]
fn presses_are_also_read_as_if_their_events_were_elsewhere() {
    let folder = places(6);
    let presses = Presses::read(folder.path(), &ReadOptions::default()).expect("presses");
    let options = Options { shift: 5, ages: 2, ..folder.options() };
    let target = Target::choose(&presses, &options, (&[], &[])).expect("numbers");
    let samples = Samples::of(&presses, &target, &options).expect("enough presses");
    let description = Description::parse(SMALL).expect("a description");
    let network = description.network(&draw(&description, 3)).expect("they fit");
    let mut engine = Engine::new(network, SENSOR).expect("an engine");
    let found = Readouts::of((&presses, &samples), &engine, 1, false, &workers(2)).expect("numbers");
    assert_eq!((samples.instants.len(), found.windows.len()), (6 * 3 * 5, 6 * 3));
    assert!(
        samples.ends().count() == 6 && samples.ends().all(|end| end.moved == [0, 0] && end.weight == 1.0)
    );
    for (instant, values) in samples.instants.iter().zip(found.values.chunks(found.columns)) {
        let [columns, rows] = instant.moved;
        engine.reset();
        for event in &presses.events(instant.press).expect("it can be read again") {
            let (x, y) = (i32::from(event.x) + columns, i32::from(event.y) + rows);
            if event.t_us <= instant.t_us && (0..48).contains(&x) && (0..36).contains(&y) {
                engine.push(Event::new(event.t_us, x as u16, y as u16, event.on));
            }
        }
        engine.advance(instant.t_us);
        engine.predict().expect("numbers");
        assert_eq!(engine.readout().concat(), values, "{instant:?}");
    }
    let one = folder.fit(&options, 1).expect("it can be fitted");
    assert_eq!(one.weights, folder.fit(&options, 2).expect("it can be fitted").weights);
    let ages: usize = one.report.outputs[0].ages.iter().map(|age| age.instants).sum();
    assert_eq!((one.report.data.instants, ages), (6 * 3 * 5, 6 * 3));
}

#[test]
fn classes_of_whole_presses_are_found() {
    let folder = Folder::new(30, "recording,side,roll_deg", |press, [x, _], _| {
        format!("press{press},{},{press}", if x < 24.0 { "left" } else { "right" })
    });
    let options = Options { labels: Some(vec!["side".to_owned()]), ..folder.options() };
    let fitted = folder.fit(&options, 2).expect("it can be fitted");
    let report = &fitted.report;
    assert_eq!(report.classes.as_deref().map(|names| names.join(" ")).as_deref(), Some("left right"));
    let [sides] = &report.outputs[..] else { panic!("one figure") };
    assert!(sides.in_events && sides.error.mean < 0.2, "{sides:?}");
    let confusion = report.confusion.as_ref().expect("classes have one");
    assert_eq!(confusion.total(), 30);
    assert_eq!((30 - confusion.hits()) as f64 / 30.0, sides.error.mean);
    let network = engine(&fitted);
    assert_eq!(network.network().outputs(), 2);
    let description = Description::parse(&fitted.description).expect("a description");
    assert_eq!(description.classes().map(<[String]>::len), Some(2));
}

/// Options to fit `first` again, with its files in `place`.
fn again(first: &Fitted, place: &Path, options: Options) -> Options {
    let [description, weights] = ["mine.toml", "mine.safetensors"].map(|name| place.join(name));
    std::fs::write(&description, &first.description).expect("it can be written");
    std::fs::write(&weights, &first.weights).expect("it can be written");
    Options { weights: Some(weights), network: description.display().to_string(), ..options }
}

#[test]
fn a_fitted_network_can_be_fitted_again_and_is_compared_with_itself() {
    let folder = places(12);
    let first = folder.fit(&folder.options(), 2).expect("it can be fitted");
    let place = tempfile::tempdir().expect("there is a place for temporary files");
    let second = folder.fit(&again(&first, place.path(), folder.options()), 2).expect("it can be fitted");
    assert_eq!(first.description, second.description);
    // The layers of events, the presses and the seed are the same.
    let head = |fitted: &Fitted| {
        let weights = Weights::from_bytes(&fitted.weights).expect("weights");
        weights.get("fitted.weight").cloned()
    };
    assert_eq!(head(&first), head(&second));
    let before = second.report.outputs[0].before.expect("it predicts x already");
    assert!(before.mean < second.report.outputs[0].constant.mean, "{before:?}");
    // Its head has seen these presses: on held-out ones it would seem better than it is.
    assert_eq!(second.report.heads.len(), 1);
}

#[test]
fn a_head_that_knows_more_than_a_new_one_is_kept_but_its_last_layer() {
    let labels = "recording,side,roll_deg";
    let side = |press: usize, [x, y]: [f64; 2], _: f64| {
        format!("press{press},{},{press}", if x + y < 42.0 { "near" } else { "far" })
    };
    let (many, few) = (Folder::new(60, labels, side), Folder::new(12, labels, side));
    let options = Options { labels: Some(vec!["side".to_owned()]), ages: 0, ..many.options() };
    let mut first = many.fit(&options, 2).expect("it can be fitted");
    // Another layer behind the one that was fitted.
    let layer = "[[layer]]\nname = \"out\"\nkind = \"dense\"\noutputs = 2\n\n[output]";
    first.description = first.description.replace("[output]", layer);
    let weights = Weights::from_bytes(&first.weights).expect("weights");
    let mut tensors: Vec<(String, Tensor)> =
        weights.iter().map(|(name, tensor)| (name.to_owned(), tensor.clone())).collect();
    let tensor = |shape: &[usize], values: Vec<f32>| Tensor::new(shape.to_vec(), values).expect("its values");
    tensors.push(("out.weight".to_owned(), tensor(&[2, 2], vec![1.0, 0.0, 0.0, 1.0])));
    tensors.push(("out.bias".to_owned(), tensor(&[2], vec![0.0; 2])));
    first.weights = Weights::new(tensors).to_safetensors(weights.metadata());

    let place = tempfile::tempdir().expect("there is a place for temporary files");
    let second = few.fit(&again(&first, place.path(), options), 2).expect("it can be fitted");
    let [new, kept] = &second.report.heads[..] else { panic!("{:?}", second.report.heads) };
    assert!(new.head == Head::New && matches!(kept.head, Head::Kept { values: 2, .. }), "{kept:?}");
    assert!(kept.error <= new.error && second.report.base.readout == 2, "{new:?} {kept:?}");
    // The readouts are the values that the last layer reads in a run.
    let presses = Presses::read(few.path(), &ReadOptions::default()).expect("presses");
    let mut engine = engine(&second);
    let wrong = (0..12).filter(|&press| {
        engine.reset();
        engine.push_slice(&presses.events(press).expect("it can be read again"));
        let logits = engine.predict().expect("numbers").values;
        let truth = presses.rows_of(press).last().expect("labels").values[0];
        (logits[1] > logits[0]) != (truth > 0.5)
    });
    assert!(
        wrong.count() as f64 / 12.0 <= second.report.outputs[0].error.mean,
        "{:?}",
        second.report.outputs
    );
}
