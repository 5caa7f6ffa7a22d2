//! Frame networks: skipping changes no bit, and the computed pixels are those that a change
//! reaches.

use meissner_engine::EngineError;
use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions,
    FrameShape, Skip,
};
use meissner_kernels::{Activation, Isa};
use meissner_tests::cases;
use meissner_verify::frame_networks::{Style, network, sequence};
use meissner_verify::strategies::frame_style;
use meissner_verify::{Random, bits};
use proptest::prelude::*;

fn engine(parts: &FrameNetworkParts, convolution: Convolution, options: FrameOptions) -> FrameEngine {
    let network = FrameNetwork::new(parts.clone(), convolution).expect("parts that fit");
    FrameEngine::with_options(network, options).expect("options in range")
}

fn predict(engine: &mut FrameEngine) -> Vec<u32> {
    bits(engine.predict().expect("finite values").values)
}

proptest! {
    #![proptest_config(cases(100))]

    #[test]
    fn instruction_sets_give_the_same_bits(style in frame_style(), seed in any::<u64>()) {
        let size = [2, 12, 20];
        let parts = network(style, size, 8, seed);
        let run = |isa| {
            let mut engine = engine(&parts, Convolution::Direct, FrameOptions::new().with_isa(isa));
            for frame in sequence(4, size, seed) {
                engine.push(&frame).expect("a frame that fits");
            }
            predict(&mut engine)
        };
        let expected = run(Isa::portable());
        for isa in Isa::available() {
            prop_assert_eq!(&run(isa), &expected, "{}", isa.name());
        }
    }
}

/// Layers over a vector of 6 values, each with its input.
fn over_a_vector(layers: Vec<(usize, FrameLayerKind)>) -> FrameNetworkParts {
    let name = |(i, (from, kind))| FrameLayer { name: format!("layer{i}"), from, kind };
    let layers = layers.into_iter().enumerate().map(name).collect();
    FrameNetworkParts { name: "vectors".to_owned(), input: FrameShape::Vector(6), layers, training: None }
}

fn lstm_of_6() -> FrameLayerKind {
    let mut random = Random::new(7);
    let [weight_ih, weight_hh, bias] = [4 * 5 * 6, 4 * 5 * 5, 4 * 5].map(|count| random.values(count, 0.7));
    FrameLayerKind::Lstm { hidden: 5, weight_ih, weight_hh, bias }
}

#[test]
fn a_concatenation_of_vectors_is_the_values_of_one_and_then_of_the_other() {
    let (lstm, delay) = (lstm_of_6(), FrameLayerKind::Delay { frames: 3 });
    let join = |with| FrameLayerKind::Concat { with };
    // Both read the frame; the frame follows after them.
    let parts = over_a_vector(vec![(0, lstm.clone()), (0, delay.clone()), (1, join(2)), (3, join(0))]);
    for skip in [Skip::Exact, Skip::Nothing, Skip::Tolerance(0.0)] {
        let options = FrameOptions::new().with_skip(skip);
        let make = |parts| engine(&parts, Convolution::Direct, options);
        let mut joined = make(parts.clone());
        let mut alone = [&lstm, &delay].map(|kind| make(over_a_vector(vec![(0, kind.clone())])));
        for (n, frame) in sequence(40, [1, 1, 6], 3).iter().enumerate() {
            if n % 9 == 8 {
                joined.reset();
                alone.iter_mut().for_each(FrameEngine::reset);
                assert_eq!(predict(&mut joined), [0; 5 + 18 + 6], "before the first frame");
            }
            joined.push(frame).expect("a frame that fits");
            alone.iter_mut().for_each(|engine| engine.push(frame).expect("a frame that fits"));
            // A prediction may cover several frames.
            if n % 4 != 1 {
                let expected = [predict(&mut alone[0]), predict(&mut alone[1]), bits(frame)].concat();
                assert_eq!(predict(&mut joined), expected, "frame {n}, {skip:?}");
            }
        }
    }
}

#[test]
fn a_vector_may_be_appended_to_itself() {
    let parts = over_a_vector(vec![(0, FrameLayerKind::Concat { with: 0 })]);
    let mut engine = engine(&parts, Convolution::Direct, FrameOptions::default());
    let frame = [1.0, -2.0, 3.0, -4.0, 5.0, -6.0];
    engine.push(&frame).expect("a frame that fits");
    assert_eq!(predict(&mut engine), bits(&[frame, frame].concat()));
    let layer = engine.counters().layers[0];
    engine.push(&frame).expect("a frame that fits");
    assert_eq!(predict(&mut engine), bits(&[frame, frame].concat()));
    let again = engine.counters().layers[0];
    assert_eq!((again.computed, again.skipped), (layer.computed, layer.skipped + 1), "nothing has changed");
}

