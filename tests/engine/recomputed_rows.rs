//! Recomputed rows, on graphs small enough to know the answer.

use meissner_engine::{
    Candidates, Counters, Engine, Event, GraphRule, LayerCounters, Lifetime, Network, Options, Reach, Sensor,
};
use meissner_kernels::{PointNetConv, PointNetParts, SplineConv, SplineParts};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};

pub(crate) const SENSOR: Sensor = Sensor { width: 100, height: 100 };
pub(crate) const SPAN_US: i64 = 1_000;

/// Neighbours within 11 pixels at one instant.
pub(crate) fn near(candidates: Candidates) -> GraphRule {
    GraphRule { reach: Reach::Radius { r: 0.115, max: 8 }, candidates }
}

pub(crate) fn block() -> BlockShape {
    BlockShape {
        channels: 2,
        conv: ConvolutionShape::Spline([2, 2, 2]),
        input: 0,
        skip: None,
        extras: [false, true, true, true],
    }
}

/// A chain of `blocks` at the event level, and pooled levels above.
pub(crate) fn shape(graph: GraphRule, blocks: usize, pooled: Vec<PoolShape>) -> NetworkShape {
    NetworkShape {
        graph,
        span_us: SPAN_US,
        capacity: 64,
        place: None,
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
pub(crate) fn pool(from: usize, blocks: usize, mean: bool) -> PoolShape {
    let blocks = (0..blocks).map(|input| BlockShape { input, ..block() }).collect();
    PoolShape { from, cell: [(1, 10), (1, 10)], time: None, mean, blocks }
}

pub(crate) fn engine(network: Network) -> Engine {
    let options = Options::new().with_poison(true).with_record_rows(true);
    Engine::with_options(network, SENSOR, options).expect("the network is exact")
}

/// Events at one instant at columns 0, 10, 20, ..., each a neighbour only of the next.
pub(crate) fn chain(shape: &NetworkShape, events: u16) -> Engine {
    let mut engine = engine(shape.build());
    for i in 0..events {
        engine.push(Event::new(0, 10 * i, 50, true));
    }
    engine.predict().expect("finite");
    engine
}

pub(crate) fn recomputed(engine: &mut Engine) -> Vec<Vec<usize>> {
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
    // The second event read the first; the third reads the second.
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
    // The first block writes the same row for any input: only the new row changes there.
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
    parts.events.blocks[0].conv = SplineConv::new(&constant).expect("sizes fit").into();
    let mut engine = engine(Network::new(parts).expect("the parts fit"));
    for x in [0, 10, 20, 30, 40, 60] {
        engine.push(Event::new(0, x, 50, true));
    }
    engine.predict().expect("finite");
    let before = engine.counters();
    engine.push(Event::new(0, 50, 50, true));
    assert_eq!(recomputed(&mut engine), [[4, 5, 6], [4, 5, 6]]);
    let [first, second] = engine.counters().since(&before).layers[..] else { panic!("two layers") };
    assert_eq!((first.recomputed, first.unchanged, first.within_tolerance), (3, 2, 0));
    assert_eq!((second.recomputed, second.unchanged), (3, 0));
}

#[test]
fn a_pooled_maximum_that_does_not_move_stops_the_wave() {
    // Polarity is pooled directly, at centres of cells: a second event of a cell changes nothing.
    let mut engine = chain(&shape(near(Candidates::All), 0, vec![pool(0, 2, false)]), 5);
    engine.push(Event::new(1, 21, 51, true));
    let rows = recomputed(&mut engine);
    assert_eq!(rows, [vec![2], vec![], vec![]]);
    let pooled = engine.counters().layers[0];
    assert_eq!(pooled.unchanged, 1);
}

#[test]
fn a_cell_without_a_root_weight_does_not_read_its_own_maximum() {
    let mut engine = engine(shape(near(Candidates::All), 0, vec![pool(0, 1, false)]).build());
    for i in 0..5 {
        engine.push(Event::new(0, 10 * i, 50, false));
    }
    engine.predict().expect("finite");
    engine.push(Event::new(1, 21, 51, true));
    assert_eq!(recomputed(&mut engine), [vec![2], vec![1, 3]]);
}

#[test]
fn a_row_is_computed_for_what_it_reads_and_for_nothing_that_blocks_before_read() {
    let two = |first: BlockShape| {
        let mut pool = pool(0, 2, false);
        pool.blocks[0] = first;
        pool
    };
    // Cells 0, 5 and 6 move. The first block leaves the row of cell 0 as it was.
    let mut engine = engine(shape(near(Candidates::All), 0, vec![two(block())]).build());
    for i in 0..10 {
        engine.push(Event::new(0, 10 * i, 50, false));
    }
    engine.predict().expect("finite");
    for x in [1, 51, 61] {
        engine.push(Event::new(1, x, 51, true));
    }
    assert_eq!(recomputed(&mut engine), [vec![0, 5, 6], vec![1, 4, 5, 6, 7], vec![0, 2, 3, 4, 5, 6, 7, 8]]);
    // A cell that reads itself in the first block alone, where each reads the cell before it.
    let rooted = BlockShape { extras: [true; 4], ..block() };
    let skipping = BlockShape { channels: 1, skip: Some(0), ..block() };
    for first in [rooted, skipping] {
        let past = Candidates::Past(Lifetime::Window);
        let mut engine = self::engine(shape(near(past), 0, vec![two(first)]).build());
        for i in 0..6 {
            engine.push(Event::new(0, 10 * i, 50, false));
        }
        engine.predict().expect("finite");
        engine.push(Event::new(1, 20, 56, true));
        assert_eq!(recomputed(&mut engine), [vec![2], vec![2, 3], vec![3, 4]]);
    }
}

#[test]
fn a_pointnet_row_is_computed_for_itself_and_for_what_it_reads() {
    let pointnet = || BlockShape { conv: ConvolutionShape::PointNet, ..block() };
    let cells = |first: BlockShape, second: BlockShape| {
        let mut pool = pool(0, 2, false);
        pool.blocks = vec![first, BlockShape { input: 1, ..second }];
        shape(near(Candidates::Past(Lifetime::Window)), 0, vec![pool])
    };
    // Each cell reads the cell before it. Cell 2 moves, but its row stays.
    for (first, second, expected) in [
        (block(), block(), [vec![2], vec![3], vec![4]]),
        (pointnet(), block(), [vec![2], vec![2, 3], vec![3, 4]]),
        (block(), pointnet(), [vec![2], vec![3], vec![3, 4]]),
        (pointnet(), pointnet(), [vec![2], vec![2, 3], vec![2, 3, 4]]),
    ] {
        let mut engine = engine(cells(first, second).build());
        for i in 0..6 {
            engine.push(Event::new(0, 10 * i, 50, false));
        }
        engine.predict().expect("finite");
        engine.push(Event::new(1, 20, 56, true));
        assert_eq!(recomputed(&mut engine), expected);
    }
}

#[test]
fn a_pointnet_row_whose_maximum_stays_stops_the_wave() {
    // A block whose outputs no input reaches: ReLU leaves only the bias where it is the largest.
    let mut parts = shape(near(Candidates::All), 2, vec![]).build().parts().clone();
    let constant = PointNetParts {
        inputs: 1,
        outputs: 2,
        weight: vec![0.0; 8],
        bias: vec![0.5, -0.5],
        ..PointNetParts::default()
    };
    parts.events.blocks[0].conv = PointNetConv::new(&constant).expect("sizes fit").into();
    let mut engine = engine(Network::new(parts).expect("the parts fit"));
    for x in [0, 10, 20, 30, 40] {
        engine.push(Event::new(0, x, 50, true));
    }
    engine.predict().expect("finite");
    engine.push(Event::new(1, 50, 50, true));
    // The new row and its neighbour are computed; the second block reads only new in-edges.
    assert_eq!(recomputed(&mut engine), [vec![4, 5], vec![4, 5]]);
}

#[test]
fn a_row_that_leaves_before_a_prediction_is_not_computed() {
    let mut engine = engine(shape(near(Candidates::All), 2, vec![]).build());
    engine.push(Event::new(0, 0, 50, true));
    engine.push(Event::new(10, 10, 50, true));
    engine.advance(SPAN_US + 1);
    assert_eq!(recomputed(&mut engine), [[0], [0]]);
    assert!(engine.counters().layers.iter().all(|layer| layer.recomputed == 1));
}

#[test]
fn a_cell_that_loses_its_last_member_is_computed_by_no_block() {
    let mut rooted = shape(near(Candidates::All), 0, vec![pool(0, 1, true)]);
    rooted.pooled[0].blocks[0].extras[0] = true;
    let mut engine = engine(rooted.build());
    engine.push(Event::new(0, 0, 50, true));
    engine.push(Event::new(10, 90, 50, true));
    engine.predict().expect("finite");
    let before = engine.counters();
    engine.advance(SPAN_US + 1);
    assert_eq!(recomputed(&mut engine), [[0usize; 0]; 2]);
    let layers = engine.counters().since(&before).layers;
    assert_eq!([layers[0].recomputed, layers[1].recomputed], [1, 0]);
}

#[test]
fn a_frozen_row_that_leaves_before_a_prediction_is_pooled_by_none() {
    let mut engine =
        engine(shape(near(Candidates::Past(Lifetime::Frozen)), 1, vec![pool(1, 0, false)]).build());
    engine.push(Event::new(0, 0, 50, true));
    engine.predict().expect("finite");
    let before = engine.counters();
    engine.push(Event::new(1, 30, 50, true));
    engine.push(Event::new(900, 60, 50, true));
    engine.advance(SPAN_US + 2);
    assert_eq!(recomputed(&mut engine), [[0], [0]]);
    // The cell that the first event has left, and that of the third.
    assert_eq!(engine.counters().since(&before).layers[1].recomputed, 2);
}

#[test]
fn a_member_below_the_maximum_leaves_without_its_cell_being_taken_again() {
    for candidates in [Candidates::All, Candidates::Past(Lifetime::Frozen)] {
        let mut engine = engine(shape(near(candidates), 0, vec![pool(0, 0, false)]).build());
        // With frozen rows the first two predictions split the members of a queue into two parts.
        for (t_us, on) in [(0, false), (10, false), (20, true)] {
            engine.push(Event::new(t_us, 50, 50, on));
            engine.predict().expect("finite");
        }
        for oldest_us in [0, 10] {
            let before = engine.counters();
            engine.advance(oldest_us + SPAN_US + 1);
            engine.predict().expect("finite");
            assert_eq!(engine.counters().since(&before).layers[0].recomputed, 0, "{candidates:?}");
        }
        assert_eq!(engine.feature(1, 0), [[1.0]]);
    }
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
    // Five nodes left; the one that read the fifth is recomputed, its neighbour a layer later.
    assert_eq!(recomputed(&mut engine)[..2], [vec![0], vec![0, 1]]);
    engine.push(Event::new(10 * SPAN_US, 0, 0, true));
    assert_eq!(recomputed(&mut engine), [[0], [0], [0], [0]]);
}

#[test]
fn a_reset_leaves_nothing_to_recompute() {
    let shape = shape(near(Candidates::All), 2, vec![pool(2, 1, true)]);
    for (poison, predicts) in [(false, false), (false, true), (true, false), (true, true)] {
        let options = Options::new().with_poison(poison);
        let mut engine = Engine::with_options(shape.build(), SENSOR, options).expect("the network is exact");
        for i in 0..5 {
            engine.push(Event::new(10 * i64::from(i), 10 * i, 50, true));
        }
        if predicts {
            engine.predict().expect("finite");
            engine.advance(SPAN_US + 11);
        }
        engine.reset();
        let before = engine.counters();
        engine.predict().expect("finite");
        let counters = engine.counters().since(&before);
        assert!(counters.layers.iter().all(|layer| layer.recomputed == 0), "{counters:?}");
        let p = counters.predictions;
        assert_eq!((p.cells_recomputed, p.neighbourhoods_checked), (0, 0), "{poison}, {predicts}");
    }
}

#[test]
fn every_layer_of_every_level_counts_its_own_rows() {
    let mut coarse = pool(1, 1, true);
    coarse.cell = [(1, 5), (1, 5)];
    let mut engine = engine(shape(near(Candidates::All), 1, vec![pool(1, 1, true), coarse]).build());
    for i in 0..5 {
        engine.push(Event::new(0, 10 * i, 50, true));
    }
    // Columns 0, 10, ..., 40 in cells of 10, and the centres of these in cells of 20.
    assert_eq!(engine.predict().expect("finite").rows, [5, 5, 5, 3, 3]);
    engine.push(Event::new(0, 90, 0, true));
    assert_eq!(engine.predict().expect("finite").rows, [1, 1, 1, 1, 1]);
    let count = |counters: &Counters, of: fn(&LayerCounters) -> u64| -> Vec<u64> {
        counters.layers.iter().map(of).collect()
    };
    assert_eq!(count(&engine.counters(), |layer| layer.recomputed), [6, 6, 6, 4, 4]);
    assert_eq!(count(&engine.counters(), |layer| layer.kept), [5, 5, 5, 3, 3]);
    // One event and one cell of either level are left, then none.
    engine.push(Event::new(SPAN_US, 90, 0, false));
    engine.advance(SPAN_US + 1);
    engine.predict().expect("finite");
    let before = engine.counters();
    engine.predict().expect("finite");
    engine.reset();
    engine.push(Event::new(0, 0, 0, true));
    engine.predict().expect("finite");
    engine.predict().expect("finite");
    assert_eq!(count(&engine.counters().since(&before), |layer| layer.kept), [2; 5]);
}

#[test]
fn neighbourhoods_of_cells_are_checked_where_an_edge_or_a_position_changed_and_nowhere_else() {
    let checked = |mean, events: &[(i64, u16)], more: &[(i64, u16)], now_us| {
        let shape = NetworkShape { capacity: 3, ..shape(near(Candidates::All), 0, vec![pool(0, 1, mean)]) };
        let mut engine = engine(shape.build());
        let push = |engine: &mut Engine, events: &[(i64, u16)]| {
            for &(t_us, x) in events {
                engine.push(Event::new(t_us, x, 50, true));
            }
        };
        push(&mut engine, events);
        engine.predict().expect("finite");
        let before = engine.counters();
        push(&mut engine, more);
        engine.advance(now_us);
        engine.predict().expect("finite");
        let count = |engine: &Engine| {
            let p = engine.counters().since(&before).predictions;
            (p.neighbourhoods_checked, p.neighbourhoods_unchanged)
        };
        let counted = count(&engine);
        engine.predict().expect("finite");
        assert_eq!(count(&engine), counted, "nothing changed");
        counted
    };
    // An event at the position of another one does not change the mean; one beside it does.
    assert_eq!(checked(true, &[(0, 50)], &[(0, 50)], 0), (0, 0));
    assert_eq!(checked(true, &[(0, 50)], &[(0, 51)], 0), (1, 1));
    // A removed cell is not checked; the cell that read it is.
    assert_eq!(checked(false, &[(0, 0), (10, 10)], &[], SPAN_US + 1), (1, 0));
    // An edge between two cells stays unchanged if more than one pair of its events is left.
    assert_eq!(checked(false, &[(0, 0), (10, 10)], &[(11, 1)], SPAN_US + 1), (0, 0));
    // The oldest event makes room for one of its cell, which has a new edge.
    assert_eq!(checked(false, &[(0, 0), (1, 10), (1, 90)], &[(2, 1)], 2).0, 2);
}

#[test]
fn a_cell_that_loses_its_maximum_and_gets_it_back_is_taken_once_and_moves_nothing() {
    for candidates in [Candidates::All, Candidates::Past(Lifetime::Frozen)] {
        let mut rooted = shape(near(candidates), 0, vec![pool(0, 1, false)]);
        rooted.pooled[0].blocks[0].extras[0] = true;
        let mut engine = engine(rooted.build());
        engine.push(Event::new(0, 50, 50, true));
        engine.push(Event::new(10, 50, 50, true));
        engine.predict().expect("finite");
        let before = engine.counters();
        engine.push(Event::new(20, 50, 50, true));
        engine.advance(SPAN_US + 1);
        assert_eq!(recomputed(&mut engine), [vec![0], vec![]], "{candidates:?}");
        let layers = engine.counters().since(&before).layers;
        assert_eq!([layers[0].recomputed, layers[0].unchanged, layers[1].recomputed], [1, 1, 0]);
    }
}

#[test]
fn a_prediction_counts_the_cells_of_the_readout_that_it_took_again() {
    let mut engine = engine(shape(near(Candidates::All), 0, vec![]).build());
    for (x, expected) in [
        // Read, reused, cells taken again, cells of these that did not change.
        (10, [1, 0, 1, 0]),
        (20, [2, 1, 2, 1]),
        (90, [3, 1, 3, 1]),
        (95, [4, 2, 4, 2]),
    ] {
        engine.push(Event::new(0, x, 50, true));
        engine.predict().expect("finite");
        let p = engine.counters().predictions;
        assert_eq!([p.read, p.reused, p.cells_recomputed, p.cells_unchanged], expected, "column {x}");
    }
}
