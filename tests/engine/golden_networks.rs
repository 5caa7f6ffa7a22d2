//! Kernels, pooling and whole networks against `PyTorch` Geometric, layer by layer: batch,
//! incremental, and the f64 reference.

use std::collections::BTreeSet;
use std::sync::Arc;

use meissner_engine::{
    Batch, Cells, Edges, Engine, Event, LevelTrace, Network, Search, Sensor, Stream, Trace,
};
use meissner_kernels::{GraphRow, Isa, Matrix, Neighbour, SplineConv, SplineParts, SplineScratch};
use meissner_models::{Description, Weights};
use meissner_reference::{Difference, EventReference, EventTrace, Rows};
use meissner_tests::shared::{Golden, POINTNET, assert_close, shared};
use meissner_verify::bits;

const SENSOR: Sensor = Sensor { width: 240, height: 180 };
const LAYER: f32 = 1e-5;
const PREDICTION: f32 = 1e-4;
const GRAPHRES: [&str; 4] =
    ["graphres_small", "graphres_fixed_a", "graphres_fixed_idle", "graphres_fixed_late"];
const TACTIGRAPH: [&str; 2] = ["tactigraph_small", "tactigraph"];
const NETS_OF_POINTS: [&str; 2] = ["pointnet_small", "pointnet"];

fn events(golden: &Golden) -> Vec<Event> {
    let rows = golden.integers("events").chunks_exact(4);
    rows.map(|e| Event::new(e[0], e[1] as u16, e[2] as u16, e[3] == 1)).collect()
}

/// A shipped network with the weights of a golden file: the shipped ones, or those of ../shared.
fn network(name: &str, golden: &str) -> Arc<Network> {
    let weights = match name {
        _ if Golden::is_small(golden) => Weights::shipped(name).expect("shipped weights"),
        "tactigraph" => Weights::load(Golden::path(golden)).expect("readable weights"),
        _ => published(),
    };
    let text = Description::shipped_text(name).expect("a shipped network");
    let mut text = text.to_owned();
    if golden == "tactigraph" {
        // One dense layer behind the readout.
        let (begin, end) = (text.find("[[layer]]\nname = \"hidden\""), text.find("[[layer]]\nname = \"fc\""));
        text.replace_range(begin.expect("its hidden layer")..end.expect("its last layer"), "");
    }
    let description = Description::parse(&text).expect("consistent");
    Arc::new(description.network_ignoring_preparation(&weights).expect("the weights fit"))
}

fn pointnet(golden: &str) -> Arc<Network> {
    let weights = Weights::load(Golden::path(golden)).expect("readable weights");
    let description = Description::parse(POINTNET).expect("consistent");
    Arc::new(description.network_ignoring_preparation(&weights).expect("the weights fit"))
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

/// Compares a pooled level; `columns` is the row length of the reference's cell numbers.
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
    let widest = pooled.cells.iter().map(|c| c[0]).max().unwrap_or(0) + 1;
    let columns = if name.contains("published") { widest } else { 22 };
    assert_pooled(pooled, golden, "pool", columns);
    for n in 6..=7 {
        let what = format!("{name}: conv{n}");
        assert_close(&what, &flat(&pooled.features[n - 5]), golden.floats(&format!("conv{n}")), LAYER);
    }
    assert_close(&format!("{name}: readout"), &flat(&trace.readout), golden.floats("readout"), LAYER);
    assert_close(&format!("{name}: y"), &trace.prediction, golden.floats("y"), PREDICTION);
}

/// Grows the graph event by event: neighbourhoods and prediction are the reference's.
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
fn graphres_with_fixed_scales_agrees_with_the_reference() {
    for (name, golden) in Golden::at_hand(&GRAPHRES) {
        let network = network("graphres", name);
        for search in [Search::Exhaustive, Search::Grid] {
            let trace = forward(&network, &events(&golden), search);
            assert_graphres(name, &golden, &trace);
            assert_incremental(name, &golden, &network, &trace);
        }
    }
}

#[test]
fn graphres_as_published_agrees_with_the_reference() {
    let names = [
        "graphres_published_small",
        "graphres_published_a",
        "graphres_published_idle",
        "graphres_published_late",
    ];
    for (name, golden) in Golden::at_hand(&names) {
        let network = network("graphres-published", name);
        assert_graphres(name, &golden, &forward(&network, &events(&golden), Search::Grid));
    }
}

#[test]
fn graphres_as_published_agrees_with_the_reference_where_float32_moves_events_to_other_cells() {
    let names = ["small", "a", "b", "c"].map(|window| format!("graphres_published_offgrid_{window}"));
    for (name, golden) in Golden::at_hand(&names.each_ref().map(String::as_str)) {
        let network = network("graphres-published", name);
        for search in [Search::Exhaustive, Search::Grid] {
            let trace = forward_on(Sensor::new(346, 260), &network, &events(&golden), search);
            assert_graphres(name, &golden, &trace);
        }
    }
}

