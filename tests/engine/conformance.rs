//! The claims of [`conformance`] hold for every engine, over random networks, streams and clocks.
//!
//! `MEISSNER_CASES` sets the number of cases (400 without it).

use std::path::Path;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use meissner_engine::filters::FilterRule;
use meissner_engine::frames::{
    Convolution, Frame, FrameEngine, FrameNetwork, FrameOptions, Skip, TimedFrames,
};
use meissner_engine::{
    BatchEngine, Candidates, Engine, EngineError, Event, EventCounters, GraphRule, LatePolicy, LayerCounters,
    Lifetime, Options, Outcome, Prediction, PredictionCounters, Predictor, Reach, Search, Sensor,
    StaleReadout, Staleness,
};
use meissner_kernels::WinogradTile;
use meissner_live::{Input, Item, Live, LiveError, QueueOptions, TimedAnswer};
use meissner_models::{Description, draw};
use meissner_run::live_frames::LiveFrames;
use meissner_run::model::FrameModel;
use meissner_tests::cases;
use meissner_verify::conformance::{forgets, predicts, refuses_damage, resumes, takes_slices};
use meissner_verify::frame_networks::network as frame_network;
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use meissner_verify::{Script, Step, bits, random_streams, strategies};
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::network_text::NetworkText;

/// Streams: steady, long, and with a clock that jumps.
fn script() -> impl Strategy<Value = Script> {
    prop_oneof![
        7 => strategies::script(120),
        1 => strategies::script(700),
        3 => strategies::unsteady_clock(1_000, 120),
    ]
}

/// Lengths of slices.
fn cuts() -> impl Strategy<Value = Vec<usize>> {
    prop::collection::vec(1_usize..100, 1..30)
}

/// Options that affect results, and one that makes a stale read visible.
fn options() -> impl Strategy<Value = Options> {
    let tolerance = prop_oneof![2 => Just(0.0f32), 1 => Just(0.02), 1 => Just(f32::MAX)];
    (tolerance, any::<bool>()).prop_map(|(tolerance, clamps)| {
        let late = if clamps { LatePolicy::Clamp } else { LatePolicy::Drop };
        Options::new().with_tolerance(tolerance).with_late(late).with_poison(true)
    })
}

/// Filters that a network states, mostly none.
fn filters() -> impl Strategy<Value = Vec<FilterRule>> {
    let rule = prop_oneof![
        2 => (1i64..400, 1u32..4).prop_map(|(period_us, burst)| FilterRule::HotPixel { period_us, burst }),
        1 => (1i64..400).prop_map(|us| FilterRule::Refractory { us }),
        1 => (1i64..4_000).prop_map(|us| FilterRule::BackgroundActivity { us }),
    ];
    prop_oneof![2 => Just(Vec::new()), 1 => prop::collection::vec(rule, 1..3)]
}

