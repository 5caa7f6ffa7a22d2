//! Compares the queue with a model that processes one event at a time; tests the worker's pace and
//! priority.

use meissner_engine::Event;
use meissner_engine::filters::Chain;
use proptest::prelude::*;

use std::time::{Duration, Instant};

use crate::intake::Intake;
use crate::overload::Overload;
use crate::worker::{Pace, can_restore_priority, lower_priority, restore_priority};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Waiting,
    Delivered,
    Oldest,
    Newest,
    Thinned,
    Filtered,
}

/// Outcomes of all events offered so far, by number.
struct Model {
    rule: Overload,
    capacity: usize,
    fates: Vec<Fate>,
    congested: bool,
    high_water: usize,
}

impl Model {
    fn count(&self, fate: Fate) -> usize {
        self.fates.iter().filter(|&&f| f == fate).count()
    }

    fn oldest(&self) -> Option<usize> {
        self.fates.iter().position(|&f| f == Fate::Waiting)
    }

    /// Offers one event; returns whether it was processed.
    fn offer(&mut self, passes: bool) -> bool {
        let waiting = self.count(Fate::Waiting);
        let full = waiting == self.capacity;
        if waiting * 2 > self.capacity {
            self.congested = true;
        } else if waiting * 4 <= self.capacity {
            self.congested = false;
        }
        let number = self.fates.len() as u64;
        let fate = match self.rule {
            Overload::Block if full => return false,
            Overload::DropOldest if full => {
                let oldest = self.oldest().expect("a full queue holds events");
                self.fates[oldest] = Fate::Oldest;
                Fate::Waiting
            }
            Overload::Thin { stride } if self.congested && !number.is_multiple_of(stride.into()) => {
                Fate::Thinned
            }
            Overload::Filter(_) if self.congested && !passes => Fate::Filtered,
            _ if full => Fate::Newest,
            _ => Fate::Waiting,
        };
        self.fates.push(fate);
        self.high_water = self.high_water.max(self.count(Fate::Waiting));
        true
    }

    /// Numbers of the taken events.
    fn take(&mut self, most: usize) -> Vec<usize> {
        let mut taken = Vec::new();
        while let Some(oldest) = self.oldest().filter(|_| taken.len() < most) {
            self.fates[oldest] = Fate::Delivered;
            taken.push(oldest);
        }
        taken
    }
}

#[derive(Clone, Debug)]
enum Call {
    /// Whether each event passes the filters.
    Offer(Vec<bool>),
    Take(usize),
}

fn rules() -> impl Strategy<Value = Overload> {
    prop_oneof![
        Just(Overload::Block),
        Just(Overload::DropOldest),
        Just(Overload::DropNewest),
        (1..6_u32).prop_map(|stride| Overload::Thin { stride }),
        Just(Overload::Filter(Chain::default())),
    ]
}

fn calls() -> impl Strategy<Value = Vec<Call>> {
    let call = prop_oneof![
        2 => prop::collection::vec(any::<bool>(), 0..30).prop_map(Call::Offer),
        1 => (0..20_usize).prop_map(Call::Take),
    ];
    prop::collection::vec(call, 0..40)
}

proptest! {
    #[test]
    fn every_event_has_the_fate_that_the_model_gives_it(
        rule in rules(), capacity in 1..20_usize, calls in calls(),
    ) {
        let mut model = Model { rule: rule.clone(), capacity, fates: vec![], congested: false, high_water: 0 };
        let mut intake = Intake::new(capacity, rule);
        let room = intake.ring.capacity();
        for call in calls {
            match call {
                Call::Offer(passes) => {
                    let number = model.fates.len();
                    let events: Vec<Event> = (0..passes.len())
                        .map(|i| Event::new((number + i) as i64, 0, 0, true))
                        .collect();
                    let expected = passes.iter().take_while(|&&passes| model.offer(passes)).count();
                    prop_assert_eq!(intake.offer(&events, &passes), expected);
                }
                Call::Take(most) => {
                    let mut taken = Vec::new();
                    prop_assert_eq!(intake.take(most, &mut taken), taken.len());
                    let numbers: Vec<usize> = taken.iter().map(|event| event.t_us as usize).collect();
                    prop_assert_eq!(numbers, model.take(most));
                }
            }
            let counters = *intake.counters();
            prop_assert_eq!(counters.offered, counters.delivered + counters.waiting + counters.dropped());
            prop_assert_eq!(counters.waiting as usize, intake.waiting());
            prop_assert!(intake.waiting() <= capacity);
            let counted = [
                (Fate::Waiting, counters.waiting),
                (Fate::Delivered, counters.delivered),
                (Fate::Oldest, counters.dropped_oldest),
                (Fate::Newest, counters.dropped_newest),
                (Fate::Thinned, counters.thinned),
                (Fate::Filtered, counters.filtered),
            ];
            for (fate, count) in counted {
                prop_assert_eq!(model.count(fate) as u64, count, "{:?}", fate);
            }
            prop_assert_eq!(counters.offered as usize, model.fates.len());
            prop_assert_eq!(counters.high_water as usize, model.high_water);
            prop_assert_eq!(intake.entered() - intake.left(), counters.waiting);
        }
        prop_assert_eq!(intake.ring.capacity(), room, "no memory is taken");
    }
}

