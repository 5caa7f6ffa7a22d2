//! Whole networks against the reference, layer by layer, through the golden files: batch and incremental.

use std::collections::BTreeSet;
use std::sync::Arc;

use meissner_engine::{Batch, Engine, Event, LevelTrace, Network, Search, Sensor, Stream, Trace};
use meissner_kernels::Matrix;
use meissner_models::{Description, Weights};
use meissner_tests::shared::{Golden, POINTNET, assert_close, shared};
use meissner_verify::bits;

const SENSOR: Sensor = Sensor { width: 240, height: 180 };
const LAYER: f32 = 1e-5;
const PREDICTION: f32 = 1e-4;

fn events(golden: &Golden) -> Vec<Event> {
    let rows = golden.integers("events").chunks_exact(4);
    rows.map(|e| Event::new(e[0], e[1] as u16, e[2] as u16, e[3] == 1)).collect()
}

fn network(name: &str, weights: &Weights) -> Arc<Network> {
    let description = Description::shipped(name).expect("a shipped network");
    Arc::new(description.network_ignoring_preparation(weights).expect("the weights fit"))
}

fn published() -> Weights {
    let path = shared("data/checkpoints/contact_angle_graphres.safetensors");
    Weights::load(&path).expect("readable weights")
}

fn flat(matrix: &Matrix) -> Vec<f32> {
    (0..matrix.rows()).flat_map(|row| matrix.values(row).collect::<Vec<_>>()).collect()
}

/// Sources of each row's in-edges, in order.
fn sources(golden: &Golden, rows: usize) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); rows];
    golden.edges("edge_index").iter().for_each(|&(source, reader)| lists[reader].push(source as u32));
    lists
}

fn rows_of(level: &LevelTrace) -> Vec<Vec<u32>> {
    (0..level.edges.rows()).map(|row| level.edges.row(row).iter().map(|n| n.row).collect()).collect()
}

/// Compares a pooled level's nodes and edges; `columns` is the row length of the reference's cell numbers.
fn assert_pooled(level: &LevelTrace, golden: &Golden, prefix: &str, columns: i64) {
    let numbers: Vec<i64> = level.cells.iter().map(|[x, y, _]| y * columns + x).collect();
    assert_eq!(numbers, golden.integers(&format!("{prefix}_cell")), "{prefix}_cell");
    assert_close(
        &format!("{prefix}_x"),
        &flat(&level.features[0]),
        golden.floats(&format!("{prefix}_x")),
        LAYER,
    );
    let positions: Vec<f32> = level.positions.iter().flatten().map(|&p| p as f32).collect();
    assert_close(&format!("{prefix}_pos"), &positions, golden.floats(&format!("{prefix}_pos")), LAYER);
    let edges: BTreeSet<(usize, usize)> = rows_of(level)
        .iter()
        .enumerate()
        .flat_map(|(reader, sources)| sources.iter().map(move |&source| (source as usize, reader)))
        .collect();
    let expected = golden.edges(&format!("{prefix}_edge_index"));
    assert_eq!(edges, expected.into_iter().collect(), "{prefix}_edge_index");
}

fn assert_graphres(name: &str, golden: &Golden, trace: &Trace) {
    let [events, pooled] = &trace.levels[..] else { panic!("{name} has two levels") };
    assert_eq!(rows_of(events), sources(golden, events.edges.rows()), "{name}: edge_index");
    let attributes: Vec<f32> =
        (0..events.edges.rows()).flat_map(|row| events.edges.row(row)).flat_map(|n| n.u).collect();
    assert_close(&format!("{name}: edge_attr"), &attributes, golden.floats("edge_attr"), LAYER);
    for n in 1..=5 {
        let what = format!("{name}: conv{n}");
        assert_close(&what, &flat(&events.features[n]), golden.floats(&format!("conv{n}")), LAYER);
    }
    let columns =
        if name.contains("fixed") { 22 } else { pooled.cells.iter().map(|c| c[0]).max().unwrap_or(0) + 1 };
    assert_pooled(pooled, golden, "pool", columns);
    for n in 6..=7 {
        let what = format!("{name}: conv{n}");
        assert_close(&what, &flat(&pooled.features[n - 5]), golden.floats(&format!("conv{n}")), LAYER);
    }
    assert_close(&format!("{name}: readout"), &flat(&trace.readout), golden.floats("readout"), LAYER);
    assert_close(&format!("{name}: y"), &trace.prediction, golden.floats("y"), PREDICTION);
}

/// Grows the graph one event at a time and asserts that neighbourhoods and prediction are the reference's.
fn assert_incremental(name: &str, golden: &Golden, network: &Arc<Network>, batch: &Trace) {
    let mut engine = Engine::new(Arc::clone(network), SENSOR).expect("the network is exact");
    for event in events(golden) {
        engine.push(event);
    }
    for (index, expected) in sources(golden, engine.nodes()).iter().enumerate() {
        let got: Vec<u32> = engine.neighbourhood(index).iter().map(|n| n.row).collect();
        assert_eq!(&got, expected, "{name}: neighbourhood of event {index}");
    }
    let got = engine.predict().expect("finite").values.to_vec();
    assert_eq!(bits(&got), bits(&batch.prediction), "{name}: incremental and batch");
    assert_close(&format!("{name}: incremental y"), &got, golden.floats("y"), PREDICTION);
}

