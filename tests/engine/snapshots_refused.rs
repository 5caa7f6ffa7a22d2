//! Snapshots that an engine refuses with a named cause, without a change of the engine.

use std::sync::{Arc, LazyLock};

use meissner_engine::{
    Candidates, DenseLayer, Engine, EngineError, Event, GraphRule, LatePolicy, Lifetime, Network, Options,
    Reach, Sensor, snapshot_note,
};
use meissner_kernels::{Activation, Dense, Isa, SplineConv, SplineParts};
use meissner_tests::snapshots::{FOOTER, Fields, sealed};
use meissner_verify::Random;
use meissner_verify::bits;
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use proptest::prelude::*;

pub(crate) const SENSOR: Sensor = Sensor { width: 20, height: 10 };
/// Positions of the fields of the snapshots below; all have the same up to the window's events.
static FIELDS: LazyLock<Fields> = LazyLock::new(|| {
    let (mut engine, bytes) = after_events(Candidates::Past(Lifetime::Frozen), 0.0);
    Fields::of(&bytes, |bytes| engine.restore_bytes(bytes))
});
const COUNTS: &str = "count of events";
const CLOCK: &str = "whether there is a clock";
const WINDOW: &str = "number of events";

/// The number that starts at `at`.
pub(crate) fn number(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"))
}

pub(crate) fn block(channels: usize) -> BlockShape {
    BlockShape {
        channels,
        conv: ConvolutionShape::Spline([2, 2, 2]),
        input: 0,
        skip: None,
        extras: [true; 4],
    }
}

/// A block over events, a pooling with a block over its cells.
pub(crate) fn shape(candidates: Candidates) -> NetworkShape {
    let pool =
        PoolShape { from: 1, cell: [(1, 4), (1, 2)], time: Some((1, 2)), mean: true, blocks: vec![block(3)] };
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 4 }, candidates },
        span_us: 500,
        capacity: 40,
        place: None,
        blocks: vec![block(4)],
        pooled: vec![pool],
        from: 1,
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 5,
    }
}

pub(crate) fn engine_of(candidates: Candidates) -> Engine {
    engine(shape(candidates).build(), SENSOR, Options::default())
}

pub(crate) fn engine(network: Network, sensor: Sensor, options: Options) -> Engine {
    Engine::with_options(Arc::new(network), sensor, options).expect("admissible")
}

/// Pushes events and reads a prediction now and then; returns the predictions, or the reason why
/// there were none.
pub(crate) fn run(
    engine: &mut Engine,
    from_us: i64,
    events: usize,
    seed: u64,
) -> Vec<Result<Vec<u32>, EngineError>> {
    let mut random = Random::new(seed);
    let mut pixel = |extent: u16| random.below(extent.into()) as u16;
    let mut out = vec![];
    for i in 0..events {
        let (x, y) = (pixel(SENSOR.width), pixel(SENSOR.height));
        engine.push(Event::new(from_us.saturating_add(9 * i as i64), x, y, x % 3 == 0));
        if i % 4 == 0 {
            out.push(engine.predict().map(|p| bits(p.values)));
        }
    }
    out
}

fn candidates() -> impl Strategy<Value = Candidates> {
    prop_oneof![
        Just(Candidates::All),
        Just(Candidates::Past(Lifetime::Window)),
        Just(Candidates::Past(Lifetime::Frozen)),
    ]
}

/// An engine that has seen a few events, and the bytes of one that has seen more.
fn after_events(candidates: Candidates, tolerance: f32) -> (Engine, Vec<u8>) {
    let options = Options::new().with_tolerance(tolerance);
    let new = || engine(shape(candidates).build(), SENSOR, options);
    let (mut few, mut many) = (new(), new());
    run(&mut few, 0, 12, 1);
    run(&mut many, -3, 90, 2);
    (few, many.to_bytes())
}

fn is_typed(error: &EngineError) -> bool {
    matches!(error, EngineError::Snapshot { .. } | EngineError::SnapshotBytes { .. })
}