/// An engine that takes slices, cut at `cuts`, has in the end the same state as bytes as one that
/// takes event by event. Only the counts of work differ, because a slice may save work.
fn slices_leave_the_state(
    make: impl Fn() -> Engine,
    steps: &[Step<Event>],
    cuts: &[usize],
) -> Result<(), String> {
    let events: Vec<Event> = steps.iter().filter_map(Step::input).copied().collect();
    let [mut sliced, mut single] = [make(), make()];
    for &event in &events {
        single.push(event);
    }
    let (mut rest, mut cuts) = (&events[..], cuts.iter().cycle());
    while let Some(&cut) = cuts.next().filter(|_| !rest.is_empty()) {
        let (slice, after) = rest.split_at(cut.min(rest.len()));
        sliced.push_slice(slice);
        rest = after;
    }
    let shown = |engine: &mut Engine| engine.predict().map(|p| bits(p.values));
    if shown(&mut sliced) != shown(&mut single) {
        return Err("another prediction".to_owned());
    }
    let layers = single.counters().layers.len();
    let work = layers * size_of::<LayerCounters>() + size_of::<PredictionCounters>();
    // Header, fingerprint, name, sensor, tolerance, policy, and the counts of events.
    let name = single.network().name().len();
    let start = 24 + 8 + 8 + name + 4 + 4 + 1 + size_of::<EventCounters>() - 8;
    let (found, expected) = (sliced.to_bytes(), single.to_bytes());
    let differs = |&i: &usize| found[i] != expected[i] && !(start..start + work).contains(&i);
    // The last bytes are a checksum.
    let first = (0..expected.len() - 8).find(differs);
    if found.len() != expected.len() || first.is_some() {
        return Err(format!("byte {first:?} of {}, counts at {start}, then {work}", expected.len()));
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn an_engine_over_events(
        shape in strategies::network(), filters in filters(), script in script(), cuts in cuts(), options in options(),
        place in 0.0f64..1.0, bit in 0u32..8,
    ) {
        let (network, steps) = (shape.build().with_filters(filters).expect("admissible"), &script.steps);
        let network = Arc::new(network);
        let cut = (steps.len() as f64 * place) as usize;
        let engine = || Engine::with_options(Arc::clone(&network), script.sensor, options).expect("admissible");
        let batch = || BatchEngine::new(Arc::clone(&network), script.sensor).expect("pixels").with_late(options.late);
        if options.tolerance == 0.0 {
            prop_assert_eq!(predicts(&mut engine(), &mut batch().with_search(Search::Exhaustive), steps), Ok(()));
        }
        prop_assert_eq!(takes_slices(engine, steps, &cuts), Ok(()));
        prop_assert_eq!(slices_leave_the_state(engine, steps, &cuts), Ok(()));
        prop_assert_eq!(forgets(engine, steps), Ok(()));
        prop_assert_eq!(resumes(engine, steps, cut), Ok(()));
        prop_assert_eq!(refuses_damage(engine, steps, place, bit), Ok(()));
    }

    #[test]
    fn a_batch_and_a_readout_that_may_be_stale(shape in strategies::network(), script in script(), cuts in cuts()) {
        let (network, steps) = (Arc::new(shape.build()), &script.steps);
        let batch = || BatchEngine::new(Arc::clone(&network), script.sensor).expect("pixels").with_bounded_memory();
        let mut bounded = batch();
        prop_assert_eq!(predicts(&mut bounded, &mut batch().with_search(Search::Exhaustive), steps), Ok(()));
        prop_assert!(bounded.events().len() <= bounded.most_events());
        prop_assert_eq!(takes_slices(batch, steps, &cuts), Ok(()));
        prop_assert_eq!(forgets(batch, steps), Ok(()));
        let readout = |(events, us)| {
            let engine = Engine::new(Arc::clone(&network), script.sensor).expect("exact");
            StaleReadout::new(engine, Staleness::new().with_events(events).with_us(us)).expect("in range")
        };
        prop_assert_eq!(predicts(&mut readout((1, 1)), &mut batch(), steps), Ok(()));
        prop_assert_eq!(takes_slices(|| readout((3, 400)), steps, &cuts), Ok(()));
        prop_assert_eq!(forgets(|| readout((3, 400)), steps), Ok(()));
    }
}

/// Ways to compute a frame network.
fn frame_options() -> impl Strategy<Value = FrameOptions> {
    let skip = prop_oneof![1 => Just(Skip::Nothing), 3 => Just(Skip::Exact), 1 => Just(Skip::Tolerance(0.1))];
    (skip, any::<[bool; 2]>()).prop_map(|(skip, [sparse, two_threads])| {
        FrameOptions::new().with_skip(skip).with_sparse(sparse).with_two_threads(two_threads)
    })
}

fn convolution() -> impl Strategy<Value = Convolution> {
    prop_oneof![
        Just(Convolution::Direct),
        Just(Convolution::Winograd(WinogradTile::Two)),
        Just(Convolution::Winograd(WinogradTile::Four)),
        Just(Convolution::Kn2row),
    ]
}

/// The frames with times from a separate clock; some are late.
fn timed(steps: &[Step<Vec<f32>>]) -> Vec<Step<Frame>> {
    let mut t_us = 0;
    let step = |(i, step): (usize, &Step<Vec<f32>>)| match step {
        Step::Push(values) => {
            t_us += if i % 7 == 3 { -15_000 } else { 10_000 };
            Step::Push(Frame { t_us, values: values.clone() })
        }
        Step::Advance(_) | Step::Predict => Step::Predict,
        Step::Reset => Step::Reset,
        Step::Snapshot | Step::Bytes => Step::Advance(t_us + 2_000),
    };
    steps.iter().enumerate().map(step).collect()
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn an_engine_over_frames(
        style in strategies::frame_style(),
        (size, steps) in (1usize..4, 1usize..7, 1usize..25).prop_flat_map(|(c, h, w)| {
            let size = [c, 4 * h, 4 * w];
            (Just(size), strategies::frames(size.iter().product()))
        }),
        wide in prop_oneof![Just(3usize), Just(8), Just(16), Just(33)],
        convolution in convolution(),
        options in frame_options(),
        seed in any::<u64>(),
        place in 0.0f64..1.0,
        bit in 0u32..8,
        cuts in cuts(),
    ) {
        let network = FrameNetwork::new(frame_network(style, size, wide, seed), convolution).expect("parts that fit");
        let network = Arc::new(network);
        let cut = (steps.len() as f64 * place) as usize;
        let with = |options| FrameEngine::with_options(Arc::clone(&network), options).expect("in range");
        let engine = || with(options);
        let whole = || with(FrameOptions::new().with_skip(Skip::Nothing));
        let clocked = || TimedFrames::new(engine());
        let frames = timed(&steps);
        if !matches!(options.skip, Skip::Tolerance(_)) {
            prop_assert_eq!(predicts(&mut engine(), &mut whole(), &steps), Ok(()));
            prop_assert_eq!(predicts(&mut clocked(), &mut TimedFrames::new(whole()), &frames), Ok(()));
            let mut behind = Behind::of(clocked());
            prop_assert_eq!(predicts(&mut behind, &mut clocked(), &queueable(&frames)), Ok(()));
        }
        prop_assert_eq!(takes_slices(engine, &steps, &cuts), Ok(()));
        prop_assert_eq!(takes_slices(clocked, &frames, &cuts), Ok(()));
        prop_assert_eq!(forgets(engine, &steps), Ok(()));
        prop_assert_eq!(forgets(clocked, &frames), Ok(()));
        prop_assert_eq!(resumes(engine, &steps, cut), Ok(()));
        prop_assert_eq!(refuses_damage(engine, &steps, place, bit), Ok(()));
        let [mut whole, mut resumed] = [engine(), engine()];
        let pushed = |engine: &mut FrameEngine, steps: &[Step<Vec<f32>>]| {
            steps.iter().filter_map(Step::input).for_each(|frame| engine.push(frame).expect("a frame that fits"));
        };
        pushed(&mut whole, &steps[..cut]);
        resumed.restore_bytes(&whole.to_bytes()).expect("its own bytes");
        [&mut whole, &mut resumed].into_iter().for_each(|engine| pushed(engine, &steps[cut..]));
        prop_assert_eq!(resumed.counters(), whole.counters(), "what is recomputed is the same");
    }
}

/// A predictor behind a queue that loses nothing.
struct Behind<P: Predictor<Input: Item>> {
    input: Input<P::Input>,
    live: Live<P>,
}

impl<P: Predictor<Input: Item> + Send + 'static> Behind<P> {
    fn of(predictor: P) -> Self {
        // Smaller than most streams.
        let (input, live) = Live::spawn(predictor, QueueOptions::new().with_capacity(64)).expect("in range");
        Self { input, live }
    }
}

