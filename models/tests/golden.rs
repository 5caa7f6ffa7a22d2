//! The shipped descriptions compute what the reference networks do: layer by layer over recorded graphs, with the
//! kernels called directly. Neither the engine's graph nor its poolings take part.

mod support;

use std::path::Path;

use meissner_engine::{Level, Network};
use meissner_kernels::{Isa, Matrix, Neighbour, SplineRow, SplineScratch};
use meissner_models::{Description, Weights};
use safetensors::SafeTensors;
use support::shared;

/// A recorded file.
struct Golden(Vec<u8>);

impl Golden {
    fn open(path: &Path) -> Self {
        Self(std::fs::read(path).expect("readable"))
    }

    fn data(&self, name: &str) -> Vec<u8> {
        let file = SafeTensors::deserialize(&self.0).expect("a safetensors file");
        file.tensor(name).expect("a recorded tensor").data().to_vec()
    }

    fn floats(&self, name: &str) -> Vec<f32> {
        self.data(name).chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four"))).collect()
    }

    fn integers(&self, name: &str) -> Vec<i64> {
        self.data(name).chunks_exact(8).map(|b| i64::from_le_bytes(b.try_into().expect("eight"))).collect()
    }

    /// In-edges of each node.
    fn edges(&self, name: &str, nodes: usize) -> Vec<Vec<usize>> {
        let index = self.integers(name);
        let (sources, targets) = index.split_at(index.len() / 2);
        let mut edges = vec![Vec::new(); nodes];
        for (&source, &target) in sources.iter().zip(targets) {
            edges[target as usize].push(source as usize);
        }
        edges
    }

    #[track_caller]
    fn compare(&self, name: &str, found: &Matrix, tolerance: f32) {
        let expected = self.floats(name);
        let found: Vec<f32> = (0..found.rows()).flat_map(|i| found.values(i).collect::<Vec<_>>()).collect();
        compare(name, &expected, &found, tolerance);
    }
}