proptest! {
    #[test]
    fn bytes_that_are_cut_or_flipped_are_refused_and_change_nothing(
        candidates in candidates(),
        tolerance in prop_oneof![Just(0.0f32), Just(0.1)],
        place in 0.0f64..1.0,
        bit in 0u32..8,
    ) {
        let (mut engine, bytes) = after_events(candidates, tolerance);
        let mut untouched = engine.clone();
        let at = (bytes.len() as f64 * place) as usize;
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << bit;
        for wrong in [&bytes[..at], &flipped] {
            let error = engine.restore_bytes(wrong).expect_err("what was changed");
            prop_assert!(is_typed(&error), "{}", error);
        }
        prop_assert_eq!(engine.counters(), untouched.counters());
        prop_assert_eq!(run(&mut engine, 200, 60, 3), run(&mut untouched, 200, 60, 3));
    }

    #[test]
    fn a_content_that_was_made_up_is_refused_or_gives_other_numbers(
        candidates in candidates(),
        tolerance in prop_oneof![Just(0.0f32), Just(0.1)],
        changes in proptest::collection::vec(
            (
                prop_oneof![0usize..40, FIELDS.at(COUNTS)..FIELDS.at(WINDOW) + 200, 0usize..1 << 16],
                1usize..9,
                prop_oneof![Just(1u64 << 63), Just(u64::MAX), 0u64..64, any::<u64>()],
            ),
            1..4,
        ),
    ) {
        let (mut engine, mut bytes) = after_events(candidates, tolerance);
        let mut untouched = engine.clone();
        for (place, count, word) in changes {
            let at = FIELDS.at(COUNTS) + place % (bytes.len() - FOOTER - FIELDS.at(COUNTS));
            bytes[at..at + count].copy_from_slice(&word.to_le_bytes()[..count]);
        }
        if let Err(error) = engine.restore_bytes(&sealed(bytes)) {
            prop_assert!(is_typed(&error), "{}", error);
            prop_assert_eq!(run(&mut engine, 200, 60, 3), run(&mut untouched, 200, 60, 3));
            return Ok(());
        }
        // The engine continues from any state: over events that fill the window, silence, and a
        // reset.
        let now = engine.now_us().unwrap_or(0);
        run(&mut engine, now, 90, 3);
        engine.advance(now.saturating_add(1_000));
        let _ = engine.predict();
        if let Err(error) = engine.restore_bytes(&engine.to_bytes()) {
            // Large numbers can grow too large.
            let error = error.to_string();
            let grown = ["expected a finite number", "expected a count below 2^56"];
            prop_assert!(grown.iter().any(|grown| error.contains(grown)), "{}", error);
        }
        engine.reset();
        run(&mut engine, now, 9, 3);
    }
}

/// Writes `value` to the content at `at`, and asserts that it is refused.
fn refused(candidates: Candidates, at: usize, value: &[u8]) -> String {
    let (mut engine, mut bytes) = after_events(candidates, 0.0);
    bytes[at..at + value.len()].copy_from_slice(value);
    let mut untouched = engine.clone();
    let error = engine.restore_bytes(&sealed(bytes)).expect_err("a content that does not fit");
    assert_eq!(run(&mut engine, 200, 60, 3), run(&mut untouched, 200, 60, 3));
    error.to_string()
}

#[test]
fn a_content_that_does_not_fit_is_refused_with_place_expected_and_found() {
    let frozen = Candidates::Past(Lifetime::Frozen);
    let huge = (1u64 << 63).to_le_bytes();
    let (_, bytes) = after_events(frozen, 0.0);
    let name = FIELDS.at("network's name");
    let left = bytes.len() - FOOTER - (name + 8);
    let [counts, layers, clock, epoch] =
        [COUNTS, "number of layers", CLOCK, "epoch"].map(|name| FIELDS.at(name));
    let [now, last, window] = ["newest time", "newest event", WINDOW].map(|name| FIELDS.at(name));
    let rows = FIELDS.at("number of rows of level 0");
    let events = number(&bytes, window) as usize;
    let newest = number(&bytes, last) as i64 - 1;
    // Between the number of events and their rows: 13 bytes an event, its number of in-edges.
    let (first, in_edges) = (window + 8, rows - events);
    let after = |event: usize| first + event * (in_edges - first) / events;
    for (at, value, expected) in [
        (
            name,
            &huge[..],
            format!("network's name at byte 32: expected at most {left}, found 9223372036854775808"),
        ),
        (
            counts,
            &huge,
            "count of events at byte 55: expected a count below 2^56, found 9223372036854775808".into(),
        ),
        (
            counts + 8,
            &(1u64 << 56).to_le_bytes(),
            "count of events at byte 63: expected a count below 2^56, found 72057594037927936".into(),
        ),
        (layers, &huge, format!("number of layers at byte {layers}: expected 3, found 9223372036854775808")),
        (clock, &[2], format!("whether there is a clock at byte {clock}: expected 0 or 1, found 2")),
        (epoch, &i64::MAX.to_le_bytes(), format!("newest time at byte {now}")),
        (now, &(-1i64).to_le_bytes(), "expected a time from the epoch on that fits 64 bits, found -1".into()),
        (last, &2_000i64.to_le_bytes(), format!("newest event at byte {last}")),
        (
            after(events - 1),
            &newest.to_le_bytes(),
            format!("to {}, the last at its end, found {newest}", newest + 1),
        ),
        (
            window,
            &huge,
            format!("number of events at byte {window}: expected at most 40, found 9223372036854775808"),
        ),
        (first, &0i64.to_le_bytes(), format!("time of event 0 at byte {first}: expected ")),
        (
            first,
            &newest.to_le_bytes(),
            format!("time of event 1 at byte {}: expected {newest} to ", after(1)),
        ),
        (first + 8, &20u16.to_le_bytes(), format!("event 0 at byte {}: expected a pixel", first + 8)),
        (first + 12, &[7], "polarity of event 0".into()),
        (in_edges, &[1], format!("in-edges of event 0 at byte {in_edges}: expected at most 0, found 1")),
        (
            rows,
            &huge,
            format!("number of rows of level 0 at byte {rows}: expected {events}, found 9223372036854775808"),
        ),
        (
            rows + 8 + 4,
            &f32::NAN.to_le_bytes(),
            format!("row 0 of layer \"conv1_1\", value 1 at byte {}: expected a finite", rows + 8 + 4),
        ),
        (rows + 8, &f32::INFINITY.to_le_bytes(), "expected a finite number, found inf".into()),
    ] {
        let error = refused(frozen, at, value);
        assert!(error.starts_with("snapshot: ") && error.contains(&expected), "{expected}: {error}");
    }
}

