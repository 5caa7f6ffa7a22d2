//! Storage and search of the event graph against plain lists.

mod grid {
    use std::cell::Cell;

    use meissner_kernels::Portable;

    use crate::event::Sensor;
    use crate::grid::*;
    use crate::memory::Memory;
    use crate::metric::{Metric, Node};
    use crate::nearest::Nearest;

    /// The nearest 16 of nodes at `times` on a pixel to the last; how often arrivals were compared.
    fn nearest(times: &[i64]) -> (Vec<(f64, u32)>, u32) {
        let sensor = Sensor::new(40, 30);
        let memory = &mut Memory::default();
        let mut grid = Grid::new(sensor, 4, times.len(), memory);
        let node = |t| Node { t, x: 7, y: 7, on: true };
        times.iter().zip(0..).for_each(|(&t, slot)| grid.push(slot, node(t)));
        let (mut found, asked) = (Nearest::new(16, memory), Cell::new(0));
        let arrival = |slot| {
            asked.set(asked.get() + 1);
            slot
        };
        found.begin(1.0);
        let last = *times.last().expect("there is one");
        grid.find(Portable, &Metric::new(sensor, 100_000, 1.0, memory), node(last), &mut found, arrival);
        found.select(arrival);
        (found.iter().collect(), asked.get())
    }

    #[test]
    fn the_cost_of_a_search_does_not_grow_with_the_events_of_one_pixel_at_one_time() {
        let latest = |count: u32| (0..16).map(|i| count - 1 - i).collect::<Vec<_>>();
        for count in [100, 1_000, 10_000] {
            let (found, cost) = nearest(&vec![5; count as usize]);
            assert_eq!(found.iter().map(|&(_, slot)| slot).collect::<Vec<_>>(), latest(count));
            // Two sorts of a full collection.
            assert!(cost < 1_000, "{count} events: {cost}");
        }
    }

    #[test]
    fn of_the_events_of_one_pixel_at_an_earlier_time_the_latest_are_the_nearest() {
        let times = [&[0; 1_000][..], &[500; 1_000], &[1_000; 5]].concat();
        let (found, cost) = nearest(&times);
        let expected: Vec<u32> = (1_989..2_005).rev().collect();
        assert_eq!(found.iter().map(|&(_, slot)| slot).collect::<Vec<_>>(), expected);
        assert!(cost < 1_000, "{cost}");
    }
}

mod nearest {
    use proptest::prelude::*;

    use crate::memory::Memory;
    use crate::nearest::*;
    use crate::queues::NODES;

    proptest! {
        #[test]
        fn the_nearest_are_the_first_of_all_sorted(
            most in 1usize..40,
            distances in proptest::collection::vec(prop_oneof![0u32..30, any::<u32>()], 0..300),
            bound in prop_oneof![Just(f64::INFINITY), (0u32..40).prop_map(f64::from)],
            blocks in any::<bool>(),
            later in any::<u32>(),
        ) {
            let mut nearest = Nearest::new(most, &mut Memory::default());
            // Slots in any order of arrival.
            let arrival = |slot: u32| slot ^ later;
            for _ in 0..2 {
                nearest.begin(bound);
                let d2: Vec<f64> = distances.iter().map(|&d| d.into()).collect();
                let slots: Vec<u32> = (0..d2.len() as u32).collect();
                for (d2, slots) in d2.chunks(NODES).zip(slots.chunks(NODES)) {
                    if blocks {
                        let (mut all, mut all_slots) = ([0.0; NODES], [0; NODES]);
                        let start = NODES - d2.len();
                        all[start..].copy_from_slice(d2);
                        all_slots[start..].copy_from_slice(slots);
                        nearest.add_all(&all, &all_slots, start..NODES, arrival);
                    } else {
                        d2.iter().zip(slots).for_each(|(&d2, &slot)| nearest.add(d2, slot, arrival));
                    }
                }
                nearest.select(arrival);
                let mut all: Vec<(f64, u32)> = d2.into_iter().zip(slots).filter(|c| c.0 <= bound).collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0).then(arrival(b.1).cmp(&arrival(a.1))));
                all.truncate(most);
                prop_assert_eq!(nearest.iter().collect::<Vec<_>>(), all);
            }
        }
    }
}

