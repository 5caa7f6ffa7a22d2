//! Times of stages: each time belongs to its stage, and no time is lost.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use meissner_engine::{Candidates, Engine, Event, Lifetime, Options, Stage};

use crate::recomputed_rows::{SENSOR, SPAN_US, near, pool, shape};

#[test]
fn an_insertion_and_an_expiry_take_time_in_the_stages_that_they_run() {
    let options = Options::new().with_stage_times(true);
    let structure = vec![Stage::EventGraph, Stage::PooledGraphs];
    let with_rows = vec![Stage::EventGraph, Stage::PooledGraphs, Stage::EventLayers];
    for (candidates, inserting) in
        [(Candidates::All, &structure), (Candidates::Past(Lifetime::Frozen), &with_rows)]
    {
        let shape = shape(near(candidates), 1, vec![pool(1, 1, true)]);
        let mut engine = Engine::with_options(shape.build(), SENSOR, options).expect("the network is exact");
        let mut during = |step: &mut dyn FnMut(&mut Engine)| -> Vec<Stage> {
            let before = engine.stage_times();
            step(&mut engine);
            let stages = engine.stage_times().into_iter().zip(before);
            stages.filter(|((_, after), (_, before))| after > before).map(|((stage, _), _)| stage).collect()
        };
        let mut push = |t_us| {
            during(&mut |engine| {
                engine.push(Event::new(t_us, 50, 50, true));
            })
        };
        assert_eq!(&push(0), inserting);
        assert_eq!(&push(500), inserting);
        assert_eq!(during(&mut |engine| engine.advance(SPAN_US + 1)), structure);
    }
}

#[test]
fn every_stage_takes_time_and_none_of_it_between_the_calls() {
    let options = Options::new().with_stage_times(true);
    let pause = Duration::from_millis(20);
    let attempt = || {
        let shape = shape(near(Candidates::All), 2, vec![pool(2, 1, true)]);
        let mut engine = Engine::with_options(shape.build(), SENSOR, options).expect("the network is exact");
        let mut frozen = shape;
        frozen.graph = near(Candidates::Past(Lifetime::Frozen));
        let mut frozen = Engine::with_options(frozen.build(), SENSOR, options).expect("the network is exact");
        let sum = |engine: &Engine| engine.stage_times().iter().map(|(_, time)| *time).sum::<Duration>();
        let mut calls = Duration::ZERO;
        for t_us in [0, 500, SPAN_US + 100] {
            for engine in [&mut engine, &mut frozen] {
                let began = Instant::now();
                engine.push(Event::new(t_us, 10, 50, true));
                calls += began.elapsed();
                std::thread::sleep(pause);
                let began = Instant::now();
                engine.predict().expect("finite");
                calls += began.elapsed();
                std::thread::sleep(pause);
                let began = Instant::now();
                engine.advance(t_us + 100);
                calls += began.elapsed();
            }
        }
        assert!(sum(&engine) + sum(&frozen) <= calls);
        for engine in [&mut engine, &mut frozen] {
            let times = engine.stage_times();
            assert!(times.iter().all(|(_, time)| !time.is_zero()), "{times:?}");
            engine.restore_bytes(&engine.to_bytes()).expect("its own bytes");
            assert!(engine.stage_times().iter().zip(&times).all(|(after, before)| after.1 >= before.1));
        }
        sum(&engine) + sum(&frozen) < pause
    };
    let names: BTreeSet<&str> = Stage::ALL.into_iter().map(Stage::name).collect();
    assert_eq!(names.len(), Stage::ALL.len());
    assert!(names.iter().all(|name| !name.is_empty()));
    // Other programs may stop this one at any point, for any time.
    assert!((0..10).any(|_| attempt()));
}
