//! Unlikeness of frames to those of a training.

use std::time::Duration;

use meissner_engine::frames::{
    Convolution, Frame, FrameEngine, FrameFeatures, FrameNetwork, FrameNetworkParts, FrameShape,
    FrameStatistics, TimedFrames, TrainingFrames,
};
use meissner_engine::{Event, Predictor};
use meissner_kernels::random::Random;
use meissner_live::{Live, QueueOptions};
use meissner_tests::cases;
use meissner_verify::frame_networks::{Style, network, sequence};
use proptest::prelude::*;

const SIZE: [usize; 3] = [2, 12, 20];

fn shape([channels, height, width]: [usize; 3]) -> FrameShape {
    FrameShape::Image { channels, height, width }
}

/// The features of an image, value by value: every sum as the documentation names it.
fn naive(frames: &[&[f32]], [channels, height, width]: [usize; 3]) -> Vec<f64> {
    let groups = if channels <= 3 { channels } else { 1 };
    let group = |channel: usize| if groups == channels { channel } else { 0 };
    let at = |frame: &[f32], channel: usize, y: usize, x: usize| {
        f64::from(frame[(channel * height + y) * width + x])
    };
    let mut means = vec![0.0; 3 * groups + groups * (groups - 1) / 2 + 16];
    for frame in frames {
        let mut sums = vec![0.0; means.len()];
        let (differences, cells) = (sums.len() - 16 - groups, sums.len() - 16);
        for channel in 0..channels {
            for y in 0..height {
                for x in 0..width {
                    let v = at(frame, channel, y, x);
                    sums[group(channel)] += v;
                    sums[groups + group(channel)] += v * v;
                    sums[cells + y * 4 / height * 4 + x * 4 / width] += v * v;
                    if x > 0 {
                        let step = v - at(frame, channel, y, x - 1);
                        sums[differences + group(channel)] += step * step;
                    }
                    for other in (0..channel).filter(|_| groups > 1) {
                        let pair = channel * (channel - 1) / 2 + other;
                        sums[2 * groups + pair] += v * at(frame, other, y, x);
                    }
                }
            }
        }
        means.iter_mut().zip(&sums).for_each(|(mean, sum)| *mean += sum / frames.len() as f64);
    }
    let square = |channel: usize| means[groups + channel];
    let cosine = |(pair, [a, b]): (usize, [usize; 2])| {
        let both = square(a) * square(b);
        if both > 0.0 { means[2 * groups + pair] / both.sqrt() } else { 0.0 }
    };
    let pairs = [[1, 0], [2, 0], [2, 1]].into_iter().take(groups * (groups - 1) / 2);
    let cosines: Vec<f64> = pairs.enumerate().map(cosine).collect();
    let roots = means[2 * groups + cosines.len()..].iter().map(|sum| sum.sqrt());
    let squares = (0..groups).map(|channel| square(channel).sqrt());
    means[..groups].iter().copied().chain(squares).chain(cosines).chain(roots).collect()
}

/// A frame; the part `filled` of its values is not zero, and some zeros are -0.
fn frame(size: [usize; 3], filled: f64, random: &mut Random) -> Vec<f32> {
    let value = |_| match random.uniform() {
        part if part < filled => (random.uniform() * 4.0 - 2.0) as f32,
        part if part < 1.1 * filled => -0.0,
        _ => 0.0,
    };
    (0..size.iter().product()).map(value).collect()
}

proptest! {
    #![proptest_config(cases(100))]

    #[test]
    fn features_are_those_of_plain_loops_over_the_newest_frames(
        size in (1usize..6, 1usize..9, 1usize..60).prop_map(|(c, h, w)| [c, h, w]),
        filled in prop_oneof![Just(0.0), Just(0.01), Just(0.2), Just(1.0)],
        remembers in any::<bool>(),
        count in 1usize..40,
        seed in any::<u64>(),
    ) {
        let mut random = Random::new(seed);
        let frames: Vec<Vec<f32>> = (0..count).map(|_| frame(size, filled, &mut random)).collect();
        let mut statistics = FrameStatistics::new(&FrameFeatures::Image, shape(size), remembers).expect("an image");
        frames.iter().for_each(|frame| statistics.push(frame));
        let window = if remembers { 16 } else { 1 };
        let newest: Vec<&[f32]> = frames[count.saturating_sub(window)..].iter().map(|frame| &frame[..]).collect();
        let (found, expected) = (statistics.features(), naive(&newest, size));
        prop_assert_eq!(found.len(), expected.len());
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let near = (found - expected).abs() <= 1e-6 * (1.0 + expected.abs());
            prop_assert!(near, "feature {}: found {}, expected {}", i, found, expected);
        }
        // Zeros with a sign are not skipped, and change no bit.
        let signed = |value: &f32| if *value == 0.0 { -0.0 } else { *value };
        let mut slow = FrameStatistics::new(&FrameFeatures::Image, shape(size), remembers).expect("an image");
        frames.iter().for_each(|frame| slow.push(&frame.iter().map(signed).collect::<Vec<_>>()));
        let bits = |of: &FrameStatistics| of.features().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&statistics), bits(&slow));
        statistics.reset();
        frames[..1].iter().for_each(|frame| statistics.push(frame));
        let mut new = FrameStatistics::new(&FrameFeatures::Image, shape(size), remembers).expect("an image");
        new.push(&frames[0]);
        prop_assert_eq!(statistics.features(), new.features());
    }
}

