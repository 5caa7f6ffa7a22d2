//! Values at the ends of their types are taken, dropped and counted, or refused. Nothing panics.

use std::sync::Arc;

use meissner_engine::filters::{BackgroundActivity, EventFilter, RateLimit, Refractory, Stride};
use meissner_engine::representations::{
    Consecutive, ConsecutiveFrames, Crop, Decay, SignedRule, SlidingSigned, TimeSurface, VoxelGrid, VoxelTime,
};
use meissner_engine::{
    Batch, Engine, EngineError, Event, Fraction, LatePolicy, Network, Options, Reach, Search, Sensor,
    StaleReadout, Staleness, Stream,
};
use meissner_verify::strategies;
use proptest::prelude::*;

const SENSOR: Sensor = Sensor { width: 6, height: 5 };
const WITHOUT_PIXELS: [Sensor; 3] = [
    Sensor { width: 0, height: 0 },
    Sensor { width: 0, height: u16::MAX },
    Sensor { width: u16::MAX, height: 0 },
];

/// Stamps of all sizes, including the ends.
fn time() -> impl Strategy<Value = i64> {
    let end = prop_oneof![Just(i64::MIN), Just(i64::MIN + 1), Just(-1), Just(0), Just(i64::MAX)];
    prop_oneof![3 => any::<i64>(), 3 => end, 6 => 0i64..3_000]
}

/// Pixels on the sensor and off it.
fn pixel() -> impl Strategy<Value = u16> {
    prop_oneof![8 => 0u16..5, 1 => Just(u16::MAX), 1 => any::<u16>()]
}

/// Events, some followed by a time to which the clock advances.
fn steps() -> impl Strategy<Value = Vec<(Event, Option<i64>)>> {
    let event = (time(), pixel(), pixel(), any::<bool>()).prop_map(|(t, x, y, on)| Event::new(t, x, y, on));
    proptest::collection::vec((event, proptest::option::weighted(0.2, time())), 0..40)
}

fn late() -> impl Strategy<Value = LatePolicy> {
    prop_oneof![Just(LatePolicy::Drop), Just(LatePolicy::Clamp)]
}

/// Numbers of a network, including the ends of the admissible range.
fn scale() -> impl Strategy<Value = f32> {
    prop_oneof![Just(f32::from_bits(1)), Just(f32::MIN_POSITIVE), Just(f32::MAX), 0.01f32..10.0]
}

fn span() -> impl Strategy<Value = i64> {
    prop_oneof![Just(1), Just(Network::MAX_SPAN_US), 1i64..5_000]
}

fn radius() -> impl Strategy<Value = f64> {
    prop_oneof![Just(f64::from_bits(1)), Just(1e-200), Just(f64::MAX), 0.01f64..2.0]
}

fn fraction() -> impl Strategy<Value = Fraction> {
    let term = prop_oneof![Just(1), Just(u32::MAX), 1u32..40];
    (term.clone(), term).prop_map(|(n, d)| Fraction::new(n, d).expect("positive"))
}

