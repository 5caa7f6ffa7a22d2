//! Descriptions that keep their layers of events and get other dense layers.

use super::support;

use meissner_engine::{Engine, Event, Sensor};
use meissner_kernels::Activation;
use meissner_models::description::frames::{FrameKind, FrameLayer};
use meissner_models::description::{Outputs, Refit};
use meissner_models::{Description, Layer, LayerKind, Tensor, Weights, draw};
use support::{SMALL, shipped};

/// The layers of events of `description`, without their line numbers.
fn of_events(description: &Description) -> Vec<Layer> {
    let kept = description.layers().iter().filter(|layer| !matches!(layer.kind, LayerKind::Dense { .. }));
    let at_no_line = |layer: &Layer| {
        let mut layer = layer.clone();
        layer.line = 0;
        layer
    };
    kept.map(at_no_line).collect()
}

fn refit(outputs: &Outputs, counts: bool) -> Refit<'_> {
    Refit { name: "mine", span_us: None, grid: None, counts, kept: 0, hidden: &[], outputs }
}

#[test]
fn every_shipped_network_keeps_its_layers_of_events_with_dense_layers() {
    let outputs =
        Outputs::Quantities(vec![("x".to_owned(), "mm".to_owned()), ("y".to_owned(), "N".to_owned())]);
    for name in Description::shipped_names() {
        let (description, _) = shipped(name);
        let text = Description::shipped_text(name).expect("a shipped description");
        let found = Description::refitted(text, &refit(&outputs, false)).expect("a consistent description");
        let own = &found.description;
        assert_eq!(of_events(own), of_events(&description), "{}", found.text);
        assert_eq!((own.name(), own.preparation()), ("mine", description.preparation()));
        assert_eq!(
            (own.graph(), own.place(), own.head().len()),
            (description.graph(), description.place(), 0)
        );
        assert_eq!(own.outputs().1, ["mm", "N"]);
        let last = own.layers().last().expect("a layer");
        assert_eq!((last.kind.word(), &*last.name, last.outputs), ("dense", "fitted", 2));
        // Once more, for other outputs, with another layer between.
        let classes = Outputs::Classes(vec!["a".to_owned(), "b".to_owned(), "c".to_owned()]);
        let again = Refit { hidden: &[(5, Activation::Elu)], ..refit(&classes, false) };
        let again = Description::refitted(&found.text, &again).expect("a consistent description");
        assert_eq!(of_events(&again.description), of_events(&description), "{}", again.text);
        let layers = again.description.layers();
        let dense: Vec<&str> = layers.iter().rev().take(2).map(|layer| layer.name.as_str()).collect();
        assert_eq!(
            (dense, again.description.classes().map(<[String]>::len)),
            (vec!["fitted", "fitted1"], Some(3))
        );
    }
}

#[test]
fn dense_layers_get_names_that_no_layer_of_events_has() {
    let text = SMALL.replace("conv1", "fitted");
    let outputs = Outputs::Quantities(vec![("x".to_owned(), "mm".to_owned())]);
    let found = Description::refitted(&text, &refit(&outputs, true)).expect("a consistent description");
    let last = found.description.layers().last();
    assert_eq!(last.map(|layer| layer.name.as_str()), Some("fitted_"), "{}", found.text);
    let wrong = Refit { name: "", ..refit(&outputs, true) };
    Description::refitted(&text, &wrong).expect_err("it is inconsistent");
    let one = Outputs::Classes(vec!["one".to_owned()]);
    Description::refitted(&text, &refit(&one, true)).expect_err("it is inconsistent");
}

#[test]
fn a_window_and_a_grid_can_be_others() {
    let outputs = Outputs::Quantities(vec![("x".to_owned(), "mm".to_owned())]);
    let text = Description::shipped_text("tactigraph-past").expect("a shipped description");
    let other = Refit { span_us: Some(2_000_000), grid: Some([5, 3]), ..refit(&outputs, false) };
    let found = Description::refitted(text, &other).expect("a consistent description").description;
    assert_eq!(found.span_us(), 2_000_000);
    assert_eq!(found.layers().last().map(|layer| layer.inputs), Some(5 * 3 * 16));
}

