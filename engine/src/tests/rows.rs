//! Rows, their members, maxima, sums and edges against plain collections.

mod sets {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use crate::memory::Memory;
    use crate::rows::*;

    proptest! {
        #[test]
        fn a_row_set_holds_what_a_tree_set_holds(steps in proptest::collection::vec((0u8..3, 0u32..20), 0..200)) {
            let (mut rows, mut tree) = (RowSet::new(20), BTreeSet::new());
            let mut few = FewRows::new(20, &mut Memory::default());
            let (mut growing, mut grown) = (GrowingSet::new(20, &mut Memory::default()), BTreeSet::new());
            for (step, row) in steps {
                match step {
                    0 => { rows.insert(row); few.insert(row); tree.insert(row); }
                    1 => { rows.remove(row); few.remove(row); tree.remove(&row); }
                    _ if row == 0 => { rows.clear(); few.clear(); tree.clear(); }
                    _ => prop_assert_eq!(rows.contains(row), tree.contains(&row)),
                }
                prop_assert_eq!(rows.as_slice().iter().copied().collect::<BTreeSet<_>>(), tree.clone());
                prop_assert_eq!([rows.len(), few.len()], [tree.len(); 2]);
                if step == 2 && row == 0 {
                    growing.clear();
                    grown.clear();
                } else {
                    growing.insert(&[row]);
                    grown.insert(row);
                }
                prop_assert_eq!(growing.as_slice().len(), grown.len());
                prop_assert_eq!(growing.as_slice().iter().copied().collect::<BTreeSet<_>>(), grown.clone());
            }
        }
    }
}

mod members {
    use proptest::prelude::*;

    use crate::memory::Memory;
    use crate::rows::*;

    proptest! {
        #[test]
        fn linked_members_are_those_of_plain_lists(
            steps in proptest::collection::vec((0u8..50, 0u32..20, 0u32..3), 0..300),
        ) {
            let mut members = Members::new(20, 3, &mut Memory::default());
            let mut lists = vec![Vec::new(); 3];
            for (step, row, cell) in steps {
                if step == 0 {
                    members.clear();
                    lists.iter_mut().for_each(Vec::clear);
                } else if let Some(at) = lists.iter().position(|list| list.contains(&row)) {
                    prop_assert_eq!(members.cell_of(row), at as u32);
                    prop_assert_eq!(members.remove(row), at as u32);
                    lists[at].retain(|&r| r != row);
                } else {
                    members.push(row, cell);
                    lists[cell as usize].push(row);
                }
                for (cell, list) in (0..).zip(&lists) {
                    prop_assert_eq!(members.count(cell) as usize, list.len());
                    prop_assert!(list.is_empty() || members.oldest(cell) == list[0]);
                    prop_assert!(members.oldest_first(cell).eq(list.iter().copied()));
                    prop_assert!(members.youngest_first(cell).eq(list.iter().rev().copied()));
                    for count in 0..=list.len() {
                        let last = &list[list.len() - count..];
                        prop_assert!(members.youngest(cell, count as u32).eq(last.iter().copied()));
                    }
                }
            }
        }
    }
}

mod maxima {
    use meissner_kernels::{Isa, LANES, Matrix};

    use crate::counters::LayerLog;
    use crate::maxima::*;
    use crate::memory::Memory;
    use crate::rows::RowSet;

    fn row(values: &[f32]) -> Matrix {
        Matrix::from_rows(values.len(), values)
    }

    #[test]
    fn a_row_is_below_another_where_it_is_in_every_column_and_nothing_else_counts() {
        for columns in [1, LANES - 1, LANES, LANES + 1, 3 * LANES - 1] {
            let below = |a: &[f32], b: &[f32]| below(row(a).row(0), row(b).row(0), columns);
            let (low, high) = (vec![-2.0; columns], vec![-1.0; columns]);
            assert!(below(&low, &high) && !below(&high, &high), "{columns} columns");
            for reaching in [-1.0, f32::NAN] {
                let mut other = low.clone();
                other[columns - 1] = reaching;
                assert!(!below(&other, &high), "{reaching} in the last of {columns} columns");
            }
        }
    }

