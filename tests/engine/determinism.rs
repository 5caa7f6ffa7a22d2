//! The same bits at any number of threads, on every instruction set, in every build, and as in
//! earlier versions; the content of a fingerprint.

use meissner_engine::frames::{FrameEngine, FrameSnapshot};
use meissner_engine::{
    Batch, Candidates, Engine, Event, Fraction, GraphConvolution, GraphRule, Lifetime, Network, NetworkParts,
    Normalisation, Options, Position, Reach, Search, Sensor, Snapshot, StaleReadout, Stream,
};
use meissner_kernels::{Isa, PointNetConv, PointNetParts, SplineConv, SplineParts};
use meissner_tests::fixed_run::{self, Mode};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use meissner_verify::{Random, Step, bits, strategies};
use proptest::prelude::*;

use crate::snapshots_refused::shape as small;

const SENSOR: Sensor = Sensor { width: 120, height: 90 };

fn shape(candidates: Candidates) -> NetworkShape {
    let block = |channels, input, kernel| BlockShape {
        channels,
        conv: ConvolutionShape::Spline(kernel),
        input,
        skip: (input > 0).then_some(input),
        extras: [input == 1, true, true, true],
    };
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 16 }, candidates },
        span_us: 20_000,
        capacity: 4_096,
        place: Some([(1, 5), (2, 7)]),
        blocks: vec![block(8, 0, [2, 2, 2]), block(19, 1, [3, 2, 4]), block(32, 2, [2, 2, 2])],
        pooled: vec![PoolShape {
            from: 3,
            cell: [(16, 346), (12, 260)],
            time: None,
            mean: true,
            blocks: vec![block(32, 0, [2, 2, 2])],
        }],
        from: 1,
        grid: [4, 4],
        dense: vec![32, 2],
        head: None,
        seed: 3,
    }
}

/// A blob that moves over the sensor, and noise.
fn events() -> Vec<Event> {
    let mut random = Random::new(9);
    (0..3_000)
        .map(|i| {
            let spread = if random.below(10) == 0 { 60 } else { 12 };
            let mut pixel = |centre: u64, extent: u64| ((centre + random.below(spread)) % extent) as u16;
            Event::new(i * 13, pixel(i as u64 / 60, 120), pixel(20 + i as u64 / 100, 90), i % 3 == 0)
        })
        .collect()
}

const EVERY: [Candidates; 3] =
    [Candidates::All, Candidates::Past(Lifetime::Window), Candidates::Past(Lifetime::Frozen)];

#[test]
fn every_instruction_set_computes_the_same_bits() {
    let events = events();
    for candidates in EVERY {
        let predict = |isa| {
            let options = Options::new().with_isa(isa);
            let mut engine = Engine::with_options(shape(candidates).build(), SENSOR, options).expect("exact");
            let mut out = Vec::new();
            for chunk in events.chunks(500) {
                engine.push_slice(chunk);
                out.extend(bits(engine.predict().expect("finite").values));
            }
            out
        };
        let expected = predict(Isa::portable());
        for isa in Isa::available() {
            assert_eq!(predict(isa), expected, "{candidates:?} on {}", isa.name());
        }
    }
}

