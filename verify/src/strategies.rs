//! Strategies for proptest: streams, and networks of every kind that the engine runs.

use meissner_engine::{Candidates, Event, GraphRule, Lifetime, MAX_SILENCE_US, Reach, Sensor};
use proptest::prelude::*;

use crate::frame_networks::Style as FrameStyle;
use crate::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use crate::random_stream::random_frames;
use crate::stream::{Script, Step};

/// A step whose time counts from the step before. Events lie in the first `pixels` columns and
/// rows, and all have the same time if `one_instant`.
fn relative(pixels: u16, one_instant: bool) -> impl Strategy<Value = Step> {
    let dt = if one_instant {
        Just(0i64).boxed()
    } else {
        prop_oneof![4 => 0i64..4, 4 => 0i64..60, 1 => 0i64..1_500, 1 => -9i64..0].boxed()
    };
    let push = (dt, 0..pixels, 0..pixels, any::<bool>())
        .prop_map(|(dt, x, y, on)| Step::Push(Event::new(dt, x, y, on)));
    prop_oneof![
        40 => push,
        2 => prop_oneof![3 => 0i64..80, 1 => 0i64..3_000].prop_map(Step::Advance),
        8 => Just(Step::Predict),
        1 => Just(Step::Snapshot),
        1 => Just(Step::Bytes),
    ]
}

/// Scripts of up to `most` steps, or twice as many with a reset or restart, on small sensors.
pub fn script(most: usize) -> impl Strategy<Value = Script> {
    script_on(small(), most)
}

/// The same on one clock, which continues after a reset.
pub fn steady(most: usize) -> impl Strategy<Value = Script> {
    scripts(small(), most, false)
}

fn small() -> impl Strategy<Value = (u16, u16)> {
    (prop_oneof![1u16..12, 12u16..70], prop_oneof![1u16..12, 12u16..70])
}

/// Scripts of up to `most` steps on sensors of these columns and rows.
pub fn script_on(sensor: impl Strategy<Value = (u16, u16)>, most: usize) -> impl Strategy<Value = Script> {
    scripts(sensor, most, true)
}

fn scripts(
    sensor: impl Strategy<Value = (u16, u16)>,
    most: usize,
    restarts: bool,
) -> impl Strategy<Value = Script> {
    // Anywhere, at one pixel, at few pixels, at one instant.
    let style = prop_oneof![
        4 => Just((u16::MAX, false)),
        1 => Just((1, false)),
        1 => Just((4, false)),
        1 => Just((u16::MAX, true)),
    ];
    let origin = || prop_oneof![Just(0i64), Just(1_700_000_000_000_000), Just(-77), Just(i64::MIN / 2)];
    let runs = style.prop_flat_map(move |(pixels, one_instant)| {
        let run = move || (origin(), proptest::collection::vec(relative(pixels, one_instant), 1..most));
        (run(), proptest::option::weighted(0.3, (any::<bool>(), run())))
    });
    (sensor, runs).prop_map(move |((width, height), ((origin_us, steps), second))| {
        let sensor = Sensor::new(width, height);
        let mut script = Script::new(sensor, origin_us, steps);
        if let Some((is_reset, (other_us, steps))) = second {
            // Without the reset, the clock of the sensor restarts.
            script.steps.extend((is_reset || !restarts).then_some(Step::Reset));
            let origin_us = if restarts { other_us } else { origin_us };
            script.steps.extend(Script::new(sensor, origin_us, steps).steps);
        }
        script
    })
}

/// Scripts of up to `most` steps with single stamps far ahead, and jumps back by more than a window
/// of `span_us`.
pub fn unsteady_clock(span_us: i64, most: usize) -> impl Strategy<Value = Script> {
    let jump = prop_oneof![
        6 => 0..40i64,
        3 => -30..0i64,
        2 => -4 * span_us..-span_us,
        1 => Just(-MAX_SILENCE_US),
        1 => Just(MAX_SILENCE_US + 1),
        1 => Just(50 * MAX_SILENCE_US),
    ];
    let kind = prop_oneof![20 => Just(0u8), 2 => Just(1), 3 => Just(2), 1 => Just(3)];
    proptest::collection::vec((kind, jump, 0..41u16, 0..31u16, any::<bool>()), 1..most).prop_map(|steps| {
        let mut now = 0i64;
        let step = |(kind, jump, x, y, on)| {
            now = now.saturating_add(jump);
            match kind {
                0 => Step::Push(Event::new(now, x, y, on)),
                1 => Step::Advance(now),
                2 => Step::Predict,
                _ => Step::Bytes,
            }
        };
        Script { sensor: Sensor::new(40, 30), origin_us: 0, steps: steps.into_iter().map(step).collect() }
    })
}