    #[test]
    fn a_maximum_of_negative_zeros_is_zero_however_it_is_taken() {
        for queues in [false, true] {
            let features = Matrix::from_rows(1, &[-0.0, -0.0, -1.0]);
            let changed = RowSet::new(3);
            let after = |steps: &[(u32, bool)]| {
                let (mut maxima, mut values) =
                    (Maxima::new(3, 1, 1, queues, &mut Memory::default()), Matrix::zeros(1, 1));
                for &(row, again) in steps {
                    maxima.enter(row, 0);
                    if again {
                        maxima.dirty.insert(0);
                    }
                    let mut log = LayerLog::default();
                    maxima.update(Isa::best(), &features, &changed, &mut values, &mut log, |_, _| {});
                }
                values.values(0).next().map(f32::to_bits)
            };
            assert_eq!(after(&[(0, false)]), Some(0), "taken from all members");
            assert_eq!(after(&[(2, false), (0, false)]), Some(0), "merged with a newcomer");
            assert_eq!(after(&[(2, false), (0, true)]), Some(0), "taken again");
        }
    }
}

mod sums {
    use meissner_kernels::{Isa, Lanes, Matrix, same_bits};
    use proptest::prelude::*;

    use crate::counters::LayerLog;
    use crate::memory::Memory;
    use crate::network::SUM_PARTS;
    use crate::rows::RowSet;
    use crate::sums::*;

    const ROWS: usize = 12;
    const CELLS: usize = 3;
    const PART_US: i64 = 3;
    const SPAN_US: i64 = SUM_PARTS * PART_US;

    proptest! {
        /// Features of very different sizes: a sum in another order has other bits.
        #[test]
        fn sums_are_those_of_plain_loops_over_parts_and_their_members_in_order_of_arrival(
            steps in proptest::collection::vec(
                (0u8..8, 0..ROWS as u32, 0..CELLS as u32, -1e8f32..1e8, any::<bool>(), 0..12i64),
                0..200,
            ),
        ) {
            let mut sums = Sums::new(PART_US, ROWS, CELLS, 2, &mut Memory::default());
            let (mut values, mut features) = (Matrix::zeros(CELLS, 2), Matrix::zeros(ROWS, 2));
            let mut changed = RowSet::new(ROWS);
            let mut lists: Vec<Vec<(u32, i64)>> = vec![Vec::new(); CELLS];
            let mut now = 0;
            for (step, row, cell, value, small, later) in steps {
                let held = lists.iter().position(|list| list.iter().any(|&(r, _)| r == row));
                let value = if small { value * 1e-8 } else { value };
                match (step, held) {
                    (0, _) => {
                        sums.clear(&mut values);
                        lists.iter_mut().for_each(Vec::clear);
                        changed.clear();
                    }
                    (1 | 2, Some(of)) => {
                        sums.leave(row);
                        changed.remove(row);
                        lists[of].retain(|&(r, _)| r != row);
                    }
                    (_, Some(_)) => {
                        features.row_mut(row as usize)[0] = Lanes::splat(value);
                        changed.insert(row);
                    }
                    (_, None) => {
                        now += later;
                        for (left, _) in lists.iter().flatten().filter(|&&(_, t)| t < now - SPAN_US) {
                            sums.leave(*left);
                            changed.remove(*left);
                        }
                        lists.iter_mut().for_each(|list| list.retain(|&(_, t)| t >= now - SPAN_US));
                        features.row_mut(row as usize)[0] = Lanes::splat(value);
                        sums.enter(row, cell, now);
                        lists[cell as usize].push((row, now));
                    }
                }
                if step < 6 {
                    let before = values.clone();
                    let mut log = LayerLog::default();
                    let mut moved = Vec::new();
                    sums.update(Isa::best(), &features, &changed, &mut values, &mut log, |cell| moved.push(cell));
                    moved.sort_unstable();
                    changed.clear();
                    let differ = (0..CELLS as u32).filter(|&c| !same_bits(values.row(c as usize), before.row(c as usize)));
                    let differ: Vec<_> = differ.collect();
                    prop_assert_eq!(log.counters.recomputed - log.counters.unchanged, differ.len() as u64);
                    prop_assert_eq!(moved, differ);
                    for (cell, list) in lists.iter().enumerate() {
                        let parts = list.chunk_by(|&(_, a), &(_, b)| a / PART_US == b / PART_US);
                        let of = |row: u32| features.row(row as usize)[0].0[0];
                        let sum = parts.fold(0.0f32, |sum, part| sum + part.iter().fold(0.0, |sum, &(r, _)| sum + of(r)));
                        prop_assert_eq!(values.row(cell)[0].0[0].to_bits(), sum.to_bits());
                    }
                }
            }
        }
    }
}