#[test]
fn more_events_than_the_bytes_or_a_window_without_a_clock_can_hold_are_refused_before_they_are_read() {
    let (mut engine, mut bytes) = after_events(Candidates::Past(Lifetime::Frozen), 0.0);
    // Room for two events of 14 bytes, and for three of 13.
    let (window, clock) = (FIELDS.at(WINDOW), FIELDS.at(CLOCK));
    bytes.truncate(window + 8 + 3 * 13 + FOOTER);
    bytes[window..window + 8].copy_from_slice(&3u64.to_le_bytes());
    let end = bytes.len() - FOOTER;
    bytes[end..].fill(0);
    let error = engine.restore_bytes(&sealed(bytes)).expect_err("an event is missing").to_string();
    assert_eq!(error, format!("snapshot: number of events at byte {window}: expected at most 2, found 3"));
    let mut empty = engine_of(Candidates::All).to_bytes();
    empty.splice(clock + 1.., [1, 0, 0, 0, 0, 0, 0, 0].into_iter().chain([0; 13 + FOOTER]));
    let error = engine_of(Candidates::All).restore_bytes(&sealed(empty)).expect_err("no clock").to_string();
    let at = clock + 1;
    assert_eq!(error, format!("snapshot: number of events at byte {at}: expected at most 0, found 1"));
}

#[test]
fn bytes_too_few_for_any_snapshot_are_refused_whatever_they_say() {
    let (mut engine, bytes) = after_events(Candidates::All, 0.0);
    for length in 24..=40 {
        let mut bytes = bytes[..length].to_vec();
        bytes[16..24].copy_from_slice(&(length as u64).to_le_bytes());
        let bytes = if length == 40 { sealed([&bytes[..24], &[0; FOOTER]].concat()) } else { bytes };
        let error = engine.restore_bytes(&bytes).expect_err("no content").to_string();
        let expected = if length < 40 { "length at byte 16" } else { "network at byte 24" };
        assert!(error.contains(expected), "{length}: {error}");
    }
}

#[test]
fn a_snapshot_of_an_exact_engine_is_thirteen_bytes_an_event_and_one_with_a_tolerance_says_which() {
    let (_, bytes) = after_events(Candidates::All, 0.0);
    let window = FIELDS.at(WINDOW);
    let events = number(&bytes, window) as usize;
    // Then the number of held events, and of bytes of the note, and the checksum.
    assert_eq!(bytes.len(), window + 8 + 13 * events + 8 + FOOTER);
    let (_, bytes) = after_events(Candidates::All, 0.1);
    assert_eq!(bytes[FIELDS.at("tolerance")..][..4], 0.1f32.to_le_bytes());
}

#[test]
fn a_tolerance_of_negative_zero_is_written_and_read_as_zero() {
    let network = Arc::new(shape(Candidates::All).build());
    let with = |tolerance| {
        let options = Options::new().with_tolerance(tolerance);
        Engine::with_options(Arc::clone(&network), SENSOR, options).expect("admissible")
    };
    assert_eq!(with(0.0).restore_bytes(&with(-0.0).to_bytes()), Ok(()));
    assert_eq!(with(-0.0).restore_bytes(&with(0.0).to_bytes()), Ok(()));
}

