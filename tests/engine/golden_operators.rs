//! Kernels and pooling against `PyTorch` Geometric's, through the golden files.

use std::collections::BTreeSet;

use meissner_engine::{Cells, Edges};
use meissner_kernels::{GraphRow, Isa, Matrix, Neighbour, SplineConv, SplineParts, SplineScratch};
use meissner_tests::shared::{Golden, assert_close};

/// In-edges of each of `rows` rows, in the order of an edge list; `attribute` gives those of an edge.
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
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn spline_convolution_agrees_with_the_reference() {
    let kernels = [[2, 2, 2], [2, 2, 2], [5, 5, 1], [2, 3, 4], [8, 8, 8]];
    for (n, kernel) in kernels.into_iter().enumerate() {
        let golden = Golden::load(&format!("spline_conv_{n}"));
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
            assert_close(&format!("spline_conv_{n} on {}", isa.name()), &got, golden.floats("y"), 1e-5);
        }
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn pooling_agrees_with_the_reference() {
    let golden = Golden::load("voxel_pool");
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
