//! Fingerprint of a network over events: a hash of all that predictions depend on, and of names.

use super::parts::{
    Aggregation, Block, Candidates, DenseLayer, Level, Lifetime, NetworkParts, Normalisation, Pooling,
    Position, Reach, Readout,
};
use crate::Fraction;
use crate::fingerprint::{Fingerprint, activation_code};

/// The fingerprint of checked parts. O(parameters).
pub(super) fn of(parts: &NetworkParts) -> u64 {
    let mut to = Fingerprint::new();
    to.text(&parts.name);
    to.word(parts.span_us as u64);
    to.size(parts.capacity);
    match parts.graph.reach {
        Reach::Knn { k } => [0, k as u64, 0],
        Reach::Radius { r, max } => [1, max as u64, r.to_bits()],
    }
    .into_iter()
    .for_each(|word| to.word(word));
    to.word(match parts.graph.candidates {
        Candidates::All => 0,
        Candidates::Past(Lifetime::Window) => 1,
        Candidates::Past(Lifetime::Frozen) => 2,
    });
    to.word(match parts.normalisation {
        Normalisation::Fixed => 0,
        Normalisation::PerGraph => 1,
    });
    level(&mut to, &parts.events);
    to.size(parts.pooled.len());
    for (above, blocks) in &parts.pooled {
        pooling(&mut to, above);
        level(&mut to, blocks);
    }
    let Readout { from, columns, rows, aggregation, by_time } = parts.readout;
    to.sizes([from, columns, rows, by_time.into()]);
    if aggregation == Aggregation::Sum {
        to.text("sum");
    }
    to.size(parts.dense.len());
    for DenseLayer { name, dense } in &parts.dense {
        to.text(name);
        to.sizes([dense.inputs(), dense.channels(), activation_code(dense.activation())]);
        to.values(&dense.weight());
        to.values(dense.bias());
    }
    to.word(parts.head.is_some().into());
    if let Some(head) = &parts.head {
        to.word(head.fingerprint());
    }
    if let Some(cell) = parts.place {
        cell.into_iter().for_each(|size| to.word(fraction(size)));
    }
    to.finish()
}

fn fraction(size: Fraction) -> u64 {
    u64::from(size.numerator()) << 32 | u64::from(size.denominator())
}

fn level(to: &mut Fingerprint, level: &Level) {
    to.word(level.scale.to_bits().into());
    to.size(level.blocks.len());
    for Block { name, input, skip, conv } in &level.blocks {
        to.text(name);
        to.size(*input);
        to.size(skip.map_or(0, |skip| skip + 1));
        conv.fingerprint(to);
    }
}

fn pooling(to: &mut Fingerprint, pooling: &Pooling) {
    to.text(&pooling.name);
    to.size(pooling.from);
    let [x, y] = pooling.cell;
    for size in [Some(x), Some(y), pooling.time] {
        to.word(size.map_or(0, fraction));
    }
    to.word(match pooling.position {
        Position::Mean => 0,
        Position::Centre => 1,
    });
}