#[test]
fn tactigraph_agrees_with_the_reference() {
    for (name, golden) in Golden::at_hand(&TACTIGRAPH) {
        let network = network("tactigraph", name);
        let trace = forward(&network, &events(&golden), Search::Exhaustive);
        let [level0, level1, level2] = &trace.levels[..] else { panic!("tactigraph has three levels") };
        assert_eq!(rows_of(level0), sources(&golden, level0.edges.rows()), "{name}: edge_index");
        assert_close("level0", &flat(&level0.features[4]), golden.floats("level0"), LAYER);
        assert_pooled(level1, &golden, "pool1", 44);
        assert_close("level1", &flat(&level1.features[3]), golden.floats("level1"), LAYER);
        assert_pooled(level2, &golden, "pool2", 22);
        assert_close("level2", &flat(&level2.features[3]), golden.floats("level2"), LAYER);
        assert_close("readout", &flat(&trace.readout), golden.floats("readout"), LAYER);
        assert_close("y", &trace.prediction, golden.floats("y"), PREDICTION);
        assert_incremental(name, &golden, &network, &trace);
    }
}

#[test]
fn pointnet_agrees_with_the_reference() {
    for (name, golden) in Golden::at_hand(&NETS_OF_POINTS) {
        let network = pointnet(name);
        for search in [Search::Exhaustive, Search::Grid] {
            let trace = forward(&network, &events(&golden), search);
            let [level0, level1] = &trace.levels[..] else { panic!("pointnet has two levels") };
            assert_eq!(rows_of(level0), sources(&golden, level0.edges.rows()), "{name}: edge_index");
            for n in 1..=3 {
                let what = format!("conv{n}");
                assert_close(&what, &flat(&level0.features[n]), golden.floats(&what), LAYER);
            }
            assert_pooled(level1, &golden, "pool", 22);
            assert_close("conv4", &flat(&level1.features[1]), golden.floats("conv4"), LAYER);
            assert_close("readout", &flat(&trace.readout), golden.floats("readout"), LAYER);
            assert_close("y", &trace.prediction, golden.floats("y"), PREDICTION);
            assert_incremental(name, &golden, &network, &trace);
        }
    }
}

#[test]
fn a_network_that_is_normalised_per_graph_has_no_incremental_form() {
    let network = network("graphres-published", "graphres_published_small");
    let error = Engine::new(network, SENSOR).expect_err("batch only");
    assert!(error.to_string().contains("one event can change every row"), "{error}");
}

/// In-edges of each row, in the order of an edge list; `attribute` gives those of an edge.
fn in_edges(edges: &[(usize, usize)], rows: usize, attribute: impl Fn(usize) -> [f32; 3]) -> Edges {
    let mut lists = vec![Vec::new(); rows];
    for (e, &(source, reader)) in edges.iter().enumerate() {
        lists[reader].push(Neighbour { row: source as u32, u: attribute(e) });
    }
    let mut out = Edges::default();
    lists.into_iter().for_each(|list| out.push(list));
    out
}

#[test]
fn spline_convolution_agrees_with_the_reference() {
    let kernels = [
        ("spline_conv_0_small", [2, 2, 2]),
        ("spline_conv_1_small", [2, 2, 2]),
        ("spline_conv_2_small", [5, 5, 1]),
        ("spline_conv_3_small", [2, 3, 4]),
        ("spline_conv_0", [2, 2, 2]),
        ("spline_conv_1", [2, 2, 2]),
        ("spline_conv_2", [5, 5, 1]),
        ("spline_conv_3", [2, 3, 4]),
        ("spline_conv_4", [8, 8, 8]),
    ];
    let at_hand = Golden::at_hand(&kernels.map(|(name, _)| name));
    for ((name, golden), (_, kernel)) in at_hand.into_iter().zip(kernels) {
        let dims = golden.shape("edge_attr")[1];
        let attributes = golden.floats("edge_attr");
        let attribute = |e: usize| {
            let mut u = [0.5; 3];
            u[..dims].copy_from_slice(&attributes[e * dims..][..dims]);
            u
        };
        let (inputs, outputs) = (golden.shape("x")[1], golden.shape("y")[1]);
        let conv = SplineConv::new(&SplineParts {
            inputs,
            outputs,
            kernel,
            weight: golden.floats("weight").to_vec(),
            root: golden.find("root").map(|(_, values)| values.to_vec()),
            bias: golden.find("bias").map(|(_, values)| values.to_vec()),
            norm: None,
            elu: false,
        })
        .expect("the golden shapes fit");
        let features = Matrix::from_rows(inputs, golden.floats("x"));
        let edges = in_edges(&golden.edges("edge_index"), features.rows(), attribute);
        let mut scratch = SplineScratch::default();
        for isa in Isa::available() {
            let mut out = Matrix::zeros(features.rows(), outputs);
            let row = |i| GraphRow { neighbours: edges.row(i), own: features.row(i), ..GraphRow::default() };
            let rows: Vec<_> = (0..features.rows()).map(row).collect();
            conv.rows(isa, &features, &rows, &mut scratch, out.lanes_mut());
            let got: Vec<f32> = (0..out.rows()).flat_map(|row| out.values(row).collect::<Vec<_>>()).collect();
            assert_close(&format!("{name} on {}", isa.name()), &got, golden.floats("y"), 1e-5);
        }
    }
}