/// A training on frames of `size`; a fifth of their values is not zero.
fn trained(size: [usize; 3], remembers: bool) -> TrainingFrames {
    let mut random = Random::new(5);
    let mut statistics =
        FrameStatistics::new(&FrameFeatures::Image, shape(size), remembers).expect("an image");
    let mut features = |_| {
        statistics.push(&frame(size, 0.2, &mut random));
        statistics.features()
    };
    TrainingFrames::of(FrameFeatures::Image, &(0..400).map(&mut features).collect::<Vec<_>>()).expect("many")
}

fn parts(training: Option<TrainingFrames>) -> FrameNetworkParts {
    let style = Style::ConvLstm { hidden: 2, peepholes: false };
    FrameNetworkParts { training, ..network(style, SIZE, 4, 3) }
}

fn engine(training: Option<TrainingFrames>) -> FrameEngine {
    let network = FrameNetwork::new(parts(training), Convolution::Direct).expect("parts that fit");
    FrameEngine::new(network).expect("options in range")
}

#[test]
fn frames_of_the_trainings_kind_are_below_one_and_others_above() {
    let training = trained(SIZE, false);
    let unlike = |frame: &[f32]| {
        let mut statistics =
            FrameStatistics::new(&FrameFeatures::Image, shape(SIZE), false).expect("an image");
        statistics.push(frame);
        training.unlikeness(&statistics)
    };
    let mut random = Random::new(77);
    let own: Vec<f32> = (0..100).map(|_| unlike(&frame(SIZE, 0.2, &mut random))).collect();
    assert!(own.iter().filter(|unlike| **unlike > 1.0).count() <= 2, "{own:?}");
    let mut hot = frame(SIZE, 0.2, &mut random);
    hot[130] = 40.0;
    let double: Vec<f32> = frame(SIZE, 0.2, &mut random).iter().map(|value| 3.0 * value).collect();
    let values = SIZE.iter().product();
    for (what, frame) in [
        ("nothing", vec![0.0; values]),
        ("white", vec![1.0; values]),
        ("a hot pixel", hot),
        ("a stronger signal", double),
        ("everywhere", frame(SIZE, 1.0, &mut random)),
        ("the largest numbers", vec![f32::MAX; values]),
    ] {
        let unlike = unlike(&frame);
        assert!(unlike > 1.0 && unlike.is_finite(), "{what}: {unlike}");
    }
}

#[test]
fn predictions_say_it_and_keep_their_bits() {
    let (mut known, mut unknown) = (engine(Some(trained(SIZE, true))), engine(None));
    assert_eq!(known.network().fingerprint(), unknown.network().fingerprint());
    let mut statistics = FrameStatistics::new(&FrameFeatures::Image, shape(SIZE), true).expect("an image");
    for frame in sequence(30, SIZE, 9) {
        known.push(&frame).expect("a frame");
        unknown.push(&frame).expect("a frame");
        statistics.push(&frame);
        let expected = known.network().training().expect("it knows").unlikeness(&statistics);
        let (found, silent) = (known.predict().expect("finite"), unknown.predict().expect("finite"));
        assert_eq!(found.values, silent.values);
        assert_eq!((found.unlike, silent.unlike), (Some(expected), None));
    }
}

#[test]
fn a_clock_and_a_live_engine_say_what_their_engine_says() {
    let frames: Vec<Frame> = (0..).step_by(10_000).zip(sequence(20, SIZE, 4)).map(of_time).collect();
    let mut alone = engine(Some(trained(SIZE, true)));
    frames.iter().for_each(|frame| alone.push(&frame.values).expect("a frame"));
    let expected = alone.predict().expect("finite").unlike;
    assert!(expected.is_some());
    let timed = || TimedFrames::new(engine(Some(trained(SIZE, true))));
    let mut clocked = timed();
    clocked.push_slice(&frames).expect("frames in order");
    assert_eq!(clocked.predict().expect("finite").unlike, expected);
    let (mut input, mut live) = Live::spawn(timed(), QueueOptions::new()).expect("in range");
    input.push_slice(&frames).expect("the worker lives");
    assert_eq!(live.predict(Duration::MAX).expect("it predicts").unlike, expected);
}

fn of_time((t_us, values): (i64, Vec<f32>)) -> Frame {
    Frame { t_us, values }
}

