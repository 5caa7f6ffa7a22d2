//! Which rows are recomputed, on graphs small enough to know the answer.

use meissner_engine::{Candidates, Engine, Event, GraphRule, Lifetime, Network, Options, Reach, Sensor};
use meissner_kernels::{SplineConv, SplineParts};
use meissner_tests::networks::{BlockShape, NetworkShape, PoolShape};

const SENSOR: Sensor = Sensor { width: 100, height: 100 };
const SPAN_US: i64 = 1_000;

/// Neighbours within 11 pixels at one instant.
fn near(candidates: Candidates) -> GraphRule {
    GraphRule { reach: Reach::Radius { r: 0.115, max: 8 }, candidates }
}

fn block() -> BlockShape {
    BlockShape { channels: 2, kernel: [2, 2, 2], input: 0, skip: None, extras: [false, true, true, true] }
}

/// A chain of `blocks` at the event level, and what is pooled above.
fn shape(graph: GraphRule, blocks: usize, pooled: Vec<PoolShape>) -> NetworkShape {
    NetworkShape {
        graph,
        span_us: SPAN_US,
        capacity: 64,
        blocks: (0..blocks).map(|input| BlockShape { input, ..block() }).collect(),
        from: pooled.last().map_or(blocks, |pool| pool.blocks.len()),
        pooled,
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 5,
    }
}

/// Ten by ten cells of the sensor, with a chain of blocks above.
fn pool(from: usize, blocks: usize, mean: bool) -> PoolShape {
    let blocks = (0..blocks).map(|input| BlockShape { input, ..block() }).collect();
    PoolShape { from, cell: [(1, 10), (1, 10)], time: None, mean, blocks }
}

fn engine(network: Network) -> Engine {
    let options = Options { poison: true, record_rows: true, ..Options::default() };
    Engine::with_options(network, SENSOR, options).expect("the network is exact")
}

/// Events at one instant at columns 0, 10, 20, ..., each a neighbour of the next alone, and their prediction.
fn chain(shape: &NetworkShape, events: u16) -> Engine {
    let mut engine = engine(shape.build());
    for i in 0..events {
        engine.push(Event::new(0, 10 * i, 50, true));
    }
    engine.predict().expect("finite");
    engine
}

fn recomputed(engine: &mut Engine) -> Vec<Vec<usize>> {
    engine.predict().expect("finite");
    engine.recomputed()
}

#[test]
fn a_change_reaches_one_neighbour_further_with_each_layer() {
    let mut engine = chain(&shape(near(Candidates::All), 3, vec![]), 5);
    engine.push(Event::new(0, 50, 50, true));
    assert_eq!(recomputed(&mut engine), [vec![4, 5], vec![3, 4, 5], vec![2, 3, 4, 5]]);
}

#[test]
fn an_event_without_neighbours_recomputes_its_own_row_alone() {
    let mut engine = chain(&shape(near(Candidates::All), 2, vec![]), 3);
    engine.push(Event::new(0, 90, 0, false));
    assert_eq!(recomputed(&mut engine), [[3], [3]]);
}

#[test]
fn an_event_changes_no_older_row_where_only_the_past_is_read() {
    for lifetime in [Lifetime::Window, Lifetime::Frozen] {
        let mut engine = chain(&shape(near(Candidates::Past(lifetime)), 3, vec![]), 5);
        engine.push(Event::new(0, 50, 50, true));
        assert_eq!(recomputed(&mut engine), [[5], [5], [5]], "{lifetime:?}");
    }
}

#[test]
fn an_expiry_recomputes_the_rows_that_read_the_expired_and_what_reads_them() {
    let mut engine = engine(shape(near(Candidates::Past(Lifetime::Window)), 2, vec![]).build());
    engine.push(Event::new(0, 0, 50, true));
    for i in 1..4 {
        engine.push(Event::new(10, 10 * i, 50, true));
    }
    engine.predict().expect("finite");
    engine.advance(SPAN_US + 1);
    // The second event read the first; the third reads the second. Places count from the oldest that is left.
    assert_eq!(recomputed(&mut engine), [vec![0], vec![0, 1]]);
}

#[test]
fn an_expiry_recomputes_nothing_where_rows_are_frozen() {
    let mut engine = engine(shape(near(Candidates::Past(Lifetime::Frozen)), 2, vec![]).build());
    engine.push(Event::new(0, 0, 50, true));
    engine.push(Event::new(10, 10, 50, true));
    engine.predict().expect("finite");
    engine.advance(SPAN_US + 1);
    assert_eq!(recomputed(&mut engine), [[0usize; 0]; 2]);
    assert_eq!(engine.nodes(), 1);
}