#[test]
fn how_offered_events_are_cut_in_slices_does_not_matter() {
    let events: Vec<Event> = (0..100).map(|t| Event::new(t, 0, 0, true)).collect();
    let passes: Vec<bool> = (0..100).map(|t| t % 3 == 0).collect();
    let rules = [
        Overload::DropOldest,
        Overload::DropNewest,
        Overload::Thin { stride: 4 },
        Overload::Filter(Chain::default()),
    ];
    for rule in rules {
        let mut outcomes = Vec::new();
        for slice in [1, 7, 100] {
            let mut intake = Intake::new(16, rule.clone());
            for (events, passes) in events.chunks(slice).zip(passes.chunks(slice)) {
                assert_eq!(intake.offer(events, passes), events.len());
            }
            let mut left = Vec::new();
            intake.take(100, &mut left);
            outcomes.push((left, *intake.counters()));
        }
        assert!(outcomes.windows(2).all(|pair| pair[0] == pair[1]), "{rule:?}");
    }
}

#[test]
fn thinning_begins_above_half_and_ends_at_a_quarter() {
    let mut intake = Intake::new(8, Overload::Thin { stride: 1000 });
    let event = [Event::new(0, 0, 0, true)];
    let offer = |intake: &mut Intake<Event>| {
        let before = intake.waiting();
        intake.offer(&event, &[]);
        intake.waiting() > before
    };
    let entered: Vec<bool> = (0..7).map(|_| offer(&mut intake)).collect();
    assert_eq!(entered, [true, true, true, true, true, false, false]);
    intake.take(2, &mut Vec::new());
    assert!(!offer(&mut intake), "3 of 8 is more than a quarter");
    intake.take(1, &mut Vec::new());
    assert!(offer(&mut intake));
}

const MS: Duration = Duration::from_millis(1);

#[test]
fn a_prediction_is_begun_twice_its_time_before_the_deadline() {
    let (mut pace, now) = (Pace::default(), Instant::now());
    pace.predicted(3 * MS);
    pace.pushed(4 * MS);
    assert!(!pace.is_time(Some(now + 15 * MS), now));
    assert!(pace.is_time(Some(now + 14 * MS), now));
    assert!(pace.is_time(Some(now), now + MS), "what is overdue is due");
    assert!(!pace.is_time(None, now));
}

#[test]
fn a_long_prediction_is_followed_by_as_long_a_time_for_events() {
    let (mut pace, now) = (Pace::default(), Instant::now());
    pace.predicted(10 * MS);
    for _ in 0..9 {
        pace.pushed(MS);
        assert!(!pace.is_time(Some(now), now));
    }
    pace.pushed(MS);
    assert!(pace.is_time(Some(now), now));
}

#[test]
fn a_single_slow_batch_is_forgotten() {
    let (mut pace, now) = (Pace::default(), Instant::now());
    pace.pushed(100 * MS);
    (0..40).for_each(|_| pace.pushed(MS));
    assert!(!pace.is_time(Some(now + 4 * MS), now));
}

#[test]
fn a_lowered_priority_is_restored_where_the_system_allows_it() {
    if can_restore_priority() {
        let before = lower_priority().expect("it could be lowered");
        assert_eq!(lower_priority(), Some(19));
        assert!(restore_priority(before));
        assert_eq!(lower_priority(), Some(before));
        assert!(restore_priority(before));
    }
}
