//! Event filters against their slow twin, and the promises of each.

use meissner_engine::filters::{
    BackgroundActivity, Chain, EventFilter, Filter, FilterCounters, FilterRule, HotPixel, RateLimit,
    Refractory, Stride,
};
use meissner_engine::{EngineError, Event, Sensor};
use meissner_tests::event_filters::{Rule, pass};
use proptest::prelude::*;

const SENSOR: Sensor = Sensor { width: 6, height: 5 };

fn filter(rule: Rule) -> Filter {
    const ADMISSIBLE: &str = "the rule is admissible";
    match rule {
        Rule::Stride(n) => Filter::Stride(Stride::new(n).expect(ADMISSIBLE)),
        Rule::RateLimit(rate) => Filter::RateLimit(RateLimit::new(rate).expect(ADMISSIBLE)),
        Rule::BackgroundActivity(us) => {
            Filter::BackgroundActivity(BackgroundActivity::new(SENSOR, us).expect(ADMISSIBLE))
        }
        Rule::Refractory(us) => Filter::Refractory(Refractory::new(SENSOR, us).expect(ADMISSIBLE)),
        Rule::HotPixel(us, burst) => Filter::HotPixel(HotPixel::new(SENSOR, us, burst).expect(ADMISSIBLE)),
    }
}

fn rule() -> impl Strategy<Value = Rule> {
    prop_oneof![
        (1u32..5).prop_map(Rule::Stride),
        prop_oneof![1u64..50, 1_000u64..40_000, 1_000_000u64..5_000_000, Just(RateLimit::HIGHEST)]
            .prop_map(Rule::RateLimit),
        prop_oneof![1i64..100, Just(1_250), Just(1 << 40)].prop_map(Rule::BackgroundActivity),
        prop_oneof![1i64..100, Just(1_000), Just(1 << 40)].prop_map(Rule::Refractory),
        (prop_oneof![1i64..300, Just(10_000), Just(1 << 40)], prop_oneof![1u32..4, Just(1 << 16)])
            .prop_map(|(us, burst)| Rule::HotPixel(us, burst)),
    ]
}

/// A filter that a network can state.
fn pixel_rule() -> impl Strategy<Value = FilterRule> {
    prop_oneof![
        (1i64..300).prop_map(|us| FilterRule::BackgroundActivity { us }),
        (1i64..300).prop_map(|us| FilterRule::Refractory { us }),
        (1i64..300, 1u32..4).prop_map(|(period_us, burst)| FilterRule::HotPixel { period_us, burst }),
    ]
}

/// Events of a few pixels, in and out of order, some outside the sensor, some at the ends of time.
fn events() -> impl Strategy<Value = Vec<Event>> {
    let step = prop_oneof![
        8 => 0i64..60,
        2 => 0i64..3_000,
        2 => -80i64..0,
        1 => -200_000i64..2_000_000,
    ];
    let wild = prop_oneof![Just(i64::MIN), Just(i64::MAX), Just(0), any::<i64>()];
    let event = (step, proptest::option::weighted(0.02, wild), 0u16..7, 0u16..6, any::<bool>());
    (any::<i32>(), proptest::collection::vec(event, 0..120)).prop_map(|(origin, events)| {
        let mut t = i64::from(origin);
        let mut next = |(dt, wild, x, y, on): (i64, Option<i64>, u16, u16, bool)| {
            t = wild.unwrap_or(t.saturating_add(dt));
            Event::new(t, x, y, on)
        };
        events.into_iter().map(&mut next).collect()
    })
}

fn run(filter: &mut impl EventFilter, events: &[Event]) -> Vec<bool> {
    events.iter().map(|&event| filter.admit(event)).collect()
}

