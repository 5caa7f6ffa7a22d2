//! What the fingerprint of a network covers.

use meissner_engine::{
    Candidates, Fraction, GraphConvolution, Lifetime, Network, NetworkParts, Normalisation, Position, Reach,
};
use meissner_kernels::{PointNetConv, PointNetParts, SplineConv, SplineParts};
use meissner_verify::Random;

use crate::snapshots_refused::shape;

#[test]
fn whatever_changes_predictions_changes_the_fingerprint() {
    let flip = |values: &mut Vec<f32>| values[3] = f32::from_bits(values[3].to_bits() ^ 1);
    let spline = |change: &dyn Fn(&mut SplineParts)| {
        let values = |count, seed| Random::new(seed).values(count, 1.0);
        let mut parts = SplineParts {
            inputs: 1,
            outputs: 4,
            kernel: [2, 2, 2],
            weight: values(32, 1),
            root: Some(values(4, 2)),
            bias: Some(values(4, 3)),
            norm: Some((values(4, 4), values(4, 5))),
            elu: true,
        };
        change(&mut parts);
        GraphConvolution::from(SplineConv::new(&parts).expect("sizes fit"))
    };
    let fingerprint = |change: &dyn Fn(&mut NetworkParts), conv: GraphConvolution| {
        let mut parts = shape(Candidates::All).build().parts().clone();
        parts.events.blocks[0].conv = conv;
        change(&mut parts);
        Network::new(parts).expect("the parts fit").fingerprint()
    };
    let parameters: [&dyn Fn(&mut SplineParts); 8] = [
        &|_| {},
        &|parts| flip(&mut parts.weight),
        &|parts| parts.root.iter_mut().for_each(flip),
        &|parts| parts.root = None,
        &|parts| parts.bias.iter_mut().for_each(flip),
        &|parts| parts.norm.iter_mut().for_each(|(scale, _)| flip(scale)),
        &|parts| parts.norm.iter_mut().for_each(|(_, shift)| flip(shift)),
        &|parts| parts.elu = false,
    ];
    let structure: [&dyn Fn(&mut NetworkParts); 17] = [
        &|parts| parts.name.push('2'),
        &|parts| parts.span_us += 1,
        &|parts| parts.capacity += 1,
        &|parts| parts.graph.reach = Reach::Knn { k: 5 },
        &|parts| parts.graph.reach = Reach::Radius { r: 0.5, max: 4 },
        &|parts| parts.graph.reach = Reach::Radius { r: 0.6, max: 4 },
        &|parts| parts.graph.candidates = Candidates::Past(Lifetime::Window),
        &|parts| parts.graph.candidates = Candidates::Past(Lifetime::Frozen),
        &|parts| parts.events.scale *= 2.0,
        &|parts| parts.events.blocks[0].name.push('2'),
        &|parts| parts.pooled[0].0.cell = [Fraction::new(1, 5).expect("positive"); 2],
        &|parts| parts.pooled[0].0.time = None,
        &|parts| parts.pooled[0].0.position = Position::Centre,
        &|parts| parts.pooled[0].1.scale *= 2.0,
        &|parts| (parts.readout.columns, parts.readout.rows) = (4, 1),
        &|parts| (parts.readout.columns, parts.readout.rows) = (1, 4),
        &|parts| parts.normalisation = Normalisation::PerGraph,
    ];
    let pointnet = |change: &dyn Fn(&mut PointNetParts)| {
        let values = |count, seed| Random::new(seed).values(count, 1.0);
        let (weight, bias, norm) = (values(16, 1), values(4, 3), Some((values(4, 4), values(4, 5))));
        let mut parts = PointNetParts { inputs: 1, outputs: 4, weight, bias, norm };
        change(&mut parts);
        GraphConvolution::from(PointNetConv::new(&parts).expect("sizes fit"))
    };
    let of_pointnet: [&dyn Fn(&mut PointNetParts); 5] = [
        &|_| {},
        &|parts| flip(&mut parts.weight),
        &|parts| flip(&mut parts.bias),
        &|parts| parts.norm.iter_mut().for_each(|(scale, _)| flip(scale)),
        &|parts| parts.norm.iter_mut().for_each(|(_, shift)| flip(shift)),
    ];
    let mut all: Vec<u64> = parameters.map(|change| fingerprint(&|_| {}, spline(change))).to_vec();
    all.extend(structure.map(|change| fingerprint(change, spline(&|_| {}))));
    all.extend(of_pointnet.map(|change| fingerprint(&|_| {}, pointnet(change))));
    let again = fingerprint(&|_| {}, spline(&|_| {}));
    assert_eq!(all[0], again, "equal networks have equal ones");
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), count, "all are different");
}
