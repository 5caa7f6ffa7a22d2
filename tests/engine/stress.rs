//! Overflows: no NaN becomes a prediction, and infinities are the same in every way of computation.

use std::sync::Arc;

use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions,
    FrameShape, Skip,
};
use meissner_engine::{
    Batch, Block, Candidates, Engine, EngineError, Event, Fraction, GraphRule, Level, Network, NetworkParts,
    Options, Pooling, Position, Reach, Sensor, Stream,
};
use meissner_kernels::{Activation, Dense, SplineConv, SplineParts, WinogradTile};
use meissner_models::{Description, Weights, draw};
use meissner_verify::Random;
use meissner_verify::bits;
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape};

const SENSOR: Sensor = Sensor { width: 60, height: 40 };

fn layer(name: &str, from: usize, kind: FrameLayerKind) -> FrameLayer {
    FrameLayer { name: name.to_owned(), from, kind }
}

/// Pixels of 8 channels; the second convolution makes NaN of what the first makes infinite.
fn nan_of_infinity() -> FrameNetworkParts {
    let conv =
        |channels, weight| FrameLayerKind::Conv { kernel: 1, channels, weight, bias: None, relu: false };
    let mut differences = vec![0.0; 64];
    (0..8).for_each(|o| differences[o * 8..o * 8 + 2].copy_from_slice(&[1.0, -1.0]));
    let dense = FrameLayerKind::Dense {
        outputs: 1,
        weight: vec![1.0; 8 * 4],
        bias: None,
        activation: Activation::Identity,
    };
    FrameNetworkParts {
        name: "overflow".to_owned(),
        input: FrameShape::Image { channels: 8, height: 4, width: 4 },
        layers: vec![
            layer("large", 0, conv(8, vec![10.0; 64])),
            layer("difference", 1, conv(8, differences)),
            layer("pool", 2, FrameLayerKind::MaxPool),
            layer("flat", 3, FrameLayerKind::Flatten),
            layer("fc", 4, dense),
        ],
        training: None,
    }
}

#[test]
fn nan_in_one_pixel_of_a_pooled_window_is_an_error_wherever_it_is() {
    let network =
        Arc::new(FrameNetwork::new(nan_of_infinity(), Convolution::Direct).expect("the layers fit"));
    for skip in [Skip::Exact, Skip::Nothing] {
        let options = FrameOptions::new().with_skip(skip);
        let mut engine = FrameEngine::with_options(Arc::clone(&network), options).expect("options in range");
        for pixel in 0..16 {
            let mut frame = vec![1.0; 8 * 16];
            (0..8).for_each(|c| frame[c * 16 + pixel] = 3e38);
            engine.push(&frame).expect("finite values");
            let error = engine.predict().map(|p| p.values.to_vec());
            let expected = EngineError::NotANumber { layer: "difference".to_owned(), rows: 1 };
            assert_eq!(error, Err(expected), "pixel {pixel}, {skip:?}");
        }
        engine.push(&[1.0; 8 * 16]).expect("finite values");
        assert_eq!(engine.predict().expect("it goes on").values, [0.0], "{skip:?}");
    }
}

#[test]
fn a_tile_that_overflows_is_an_error_and_not_a_prediction() {
    let weight = |o: usize, i: usize| if (o + i).is_multiple_of(2) { 0.02 } else { -0.02 };
    let weight = (0..4 * 8).flat_map(|i| [weight(i / 8, i % 8); 9]).collect();
    let conv = FrameLayerKind::Conv { kernel: 3, channels: 4, weight, bias: None, relu: false };
    let input = FrameShape::Image { channels: 8, height: 8, width: 8 };
    let parts = FrameNetworkParts {
        name: "tiles".to_owned(),
        input,
        layers: vec![layer("conv", 0, conv)],
        training: None,
    };
    let mut random = Random::new(5);
    let frame: Vec<f32> = (0..8 * 64).map(|_| if random.below(2) == 0 { 3e37 } else { -3e37 }).collect();
    let predict = |convolution| {
        let network = Arc::new(FrameNetwork::new(parts.clone(), convolution).expect("the layers fit"));
        let mut engine = FrameEngine::new(network).expect("options in range");
        engine.push(&frame).expect("finite values");
        engine.predict().map(|p| p.values.iter().all(|v| v.is_finite()))
    };
    assert_eq!(predict(Convolution::Direct), Ok(true), "directly, nothing overflows");
    // Sums inside a tile of F(4 x 4) are up to a hundred times as large as the results.
    let expected = EngineError::NotANumber { layer: "conv".to_owned(), rows: 1 };
    assert_eq!(predict(Convolution::Winograd(WinogradTile::Four)), Err(expected));
}

fn events(count: i64) -> Vec<Event> {
    let mut random = Random::new(2);
    let mut pixel = |extent: u16| random.below(extent.into()) as u16;
    (0..count).map(|i| Event::new(i * 700, pixel(60), pixel(40), i % 3 == 0)).collect()
}