mod merged {
    use std::collections::BTreeMap;

    use meissner_kernels::{attribute, offset, spline_basis};
    use proptest::prelude::*;

    use crate::convolution::EdgeReads;
    use crate::memory::Memory;
    use crate::merged::*;

    proptest! {
        #[test]
        fn merged_edges_are_those_of_plain_maps(
            // In addition to five used rows, enough rows that readers are stored in lists.
            more in prop_oneof![Just(0usize), Just(200), Just(5_000)],
            below in 1usize..30,
            steps in proptest::collection::vec((0u32..5, 0u32..5, any::<bool>(), any::<bool>()), 0..400),
        ) {
            let extent = Extent::new(5 + more, 5, below);
            let mut merged = Merged::new(extent, EdgeReads { basis: true, offsets: true }, &mut Memory::default());
            let mut plain: Vec<BTreeMap<u32, u32>> = vec![BTreeMap::new(); 5];
            let mut edges = 0;
            let difference = |source: u32| [f64::from(source), -0.5, 0.0];
            let u = |source: u32| difference(source).map(|d| attribute(d, 4.0));
            let offsets = |source: u32| difference(source).map(|d| offset(d, 4.0));
            for (source, row, up, settle) in steps {
                let at = merged.neighbours(row).binary_search_by_key(&source, |n| n.row);
                let there = plain[row as usize].contains_key(&source);
                prop_assert_eq!(at.is_ok(), there);
                let changes = source != row && if up { edges < below } else { there };
                if changes && up {
                    edges += 1;
                    *plain[row as usize].entry(source).or_default() += 1;
                    match at {
                        Ok(at) => merged.count_up(row, at),
                        Err(at) => merged.insert(row, at, source),
                    }
                } else if changes {
                    edges -= 1;
                    let count = plain[row as usize].get_mut(&source).expect("it is there");
                    *count -= 1;
                    let gone = *count == 0;
                    if gone {
                        plain[row as usize].remove(&source);
                    }
                    prop_assert_eq!(merged.count_down(row, at.expect("it is there")), gone);
                }
                if settle {
                    merged.update_attributes(row, 4.0, |_| false, difference);
                    prop_assert!(!merged.update_attributes(row, 4.0, |_| true, difference));
                    prop_assert!(merged.neighbours(row).iter().all(|n| n.u == u(n.row)));
                    let basis: Vec<_> = merged.neighbours(row).iter().map(|n| spline_basis(n.u)).collect();
                    prop_assert_eq!(merged.edges(row).basis, basis);
                    let expected: Vec<_> = merged.neighbours(row).iter().map(|n| offsets(n.row)).collect();
                    prop_assert_eq!(merged.edges(row).offsets, expected);
                }
                for (row, plain) in (0..).zip(&plain) {
                    prop_assert!(merged.neighbours(row).iter().map(|n| n.row).eq(plain.keys().copied()));
                }
                for source in 0..5 {
                    let mut readers = Vec::new();
                    merged.for_readers(std::iter::once(source), |rows| readers.extend_from_slice(rows));
                    readers.sort_unstable();
                    let expected: Vec<u32> =
                        (0..5).filter(|&row| plain[row as usize].contains_key(&source)).collect();
                    prop_assert_eq!(readers, expected);
                }
            }
        }
    }
}

mod activations {
    use crate::activations::*;
    use crate::memory::Memory;
    use crate::network::Level;
    use crate::options::Options;

    #[test]
    fn poison_is_left_where_rows_were_and_nowhere_else() {
        let held = |activations: &Activations| -> Vec<bool> {
            let feature = activations.feature(1);
            (0..feature.rows()).map(|row| feature.values(row).all(f32::is_nan)).collect()
        };
        let level = Level { scale: 1.0, blocks: Vec::new() };
        let options = Options::new();
        let mut activations = Activations::new(3, &level, &[1, 2], 1, 0.0, &options, &mut Memory::default());
        activations.grow(3);
        activations.leave(0, false);
        activations.leave(1, true);
        assert_eq!(held(&activations), [false, true, false]);
        activations.clear(false);
        assert_eq!(held(&activations), [false, true, false]);
        activations.clear(true);
        assert_eq!(held(&activations), [true; 3]);
    }
}
