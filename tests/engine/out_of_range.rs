//! Sensors, streams, options and networks out of range are refused before anything is taken.

use std::sync::Arc;

use meissner_engine::filters::{BackgroundActivity, RateLimit, Refractory, Stride};
use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions,
    FrameShape, Skip,
};
use meissner_engine::representations::{
    Consecutive, ConsecutiveFrames, Crop, Decay, RepresentationError, Sampling, Scaling, SignedRule,
    SlidingSigned, TactileForm, TactileWindow, TimeSurface, VoxelGrid, VoxelTime,
};
use meissner_engine::{
    Batch, Candidates, Engine, EngineError, Event, GraphRule, Lifetime, Network, Options, Reach, Sensor,
    StaleReadout, Staleness, Stream,
};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape};

const SENSOR: Sensor = Sensor { width: 6, height: 5 };
const MAX: Sensor = Sensor { width: u16::MAX, height: u16::MAX };
const WITHOUT_PIXELS: [Sensor; 3] = [
    Sensor { width: 0, height: 0 },
    Sensor { width: 0, height: u16::MAX },
    Sensor { width: u16::MAX, height: 0 },
];

#[test]
fn sensors_without_pixels_are_refused() {
    let network = Arc::new(small());
    for sensor in WITHOUT_PIXELS {
        let engine = Engine::new(Arc::clone(&network), sensor);
        assert_eq!(engine.err(), Some(EngineError::Sensor(sensor)));
        assert_eq!(Batch::new(Arc::clone(&network), sensor).err(), Some(EngineError::Sensor(sensor)));
        assert!(
            representations(sensor).iter().all(|r| matches!(r, Err(RepresentationError::Crop { .. }))),
            "{sensor}"
        );
    }
}

#[test]
fn tables_of_gigabytes_for_the_largest_sensor_are_refused() {
    let refused = "pixels of a filter's sensor: expected 0 to 67108864, found 4294836225";
    assert_eq!(BackgroundActivity::new(MAX, 1_250).expect_err("64 GiB").to_string(), refused);
    assert_eq!(Refractory::new(MAX, 1_000).expect_err("64 GiB").to_string(), refused);
    assert!(representations(MAX).iter().all(|r| matches!(r, Err(RepresentationError::Size { .. }))));
}

#[test]
fn a_sensor_of_one_row_as_long_as_can_be_runs() {
    for sensor in [Sensor::new(u16::MAX, 1), Sensor::new(1, u16::MAX)] {
        let network = Arc::new(small());
        let mut engine = Engine::new(Arc::clone(&network), sensor).expect("a megabyte of tables");
        let ends = [0, 1, 40_000, u16::MAX - 2, u16::MAX - 1, u16::MAX];
        let at =
            |p: u16| if sensor.height == 1 { Event::new(5, p, 0, true) } else { Event::new(5, 0, p, true) };
        let events = ends.map(at);
        assert_eq!(engine.push_slice(&events), 5, "the last is beside {sensor}");
        let got = engine.predict().expect("finite").values.to_vec();
        let batch = Batch::new(network, sensor).expect("it has pixels");
        assert_eq!(got, batch.forward(Stream::new(&events[..5])).expect("finite").prediction);
        assert!(matches!(
            batch.forward(Stream::new(&events)),
            Err(EngineError::Stream { what: "pixel", .. })
        ));
        assert!(representations(sensor).iter().all(Result::is_ok));
    }
}