/// The shipped network with the weights of its blocks and of its last dense layer multiplied by
/// these factors.
fn changed(name: &str, blocks: f32, last: f32) -> Arc<Network> {
    changed_from(name, &Weights::shipped(name).expect("shipped weights"), blocks, last)
}

/// The shipped network with such changes to `weights`.
fn changed_from(name: &str, weights: &Weights, blocks: f32, last: f32) -> Arc<Network> {
    let network = Description::shipped(name).expect("a shipped network").network(weights);
    let network = network.expect("the weights fit").with_capacity(48).expect("in range");
    let mut parts: NetworkParts = network.parts().clone();
    let scaled = |values: &[f32], by: f32| values.iter().map(|v| v * by).collect::<Vec<_>>();
    let levels = std::iter::once(&mut parts.events).chain(parts.pooled.iter_mut().map(|(_, level)| level));
    for block in levels.flat_map(|level| &mut level.blocks) {
        block.conv = block.conv.scaled(blocks, 1.0).expect("finite weights");
    }
    if let Some(layer) = parts.dense.last_mut() {
        let old = &layer.dense;
        let (segments, weight) = (old.inputs() / old.channels(), scaled(&old.weight(), last));
        layer.dense =
            Dense::new(segments, old.channels(), old.outputs(), &weight, Some(old.bias()), old.activation())
                .expect("finite weights");
    }
    Arc::new(Network::new(parts).expect("the parts fit"))
}

/// Prediction or error after each event; asserts that both are the same from scratch.
fn outcomes(network: &Arc<Network>) -> Vec<Result<Vec<f32>, EngineError>> {
    let batch = Batch::new(Arc::clone(network), SENSOR).expect("the sensor has pixels");
    let mut engine = Engine::new(Arc::clone(network), SENSOR).expect("the network is exact");
    let events = events(120);
    let mut out = Vec::new();
    for i in 0..events.len() {
        engine.push(events[i]);
        let got = engine.predict().map(|p| p.values.to_vec());
        let want = batch.forward(Stream::new(&events[..=i])).map(|trace| trace.prediction);
        let text =
            |outcome: &Result<Vec<f32>, EngineError>| outcome.as_ref().map(|v| bits(v)).map_err(Clone::clone);
        assert_eq!(text(&got), text(&want), "event {i}");
        out.push(got);
    }
    out
}

#[test]
fn exploding_activations_are_an_error_with_the_layers_name_in_engine_and_batch_alike() {
    for name in ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"] {
        let network = changed(name, 1e15, 1.0);
        let refused: Vec<EngineError> = outcomes(&network).into_iter().filter_map(Result::err).collect();
        assert!(!refused.is_empty(), "{name}: 1e15 in each of 3, 7 or 10 blocks is more than f32 holds");
        for error in refused {
            let EngineError::NotANumber { layer, .. } = &error else { panic!("{name}: {error}") };
            assert!(network.layers().contains(&layer.as_str()), "{name}: {layer}");
        }
    }
}

#[test]
fn an_infinite_prediction_is_given_as_such_and_holds_no_nan() {
    // Trained weights of a last layer are small: larger blocks or drawn weights make up for it.
    let graphres = draw(&Description::shipped("graphres").expect("a shipped network"), 1);
    let networks = [changed_from("graphres", &graphres, 1.0, 1e38), changed("tactigraph-past", 10.0, 1e38)];
    for network in &networks {
        let (name, outcomes) = (network.name(), outcomes(network));
        let values = || outcomes.iter().flatten().flatten();
        assert!(values().any(|v| v.is_infinite()), "{name}");
        assert!(!values().any(|v| v.is_nan()), "{name}");
    }
}

#[test]
fn vanishing_and_denormal_activations_are_the_same_bits_in_engine_and_batch() {
    for name in ["graphres", "tactigraph-past"] {
        for by in [1e-6, 1e-39, 1e-44] {
            let outcomes = outcomes(&changed(name, by, 1.0));
            assert!(
                outcomes.iter().all(|o| o.as_ref().is_ok_and(|v| v.iter().all(|v| v.is_finite()))),
                "{name}, {by:e}"
            );
        }
    }
}

/// Neighbours within 11 pixels. The first block is infinite for a row of two neighbours; the second
/// is then not a number in its first channel and infinite in its second.
fn infinite_between_two(head: Option<usize>, blocks: usize) -> NetworkParts {
    let block = |input| BlockShape {
        channels: 2,
        conv: ConvolutionShape::Spline([2; 3]),
        input,
        skip: None,
        extras: [false; 4],
    };
    let shape = NetworkShape {
        graph: GraphRule { reach: Reach::Radius { r: 0.115, max: 8 }, candidates: Candidates::All },
        span_us: 1_000,
        capacity: 16,
        place: None,
        blocks: (0..blocks).map(block).collect(),
        pooled: vec![],
        from: blocks,
        grid: [1, 1],
        dense: vec![2, 2, 2],
        head,
        seed: 5,
    };
    let mut parts = shape.build().parts().clone();
    let weights = [vec![2.5e38; 16], [1.0, 0.5, -1.0, 0.5].repeat(8), [1.0, 0.0, 0.0, 1.0].repeat(8)];
    for ((block, inputs), weight) in parts.events.blocks.iter_mut().zip([1, 2, 2]).zip(weights) {
        let conv = SplineParts { inputs, outputs: 2, kernel: [2; 3], weight, ..SplineParts::default() };
        block.conv = SplineConv::new(&conv).expect("finite weights").into();
    }
    parts
}

