//! Frame engines and representations.

use std::sync::Arc;

use meissner_engine::Event;
use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_engine::representations::{
    Consecutive, ConsecutiveFrames, Crop, Decay, ELECTRODES, Sampling, Scaling, SignedRule, SlidingSigned,
    TactileForm, TactileWindow, TimeSurface, VoxelGrid, VoxelTime,
};
use meissner_kernels::WinogradTile;
use meissner_verify::frame_networks::{Style, network, sequence};

use crate::{ALONE, COUNT, measured, synthetic};

/// Frame networks with and without a memory of frames.
const STYLES: [Style; 6] = [
    Style::Classifier,
    Style::UNet { squeeze: true },
    Style::ConvolutionsThenLstm,
    Style::ConvLstm { hidden: 3, peepholes: false },
    Style::ConvLstm { hidden: 16, peepholes: true },
    Style::Delays,
];

#[test]
fn frames_allocate_nothing_after_new() {
    let _alone = ALONE.lock();
    let committees = [false, true].map(|vector| Style::Committee { vector });
    let size = [2, 32, 48];
    for (style, convolution) in STYLES.into_iter().chain(committees).flat_map(|style| {
        [Convolution::Direct, Convolution::Winograd(WinogradTile::Two)]
            .map(|convolution| (style, convolution))
    }) {
        for sparse in [false, true] {
            let network =
                FrameNetwork::new(network(style, size, 16, 1), convolution).expect("parts that fit");
            let options = FrameOptions::new().with_sparse(sparse);
            let mut engine = FrameEngine::with_options(network, options).expect("options in range");
            let frames = sequence(40, size, 2);
            let pass = |engine: &mut FrameEngine| {
                let before = COUNT.get();
                for frame in &frames {
                    engine.push(frame).expect("a frame that fits");
                    engine.predict().expect("finite");
                }
                engine.reset();
                COUNT.get() - before
            };
            let start = engine.snapshot();
            assert_eq!(pass(&mut engine), 0, "{style:?}, {convolution:?}, sparse {sparse}");
            engine.restore(&start).expect("a state of its own");
            assert_eq!(pass(&mut engine), 0, "{style:?}, {convolution:?}, sparse {sparse}: restored");
        }
    }
}

#[test]
fn a_frame_engine_takes_at_most_what_is_foreseen_and_at_least_99_percent_of_it() {
    let _alone = ALONE.lock();
    let tolerant = Skip::Tolerance(0.01);
    for style in STYLES {
        for (convolution, skip, sparse, two_threads, size) in [
            (Convolution::Direct, Skip::Exact, false, true, [2, 128, 160]),
            (Convolution::Direct, tolerant, true, false, [1, 160, 128]),
            (Convolution::Winograd(WinogradTile::Four), Skip::Exact, true, false, [3, 96, 144]),
            (Convolution::Winograd(WinogradTile::Two), Skip::Nothing, true, false, [4, 128, 128]),
        ] {
            let network =
                FrameNetwork::new(network(style, size, 24, 1), convolution).expect("parts that fit");
            let network = Arc::new(network);
            let options =
                FrameOptions::new().with_skip(skip).with_sparse(sparse).with_two_threads(two_threads);
            let foreseen = network.engine_bytes(options);
            let frames = sequence(12, size, 2);
            let run = || {
                let mut engine =
                    FrameEngine::with_options(Arc::clone(&network), options).expect("options in range");
                for frame in &frames {
                    engine.push(frame).expect("a frame that fits");
                    engine.predict().expect("finite");
                }
            };
            // The threads that all engines share begin with the first engine that needs them.
            run();
            let ((), [_, peak]) = measured(run);
            let peak = u128::from(peak);
            println!("{style:?}, {convolution:?}, {skip:?}: {peak} bytes at most, {foreseen} foreseen");
            assert!(peak <= foreseen && 100 * peak >= 99 * foreseen, "{style:?}, {convolution:?}, {skip:?}");
        }
    }
}

#[test]
fn a_second_pass_through_every_representation_allocates_nothing() {
    let _alone = ALONE.lock();
    let (sensor, events) = synthetic();
    let options = Consecutive::new(Crop::whole(sensor));
    let sum = SignedRule::Sum;
    let mut counts = ConsecutiveFrames::counts(sensor, options, 255.0).expect("admissible");
    let mut signed = ConsecutiveFrames::signed(sensor, options, sum).expect("admissible");
    let capacity = SlidingSigned::DEFAULT_CAPACITY;
    let mut sliding = SlidingSigned::new(sensor, options.crop, sum, 150_000, capacity).expect("admissible");
    let decay = Decay::Exponential { tau_us: 30_000.0 };
    let mut surface = TimeSurface::new(sensor, options.crop, decay).expect("admissible");
    let mut voxels = VoxelGrid::new(sensor, options.crop, 5, VoxelTime::Bins, 0..=1).expect("admissible");
    let mut tactile =
        TactileWindow::new(5, Sampling::Sliding, Scaling::PerImage, TactileForm::Image).expect("admissible");
    let both = Scaling::ReadingAndRange { minimum: 0.0, maximum: 4_096.0 };
    let mut twice = TactileWindow::new(5, Sampling::Sliding, both, TactileForm::Reading).expect("admissible");
    let span = events[events.len() - 1].t_us - events[0].t_us;
    let mut pass = |shift: i64| {
        let before = COUNT.get();
        let (mut frames, mut images) = (0, 0);
        for (i, &event) in events.iter().enumerate() {
            let event = Event { t_us: event.t_us + shift, ..event };
            counts.push(event, |completed| frames += completed.count());
            signed.push(event, |completed| frames += completed.count());
            sliding.push(event);
            surface.push(event);
            if i % 1_000 == 0 {
                voxels.restart(event.t_us..=event.t_us + 50_000).expect("admissible");
            }
            voxels.push(event);
            if i % 100 == 0 {
                assert!(!sliding.frame().is_empty());
                assert!(!surface.surface().active.is_empty());
                assert!(voxels.frame().events > 0);
                images += usize::from(tactile.push(&[i as f32; ELECTRODES]).expect("finite").is_some());
                images += usize::from(twice.push(&[i as f32; ELECTRODES]).expect("finite").is_some());
            }
        }
        assert!(frames > 100 && images > 100);
        COUNT.get() - before
    };
    let warm_up = pass(0);
    let second = pass(span + 10 * 150_000);
    println!("{warm_up} allocations in the first pass, {second} in the second");
    assert_eq!(second, 0);
}