#[test]
fn streams_that_no_engine_accepts_are_refused_with_the_event() {
    let batch = Batch::new(small(), SENSOR).expect("the sensor has pixels");
    let refused = |events: &[Event], epoch_us: i64, now_us: i64| {
        batch.forward(Stream { events, epoch_us, now_us }).expect_err("no such stream").to_string()
    };
    let event = |t_us: i64| Event::new(t_us, 1, 1, true);
    let beside = Event::new(1, 6, 4, true);
    assert_eq!(
        refused(&[event(0), beside], 0, 1),
        "stream: pixel: expected a pixel of 6x5, found (6, 4) of event 1"
    );
    assert_eq!(
        refused(&[event(3), event(2)], 3, 3),
        "stream: times: expected none to descend, found 2 us after 3 us at event 1"
    );
    assert_eq!(
        refused(&[event(3)], 4, 9),
        "stream: first event: expected not before the epoch, 4 us, found 3"
    );
    assert_eq!(
        refused(&[event(3)], 3, 2),
        "stream: newest time: expected not before the last event, 3 us, found 2"
    );
    assert!(
        refused(&[event(-2), event(i64::MAX)], -2, i64::MAX).contains("at most 2^63 - 1 us after the epoch")
    );
    assert!(batch.forward(Stream { events: &[], epoch_us: i64::MAX, now_us: i64::MIN }).is_ok());
}

#[test]
fn options_that_are_no_numbers_or_beyond_all_bounds_are_refused() {
    let network = Arc::new(small());
    let frames = Arc::new(copies(1, FrameShape::Vector(2)));
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -f32::MIN_POSITIVE] {
        let options = Options::new().with_tolerance(wrong);
        let engine = Engine::with_options(Arc::clone(&network), SENSOR, options);
        assert!(matches!(engine, Err(EngineError::Option { what: "tolerance", .. })), "{wrong}");
        let options = FrameOptions::new().with_skip(Skip::Tolerance(wrong));
        let engine = FrameEngine::with_options(Arc::clone(&frames), options);
        assert!(matches!(engine, Err(EngineError::Option { what: "tolerance", .. })), "{wrong}");
        let whole = Crop::whole(SENSOR);
        assert!(TimeSurface::new(SENSOR, whole, Decay::Exponential { tau_us: wrong }).is_err(), "{wrong}");
        assert!(TimeSurface::new(SENSOR, whole, Decay::Linear { span_us: wrong }).is_err(), "{wrong}");
        assert!(ConsecutiveFrames::counts(SENSOR, Consecutive::new(whole), wrong).is_err(), "{wrong}");
        let scaling = Scaling::Range { minimum: 0.0, maximum: wrong };
        assert!(TactileWindow::new(5, Sampling::Sliding, scaling, TactileForm::Image).is_err(), "{wrong}");
    }
    for (steps, stride) in [(0, 1), (usize::MAX, 1), (1, 0)] {
        let sampling = Sampling::Step { stride };
        assert!(TactileWindow::new(steps, sampling, Scaling::PerImage, TactileForm::Image).is_err());
    }
    for us in [i64::MIN, -1, 0, i64::MAX] {
        assert!(BackgroundActivity::new(SENSOR, us).is_err() && Refractory::new(SENSOR, us).is_err(), "{us}");
        let engine = Engine::new(Arc::clone(&network), SENSOR).expect("admissible");
        assert!(StaleReadout::new(engine, Staleness::new().with_us(us)).is_err(), "{us}");
    }
    assert!(Stride::new(0).is_err() && RateLimit::new(0).is_err() && RateLimit::new(u64::MAX).is_err());
    for capacity in [0, usize::MAX] {
        let sliding = SlidingSigned::new(SENSOR, Crop::whole(SENSOR), SignedRule::Sum, i64::MAX, capacity);
        assert!(sliding.is_err(), "{capacity}");
    }
}