/// Sequences of frames of `values` values each, with predictions, resets and states between them.
pub fn frames(values: usize) -> impl Strategy<Value = Vec<Step<Vec<f32>>>> {
    any::<u64>()
        .prop_map(move |seed| random_frames(values, 1, seed).flat_map(|stream| stream.steps).collect())
}

fn block() -> impl Strategy<Value = BlockShape> {
    let kernel = prop_oneof![
        3 => Just([2, 2, 2]),
        2 => (2usize..=5, 2usize..=5, 1usize..=5).prop_map(|(x, y, t)| [x, y, t]),
    ];
    (
        prop_oneof![3 => 1usize..=9, 1 => Just(16usize)],
        (0u8..8, kernel),
        0usize..8,
        any::<Option<u8>>(),
        any::<[bool; 4]>(),
    )
        .prop_map(|(channels, (number, kernel), input, skip, extras)| BlockShape {
            channels,
            conv: ConvolutionShape::of(number, kernel),
            input,
            skip: skip.map(usize::from),
            extras,
        })
}

fn fraction() -> impl Strategy<Value = (u32, u32)> {
    prop_oneof![
        3 => (1u32..=4, 2u32..=9).prop_map(|(n, d)| (n, d)),
        1 => Just((16, 346)),
        1 => Just((1, 1)),
    ]
}

fn pool() -> impl Strategy<Value = PoolShape> {
    (
        0usize..8,
        [fraction(), fraction()],
        proptest::option::of((1u32..=3, 1u32..=7)),
        any::<bool>(),
        proptest::collection::vec(block(), 0..=2),
    )
        .prop_map(|(from, cell, time, mean, blocks)| PoolShape { from, cell, time, mean, blocks })
}

fn rule() -> impl Strategy<Value = GraphRule> {
    let reach = prop_oneof![
        2 => (1usize..=24).prop_map(|k| Reach::Knn { k }),
        1 => (0.05f64..1.5, 1usize..=24).prop_map(|(r, max)| Reach::Radius { r, max }),
    ];
    let candidates = prop_oneof![
        Just(Candidates::All),
        Just(Candidates::Past(Lifetime::Window)),
        Just(Candidates::Past(Lifetime::Frozen)),
    ];
    (reach, candidates).prop_map(|(reach, candidates)| GraphRule { reach, candidates })
}

/// Networks of up to three pooled levels.
pub fn network() -> impl Strategy<Value = NetworkShape> {
    (
        rule(),
        50i64..2_000,
        (
            prop_oneof![1 => 1usize..8, 3 => 8usize..80],
            proptest::option::weighted(0.3, [fraction(), fraction()]),
        ),
        proptest::collection::vec(block(), 0..=4),
        proptest::collection::vec(pool(), 0..=3),
        0usize..8,
        [1usize..=5, 1usize..=4],
        proptest::collection::vec(1usize..=9, 1..=3),
        proptest::option::weighted(0.3, 1usize..=9),
        any::<u64>(),
    )
        .prop_map(
            |(graph, span_us, (capacity, place), blocks, pooled, from, grid, dense, head, seed)| {
                NetworkShape {
                    graph,
                    span_us,
                    capacity,
                    place,
                    blocks,
                    pooled,
                    from,
                    grid,
                    dense,
                    head,
                    seed,
                }
            },
        )
}

/// Kinds of frame networks.
pub fn frame_style() -> impl Strategy<Value = FrameStyle> {
    prop_oneof![
        3 => Just(FrameStyle::Classifier),
        3 => any::<bool>().prop_map(|squeeze| FrameStyle::UNet { squeeze }),
        2 => Just(FrameStyle::ConvolutionsThenLstm),
        2 => (prop_oneof![Just(3usize), Just(8)], any::<bool>())
            .prop_map(|(hidden, peepholes)| FrameStyle::ConvLstm { hidden, peepholes }),
        1 => Just(FrameStyle::Delays),
        3 => any::<bool>().prop_map(|vector| FrameStyle::Committee { vector }),
    ]
}