/// Three events in a row, each a neighbour of the next.
fn three(engine: &mut Engine) {
    for (t_us, x) in [(0, 10), (10, 20), (20, 30)] {
        engine.push(Event::new(t_us, x, 50, true));
    }
}

#[test]
fn rows_that_are_no_numbers_are_counted_in_the_first_layer_that_has_them_until_they_leave() {
    let network = Arc::new(Network::new(infinite_between_two(None, 3)).expect("the parts fit"));
    let mut engine = Engine::new(Arc::clone(&network), Sensor::new(100, 100)).expect("the network is exact");
    let error = |rows| Err(EngineError::NotANumber { layer: network.layers()[1].to_owned(), rows });
    let outcome = |engine: &mut Engine| engine.predict().map(|_| ());
    // The middle one has two neighbours; the others read it.
    three(&mut engine);
    assert_eq!(outcome(&mut engine), error(2));
    // One of the two leaves, and the other no longer reads an infinite value.
    engine.advance(1_001);
    assert_eq!(outcome(&mut engine), Ok(()));
    engine.reset();
    three(&mut engine);
    assert_eq!(outcome(&mut engine), error(2));
    engine.reset();
    assert_eq!(outcome(&mut engine), Ok(()));
}

#[test]
fn cells_that_are_no_numbers_are_counted_in_the_first_block_of_their_level() {
    let mut parts = infinite_between_two(None, 1);
    let conv = infinite_between_two(None, 2).events.blocks.remove(1).conv;
    let level =
        Level { scale: 1.0, blocks: vec![Block { name: "above".to_owned(), input: 0, skip: None, conv }] };
    let tenth = Fraction::new(1, 10).expect("positive");
    let pooling = Pooling {
        name: "pool".to_owned(),
        from: 1,
        cell: [tenth; 2],
        time: None,
        position: Position::Centre,
    };
    parts.pooled = vec![(pooling, level)];
    let network = Network::new(parts).expect("the parts fit");
    let mut engine = Engine::new(network, Sensor::new(100, 100)).expect("the network is exact");
    three(&mut engine);
    let error = engine.predict().expect_err("infinity less infinity");
    assert_eq!(error, EngineError::NotANumber { layer: "above".to_owned(), rows: 2 });
}

#[test]
fn a_row_that_is_partly_no_number_is_refused_from_a_snapshot() {
    let options = Options::new().with_tolerance(0.1);
    let network = Network::new(infinite_between_two(None, 2)).expect("the parts fit");
    let mut engine = Engine::with_options(network, Sensor::new(100, 100), options).expect("admissible");
    three(&mut engine);
    assert!(engine.predict().is_err());
    let error = engine.restore_bytes(&engine.to_bytes()).expect_err("not finite").to_string();
    assert!(error.contains("expected a finite number"), "{error}");
}

#[test]
fn a_dense_layer_that_is_no_number_is_named_and_the_first_of_several() {
    let mut parts = infinite_between_two(None, 0);
    let weights = [vec![f32::MAX; 2], vec![1.0, -1.0, 1.0, 1.0], vec![1.0; 4]];
    for ((layer, inputs), weight) in parts.dense.iter_mut().zip([1, 2, 2]).zip(weights) {
        let bias = [f32::MAX; 2];
        let dense = Dense::new(1, inputs, 2, &weight, Some(&bias), Activation::Identity);
        layer.dense = dense.expect("finite weights");
    }
    let name = parts.dense[1].name.clone();
    let network = Network::new(parts).expect("the parts fit");
    let mut engine = Engine::new(network, Sensor::new(100, 100)).expect("the network is exact");
    three(&mut engine);
    let error = engine.predict().expect_err("infinity less infinity");
    assert_eq!(error, EngineError::NotANumber { layer: name, rows: 1 });
}

#[test]
fn a_head_over_an_infinite_readout_predicts_nothing() {
    let network = Network::new(infinite_between_two(Some(3), 1)).expect("the parts fit");
    let mut engine = Engine::new(network, Sensor::new(100, 100)).expect("the network is exact");
    three(&mut engine);
    let error = engine.predict().expect_err("an infinite maximum");
    assert_eq!(error, EngineError::NotANumber { layer: "readout".to_owned(), rows: 1 });
    engine.advance(1_001);
    assert!(engine.predict().is_ok());
}