fn passed(filter: &mut impl EventFilter, events: &[Event]) -> usize {
    run(filter, events).into_iter().filter(|&passes| passes).count()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn a_filter_lets_pass_what_its_slow_twin_does(rule in rule(), events in events()) {
        let mut filter = filter(rule);
        let expected = pass(rule, SENSOR, &events);
        prop_assert_eq!(run(&mut filter, &events), expected.clone());
        let count = |which| expected.iter().filter(|&&passes| passes == which).count() as u64;
        prop_assert_eq!(filter.counters(), FilterCounters { passed: count(true), dropped: count(false) });
    }

    #[test]
    fn a_reset_filter_does_what_a_new_one_does(rule in rule(), before in events(), events in events()) {
        let (mut used, mut new) = (filter(rule), filter(rule));
        run(&mut used, &before);
        used.reset();
        prop_assert_eq!(run(&mut used, &events), run(&mut new, &events));
        let counted = used.counters().passed + used.counters().dropped;
        prop_assert_eq!(counted, (before.len() + events.len()) as u64);
    }

    #[test]
    fn a_chain_shows_each_filter_what_those_before_it_let_pass(
        rules in proptest::collection::vec(rule(), 0..4), events in events(),
    ) {
        let mut chain = Chain::new(rules.iter().map(|&rule| filter(rule)).collect());
        let got = run(&mut chain, &events);
        let mut left: Vec<usize> = (0..events.len()).collect();
        for (&rule, filter) in rules.iter().zip(chain.filters()) {
            let seen: Vec<Event> = left.iter().map(|&i| events[i]).collect();
            let passes = pass(rule, SENSOR, &seen);
            prop_assert_eq!(filter.counters().dropped, passes.iter().filter(|&&p| !p).count() as u64);
            left = left.into_iter().zip(passes).filter(|&(_, passes)| passes).map(|(i, _)| i).collect();
        }
        let expected: Vec<bool> = (0..events.len()).map(|i| left.contains(&i)).collect();
        prop_assert_eq!(got, expected);
        prop_assert_eq!(chain.counters().passed, left.len() as u64);
    }

    #[test]
    fn of_a_pixel_no_more_than_a_burst_and_the_periods_of_any_time_pass(
        us in 1i64..300, burst in 1u32..5, events in events(),
    ) {
        let mut filter = HotPixel::new(SENSOR, us, burst).expect("admissible");
        // There is no debt beyond the end of time.
        let counts = |e: &Event| SENSOR.contains(e.x, e.y) && e.t_us < i64::MAX / 2;
        let mut events: Vec<Event> = events.into_iter().filter(counts).collect();
        events.sort_by_key(|event| event.t_us);
        events.retain(|&event| filter.admit(event));
        for (i, first) in events.iter().enumerate() {
            let of_pixel = events[i..].iter().filter(|e| (e.x, e.y) == (first.x, first.y));
            for (count, last) in (1u64..).zip(of_pixel) {
                prop_assert!(count <= u64::from(burst) + last.t_us.abs_diff(first.t_us) / us.unsigned_abs());
            }
        }
    }

    #[test]
    fn what_a_chain_remembers_is_all_that_decides_about_later_events(
        rules in proptest::collection::vec(pixel_rule(), 0..4), before in events(), after in events(),
    ) {
        let mut chain = Chain::of_rules(&rules, SENSOR).expect("admissible");
        run(&mut chain, &before);
        let now_us = before.iter().map(|event| event.t_us).max().unwrap_or(i64::MIN);
        let remembered = chain.remembered(now_us);
        let mut other = Chain::of_rules(&rules, SENSOR).expect("admissible");
        // The filter forgets earlier events.
        run(&mut other, &after);
        prop_assert!(other.remember(&remembered));
        prop_assert_eq!(other.remembered(now_us), remembered);
        let later: Vec<Event> = after.into_iter().filter(|event| event.t_us >= now_us).collect();
        prop_assert_eq!(run(&mut other, &later), run(&mut chain, &later));
    }

    #[test]
    fn two_events_of_a_pixel_that_pass_are_never_closer_than_the_refractory_time(
        us in 1i64..200, events in events(),
    ) {
        let mut filter = Refractory::new(SENSOR, us).expect("admissible");
        let mut last = std::collections::BTreeMap::new();
        for event in events.into_iter().filter(|e| SENSOR.contains(e.x, e.y)) {
            if filter.admit(event)
                && let Some(before) = last.insert((event.x, event.y), event.t_us)
            {
                prop_assert!(event.t_us.abs_diff(before) >= us.unsigned_abs());
            }
        }
    }
}

fn at(t_us: i64, x: u16, y: u16) -> Event {
    Event::new(t_us, x, y, true)
}

#[test]
fn every_event_passes_while_the_rate_is_below_the_bound() {
    let mut filter = RateLimit::new(10_000).expect("admissible");
    // One event per 100 us, and sometimes ten at once, as the rate allows over a millisecond.
    let steady: Vec<Event> = (0..1_000).map(|i| at(100 * i, 0, 0)).collect();
    assert_eq!(passed(&mut filter, &steady), 1_000);
    let bursts: Vec<Event> = (0..1_000).map(|i| at(1_000_000 + i / 10 * 1_000, 0, 0)).collect();
    assert_eq!(passed(&mut filter, &bursts), 1_000);
}

#[test]
fn a_steady_stream_above_the_bound_is_thinned_evenly() {
    // 4 events per microsecond and a rate of 1 million per second: every fourth passes, once the
    // depth is used up.
    let mut filter = RateLimit::new(1_000_000).expect("admissible");
    let events: Vec<Event> = (0..40_000).map(|i| at(i / 4, 0, 0)).collect();
    let passes = run(&mut filter, &events);
    let places: Vec<usize> = (8_000..40_000).filter(|&i| passes[i]).collect();
    assert!(places.windows(2).all(|pair| pair[1] - pair[0] == 4));
    assert_eq!(places.len(), 8_000);
}