mod queues {
    use std::collections::VecDeque;

    use proptest::prelude::*;

    use crate::memory::Memory;
    use crate::queues::*;

    /// Nodes before `place` and from it on, each in order of time.
    fn parts(queue: Queue<'_>, place: Place) -> [Vec<Entry>; 2] {
        let [mut before, mut after] = [Vec::new(), Vec::new()];
        let mut at = Some(place);
        while let Some(place) = at {
            before.extend(queue.nodes_before(place).rev().map(|i| queue.block(place).entry(i)));
            at = queue.previous(place);
        }
        at = Some(place);
        while let Some(place) = at {
            after.extend(queue.nodes_from(place).map(|i| queue.block(place).entry(i)));
            at = queue.next(place);
        }
        before.reverse();
        [before, after]
    }

    proptest! {
        #[test]
        fn queues_in_blocks_are_plain_queues(
            queues in 1usize..5,
            capacity in 1usize..60,
            steps in proptest::collection::vec((0u8..40, 0usize..5, 0i64..4), 0..300),
        ) {
            let mut blocks = Queues::new(queues, capacity, &mut Memory::default());
            let mut plain = vec![VecDeque::new(); queues];
            let (mut t, mut nodes) = (0, 0);
            for (step, queue, later) in steps {
                let queue = queue % queues;
                t += later;
                if step == 0 {
                    blocks.clear();
                    plain.iter_mut().for_each(VecDeque::clear);
                    nodes = 0;
                } else if step < 24 && nodes < capacity {
                    let entry = Entry { t, slot: step.into(), x: queue as u16, y: 0 };
                    blocks.push(queue, entry);
                    plain[queue].push_back(entry);
                    nodes += 1;
                } else {
                    let popped = plain[queue].pop_front();
                    prop_assert_eq!(blocks.pop(queue), popped);
                    nodes -= usize::from(popped.is_some());
                }
                for (queue, plain) in plain.iter().enumerate() {
                    prop_assert_eq!(blocks.queue(queue).len(), plain.len());
                    prop_assert_eq!(plain, &blocks.queue(queue).iter().collect::<Vec<_>>());
                }
            }
            for (queue, plain) in plain.iter().enumerate().filter(|(_, plain)| !plain.is_empty()) {
                let (queue, mut cursor) = (blocks.queue(queue), Cursor::default());
                for t in 0..=t + 1 {
                    let at = plain.partition_point(|e| e.t <= t);
                    let expected = [0..at, at..plain.len()].map(|r| plain.range(r).copied().collect::<Vec<_>>());
                    prop_assert_eq!(&parts(queue, queue.later_than(t)), &expected);
                    prop_assert_eq!(&parts(queue, queue.later_than_onwards(t, &mut cursor)), &expected);
                }
            }
        }

        #[test]
        fn as_many_nodes_as_were_declared_fit_however_they_are_spread(
            queues in 1usize..9,
            capacity in 1usize..200,
            spread in proptest::collection::vec((0usize..9, 0usize..9), 500),
        ) {
            let mut blocks = Queues::new(queues, capacity, &mut Memory::default());
            let mut order = VecDeque::new();
            for (low, high) in spread {
                if order.len() == capacity {
                    blocks.pop(order.pop_front().expect("a node"));
                }
                let queue = low.min(high) % queues;
                blocks.push(queue, Entry::default());
                order.push_back(queue);
            }
        }
    }
}

mod window {
    use std::collections::VecDeque;

    use proptest::prelude::*;

    use crate::memory::Memory;
    use crate::metric::Node;
    use crate::window::*;