fn forward(network: &Arc<Network>, events: &[Event], search: Search) -> Trace {
    forward_on(SENSOR, network, events, search)
}

fn forward_on(sensor: Sensor, network: &Arc<Network>, events: &[Event], search: Search) -> Trace {
    let batch = Batch::new(Arc::clone(network), sensor).expect("the sensor has pixels").with_search(search);
    batch.forward(Stream::new(events)).expect("finite")
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn graphres_with_fixed_scales_agrees_with_the_reference() {
    let weights = published();
    let network = network("graphres", &weights);
    for window in ["a", "idle", "late"] {
        let name = format!("graphres_fixed_{window}");
        let golden = Golden::load(&name);
        for search in [Search::Exhaustive, Search::Grid] {
            let trace = forward(&network, &events(&golden), search);
            assert_graphres(&name, &golden, &trace);
            assert_incremental(&name, &golden, &network, &trace);
        }
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn graphres_as_published_agrees_with_the_reference() {
    let weights = published();
    let network = network("graphres-published", &weights);
    for window in ["a", "idle", "late"] {
        let name = format!("graphres_published_{window}");
        let golden = Golden::load(&name);
        assert_graphres(&name, &golden, &forward(&network, &events(&golden), Search::Grid));
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn graphres_as_published_agrees_with_the_reference_where_float32_moves_events_to_other_cells() {
    let weights = published();
    let network = network("graphres-published", &weights);
    for window in ["a", "b", "c"] {
        let name = format!("graphres_published_offgrid_{window}");
        let golden = Golden::load(&name);
        for search in [Search::Exhaustive, Search::Grid] {
            let trace = forward_on(Sensor::new(346, 260), &network, &events(&golden), search);
            assert_graphres(&name, &golden, &trace);
        }
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn tactigraph_agrees_with_the_reference() {
    let path = shared("golden/tactigraph.safetensors");
    let golden = Golden::load("tactigraph");
    let network = network("tactigraph", &Weights::load(&path).expect("readable weights"));
    let trace = forward(&network, &events(&golden), Search::Exhaustive);
    let [level0, level1, level2] = &trace.levels[..] else { panic!("tactigraph has three levels") };
    assert_eq!(rows_of(level0), sources(&golden, level0.edges.rows()), "edge_index");
    assert_close("level0", &flat(&level0.features[4]), golden.floats("level0"), LAYER);
    assert_pooled(level1, &golden, "pool1", 44);
    assert_close("level1", &flat(&level1.features[3]), golden.floats("level1"), LAYER);
    assert_pooled(level2, &golden, "pool2", 22);
    assert_close("level2", &flat(&level2.features[3]), golden.floats("level2"), LAYER);
    assert_close("readout", &flat(&trace.readout), golden.floats("readout"), LAYER);
    assert_close("y", &trace.prediction, golden.floats("y"), PREDICTION);
    assert_incremental("tactigraph", &golden, &network, &trace);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn pointnet_agrees_with_the_reference() {
    let golden = Golden::load("pointnet");
    let weights = Weights::load(shared("golden/pointnet.safetensors")).expect("readable weights");
    let description = Description::parse(POINTNET).expect("consistent");
    let network = Arc::new(description.network_ignoring_preparation(&weights).expect("the weights fit"));
    for search in [Search::Exhaustive, Search::Grid] {
        let trace = forward(&network, &events(&golden), search);
        let [level0, level1] = &trace.levels[..] else { panic!("pointnet has two levels") };
        assert_eq!(rows_of(level0), sources(&golden, level0.edges.rows()), "edge_index");
        for n in 1..=3 {
            assert_close(
                &format!("conv{n}"),
                &flat(&level0.features[n]),
                golden.floats(&format!("conv{n}")),
                LAYER,
            );
        }
        assert_pooled(level1, &golden, "pool", 22);
        assert_close("conv4", &flat(&level1.features[1]), golden.floats("conv4"), LAYER);
        assert_close("readout", &flat(&trace.readout), golden.floats("readout"), LAYER);
        assert_close("y", &trace.prediction, golden.floats("y"), PREDICTION);
        assert_incremental("pointnet", &golden, &network, &trace);
    }
}

#[test]
fn a_network_that_is_normalised_per_graph_has_no_incremental_form() {
    let weights = Weights::shipped("graphres-published").expect("shipped weights");
    let error = Engine::new(network("graphres-published", &weights), SENSOR).expect_err("batch only");
    assert!(error.to_string().contains("one event can change every row"), "{error}");
}