#[test]
fn a_frame_network_of_a_terabyte_is_refused_before_anything_is_taken() {
    let gibibyte = FrameShape::Image { channels: 1, height: 1 << 14, width: 1 << 14 };
    let network = Arc::new(copies(1_023, gibibyte));
    for sparse in [false, true] {
        let options = FrameOptions::new().with_sparse(sparse);
        match FrameEngine::with_options(Arc::clone(&network), options) {
            Err(EngineError::FrameMemory { bytes, limit: 4_294_967_296, .. }) => {
                assert!(bytes > 1 << if sparse { 41 } else { 40 }, "{bytes} bytes");
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_frame_engine_may_take_exactly_what_is_foreseen() {
    let network = Arc::new(copies(3, FrameShape::Image { channels: 2, height: 9, width: 70 }));
    let options = FrameOptions::new().with_sparse(true);
    let memory_limit = network.engine_bytes(options);
    assert!(FrameEngine::with_options(Arc::clone(&network), options.with_memory_limit(memory_limit)).is_ok());
    let less = options.with_memory_limit(memory_limit - 1);
    let error = FrameEngine::with_options(network, less).expect_err("a byte is missing").to_string();
    let expected =
        format!("expected at most {} bytes of activations and state, found {memory_limit}", memory_limit - 1);
    assert_eq!(error, format!("network \"copies\": {expected}"));
}

#[test]
fn an_engine_may_take_exactly_what_is_foreseen() {
    let network = Arc::new(small());
    let bytes = Engine::new(Arc::clone(&network), SENSOR).expect("admissible").state_bytes();
    let with = |memory_limit| {
        let options = Options::new().with_memory_limit(memory_limit);
        Engine::with_options(Arc::clone(&network), SENSOR, options).map(|_| ())
    };
    assert_eq!(with(bytes), Ok(()));
    let refused = with(bytes - 1);
    assert!(
        matches!(refused, Err(EngineError::Memory { bytes: found, .. }) if found == bytes),
        "{refused:?}"
    );
    assert_eq!(Options::default().memory_limit, 4 << 30);
}

#[test]
fn what_a_head_takes_counts_against_the_memory_of_its_engine() {
    let (plain, headed) = (NetworkShape { head: None, ..small_shape() }, small_shape());
    let bytes = |shape: &NetworkShape| Engine::new(shape.build(), SENSOR).expect("admissible").state_bytes();
    let network = headed.build();
    let head = network.parts().head.as_ref().expect("a head").engine_bytes(FrameOptions::default());
    assert!(bytes(&headed) > bytes(&plain) + head / 2, "two dense layers instead take next to nothing");
    let options = Options::new().with_memory_limit(bytes(&plain) + head / 2);
    assert!(matches!(Engine::with_options(network, SENSOR, options), Err(EngineError::Memory { .. })));
}

/// A network that reads a grid of 2 x 2 cells by a head.
fn small_shape() -> NetworkShape {
    let block = BlockShape {
        channels: 4,
        conv: ConvolutionShape::Spline([2; 3]),
        input: 0,
        skip: None,
        extras: [true; 4],
    };
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 3 }, candidates: Candidates::Past(Lifetime::Window) },
        span_us: 1_000,
        capacity: 8,
        place: None,
        blocks: vec![block],
        pooled: vec![],
        from: 1,
        grid: [2, 2],
        dense: vec![2],
        head: Some(4),
        seed: 3,
    }
}

fn small() -> Network {
    NetworkShape { head: None, ..small_shape() }.build()
}

/// `count` layers without weights over `input`; each writes its input.
fn copies(count: usize, input: FrameShape) -> FrameNetwork {
    let kind = |from| match input {
        FrameShape::Image { .. } => FrameLayerKind::AveragePool { size: 1 },
        FrameShape::Vector(_) => FrameLayerKind::Concat { with: from },
    };
    let layer = |from| FrameLayer { name: format!("copy {from}"), from, kind: kind(from) };
    let parts = FrameNetworkParts {
        name: "copies".to_owned(),
        input,
        layers: (0..count).map(layer).collect(),
        training: None,
    };
    FrameNetwork::new(parts, Convolution::Direct).expect("parts that fit")
}

/// Whether each representation shows all of `sensor`.
fn representations(sensor: Sensor) -> [Result<(), RepresentationError>; 5] {
    let whole = Crop::whole(sensor);
    let options = Consecutive::new(whole);
    [
        ConsecutiveFrames::counts(sensor, options, 1.0).map(drop),
        ConsecutiveFrames::signed(sensor, options, SignedRule::Sum).map(drop),
        SlidingSigned::new(sensor, whole, SignedRule::Sum, 1, 1).map(drop),
        TimeSurface::new(sensor, whole, Decay::Linear { span_us: 1.0 }).map(drop),
        VoxelGrid::new(sensor, whole, 1, VoxelTime::Bins, 0..=0).map(drop),
    ]
}