impl<P: Predictor<Input: Item>> Predictor for Behind<P> {
    type Input = P::Input;

    /// The worker decides about it.
    fn push(&mut self, input: &P::Input) -> Result<Outcome, EngineError> {
        self.push_slice(std::slice::from_ref(input)).map(|()| Outcome::Held)
    }

    fn push_slice(&mut self, inputs: &[P::Input]) -> Result<(), EngineError> {
        self.input.push_slice(inputs).expect("the worker lives");
        Ok(())
    }

    fn advance(&mut self, t_us: i64) {
        self.input.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        match self.live.predict(Duration::MAX) {
            Ok(answer) => {
                let TimedAnswer { values, t_us, nodes, unlike, .. } = answer;
                Ok(Prediction { values, t_us, nodes, rows: &[], unlike })
            }
            Err(LiveError::Engine(error)) => Err(error),
            Err(other) => panic!("{other}"),
        }
    }

    fn reset(&mut self) {
        unreachable!("a queue has no reset");
    }

    fn event_counters(&self) -> EventCounters {
        self.live.event_counters()
    }
}

/// The steps of a queue. Each advance has its own prediction, because a later event would cancel
/// its effect.
fn queueable<I: Clone>(steps: &[Step<I>]) -> Vec<Step<I>> {
    let kept = steps.iter().filter(|step| !matches!(step, Step::Reset));
    kept.flat_map(|step| {
        let then = matches!(step, Step::Advance(_)).then_some(Step::Predict);
        [Some(step.clone()), then].into_iter().flatten()
    })
    .collect()
}