#[test]
fn a_restored_engine_counts_the_rows_that_it_computes_itself() {
    let (mut engine, bytes) = after_events(Candidates::All, 0.0);
    engine.restore_bytes(&bytes).expect("its own bytes");
    let before = engine.counters();
    let prediction = engine.predict().expect("finite");
    let (nodes, rows) = (prediction.nodes as u64, prediction.rows.to_vec());
    let counted = engine.counters().since(&before).layers;
    assert_eq!(rows, counted.iter().map(|layer| layer.recomputed).collect::<Vec<_>>());
    assert_eq!(rows[0], nodes);
}

#[test]
fn a_snapshot_with_rows_that_are_not_finite_is_refused_by_their_name() {
    let mut parts = shape(Candidates::Past(Lifetime::Frozen)).build().parts().clone();
    let conv = SplineParts {
        inputs: 1,
        outputs: 4,
        kernel: [2, 2, 2],
        weight: vec![f32::MAX; 32],
        bias: Some(vec![f32::MAX, f32::MAX, 0.0, 0.0]),
        ..SplineParts::default()
    };
    parts.events.blocks[0].conv = SplineConv::new(&conv).expect("sizes fit").into();
    let mut engine = engine(Network::new(parts).expect("the parts fit"), SENSOR, Options::default());
    for i in 0..4 {
        engine.push(Event::new(i, 3, 3, true));
    }
    let error = engine.restore_bytes(&engine.to_bytes()).expect_err("rows beyond f32").to_string();
    assert!(error.contains("layer \"conv1_1\"") && error.contains("expected a finite number"), "{error}");
}

#[test]
fn a_content_that_goes_on_behind_its_end_is_refused() {
    let (mut engine, mut bytes) = after_events(Candidates::All, 0.0);
    // Before the length of the note and the checksum.
    let at = bytes.len() - FOOTER;
    bytes.splice(at..at, [0; 5]);
    let error = engine.restore_bytes(&sealed(bytes)).expect_err("five more bytes").to_string();
    assert_eq!(error, format!("snapshot: end at byte {at}: expected no more bytes, found 5"));
}

#[test]
fn a_note_comes_back_and_one_that_is_longer_than_the_snapshot_is_refused() {
    let (mut engine, _) = after_events(Candidates::All, 0.0);
    let mut bytes = engine.to_bytes_with(b"a note");
    assert_eq!(snapshot_note(&bytes), Ok(&b"a note"[..]));
    assert_eq!(engine.restore_bytes(&bytes), Ok(()));
    assert_eq!(snapshot_note(&engine.to_bytes()), Ok(&[][..]));
    let at = bytes.len() - FOOTER;
    for length in [at as u64 - 23, 1 << 63, u64::MAX] {
        bytes[at..at + 8].copy_from_slice(&length.to_le_bytes());
        bytes = sealed(bytes);
        let expected = format!(
            "snapshot: length of the note at byte {at}: expected at most {}, found {length}",
            at - 24
        );
        assert_eq!(snapshot_note(&bytes).expect_err("too long").to_string(), expected);
        assert_eq!(engine.restore_bytes(&bytes).expect_err("too long").to_string(), expected);
    }
    // There may be only a note.
    bytes[at..at + 8].copy_from_slice(&(at as u64 - 24).to_le_bytes());
    assert_eq!(snapshot_note(&sealed(bytes.clone())), Ok(&bytes[24..at]));
}

#[test]
fn a_snapshot_of_another_version_or_kind_is_refused_before_anything_else() {
    let (mut engine, bytes) = after_events(Candidates::All, 0.0);
    for (at, expected) in [
        (0, "first bytes at byte 0: expected MEISSNER, found \\x02EISSNER"),
        (8, "expected format version 2, found 3"),
        (12, "expected state of an engine over events, found a frame engine"),
    ] {
        let mut bytes = bytes.clone();
        bytes[at] = if at == 8 { 3 } else { 2 };
        bytes.truncate(60);
        let error = engine.restore_bytes(&bytes).expect_err(expected).to_string();
        assert_eq!(error, format!("snapshot: {expected}"));
    }
}