/// Whether there is a prediction, or it is refused for an admissible reason.
fn is_in_order<T>(prediction: Result<T, EngineError>) -> bool {
    matches!(prediction, Ok(_) | Err(EngineError::NotANumber { .. }))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn an_engine_takes_or_drops_any_event_at_any_time(
        shape in strategies::network(), steps in steps(), late in late(), stale in 1i64..5_000,
    ) {
        let options = Options::new().with_late(late);
        let engine = Engine::with_options(shape.build(), SENSOR, options).expect("the network is exact");
        let mut engine = StaleReadout::new(engine, Staleness::new().with_us(stale)).expect("in range");
        for (event, advance) in steps {
            engine.push(event);
            if let Some(t_us) = advance {
                engine.advance(t_us);
            }
            prop_assert!(is_in_order(engine.predict()));
        }
        let engine = engine.into_engine();
        let counts = engine.counters().events;
        let dropped: u64 = counts.dropped().iter().map(|(_, count)| count).sum();
        prop_assert_eq!(counts.pushed, counts.accepted + dropped);
        prop_assert_eq!(engine.events().len(), engine.nodes());
    }

    #[test]
    fn a_network_of_extreme_numbers_is_refused_or_runs(
        shape in strategies::network(), steps in steps(), scale in scale(), span_us in span(), r in radius(),
        cell in [fraction(), fraction()], times in [fraction(), fraction()], capacity in 1usize..9,
    ) {
        let mut parts = shape.build().parts().clone();
        (parts.span_us, parts.capacity, parts.events.scale) = (span_us, capacity, scale);
        parts.graph.reach = Reach::Radius { r, max: 255 };
        let mut times = times.into_iter().cycle();
        for (pooling, level) in &mut parts.pooled {
            (pooling.cell, level.scale) = (cell, scale);
            pooling.time = pooling.time.and(times.next());
        }
        let network = match Network::new(parts) {
            Ok(network) => Arc::new(network),
            Err(error) => {
                prop_assert!(matches!(error, EngineError::Network { .. }), "{error}");
                return Ok(());
            }
        };
        let options = Options::new().with_memory_limit(1 << 26);
        let batch = Batch::new(Arc::clone(&network), SENSOR).expect("the sensor has pixels");
        match Engine::with_options(network, SENSOR, options) {
            Ok(mut engine) => {
                for &(event, advance) in &steps {
                    engine.push(event);
                    if let Some(t_us) = advance {
                        engine.advance(t_us);
                    }
                    prop_assert!(is_in_order(engine.predict()));
                }
            }
            Err(error) => prop_assert!(matches!(error, EngineError::Memory { .. }), "{error}"),
        }
        let mut events: Vec<Event> = steps.into_iter().map(|(event, _)| event).collect();
        events.retain(|e| SENSOR.contains(e.x, e.y) && e.t_us >= 0);
        events.sort_by_key(|e| e.t_us);
        for search in [Search::Grid, Search::Exhaustive] {
            prop_assert!(is_in_order(batch.clone().with_search(search).forward(Stream::new(&events))));
        }
    }

    #[test]
    fn a_batch_runs_on_any_stream_or_refuses_it(
        shape in strategies::network(), steps in steps(), epoch_us in time(), now_us in time(), sorted in any::<bool>(),
    ) {
        let mut events: Vec<Event> = steps.into_iter().map(|(event, _)| event).collect();
        if sorted {
            events.retain(|e| SENSOR.contains(e.x, e.y));
            events.sort_by_key(|e| e.t_us);
        }
        let network = Arc::new(shape.build());
        for search in [Search::Grid, Search::Exhaustive] {
            let batch = Batch::new(Arc::clone(&network), SENSOR).expect("the sensor has pixels").with_search(search);
            for stream in [Stream::new(&events), Stream { events: &events, epoch_us, now_us }] {
                let trace = batch.forward(stream);
                let refused = matches!(trace, Err(EngineError::Stream { .. }));
                prop_assert!(refused || is_in_order(trace));
                prop_assert_eq!(batch.graph(stream).is_err(), refused);
            }
        }
    }

    #[test]
    fn a_filter_takes_any_event_at_any_time(steps in steps(), us in 1i64..=1 << 40, rate in 1..=RateLimit::HIGHEST) {
        for sensor in WITHOUT_PIXELS.into_iter().chain([SENSOR, Sensor::new(u16::MAX, 1)]) {
            let filters: [Box<dyn EventFilter>; 4] = [
                Box::new(Stride::new(u32::MAX).expect("in range")),
                Box::new(RateLimit::new(rate).expect("in range")),
                Box::new(BackgroundActivity::new(sensor, us).expect("in range")),
                Box::new(Refractory::new(sensor, us).expect("in range")),
            ];
            for mut filter in filters {
                let passed = steps.iter().filter(|(event, _)| filter.admit(*event)).count() as u64;
                prop_assert_eq!(filter.counters().passed, passed);
                prop_assert_eq!(filter.counters().passed + filter.counters().dropped, steps.len() as u64);
            }
        }
    }

    #[test]
    fn a_representation_takes_or_drops_any_event_at_any_time(
        steps in steps(), start_us in proptest::option::of(time()), long in 1i64..=i64::MAX, short in 1i64..2_000,
    ) {
        let crop = Crop::new(1, 1, 4, 3);
        for period_us in [long, short, i64::MAX] {
            let options = Consecutive { crop, period_us, start_us };
            let mut counts = ConsecutiveFrames::counts(SENSOR, options, 1.0).expect("admissible");
            let mut signed = ConsecutiveFrames::signed(SENSOR, options, SignedRule::Sum).expect("admissible");
            let mut sliding = SlidingSigned::new(SENSOR, crop, SignedRule::Latest, period_us, 3).expect("admissible");
            let decay = Decay::Linear { span_us: f32::MIN_POSITIVE };
            let mut surface = TimeSurface::new(SENSOR, crop, decay).expect("admissible");
            let (mut frames, mut completed) = (0, 0);
            for &(event, advance) in &steps {
                counts.push(event, |run| completed += u64::from(run.count() > 0));
                signed.push(event, |_| frames += 1);
                sliding.push(event);
                surface.push(event);
                if let Some(t_us) = advance {
                    counts.advance(t_us, |run| completed += u64::from(run.count() > 0));
                    signed.advance(t_us, |_| frames += 1);
                    sliding.advance(t_us);
                    surface.advance(t_us);
                }
                prop_assert!(sliding.frame().events.iter().sum::<u64>() <= 3);
                prop_assert!(surface.surface().values.iter().all(|v| (0.0..=1.0).contains(v)));
                prop_assert_eq!(counts.open().map(|frame| frame.start_us), signed.open().map(|frame| frame.start_us));
            }
            prop_assert_eq!(completed, frames);
            prop_assert_eq!(counts.counters(), signed.counters());
            prop_assert_eq!(counts.counters().pushed, steps.len() as u64);
            counts.reset();
            signed.reset();
            sliding.reset();
            surface.reset();
        }
    }

    #[test]
    fn a_voxel_grid_takes_or_drops_any_event_in_any_window_or_refuses_it(
        steps in steps(), start in time(), span in 0i64..=u32::MAX.into(), end in time(), bins in 1usize..40,
    ) {
        let whole = Crop::whole(SENSOR);
        for time in [VoxelTime::Bins, VoxelTime::Centres] {
            let short = start..=start.saturating_add(span);
            let mut grid = VoxelGrid::new(SENSOR, whole, bins, time, short).expect("admissible");
            let inside = steps.iter().filter(|(event, _)| grid.push(*event)).count() as u64;
            prop_assert_eq!(grid.frame().events, inside);
            prop_assert!(grid.frame().values.iter().all(|v| v.is_finite()));
            if grid.restart(start..=end).is_ok() {
                prop_assert!(start <= end);
                prop_assert_eq!(grid.frame().events, 0);
            }
        }
    }
}