#[test]
fn an_event_alone_is_noise_and_its_neighbour_is_not() {
    let us = BackgroundActivity::DEFAULT_US;
    let mut filter = BackgroundActivity::new(SENSOR, us).expect("admissible");
    let events =
        [at(0, 2, 2), at(10, 2, 2), at(20, 3, 3), at(20 + us, 2, 3), at(21 + 2 * us, 3, 3), at(0, 4, 4)];
    // A pixel is not its own neighbour; an event that is a microsecond too late is noise; the order
    // does not matter.
    assert_eq!(run(&mut filter, &events), [false, false, true, true, false, false]);
}

#[test]
fn a_corner_has_three_neighbours_and_no_pixel_of_another_row() {
    let mut filter = BackgroundActivity::new(SENSOR, 10).expect("admissible");
    // (5, 0) and (0, 1) follow each other in memory but are not neighbours.
    assert_eq!(run(&mut filter, &[at(0, 5, 0), at(0, 0, 1), at(0, 0, 0)]), [false, false, true]);
}

#[test]
fn a_dropped_event_does_not_prolong_the_silence_of_its_pixel() {
    let mut filter = Refractory::new(SENSOR, 10).expect("admissible");
    let events = [at(0, 1, 1), at(9, 1, 1), at(9, 2, 1), at(10, 1, 1), at(19, 1, 1), at(20, 1, 1)];
    assert_eq!(run(&mut filter, &events), [true, false, true, true, false, true]);
}

#[test]
fn an_event_outside_the_sensor_is_left_to_the_engine() {
    for rule in [Rule::BackgroundActivity(10), Rule::Refractory(10), Rule::HotPixel(10, 1)] {
        let mut filter = filter(rule);
        assert_eq!(run(&mut filter, &[at(0, 6, 0), at(0, 6, 0), at(1, 0, 5)]), [true; 3], "{rule:?}");
    }
}

#[test]
fn a_pixel_that_fires_faster_than_its_period_is_muted_until_it_has_been_silent() {
    let mut filter = HotPixel::new(SENSOR, 100, 3).expect("admissible");
    // One event in 90 us: the debt rises by 10 an event from 100 on, and exceeds 300 with the 22nd.
    let fast: Vec<Event> = (0..200).map(|i| at(90 * i, 2, 2)).collect();
    assert_eq!(run(&mut filter, &fast), (0..200).map(|i| i < 21).collect::<Vec<_>>());
    // One in 100 us or more leaves the debt as it is, or pays it off.
    let slow: Vec<Event> = (0..200).map(|i| at(100 * i, 3, 3)).collect();
    assert_eq!(passed(&mut filter, &slow), 200);
    let end_us = fast[199].t_us;
    // The debt is at most twice the burst: 600 us minus the pause, and 100 for the event itself.
    let pauses = [399, 2, 601].iter().scan(end_us, |t_us, pause| {
        *t_us += pause;
        Some(at(*t_us, 2, 2))
    });
    assert_eq!(run(&mut filter, &pauses.collect::<Vec<_>>()), [false, false, true]);
    assert!(filter.admit(at(end_us, 2, 3)), "another pixel");
}

#[test]
fn a_clock_that_jumped_back_mutes_a_pixel_for_no_more_than_the_largest_debt() {
    let mut filter = HotPixel::new(SENSOR, 100, 3).expect("admissible");
    assert!(filter.admit(at(1_000_000, 2, 2)));
    assert!(!filter.admit(at(0, 2, 2)), "a million microseconds are owed");
    assert!(filter.admit(at(600, 2, 2)));
}

#[test]
fn an_unfit_memory_is_refused() {
    let rules = [FilterRule::Refractory { us: 10 }, FilterRule::HotPixel { period_us: 10, burst: 2 }];
    let mut chain = Chain::of_rules(&rules, SENSOR).expect("admissible");
    for unfit in [vec![vec![(0, 0, 5)]], vec![vec![(6, 0, 5)], vec![]], vec![vec![], vec![(0, 5, 5)]]] {
        assert!(!chain.remember(&unfit), "{unfit:?}");
    }
    assert!(chain.remembered(0).iter().all(Vec::is_empty));
    let mut none = Chain::default();
    assert!(none.remember(&[]) && !none.remember(&[vec![(0, 0, 5)]]));
}

#[test]
fn settings_out_of_range_are_refused() {
    let refused = [
        Stride::new(0).err(),
        RateLimit::new(0).err(),
        RateLimit::new(RateLimit::HIGHEST + 1).err(),
        RateLimit::new(u64::MAX).err(),
        BackgroundActivity::new(SENSOR, 0).err(),
        BackgroundActivity::new(SENSOR, i64::MAX).err(),
        Refractory::new(SENSOR, -1).err(),
        HotPixel::new(SENSOR, 0, 8).err(),
        HotPixel::new(SENSOR, 10, 0).err(),
        HotPixel::new(SENSOR, 10, u32::MAX).err(),
    ];
    assert!(refused.iter().all(|error| matches!(error, Some(EngineError::Option { .. }))), "{refused:?}");
}
