//! Approximations: adapted networks, whose engine equals their batch, and a stale readout.

use meissner_engine::{
    Candidates, Engine, EngineError, Event, Network, Search, Sensor, StaleReadout, Staleness,
};
use meissner_models::{Description, Weights};
use meissner_verify::{CheckedEngine, Step, bits, networks, strategies};
use proptest::prelude::*;

/// Some of the ways in which a network may be adapted.
#[derive(Clone, Debug)]
struct Adaptation {
    neighbours: Option<usize>,
    capacity: Option<usize>,
    span_us: Option<i64>,
}

impl Adaptation {
    fn of(&self, network: Network) -> Network {
        const ADMISSIBLE: &str = "the adaptation is admissible";
        let most = network.parts().graph.reach.most();
        let mut network = network;
        if let Some(neighbours) = self.neighbours {
            network = network.with_neighbours(1 + neighbours % most).expect(ADMISSIBLE);
            assert_eq!(network.parts().graph.reach.most(), 1 + neighbours % most);
        }
        if let Some(capacity) = self.capacity {
            network = network.with_capacity(capacity).expect(ADMISSIBLE);
        }
        if let Some(span_us) = self.span_us {
            network = network.with_span_us(span_us).expect(ADMISSIBLE);
        }
        network
    }
}

fn adaptation() -> impl Strategy<Value = Adaptation> {
    (proptest::option::of(0usize..24), proptest::option::of(1usize..40), proptest::option::of(50i64..2_000))
        .prop_map(|(neighbours, capacity, span_us)| Adaptation { neighbours, capacity, span_us })
}

fn staleness() -> impl Strategy<Value = Staleness> {
    (proptest::option::of(1u64..20), proptest::option::of(1i64..300))
        .prop_map(|(events, us)| Staleness::new().with_events(events).with_us(us))
}

/// A prediction at the time of its computation.
#[derive(Clone, Debug)]
struct Exact {
    values: Vec<u32>,
    t_us: Option<i64>,
    nodes: usize,
    now_us: Option<i64>,
    accepted: u64,
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn an_adapted_network_is_exact_in_itself(
        shape in strategies::network(), adaptation in adaptation(), script in strategies::script(120),
    ) {
        let network = adaptation.of(shape.build());
        let mut checked = CheckedEngine::new(network, script.sensor, Search::Exhaustive);
        prop_assert_eq!(checked.run(&script), Ok(()));
    }

    #[test]
    fn a_stale_prediction_is_the_exact_one_of_its_time_and_younger_than_its_bounds(
        shape in strategies::network(), script in strategies::script(200), bound in staleness(),
    ) {
        let network = std::sync::Arc::new(shape.build());
        let engine = || Engine::new(std::sync::Arc::clone(&network), script.sensor).expect("exact");
        let (mut exact, mut stale) = (engine(), StaleReadout::new(engine(), bound).expect("admissible"));
        let mut stands: Option<Exact> = None;
        let mut returned = 0;
        for step in &script.steps {
            let restarts = exact.event_counters().restarts;
            match *step {
                Step::Push(event) => prop_assert_eq!(stale.push(event), exact.push(event)),
                Step::Advance(t_us) => {
                    exact.advance(t_us);
                    stale.advance(t_us);
                }
                Step::Reset => {
                    exact.reset();
                    stale.reset();
                    stands = None;
                }
                Step::Snapshot | Step::Bytes => {
                    let before = stale.clone();
                    stale.push(Event::new(exact.now_us().unwrap_or(0) + 3, 1, 1, true));
                    stale.predict().expect("finite");
                    stale = before;
                }
                Step::Predict => {
                    let (now_us, accepted) = (exact.now_us(), exact.event_counters().accepted);
                    let now = exact.predict().expect("finite");
                    let now = Exact {
                        values: bits(now.values), t_us: now.t_us, nodes: now.nodes, now_us, accepted,
                    };
                    let age = |then: &Exact| now_us.zip(then.now_us).map(|(now, then)| now - then);
                    let old = |then: &Exact| {
                        bound == Staleness::default()
                            || bound.events.is_some_and(|events| accepted - then.accepted >= events)
                            || bound.us.is_some_and(|us| age(then).is_none_or(|age| age >= us))
                    };
                    let is_new = stands.as_ref().is_none_or(old);
                    let expected = if is_new { now } else { stands.take().expect("a prediction stands") };
                    returned += u64::from(!is_new);
                    let got = stale.predict().expect("finite");
                    prop_assert_eq!(bits(got.values), expected.values.clone());
                    prop_assert_eq!((got.t_us, got.nodes), (expected.t_us, expected.nodes));
                    prop_assert!(is_new || got.rows.iter().all(|&rows| rows == 0));
                    prop_assert!(bound.events.is_none_or(|events| accepted - expected.accepted < events));
                    stands = Some(expected);
                }
            }
            if exact.event_counters().restarts > restarts {
                stands = None;
            }
        }
        prop_assert_eq!(stale.stale(), returned);
    }
}