#[test]
fn a_readout_that_sums_also_sums_events_and_their_polarities() {
    let outputs = Outputs::Quantities(vec![("x".to_owned(), "mm".to_owned())]);
    let base = Weights::shipped("tactigraph-past").expect("its weights");
    let text = Description::shipped_text("tactigraph-past").expect("a shipped description");
    let found = Description::refitted(text, &refit(&outputs, true)).expect("a consistent description");
    assert_eq!(found.counts, 4);
    let values = found.description.layers().last().expect("a layer").inputs;
    let head = [(vec![0.0; values], vec![0.0])];
    let sensor = Sensor::new(48, 36);
    let engine = |network| Engine::new(network, sensor).expect("an engine");
    let network = found.description.network(&found.weights(&base, &head)).expect("they fit");
    let plain = Description::refitted(text, &refit(&outputs, false)).expect("a consistent description");
    let of_plain = plain.weights(&base, &[(vec![0.0; 24 * 18 * 16], vec![0.0])]);
    let (mut engine, mut plain) =
        (engine(network), engine(plain.description.network(&of_plain).expect("they fit")));
    let events = [(1, 0, 0, true), (2, 1, 1, false), (3, 1, 0, true), (4, 47, 35, false)];
    for (t_us, x, y, on) in events {
        for engine in [&mut engine, &mut plain] {
            engine.push(Event::new(t_us, x, y, on));
        }
    }
    engine.predict().expect("numbers");
    plain.predict().expect("numbers");
    let (own, others) = (engine.readout().concat(), plain.readout().concat());
    for (own, others) in own.chunks(20).zip(others.chunks(16)) {
        assert_eq!(own[..16], *others);
    }
    // A cell has 2 x 2 pixels, whose centres are halfway: events, p, p x, p y.
    let close = |own: &[f32], expected: [f32; 4]| {
        own.iter()
            .zip(expected)
            .for_each(|(own, expected)| assert!((own - expected).abs() < 1e-5, "{own} {expected}"));
    };
    close(&own[16..20], [3.0, 1.0, -0.5 - 0.5 + 0.5, -0.5 - 0.5 - 0.5]);
    close(&own[own.len() - 4..], [1.0, -1.0, -0.5, -0.5]);
    // A network that already has counts keeps them, and gets no more.
    let again = Description::refitted(&found.text, &refit(&outputs, true)).expect("a consistent description");
    assert_eq!((again.counts, again.text), (4, found.text));
}

#[test]
fn counts_are_left_out_where_nothing_is_summed() {
    let outputs = Outputs::Quantities(vec![("x".to_owned(), "mm".to_owned())]);
    for name in ["digits-past", "graphres"] {
        let text = Description::shipped_text(name).expect("a shipped description");
        let found = Description::refitted(text, &refit(&outputs, true)).expect("a consistent description");
        assert_eq!(found.counts, 0, "{name}");
    }
}

/// The dense layers of `description`, in order: name, outputs and activation.
fn dense_layers(description: &Description) -> Vec<(String, usize, Activation)> {
    let of_layer = |layer: &Layer| match layer.kind {
        LayerKind::Dense { activation, .. } => Some((layer.name.clone(), layer.outputs, activation)),
        _ => None,
    };
    let of_head = |layer: &FrameLayer| match layer.kind {
        FrameKind::Dense { outputs, activation, .. } => Some((layer.name.clone(), outputs, activation)),
        _ => None,
    };
    let layers = description.layers().iter().filter_map(of_layer);
    layers.chain(description.head().iter().filter_map(of_head)).collect()
}

#[test]
fn a_kept_head_with_its_own_other_layers_predicts_the_same_bits() {
    let outputs = |description: &Description| {
        let (names, units) = description.outputs();
        if let Some(classes) = description.classes() {
            return Outputs::Classes(classes.to_vec());
        }
        Outputs::Quantities(names.iter().cloned().zip(units.iter().cloned()).collect())
    };
    let (mut with_dense, mut without) = (0, 0);
    for name in Description::shipped_names() {
        let (description, _) = shipped(name);
        let dense = dense_layers(&description);
        for head in description.kept_heads() {
            *(if head.has_dense { &mut with_dense } else { &mut without }) += 1;
            let text = Description::shipped_text(name).expect("a shipped description");
            let outputs = outputs(&description);
            let replaced = if head.has_dense { &dense[dense.len() - 1..] } else { &dense[..] };
            let hidden: Vec<_> =
                replaced.iter().map(|(_, outputs, activation)| (*outputs, *activation)).collect();
            let keep =
                Refit { kept: head.layers, hidden: &hidden[..hidden.len() - 1], ..refit(&outputs, false) };
            let found = Description::refitted(text, &keep).expect("a consistent description");
            assert_eq!(found.description.head().len(), description.head().len(), "{}", found.text);
            assert_eq!(found.description.layers().len(), description.layers().len(), "{}", found.text);
            let base = draw(&description, 5);
            let values =
                |name: String| base.get(&name).and_then(Tensor::values).expect("its values").to_vec();
            let own: Vec<_> = replaced
                .iter()
                .map(|(layer, ..)| (values(format!("{layer}.weight")), values(format!("{layer}.bias"))))
                .collect();
            assert_eq!(own[0].0.len(), head.values * hidden[0].0);
            let own = found.weights(&base, &own);
            let predicted =
                [(&description, &base), (&found.description, &own)].map(|(description, weights)| {
                    let network = description.network(weights).expect("they fit");
                    let mut engine = Engine::new(network, Sensor::new(48, 36)).expect("an engine");
                    for i in 0..60_u16 {
                        engine.push(Event::new(i64::from(i) * 500, i % 48, i * 7 % 36, i % 3 == 0));
                    }
                    let values = engine.predict().expect("numbers").values;
                    values.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
                });
            assert_eq!(predicted[0], predicted[1], "{name}");
        }
    }
    assert!(with_dense >= 5 && without >= 1, "{with_dense} and {without} such heads");
}