    proptest! {
        #[test]
        fn a_window_is_a_queue_whose_nodes_keep_their_slots(
            capacity in 1usize..200,
            steps in proptest::collection::vec((0u8..24, 0u32..90, 0u32..90), 0..100),
            first in prop_oneof![Just(0), any::<u32>()],
        ) {
            let mut window = Window::new(capacity, &mut Memory::default());
            // The state after this number of nodes.
            window.first = first / CHUNK * CHUNK;
            let (mut plain, mut t, mut most) = (VecDeque::new(), 0, 0);
            for (step, entering, leaving) in steps {
                if step == 0 {
                    window.clear();
                    plain.clear();
                } else if step < 16 {
                    for _ in 0..entering.min((capacity - plain.len()) as u32) {
                        t += 1;
                        let node = Node { t, ..Node::default() };
                        plain.push_back((window.push(node), node));
                    }
                } else {
                    let count = leaving.min(plain.len() as u32);
                    let left: Vec<u32> = plain.drain(..count as usize).map(|(slot, _)| slot).collect();
                    window.pop(count);
                    // Nodes that were in the window together with the nodes that left rank before
                    // those.
                    for &slot in &left {
                        prop_assert!(window.age_rank(slot) >= plain.len() as u32);
                    }
                }
                most = most.max(plain.len());
                prop_assert_eq!(window.len(), plain.len());
                prop_assert_eq!(window.is_full(), plain.len() == capacity);
                prop_assert!(window.slots().eq(plain.iter().map(|&(slot, _)| slot)));
                for (index, &(slot, node)) in plain.iter().enumerate() {
                    prop_assert_eq!(window.node(slot), node);
                    prop_assert_eq!([window.age_rank(slot), window.slot_of(index as u32)], [index as u32, slot]);
                    // The window uses only as many chunks as the maximum number of simultaneous
                    // nodes needs.
                    prop_assert!((slot as usize) < Window::slots_for(most));
                }
                let middle = plain.len() as u32 / 3..plain.len() as u32;
                prop_assert!(window.slots_of(middle.clone()).eq(plain.range(middle.start as usize..).map(|n| n.0)));
                prop_assert_eq!(window.earlier_than(t), plain.iter().filter(|n| n.1.t < t).count() as u32);
            }
        }
    }
}

mod readers {
    use proptest::prelude::*;

    use crate::memory::Memory;
    use crate::readers::*;

    #[test]
    fn one_slot_can_have_as_many_readers_as_there_can_be_edges() {
        for edges in 1..=200 {
            let mut readers = Readers::new(2, edges as usize, &mut Memory::default());
            for slot in [0, 1, 0] {
                (0..edges).for_each(|row| readers.push(slot, row));
                let mut got = Vec::new();
                readers.for_each(slot, |row| got.push(row));
                assert_eq!(got, (0..edges).collect::<Vec<_>>());
                readers.clear(slot);
            }
        }
    }

    proptest! {
        #[test]
        fn readers_are_those_of_plain_lists(steps in proptest::collection::vec((0u8..12, 0u32..3, 0u32..60), 0..300)) {
            let mut readers = Readers::new(3, 180, &mut Memory::default());
            let mut lists = vec![Vec::new(); 3];
            for (step, slot, row) in steps {
                let list: &mut Vec<u32> = &mut lists[slot as usize];
                if step == 0 {
                    readers.clear(slot);
                    list.clear();
                } else if let Some(at) = list.iter().position(|&r| r == row) {
                    readers.remove(slot, row);
                    list.swap_remove(at);
                } else {
                    readers.push(slot, row);
                    list.push(row);
                }
                for (slot, list) in lists.iter().enumerate() {
                    let mut got = Vec::new();
                    readers.for_each(slot as u32, |row| got.push(row));
                    let mut expected = list.clone();
                    got.sort_unstable();
                    expected.sort_unstable();
                    prop_assert_eq!(got, expected);
                }
            }
        }
    }
}