fn graphres() -> Network {
    let weights = Weights::shipped("graphres").expect("shipped weights");
    Description::shipped("graphres").expect("a shipped network").network(&weights).expect("the weights fit")
}

#[test]
fn adaptations_out_of_range_are_refused() {
    let most = graphres().parts().graph.reach.most();
    for neighbours in [0, most + 1] {
        let refused = graphres().with_neighbours(neighbours);
        assert!(matches!(refused, Err(EngineError::Option { .. })), "{neighbours}");
    }
    assert!(graphres().with_neighbours(most).is_ok());
    for capacity in [0, Network::MAX_CAPACITY + 1] {
        assert!(matches!(graphres().with_capacity(capacity), Err(EngineError::Option { .. })), "{capacity}");
    }
    assert!(matches!(graphres().with_span_us(0), Err(EngineError::Option { .. })));
}

#[test]
fn nodes_at_their_cells_centre_never_move() {
    let mut shape = networks::NetworkShape {
        graph: meissner_engine::GraphRule {
            reach: meissner_engine::Reach::Knn { k: 1 },
            candidates: Candidates::All,
        },
        span_us: 1_000,
        capacity: 64,
        place: None,
        blocks: vec![],
        pooled: vec![],
        from: 0,
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 5,
    };
    // Without a block that reads edges, cells keep none.
    let block = networks::BlockShape {
        channels: 2,
        conv: networks::ConvolutionShape::Spline([2; 3]),
        input: 0,
        skip: None,
        extras: [false; 4],
    };
    let cell = [(1, 10), (1, 10)];
    let pool = networks::PoolShape { from: 0, cell, time: None, mean: true, blocks: vec![block] };
    shape.pooled = vec![pool];
    let checked = |network: Network| {
        let mut engine = Engine::new(network, Sensor::new(100, 100)).expect("exact");
        for (x, t) in [(20, 0), (29, 0), (50, 0), (59, 0)] {
            engine.push(Event::new(t, x, 50, true));
        }
        engine.predict().expect("finite");
        let before = engine.counters().predictions.neighbourhoods_checked;
        // Nearest to an event of its own cell: no edge of cells is new.
        engine.push(Event::new(1, 21, 50, true));
        engine.predict().expect("finite");
        engine.counters().predictions.neighbourhoods_checked - before
    };
    assert!(checked(shape.build()) > 0);
    shape.pooled[0].mean = false;
    assert_eq!(checked(shape.build()), 0);
}

#[test]
fn a_bound_below_one_is_refused() {
    let engine = Engine::new(graphres(), Sensor::new(8, 8)).expect("exact");
    for bound in [
        Staleness::new().with_events(0),
        Staleness::new().with_us(0),
        Staleness::new().with_events(3).with_us(-1),
        Staleness::new().with_us(i64::MAX),
    ] {
        let refused = StaleReadout::new(engine.clone(), bound);
        assert!(matches!(refused, Err(EngineError::Option { .. })), "{bound:?}");
    }
}