/// The largest difference is at most `tolerance` of the largest value.
#[track_caller]
fn compare(name: &str, expected: &[f32], found: &[f32], tolerance: f32) {
    assert_eq!(expected.len(), found.len(), "{name}");
    let largest = expected.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    let error = expected.iter().zip(found).fold(0.0_f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(error <= tolerance * largest, "{name}: error {error} of {largest}");
    println!("{name}: relative error {:.1e}", error / largest);
}

/// Every feature of a level.
fn level(level: &Level, input: Matrix, positions: &[[f32; 3]], edges: &[Vec<usize>]) -> Vec<Matrix> {
    let neighbours = |i: usize| -> Vec<Neighbour> {
        let attribute = |j: usize, d: usize| {
            let difference = positions[j][d] - positions[i][d];
            (difference / (2.0 * level.scale) + 0.5).clamp(0.0, 1.0)
        };
        edges[i].iter().map(|&j| Neighbour { row: j as u32, u: [0, 1, 2].map(|d| attribute(j, d)) }).collect()
    };
    let mut features = vec![input];
    let mut scratch = SplineScratch::default();
    for block in &level.blocks {
        let input = &features[block.input];
        let mut out = Matrix::zeros(input.rows(), block.conv.outputs());
        for i in 0..input.rows() {
            let row = SplineRow {
                neighbours: &neighbours(i),
                features: input,
                own: input.row(i),
                skip: block.skip.map(|skip| features[skip].row(i)),
                scratch: &mut scratch,
                out: out.row_mut(i),
            };
            block.conv.row(Isa::best(), row);
        }
        features.push(out);
    }
    features
}

/// Channel-wise maxima over the rows of each group; zeros for an empty group.
fn maxima(features: &Matrix, groups: &[Vec<usize>]) -> Matrix {
    let columns = features.columns();
    let row = |group: &Vec<usize>| -> Vec<f32> {
        let maximum = |c: usize| {
            group.iter().filter_map(|&i| features.values(i).nth(c)).fold(f32::NEG_INFINITY, f32::max)
        };
        (0..columns).map(|c| if group.is_empty() { 0.0 } else { maximum(c) }).collect()
    };
    Matrix::from_rows(columns, &groups.iter().flat_map(row).collect::<Vec<_>>())
}

/// Members of the cells of `size`, in f32 as the reference has it; cells in the order of rows.
fn cells(positions: &[[f32; 3]], size: [f64; 2]) -> Vec<Vec<usize>> {
    let mut members = std::collections::BTreeMap::<[i64; 2], Vec<usize>>::new();
    for (i, p) in positions.iter().enumerate() {
        let cell = [1, 0].map(|d| (p[d] / size[d] as f32).floor() as i64);
        members.entry(cell).or_default().push(i);
    }
    members.into_values().collect()
}

fn positions(values: &[f32]) -> Vec<[f32; 3]> {
    values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
}

/// Runs `network` over a recorded graph. `pooled`: prefix of each pooled level's recorded positions and edges.
fn run(network: &Network, golden: &Golden, pooled: &[&str]) -> (Vec<Vec<Matrix>>, Vec<f32>) {
    let events = golden.integers("events");
    let events: Vec<&[i64]> = events.chunks_exact(4).collect();
    let share = |e: &[i64], d: usize| match d {
        0 => e[1] as f64 / 240.0,
        1 => e[2] as f64 / 180.0,
        _ => (e[0] - events[0][0]) as f64 / 150_000.0,
    };
    let mut at: Vec<[f32; 3]> = events.iter().map(|e| [0, 1, 2].map(|d| share(e, d) as f32)).collect();
    let polarity: Vec<f32> = events.iter().map(|e| (2 * e[3] - 1) as f32).collect();
    let input = Matrix::from_rows(1, &polarity);
    let mut levels = vec![level(network.level(0), input, &at, &golden.edges("edge_index", events.len()))];
    for ((pooling, next), prefix) in network.parts().pooled.iter().zip(pooled) {
        let size = pooling.cell.map(|c| f64::from(c.numerator()) / f64::from(c.denominator()));
        let groups = cells(&at, size);
        let input = maxima(&levels[levels.len() - 1][pooling.from], &groups);
        golden.compare(&format!("{prefix}_x"), &input, 1e-5);
        at = positions(&golden.floats(&format!("{prefix}_pos")));
        let edges = golden.edges(&format!("{prefix}_edge_index"), at.len());
        levels.push(level(next, input, &at, &edges));
    }
    let readout = network.parts().readout;
    let mut groups = vec![Vec::new(); readout.columns * readout.rows];
    for (i, p) in at.iter().enumerate() {
        let [x, y] = [(0, readout.columns), (1, readout.rows)]
            .map(|(d, n)| ((p[d] * n as f32).floor() as usize).min(n - 1));
        groups[y * readout.columns + x].push(i);
    }
    let mut values = maxima(&levels[levels.len() - 1][readout.from], &groups);
    compare("readout", &golden.floats("readout"), &flat(&values), 1e-5);
    for layer in &network.parts().dense {
        let mut out = Matrix::zeros(1, layer.dense.outputs());
        layer.dense.run(Isa::best(), values.lanes(), out.row_mut(0));
        values = out;
    }
    (levels, flat(&values))
}

fn flat(values: &Matrix) -> Vec<f32> {
    (0..values.rows()).flat_map(|i| values.values(i).collect::<Vec<_>>()).collect()
}

#[test]
fn graphres_with_the_published_weights_meets_every_recorded_layer() {
    let Some(weights) = shared("data/checkpoints/contact_angle_graphres.safetensors") else { return };
    let description = Description::shipped("graphres").expect("shipped");
    let network = description.network(&Weights::load(weights).expect("readable")).expect("its weights");
    for window in ["a", "late", "idle"] {
        let Some(path) = shared(&format!("golden/graphres_fixed_{window}.safetensors")) else { return };
        let golden = Golden::open(&path);
        let (levels, y) = run(&network, &golden, &["pool"]);
        for (i, features) in levels[0][1..].iter().chain(&levels[1][1..]).enumerate() {
            golden.compare(&format!("conv{}", i + 1), features, 1e-5);
        }
        compare("y", &golden.floats("y"), &y, 1e-4);
    }
}

#[test]
fn tactigraph_meets_every_recorded_level() {
    let Some(path) = shared("golden/tactigraph.safetensors") else { return };
    let golden = Golden::open(&path);
    let description = Description::shipped("tactigraph").expect("shipped");
    let network = description.network(&Weights::load(path).expect("readable")).expect("its weights");
    let (levels, y) = run(&network, &golden, &["pool1", "pool2"]);
    for (i, features) in levels.iter().enumerate() {
        golden.compare(&format!("level{i}"), &features[features.len() - 1], 1e-5);
    }
    compare("y", &golden.floats("y"), &y, 1e-4);
}