/// A shipped network over frames of events.
static FORCE: LazyLock<Arc<FrameModel>> = LazyLock::new(|| {
    FrameModel::named("force-lstm", None, Convolution::Direct, false).expect("shipped").into()
});

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn engines_behind_a_queue(shape in strategies::network(), script in script(), cuts in cuts()) {
        let (network, steps) = (Arc::new(shape.build()), queueable(&script.steps));
        let engine = || Engine::new(Arc::clone(&network), script.sensor).expect("exact");
        prop_assert_eq!(predicts(&mut Behind::of(engine()), &mut engine(), &steps), Ok(()));
        prop_assert_eq!(takes_slices(|| Behind::of(engine()), &steps, &cuts), Ok(()));
    }

    #[test]
    fn a_frame_network_over_events(script in strategies::script_on((346..347u16, 260..261u16), 120), cuts in cuts()) {
        let live = |skip| {
            let options = FrameOptions::new().with_skip(skip);
            LiveFrames::new(Arc::clone(&FORCE), script.sensor, options).expect("frames of events")
        };
        prop_assert_eq!(predicts(&mut live(Skip::Exact), &mut live(Skip::Nothing), &script.steps), Ok(()));
        prop_assert_eq!(takes_slices(|| live(Skip::Exact), &script.steps, &cuts), Ok(()));
        prop_assert_eq!(forgets(|| live(Skip::Exact), &script.steps), Ok(()));
    }
}

/// An engine that fills expired rows with NaN, so that a row that is computed too late is visible.
fn poisoned(shape: &NetworkShape, sensor: Sensor) -> Engine {
    Engine::with_options(shape.build(), sensor, Options::new().with_poison(true))
        .expect("the network is exact")
}

/// Frozen rows over a window of few events.
fn frozen(capacity: usize, k: usize, blocks: usize) -> NetworkShape {
    let block = |input| BlockShape {
        channels: 3,
        conv: ConvolutionShape::Spline([2; 3]),
        input,
        skip: None,
        extras: [true; 4],
    };
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k }, candidates: Candidates::Past(Lifetime::Frozen) },
        span_us: 1_000,
        capacity,
        place: None,
        blocks: (0..blocks).map(block).collect(),
        from: blocks,
        pooled: vec![],
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 5,
    }
}

/// Every event of the slice evicts an event that another event of the slice reads.
#[test]
fn rows_are_computed_before_what_they_read_is_evicted_or_expires() {
    let sensor = Sensor::new(16, 16);
    for (capacity, k) in [(1, 1), (2, 1), (3, 8), (8, 4), (200, 8)] {
        for apart_us in [0, 40, 400, 5_000] {
            let shape = frozen(capacity, k, 3);
            let [mut singly, mut sliced] = [(); 2].map(|()| poisoned(&shape, sensor));
            let event =
                |i: i64| Event::new(i * apart_us, (i * 7 % 16) as u16, (i * 5 % 16) as u16, i % 3 == 0);
            let events: Vec<_> = (0..300).map(event).collect();
            for &event in &events {
                singly.push(event);
            }
            assert_eq!(sliced.push_slice(&events), 300);
            assert_eq!(
                bits(sliced.predict().expect("finite").values),
                bits(singly.predict().expect("finite").values),
                "{capacity} events, {apart_us} us apart"
            );
            assert!(sliced.to_bytes() == singly.to_bytes(), "{capacity} events, {apart_us} us apart");
        }
    }
}

#[test]
fn an_empty_slice_and_one_of_refused_events_change_nothing_but_counts() {
    let mut engine = poisoned(&frozen(8, 2, 1), Sensor::new(4, 4));
    engine.push(Event::new(10, 1, 1, true));
    let before = bits(engine.predict().expect("finite").values);
    assert_eq!(engine.push_slice(&[]), 0);
    assert_eq!(engine.push_slice(&[Event::new(9, 1, 1, true), Event::new(20, 4, 0, true)]), 0);
    assert_eq!(bits(engine.predict().expect("finite").values), before);
    assert_eq!((engine.counters().events.late, engine.counters().events.outside_sensor), (1, 1));
}