#[test]
fn states_of_networks_that_do_not_know_their_training_are_restored() {
    let (mut known, mut unknown) = (engine(Some(trained(SIZE, true))), engine(None));
    let frames = sequence(20, SIZE, 8);
    frames.iter().for_each(|frame| known.push(frame).expect("a frame"));
    frames.iter().for_each(|frame| unknown.push(frame).expect("a frame"));
    let expected = known.predict().expect("finite").unlike;
    let (copy, bytes) = (known.snapshot(), known.to_bytes());
    let of_unknown = (unknown.snapshot(), unknown.to_bytes());
    // The engine keeps its statistics through its own states.
    known.reset();
    known.restore(&copy).expect("its own state");
    assert_eq!(known.predict().expect("finite").unlike, expected);
    known.reset();
    known.restore_bytes(&bytes).expect("its own state");
    assert_eq!(known.predict().expect("finite").unlike, expected);
    // A state without these statistics describes the newest frame only.
    let mut newest = FrameStatistics::new(&FrameFeatures::Image, shape(SIZE), true).expect("an image");
    newest.push(&frames[19]);
    let newest = known.network().training().map(|training| training.unlikeness(&newest)).expect("it knows");
    known.restore(&of_unknown.0).expect("an equal network");
    let found = known.predict().expect("finite").unlike.expect("it knows");
    assert!((found / newest - 1.0).abs() < 1e-5, "{found}, {newest}");
    known.restore_bytes(&of_unknown.1).expect("an equal network");
    assert_eq!(known.predict().expect("finite").unlike, Some(found));
    for state in [copy, meissner_engine::frames::FrameSnapshot::from_bytes(&bytes).expect("a state")] {
        unknown.restore(&state).expect("an equal network");
        let prediction = unknown.predict().expect("finite");
        assert_eq!((prediction.unlike, prediction.frames), (None, 20));
    }
}

#[test]
fn values_at_places_describe_the_newest_frame_by_their_squares() {
    let of = FrameFeatures::Values(vec![1, 4]);
    let mut statistics = FrameStatistics::new(&of, FrameShape::Vector(5), true).expect("places");
    assert_eq!(statistics.features(), [0.0, 0.0]);
    statistics.push(&[1.0, 2.0, 3.0, 4.0, 5.0]);
    statistics.push(&[0.0, -3.0, 0.0, 0.0, 0.5]);
    assert_eq!(statistics.features(), [9.0, 0.25]);
    for places in [vec![], vec![1, 1], vec![3, 2], vec![0, 5], (0..65).collect()] {
        let of = FrameFeatures::Values(places);
        assert!(FrameStatistics::new(&of, FrameShape::Vector(5), true).is_none(), "{of:?}");
    }
    assert!(FrameStatistics::new(&FrameFeatures::Image, FrameShape::Vector(5), true).is_none());
    assert!(FrameStatistics::new(&FrameFeatures::Image, shape([2, 0, 5]), true).is_none());
}

#[test]
fn parts_that_are_no_frames_of_a_training_are_refused() {
    let training = trained(SIZE, true);
    let (of, mean, factor) = training.parts();
    let from =
        |mean: &[f64], factor: &[Vec<f64>]| TrainingFrames::from_parts(of.clone(), mean, factor.to_vec());
    assert_eq!(from(mean, factor).as_ref(), Some(&training));
    assert_eq!(from(&mean[1..], factor), None);
    assert_eq!(from(mean, &factor[1..]), None);
    assert_eq!(from(&[], &[]), None);
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut other = factor.to_vec();
        other[3][3] = value;
        assert_eq!(from(mean, &other), None);
    }
    let few = TrainingFrames::of(FrameFeatures::Image, &vec![mean.to_vec(); 2 * mean.len() + 1]);
    assert_eq!(few, None, "too few frames");
    let mixed = [vec![mean.to_vec(); 100], vec![mean[1..].to_vec(); 100]].concat();
    assert_eq!(TrainingFrames::of(FrameFeatures::Image, &mixed), None);
    assert_eq!(TrainingFrames::of(FrameFeatures::Image, &[]), None);
    let of_three = Some(trained([3, 12, 20], true));
    let error = FrameNetwork::new(parts(of_three), Convolution::Direct).expect_err("other features");
    assert!(error.to_string().contains("training"), "{error}");
}

#[test]
fn a_frame_network_over_events_says_it_too() {
    use std::sync::Arc;

    use meissner_engine::Sensor;
    use meissner_engine::frames::FrameOptions;
    use meissner_run::live_frames::LiveFrames;
    use meissner_run::model::FrameModel;

    let model = FrameModel::named("force-tdnn", None, Convolution::Direct, false).expect("shipped");
    assert!(model.network.training().is_some());
    let sensor = Sensor::new(115, 115);
    let mut live = LiveFrames::new(Arc::new(model), sensor, FrameOptions::new()).expect("a feed");
    // A few hot pixels would be muted.
    for i in 0..4_000_i64 {
        let (x, y) = (50 + i as u16 % 10, 50 + i as u16 / 10 % 10);
        live.push(&Event::new(25 * i, x, y, i % 2 == 0)).expect("an event");
    }
    let unlike = live.predict().expect("finite").unlike.expect("the weights say");
    assert!(unlike > 1.0, "a spot that flickers alone: {unlike}");
}