#[test]
fn every_number_of_threads_computes_the_same_bits() {
    let events = events();
    for candidates in EVERY {
        let batch = Batch::new(shape(candidates).build(), SENSOR).expect("the sensor has pixels");
        let batch = batch.with_search(Search::Grid);
        let stream = Stream::new(&events);
        let expected = bits(&batch.forward(stream).expect("finite").prediction);
        let parallel = batch.with_parallel_rows(true);
        for threads in [1, 2, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let got = pool.install(|| parallel.forward(stream)).expect("finite").prediction;
            assert_eq!(bits(&got), expected, "{candidates:?} on {threads} threads");
            for got in pool.install(|| parallel.predict_all(&[stream, stream, stream])) {
                assert_eq!(bits(&got.expect("finite")), expected, "{candidates:?} on {threads} threads");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn two_threads_compute_the_same_rows_and_bits_as_one(
        shape in strategies::network(),
        script in strategies::script(200),
    ) {
        let run = |options: Options| {
            let options = options.with_poison(true).with_record_rows(true);
            let mut engine = Engine::with_options(shape.build(), script.sensor, options).expect("exact");
            let mut seen = Vec::new();
            for step in script.steps.iter().chain([&Step::Predict]) {
                match *step {
                    Step::Push(event) => drop(engine.push(event)),
                    Step::Advance(t_us) => engine.advance(t_us),
                    Step::Reset => engine.reset(),
                    Step::Predict | Step::Snapshot | Step::Bytes => {
                        let prediction = engine.predict().map(|p| bits(p.values)).map_err(|e| e.to_string());
                        seen.push((prediction, engine.recomputed(), engine.to_bytes()));
                    }
                }
            }
            (seen, engine.counters())
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
        prop_assert!(pool.install(|| run(Options::new().with_all_shared())) == run(Options::new()));
    }
}

#[test]
fn a_fixed_run_has_the_bits_that_it_always_had() {
    for isa in Isa::available() {
        let name = isa.name();
        for two_threads in [false, true] {
            let events = fixed_run::of_events(Mode::Incremental { isa, two_threads });
            assert_eq!(events, fixed_run::EVENTS_EXPECTED, "{name}");
            assert_eq!(fixed_run::of_frames(isa, two_threads), fixed_run::FRAMES_EXPECTED, "{name}");
        }
    }
    for threads in [1, 2, 8] {
        assert_eq!(
            fixed_run::of_events(Mode::Batch { threads }),
            fixed_run::EVENTS_EXPECTED,
            "{threads} threads"
        );
    }
}

#[test]
fn engines_and_their_snapshots_can_move_to_another_thread_and_be_shared() {
    fn is_send_and_sync<T: Send + Sync + 'static>() {}
    is_send_and_sync::<Engine>();
    is_send_and_sync::<Snapshot>();
    is_send_and_sync::<StaleReadout>();
    is_send_and_sync::<Batch>();
    is_send_and_sync::<FrameEngine>();
    is_send_and_sync::<FrameSnapshot>();
}

#[test]
fn whatever_changes_predictions_changes_the_fingerprint() {
    let flip = |values: &mut Vec<f32>| values[3] = f32::from_bits(values[3].to_bits() ^ 1);
    let spline = |change: &dyn Fn(&mut SplineParts)| {
        let values = |count, seed| Random::new(seed).values(count, 1.0);
        let mut parts = SplineParts {
            inputs: 1,
            outputs: 4,
            kernel: [2, 2, 2],
            weight: values(32, 1),
            root: Some(values(4, 2)),
            bias: Some(values(4, 3)),
            norm: Some((values(4, 4), values(4, 5))),
            elu: true,
        };
        change(&mut parts);
        GraphConvolution::from(SplineConv::new(&parts).expect("sizes fit"))
    };
    let fingerprint = |change: &dyn Fn(&mut NetworkParts), conv: GraphConvolution| {
        let mut parts = small(Candidates::All).build().parts().clone();
        parts.events.blocks[0].conv = conv;
        change(&mut parts);
        Network::new(parts).expect("the parts fit").fingerprint()
    };
    let parameters: [&dyn Fn(&mut SplineParts); 8] = [
        &|_| {},
        &|parts| flip(&mut parts.weight),
        &|parts| parts.root.iter_mut().for_each(flip),
        &|parts| parts.root = None,
        &|parts| parts.bias.iter_mut().for_each(flip),
        &|parts| parts.norm.iter_mut().for_each(|(scale, _)| flip(scale)),
        &|parts| parts.norm.iter_mut().for_each(|(_, shift)| flip(shift)),
        &|parts| parts.elu = false,
    ];
    let structure: [&dyn Fn(&mut NetworkParts); 17] = [
        &|parts| parts.name.push('2'),
        &|parts| parts.span_us += 1,
        &|parts| parts.capacity += 1,
        &|parts| parts.graph.reach = Reach::Knn { k: 5 },
        &|parts| parts.graph.reach = Reach::Radius { r: 0.5, max: 4 },
        &|parts| parts.graph.reach = Reach::Radius { r: 0.6, max: 4 },
        &|parts| parts.graph.candidates = Candidates::Past(Lifetime::Window),
        &|parts| parts.graph.candidates = Candidates::Past(Lifetime::Frozen),
        &|parts| parts.events.scale *= 2.0,
        &|parts| parts.events.blocks[0].name.push('2'),
        &|parts| parts.pooled[0].0.cell = [Fraction::new(1, 5).expect("positive"); 2],
        &|parts| parts.pooled[0].0.time = None,
        &|parts| parts.pooled[0].0.position = Position::Centre,
        &|parts| parts.pooled[0].1.scale *= 2.0,
        &|parts| (parts.readout.columns, parts.readout.rows) = (4, 1),
        &|parts| (parts.readout.columns, parts.readout.rows) = (1, 4),
        &|parts| parts.normalisation = Normalisation::PerGraph,
    ];
    let pointnet = |change: &dyn Fn(&mut PointNetParts)| {
        let values = |count, seed| Random::new(seed).values(count, 1.0);
        let (weight, bias, norm) = (values(16, 1), values(4, 3), Some((values(4, 4), values(4, 5))));
        let mut parts = PointNetParts { inputs: 1, outputs: 4, weight, bias, norm };
        change(&mut parts);
        GraphConvolution::from(PointNetConv::new(&parts).expect("sizes fit"))
    };
    let of_pointnet: [&dyn Fn(&mut PointNetParts); 5] = [
        &|_| {},
        &|parts| flip(&mut parts.weight),
        &|parts| flip(&mut parts.bias),
        &|parts| parts.norm.iter_mut().for_each(|(scale, _)| flip(scale)),
        &|parts| parts.norm.iter_mut().for_each(|(_, shift)| flip(shift)),
    ];
    let mut all: Vec<u64> = parameters.map(|change| fingerprint(&|_| {}, spline(change))).to_vec();
    all.extend(structure.map(|change| fingerprint(change, spline(&|_| {}))));
    all.extend(of_pointnet.map(|change| fingerprint(&|_| {}, pointnet(change))));
    let again = fingerprint(&|_| {}, spline(&|_| {}));
    assert_eq!(all[0], again, "equal networks have equal ones");
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), count, "all are different");
}