/// Found by the claims: neighbours of a window's oldest events were chosen among forgotten ones.
#[test]
fn a_batch_of_bounded_memory_knows_the_edges_of_its_window() {
    let block = frozen(3, 1, 1).blocks.remove(0);
    let pool = PoolShape { from: 0, cell: [(1, 8); 2], time: None, mean: false, blocks: vec![block] };
    let network = Arc::new(NetworkShape { pooled: vec![pool], from: 1, ..frozen(3, 1, 0) }.build());
    let batch = || BatchEngine::new(Arc::clone(&network), Sensor::new(16, 16)).expect("pixels");
    let event = |i: i64| Event::new(i, (i * 7 % 16) as u16, (i * 5 % 16) as u16, i % 3 == 0);
    let steps: Vec<_> = (0..100).flat_map(|i| [Step::Push(event(i)), Step::Predict]).collect();
    assert_eq!(predicts(&mut batch().with_bounded_memory(), &mut batch(), &steps), Ok(()));
}

/// A network over events as text, with graph and pooling, whose weights are drawn from `seed`.
fn small(keys: &str) -> String {
    NetworkText::over_events("small")
        .network("span_us = 20000; capacity = 64")
        .graph(keys)
        .layer("block1", "spline", "channels = 4; kernel = 2")
        .layer("pool1", "pool", "cell = [\"1/8\", \"1/6\"]; time = \"1/2\"; scale = 0.4")
        .layer("block2", "spline", "channels = 3; kernel = 2")
        .readout("grid = [2, 2]", &["a", "b"], "rad")
}

/// A stream of a small network with predictions and counts, with which bindings compare their
/// results.
fn fixed_case(name: &str, keys: &str, seed: u64) -> Value {
    let (text, sensor) = (small(keys), Sensor::new(64, 48));
    let description = Description::parse(&text).expect("consistent");
    let network = description.network(&draw(&description, seed)).expect("they fit");
    let stream = random_streams(&network, Some(sensor), 40, seed).max_by_key(|stream| stream.steps.len());
    let mut engine = Engine::new(network, sensor).expect("exact");
    let mut step = |step: &Step| match step {
        Step::Push(event) => {
            engine.push(*event);
            json!([event.t_us, event.x, event.y, event.on])
        }
        Step::Advance(t_us) => {
            engine.advance(*t_us);
            json!(["advance", t_us])
        }
        Step::Reset => {
            engine.reset();
            json!(["reset"])
        }
        Step::Snapshot | Step::Bytes => json!(["bytes"]),
        Step::Predict => {
            let prediction = engine.predict().expect("finite");
            json!(["predict", bits(prediction.values), prediction.t_us, prediction.nodes])
        }
    };
    let steps: Vec<Value> =
        stream.expect("40 streams").steps.iter().chain([&Step::Predict]).map(&mut step).collect();
    let counters = engine.event_counters();
    let counts =
        json!({"pushed": counters.pushed, "accepted": counters.accepted, "restarts": counters.restarts});
    let sensor = [sensor.width, sensor.height];
    json!({"name": name, "network": text, "seed": seed, "sensor": sensor, "steps": steps, "counts": counts})
}

/// `MEISSNER_WRITE=1` writes the file.
#[test]
fn the_streams_that_bindings_play_have_the_bits_that_they_always_had() {
    let graph =
        |kind: &str, candidates: &str| format!("kind = {kind}; candidates = {candidates}; scale = 0.3");
    let (nearest, near) = ("\"knn\"; k = 4", "\"radius\"; r = 0.3; max = 6");
    let cases = json!([
        fixed_case("all", &graph(nearest, "\"all\""), 3),
        fixed_case("past", &graph(near, "\"past\"; lifetime = \"window\""), 8),
        fixed_case("frozen", &graph(nearest, "\"past\"; lifetime = \"frozen\""), 5),
    ]);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/streams.json");
    if std::env::var_os("MEISSNER_WRITE").is_some() {
        std::fs::write(&path, format!("{cases}\n").replace("],[", "],\n[")).expect("a folder to write to");
    }
    let golden: Value = serde_json::from_slice(&std::fs::read(&path).expect("the file")).expect("JSON");
    assert!(golden == cases, "{} differs; MEISSNER_WRITE=1 writes it", path.display());
}