#[test]
fn pooling_agrees_with_the_reference() {
    Golden::at_hand(&["voxel_pool_small", "voxel_pool"]).iter().for_each(|(_, golden)| assert_pools(golden));
}

fn assert_pools(golden: &Golden) {
    let positions: Vec<&[f32]> = golden.floats("pos").chunks_exact(3).collect();
    // The reference's grid of 1/8 x 1/6 cells has 8 columns.
    let index = |p: &[f32]| [(p[0] * 8.0) as i64, (p[1] * 6.0) as i64];
    let keys: Vec<[i64; 3]> = positions.iter().map(|p| [0, index(p)[1], index(p)[0]]).collect();
    let features = Matrix::from_rows(12, golden.floats("x"));
    let edges = in_edges(&golden.edges("edge_index"), features.rows(), |_| [0.5; 3]);
    let cells = Cells::new(&keys, 0, &features, &edges);
    let numbers: Vec<i64> = cells.keys.iter().map(|[_, y, x]| y * 8 + x).collect();
    assert_eq!(numbers, golden.integers("cell"));
    let maxima: Vec<f32> =
        (0..cells.maxima.rows()).flat_map(|i| cells.maxima.values(i).collect::<Vec<_>>()).collect();
    assert_eq!(maxima, golden.floats("pool_x"));
    let positions: Vec<[f64; 3]> = positions.iter().map(|p| [p[0], p[1], p[2]].map(f64::from)).collect();
    let means: Vec<f32> = cells.mean_positions(&positions).iter().flatten().map(|&p| p as f32).collect();
    assert_close("pool_pos", &means, golden.floats("pool_pos"), 1e-6);
    let merged: BTreeSet<(usize, usize)> = cells
        .sources
        .iter()
        .enumerate()
        .flat_map(|(to, from)| from.iter().map(move |&from| (from, to)))
        .collect();
    assert_eq!(merged, golden.edges("pool_edge_index").into_iter().collect());
}

/// Largest difference, as a share of the reference's largest magnitude, in f64.
pub(crate) const WIDE: f64 = 1e-5;

/// Asserts that the golden values are within a share of the largest magnitude of the reference's.
pub(crate) fn assert_wide(what: &str, golden: &[f32], reference: &[f64], share: f64) {
    let mut difference = Difference::default();
    difference.add_all(golden, reference);
    assert!(difference.relative() <= share, "{what}: relative error {:e}", difference.relative());
}

fn assert_rows(what: &str, golden: &Golden, name: &str, rows: &Rows) {
    assert_wide(what, golden.floats(name), &rows.concat(), WIDE);
}

fn wide_trace(golden: &Golden, network: Arc<Network>) -> EventTrace {
    EventReference::new(network, SENSOR, None).expect("fixed scales").forward(Stream::new(&events(golden)))
}

#[test]
fn graphres_in_f64_agrees_with_the_golden_files() {
    for (name, golden) in Golden::at_hand(&GRAPHRES) {
        let trace = wide_trace(&golden, network("graphres", name));
        let [events, pooled] = &trace.levels[..] else { panic!("{name} has two levels") };
        for n in 1..=7 {
            let rows = if n <= 5 { &events.features[n] } else { &pooled.features[n - 5] };
            assert_rows(&format!("{name}: conv{n}"), &golden, &format!("conv{n}"), rows);
        }
        assert_rows(&format!("{name}: pool"), &golden, "pool_x", &pooled.features[0]);
        assert_rows(&format!("{name}: readout"), &golden, "readout", &trace.readout);
        assert_wide(&format!("{name}: y"), golden.floats("y"), &trace.prediction, WIDE);
    }
}

#[test]
fn tactigraph_in_f64_agrees_with_the_golden_file() {
    for (name, golden) in Golden::at_hand(&TACTIGRAPH) {
        let trace = wide_trace(&golden, network("tactigraph", name));
        for (l, (level, feature)) in trace.levels.iter().zip([4, 3, 3]).enumerate() {
            assert_rows(&format!("level{l}"), &golden, &format!("level{l}"), &level.features[feature]);
        }
        assert_wide(name, golden.floats("y"), &trace.prediction, WIDE);
    }
}

#[test]
fn pointnet_in_f64_agrees_with_the_golden_file() {
    for (name, golden) in Golden::at_hand(&NETS_OF_POINTS) {
        let trace = wide_trace(&golden, pointnet(name));
        for (n, rows) in trace.levels[0].features.iter().enumerate().skip(1) {
            assert_rows(&format!("conv{n}"), &golden, &format!("conv{n}"), rows);
        }
        assert_rows("conv4", &golden, "conv4", &trace.levels[1].features[1]);
        assert_wide(name, golden.floats("y"), &trace.prediction, WIDE);
    }
}