#[test]
fn a_snapshot_of_another_network_sensor_tolerance_or_late_policy_is_refused() {
    let weights: Vec<f32> = (0..24).map(|w| w as f32 / 8.0 - 1.0).collect();
    let network = |weights: &[f32]| {
        let mut parts = shape(Candidates::All).build().parts().clone();
        let dense = Dense::new(4, 3, 2, weights, None, Activation::Identity);
        parts.dense = vec![DenseLayer { name: "fc".to_owned(), dense: dense.expect("sizes fit") }];
        Network::new(parts).expect("the parts fit")
    };
    let mut other = weights.clone();
    other[7] = f32::from_bits(other[7].to_bits() ^ 1);
    let exact = Options::default();
    let mut wanted = engine(network(&weights), SENSOR, exact);
    run(&mut wanted, 0, 30, 1);
    let mut refuse = |found: Engine, name: &str| {
        let mut untouched = wanted.clone();
        for refused in [wanted.restore(&found.snapshot()), wanted.restore_bytes(&found.to_bytes())] {
            let error = refused.expect_err(name);
            assert!(matches!(error, EngineError::Snapshot { what, .. } if what == name), "{error}");
        }
        assert_eq!(run(&mut wanted, 300, 30, 3), run(&mut untouched, 300, 30, 3));
    };
    refuse(engine(network(&other), SENSOR, exact), "network");
    refuse(engine(network(&weights).with_capacity(41).expect("in range"), SENSOR, exact), "network");
    refuse(engine(network(&weights), Sensor::new(20, 11), exact), "sensor");
    refuse(engine(network(&weights), SENSOR, exact.with_tolerance(0.5)), "tolerance");
    refuse(engine(network(&weights), SENSOR, exact.with_late(LatePolicy::Clamp)), "late policy");
    let clamps = engine(network(&weights), SENSOR, exact.with_late(LatePolicy::Clamp));
    let error = wanted.restore_bytes(&clamps.to_bytes()).expect_err("another policy").to_string();
    assert!(error.contains("expected late policy drop, found clamp"), "{error}");
    let larger = Engine::new(Arc::clone(wanted.network()), Sensor::new(20, 11)).expect("admissible");
    let error = wanted.restore(&larger.snapshot()).expect_err("another sensor");
    assert!(matches!(error, EngineError::Snapshot { what: "sensor", .. }), "{error}");
    // The same network, built again.
    let same = engine(network(&weights), SENSOR, exact);
    assert_eq!(wanted.restore_bytes(&same.to_bytes()), Ok(()));
    assert_eq!(wanted.restore(&same.snapshot()), Ok(()));
}

#[test]
fn a_snapshot_of_the_same_network_with_another_late_policy_or_tolerance_is_refused() {
    let network = Arc::new(shape(Candidates::All).build());
    let new = |options| Engine::with_options(Arc::clone(&network), SENSOR, options).expect("admissible");
    let mut wanted = new(Options::default());
    for (options, name) in [
        (Options::new().with_late(LatePolicy::Clamp), "late policy"),
        (Options::new().with_tolerance(0.5), "tolerance"),
    ] {
        let error = wanted.restore(&new(options).snapshot()).expect_err(name);
        assert!(matches!(error, EngineError::Snapshot { what, .. } if what == name), "{error}");
    }
    // The engine keeps its own policy.
    wanted.push(Event::new(9, 1, 1, true));
    wanted.push(Event::new(5, 1, 1, true));
    assert_eq!(wanted.counters().events.late, 1);
}

#[test]
fn options_that_reach_no_result_stay_the_engines_own_over_a_restore() {
    let plain = Options::default();
    let told =
        plain.with_isa(Isa::portable()).with_poison(true).with_record_rows(true).with_stage_times(true);
    let new = |options| engine(shape(Candidates::All).build(), SENSOR, options);
    let taken = |options| {
        let mut engine = new(options);
        run(&mut engine, 0, 30, 2);
        engine.snapshot()
    };
    let measured = |engine: &Engine| engine.stage_times().iter().any(|(_, time)| !time.is_zero());
    let recorded = |engine: &Engine| engine.recomputed().iter().any(|rows| !rows.is_empty());
    let states = [taken(plain), taken(told)];
    let mut predictions = Vec::new();
    for state in &states {
        for (own, asked) in [(plain, false), (told, true)] {
            let (mut restored, mut read) = (new(own), new(own));
            restored.restore(state).expect("an equal origin");
            read.restore_bytes(&state.to_bytes()).expect("an equal origin");
            for engine in [&mut restored, &mut read] {
                predictions.push(run(engine, 300, 29, 3));
                assert_eq!([measured(engine), recorded(engine)], [asked; 2]);
            }
        }
    }
    assert!(predictions.windows(2).all(|pair| pair[0] == pair[1]), "results are the same");
}