#[test]
fn before_the_first_frame_what_a_state_reads_is_that_of_zeros() {
    let mut random = Random::new(9);
    let dense = FrameLayerKind::Dense {
        outputs: 6,
        weight: random.values(36, 1.0),
        bias: Some((1..7).map(|b| b as f32).collect()),
        activation: Activation::Identity,
    };
    // The LSTM and the prediction read the dense layer.
    let parts = over_a_vector(vec![(0, dense), (1, lstm_of_6()), (1, FrameLayerKind::Concat { with: 2 })]);
    let expected = bits(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for skip in [Skip::Exact, Skip::Nothing] {
        let mut engine = engine(&parts, Convolution::Direct, FrameOptions::new().with_skip(skip));
        assert_eq!(predict(&mut engine), expected, "a new engine");
        engine.push(&[0.5; 6]).expect("a frame that fits");
        assert_ne!(predict(&mut engine), expected);
        engine.reset();
        assert_eq!(predict(&mut engine), expected, "a reset engine");
    }
}

#[test]
fn an_image_and_a_vector_are_not_concatenated() {
    let sum = || FrameLayer { name: "sum".to_owned(), from: 0, kind: FrameLayerKind::Sum };
    let join =
        |from, with| FrameLayer { name: "join".to_owned(), from, kind: FrameLayerKind::Concat { with } };
    for (from, with, expected) in [
        (0, 1, "an image of 4 x 5 beside 2 x 4 x 5, found 2 values"),
        (1, 0, "a vector beside 2 values, found 2 x 4 x 5"),
    ] {
        let parts = FrameNetworkParts {
            name: "mixed".to_owned(),
            input: FrameShape::Image { channels: 2, height: 4, width: 5 },
            layers: vec![sum(), join(from, with)],
            training: None,
        };
        let error = FrameNetwork::new(parts, Convolution::Direct).expect_err(expected).to_string();
        assert!(error.contains("layer \"join\": second input") && error.ends_with(expected), "{error}");
    }
}

#[test]
fn a_changed_pixel_computes_what_reads_it_and_several_compute_blocks() {
    let size = [1, 64, 128];
    let mut engine =
        engine(&network(Style::Classifier, size, 8, 1), Convolution::Direct, FrameOptions::default());
    let mut frame = vec![0.5; 64 * 128];
    engine.push(&frame).expect("a frame that fits");
    predict(&mut engine);
    let mut before = engine.counters().clone();
    let mut computed = |changed: &[(usize, usize)]| {
        changed.iter().for_each(|&(y, x)| frame[y * 128 + x] += 0.2);
        engine.push(&frame).expect("a frame that fits");
        predict(&mut engine);
        let then = std::mem::replace(&mut before, engine.counters().clone());
        [0, 1, 2].map(|layer| before.layers[layer].computed - then.layers[layer].computed)
    };
    // 3 x 3 pixels, which pool to rows 14 and 15, columns 19 and 20. The convolution runs with the
    // pooling: these and their neighbours are rows 13 to 16 and columns 18 to 21.
    assert_eq!(computed(&[(30, 40)]), [4 * 4, 4, 16]);
    // Two such places: each is in two blocks of 2 x 2, with its neighbours in 3 x 2 blocks.
    assert_eq!(computed(&[(30, 40), (10, 100)]), [4 * 16, 16, 48]);
}

#[test]
fn an_equal_frame_computes_nothing() {
    let size = [1, 32, 32];
    let mut engine = engine(
        &network(Style::UNet { squeeze: true }, size, 8, 1),
        Convolution::Direct,
        FrameOptions::default(),
    );
    let frame = vec![0.5; 32 * 32];
    engine.push(&frame).expect("a frame that fits");
    predict(&mut engine);
    let before = engine.counters().clone();
    engine.push(&frame).expect("a frame that fits");
    predict(&mut engine);
    let computed =
        |c: &meissner_engine::frames::FrameCounters| c.layers.iter().map(|l| l.computed).sum::<u64>();
    assert_eq!(computed(engine.counters()), computed(&before));
}

#[test]
fn an_empty_frame_of_events_is_taken_from_what_zeros_give() {
    let size = [1, 64, 128];
    let options = FrameOptions::new().with_sparse(true);
    let mut engine = engine(&network(Style::Classifier, size, 8, 1), Convolution::Direct, options);
    let mut frame = vec![0.0; 64 * 128];
    frame[20 * 128 + 70] = 1.0;
    engine.push(&frame).expect("a frame that fits");
    predict(&mut engine);
    // The changed pixels pool to rows 9 and 10 of two columns.
    let first = engine.counters().layers[1];
    assert_eq!((first.computed, first.absorbed), (4, 32 * 64 - 4));
    engine.push(&vec![0.0; 64 * 128]).expect("a frame that fits");
    predict(&mut engine);
    let second = engine.counters().layers[1];
    assert_eq!((second.computed, second.absorbed), (first.computed, first.absorbed + 4));
}

#[test]
fn a_tolerance_stops_small_changes_and_bounds_what_is_lost() {
    let size = [1, 32, 64];
    let parts = network(Style::UNet { squeeze: false }, size, 8, 3);
    let mut exact = engine(&parts, Convolution::Direct, FrameOptions::default());
    let options = FrameOptions::new().with_skip(Skip::Tolerance(1e-3));
    let mut near = engine(&parts, Convolution::Direct, options);
    let mut computed = 0;
    for (n, frame) in sequence(40, size, 5).iter().enumerate() {
        let frame: Vec<f32> = frame.iter().map(|v| 0.3 + 2e-3 * v + n as f32 * 1e-5).collect();
        exact.push(&frame).expect("a frame that fits");
        near.push(&frame).expect("a frame that fits");
        let (a, b) = (exact.predict().expect("finite").values, near.predict().expect("finite").values);
        let worst = a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
        assert!(worst < 0.05, "frame {n}: {worst}");
        computed = near.counters().layers[2].computed;
    }
    assert!(computed < exact.counters().layers[2].computed, "the tolerance saves work");
}

#[test]
fn a_frame_of_another_size_or_with_nan_is_refused_and_changes_nothing() {
    let size = [1, 8, 8];
    let mut engine =
        engine(&network(Style::Classifier, size, 8, 1), Convolution::Direct, FrameOptions::default());
    engine.push(&[0.25; 64]).expect("a frame that fits");
    let before = predict(&mut engine);
    let short = engine.push(&[0.0; 63]).expect_err("63 values");
    assert_eq!(short.to_string(), "values of a frame: expected 64 (1 x 8 x 8), found 63");
    let mut frame = [0.0; 64];
    frame[5] = f32::NAN;
    let nan = engine.push(&frame).expect_err("NaN");
    assert_eq!(nan.to_string(), "frame: expected finite values, found NaN as value 5");
    let late = engine.push_slice(&[[0.0; 64], frame].concat()).expect_err("NaN in the second frame");
    assert!(matches!(late, EngineError::FrameValue { at: 69, .. }), "{late}");
    let torn = engine.push_slice(&[0.0; 100]).expect_err("a frame and a half");
    assert!(matches!(torn, EngineError::FrameLength { found: 100, .. }), "{torn}");
    assert_eq!(predict(&mut engine), before);
}

#[test]
fn frames_pushed_together_are_frames_pushed_one_by_one() {
    let parts = network(Style::ConvolutionsThenLstm, [1, 8, 8], 8, 1);
    let new = || engine(&parts, Convolution::Direct, FrameOptions::default());
    let (mut together, mut singly) = (new(), new());
    let frames = sequence(5, [1, 8, 8], 1);
    together.push_slice(&frames.concat()).expect("frames that fit");
    frames.iter().for_each(|frame| singly.push(frame).expect("a frame that fits"));
    assert_eq!(predict(&mut together), predict(&mut singly));
    assert_eq!(together.counters(), singly.counters());
}

#[test]
fn a_layer_that_overflows_is_named_and_predicts_nothing() {
    let mut parts = network(Style::Classifier, [1, 8, 8], 8, 1);
    for layer in &mut parts.layers {
        if let meissner_engine::frames::FrameLayerKind::Conv { weight, .. } = &mut layer.kind {
            weight.iter_mut().for_each(|w| *w *= 1e30);
        }
    }
    let mut engine = engine(&parts, Convolution::Direct, FrameOptions::default());
    engine.push(&[1.0; 64]).expect("a frame that fits");
    let error = engine.predict().expect_err("infinities of both signs meet");
    assert!(matches!(error, EngineError::NotANumber { .. }), "{error}");
}

#[test]
fn parts_that_do_not_fit_are_refused_by_name() {
    let refuse = |change: &dyn Fn(&mut FrameNetworkParts), expected: &str| {
        let mut parts = network(Style::UNet { squeeze: false }, [1, 8, 8], 8, 1);
        change(&mut parts);
        let error = FrameNetwork::new(parts, Convolution::Direct).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
    };
    refuse(&|parts| parts.layers[1].from = 7, "layer \"layer1\": input");
    refuse(&|parts| parts.layers.clear(), "layers: expected at least one");
    refuse(&|parts| parts.input = FrameShape::Vector(64), "expected an image, found 64 values");
    refuse(
        &|parts| parts.input = FrameShape::Image { channels: 1, height: 7, width: 10 },
        "layer \"layer4\": second input",
    );
    refuse(&|parts| parts.input = FrameShape::Image { channels: 2, height: 8, width: 8 }, "layer \"layer0\"");
}