#[test]
fn a_prediction_read_twice_recomputes_nothing() {
    let mut engine = chain(&shape(near(Candidates::All), 2, vec![pool(2, 1, true)]), 5);
    let reused = engine.counters().predictions.reused;
    assert_eq!(recomputed(&mut engine), [[0usize; 0]; 4]);
    assert_eq!(engine.counters().predictions.reused, reused + 1);
}

#[test]
fn time_that_expires_nothing_recomputes_nothing() {
    let mut engine = chain(&shape(near(Candidates::All), 2, vec![pool(2, 1, true)]), 5);
    engine.advance(SPAN_US);
    assert_eq!(recomputed(&mut engine), [[0usize; 0]; 4]);
    assert_eq!(engine.nodes(), 5);
}

#[test]
fn an_event_outside_the_sensor_recomputes_nothing() {
    let mut engine = chain(&shape(near(Candidates::All), 2, vec![]), 5);
    engine.push(Event::new(1, 100, 50, true));
    assert_eq!(recomputed(&mut engine), [[0usize; 0]; 2]);
}

#[test]
fn a_row_that_keeps_its_bits_stops_the_wave() {
    // The first block writes the same row whatever it reads, so that only the new row changes there.
    let mut parts = shape(near(Candidates::All), 2, vec![]).build().parts().clone();
    let constant = SplineParts {
        inputs: 1,
        outputs: 2,
        kernel: [2, 2, 2],
        weight: vec![0.0; 16],
        bias: Some(vec![0.5, -0.5]),
        elu: true,
        ..SplineParts::default()
    };
    parts.events.blocks[0].conv = SplineConv::new(&constant).expect("sizes fit");
    let mut engine = engine(Network::new(parts).expect("the parts fit"));
    for i in 0..5 {
        engine.push(Event::new(0, 10 * i, 50, true));
    }
    engine.predict().expect("finite");
    let before = engine.counters().layers[0].unchanged;
    engine.push(Event::new(0, 50, 50, true));
    assert_eq!(recomputed(&mut engine), [[4, 5], [4, 5]]);
    assert_eq!(engine.counters().layers[0].unchanged - before, 1);
}

#[test]
fn a_pooled_maximum_that_does_not_move_stops_the_wave() {
    // Polarity is pooled directly, and positions are the cells' centres: a second event of a cell changes neither.
    let mut engine = chain(&shape(near(Candidates::All), 0, vec![pool(0, 2, false)]), 5);
    engine.push(Event::new(1, 21, 51, true));
    let rows = recomputed(&mut engine);
    assert_eq!(rows, [vec![2], vec![], vec![]]);
    let pooled = engine.counters().layers[0];
    assert_eq!(pooled.unchanged, 1);
}

#[test]
fn a_member_that_moves_the_mean_position_recomputes_the_cells_around() {
    let mut engine = chain(&shape(near(Candidates::All), 0, vec![pool(0, 1, true)]), 5);
    engine.push(Event::new(1, 21, 51, true));
    // Cell 2 moved: it and the cells that read it see other attributes.
    assert_eq!(recomputed(&mut engine), [vec![2], vec![1, 2, 3]]);
}

#[test]
fn events_between_two_predictions_share_one_wave() {
    let mut engine = chain(&shape(near(Candidates::All), 2, vec![]), 5);
    let before = engine.counters().layers[1].recomputed;
    for on in [true, false, true] {
        engine.push(Event::new(0, 50, 50, on));
    }
    assert_eq!(recomputed(&mut engine), [vec![4, 5, 6, 7], vec![3, 4, 5, 6, 7]]);
    assert_eq!(engine.counters().layers[1].recomputed - before, 5);
}

#[test]
fn a_skip_from_an_unchanged_row_adds_nothing_to_recompute() {
    let mut skipping = shape(near(Candidates::All), 3, vec![]);
    skipping.blocks[2].skip = Some(1);
    let mut engine = chain(&skipping, 5);
    engine.push(Event::new(0, 50, 50, true));
    assert_eq!(recomputed(&mut engine), [vec![4, 5], vec![3, 4, 5], vec![2, 3, 4, 5]]);
}

#[test]
fn what_expires_together_is_not_repaired() {
    let mut engine = chain(&shape(near(Candidates::All), 2, vec![pool(2, 1, true)]), 5);
    for x in [50, 60] {
        engine.push(Event::new(10, x, 50, true));
    }
    engine.predict().expect("finite");
    engine.advance(SPAN_US + 1);
    // Five nodes left; of the two that stay, the one that read the fifth is recomputed, and its neighbour a layer later.
    assert_eq!(recomputed(&mut engine)[..2], [vec![0], vec![0, 1]]);
    engine.push(Event::new(10 * SPAN_US, 0, 0, true));
    assert_eq!(recomputed(&mut engine), [[0], [0], [0], [0]]);
}
