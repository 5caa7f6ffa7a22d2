//! Many sensors in one process: no sensor harms another.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use meissner_live::{Fleet, Live, LiveError, Overload, QueueOptions, cores};

use crate::fake::{Fake, NAN_COLUMN, PANIC_COLUMN, PATIENCE, check, event, events, options};

#[test]
fn sensors_that_flood_fail_panic_or_stand_still_harm_no_other() {
    let gate = Arc::new(Mutex::new(()));
    let held = gate.lock().expect("nobody panicked");
    let fake = |sensor| {
        if sensor == 3 { Fake { gate: Arc::clone(&gate), ..Fake::default() } } else { Fake::default() }
    };
    let sensors = (0..6).map(|sensor| (fake(sensor), options(64, Overload::DropOldest)));
    let (mut inputs, mut fleet) = Fleet::spawn(sensors).expect("options are fine");
    assert_eq!((fleet.len(), fleet.is_empty()), (6, false));
    let [well, floods, panics, stands_still, fails, silent] = [0, 1, 2, 3, 4, 5];
    inputs[panics].push_slice(&[event(0, PANIC_COLUMN)]).expect("there is room");
    inputs[stands_still].push_slice(&events(0..1)).expect("there is room");
    inputs[fails].push_slice(&[event(0, NAN_COLUMN)]).expect("there is room");
    for tick in 0..20 {
        inputs[floods].push_slice(&events(1000 * tick..1000 * tick + 1000)).expect("the worker lives");
        inputs[well].push_slice(&events(3 * tick..3 * tick + 3)).expect("the worker lives");
        let mut seen = Vec::new();
        // Sensors that can answer do: a sensor that stands still uses the whole deadline.
        let most = if tick == 0 { Duration::from_millis(20) } else { PATIENCE };
        let asked = (0..6).filter(|&sensor| sensor != stands_still || tick == 0);
        fleet.predict(most, asked, |sensor, timely| {
            seen.push(sensor);
            match (sensor, timely) {
                (0, Ok(timely)) if tick > 0 => {
                    assert_eq!((timely.fresh, timely.nodes as i64), (true, 3 * tick + 3));
                }
                (5, Ok(timely)) if tick > 0 => {
                    assert_eq!((timely.fresh, timely.nodes, timely.latency), (true, 0, None));
                }
                (3, Ok(timely)) => assert!(!timely.own && timely.latency.is_none(), "{timely:?}"),
                (0 | 1 | 5, Ok(_))
                | (2, Err(LiveError::Panicked { .. }))
                | (4, Err(LiveError::Engine(_))) => {}
                // The worker that is about to panic has not done so yet.
                (2 | 4, Ok(timely)) if tick == 0 => assert!(!timely.fresh, "{timely:?}"),
                (sensor, other) => panic!("sensor {sensor}, tick {tick}: {other:?}"),
            }
        });
        assert_eq!(seen, (0..6).filter(|&sensor| sensor != stands_still || tick == 0).collect::<Vec<_>>());
    }
    drop(held);
    for (sensor, live) in fleet.sensors().iter().enumerate().filter(|&(sensor, _)| sensor != panics) {
        check(&live.counters(), 64);
        let dropped = live.counters().dropped();
        assert_eq!(dropped > 0, sensor == floods, "sensor {sensor}: {dropped} dropped");
    }
    let ended = fleet.close();
    let is_panic = |end: &Result<Fake, LiveError>| matches!(end, Err(LiveError::Panicked { .. }));
    assert_eq!(
        ended.iter().map(is_panic).collect::<Vec<_>>(),
        (0..6).map(|sensor| sensor == panics).collect::<Vec<_>>()
    );
    assert_eq!(ended[well].as_ref().map(|fake| fake.taken).ok(), Some(60));
    assert_eq!(ended[silent].as_ref().map(|fake| fake.taken).ok(), Some(0));
}

#[test]
fn a_sensor_that_cannot_start_leaves_no_worker_behind() {
    let gate = Arc::new(Mutex::new(()));
    let fake = || Fake { gate: Arc::clone(&gate), ..Fake::default() };
    let sensors = [(fake(), QueueOptions::new()), (fake(), QueueOptions::new().with_capacity(0))];
    let refused = Fleet::spawn(sensors).expect_err("the second queue has no room");
    assert!(matches!(refused, LiveError::Option { .. }), "{refused}");
    assert_eq!(Arc::strong_count(&gate), 1, "the engines are gone");
}

#[test]
fn workers_run_on_the_cores_that_were_asked_for() {
    let all = cores();
    for &core in &all {
        let (mut input, mut live) =
            Live::spawn(Fake::default(), options(8, Overload::Block).with_core(Some(core)))
                .expect("the core is there");
        input.push_slice(&events(0..3)).expect("the worker lives");
        live.predict(PATIENCE).expect("the worker lives");
        assert_eq!(
            live.close().expect("the worker lives").core,
            Some(core).filter(|_| cfg!(target_os = "linux"))
        );
    }
    let refused = Live::spawn(Fake::default(), options(8, Overload::Block).with_core(Some(1 << 20)));
    let Err(LiveError::Core { core, cores }) = refused else { panic!("{refused:?}") };
    assert_eq!((core, cores), (1 << 20, all));
}

#[test]
fn latency_counts_from_the_first_event_that_no_prediction_covered() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, mut live) = Live::spawn(fake, options(64, Overload::Block)).expect("options are fine");
    assert_eq!(live.predict(PATIENCE).expect("the worker lives").latency, None, "nothing was offered");
    let held = gate.lock().expect("nobody panicked");
    let offered = std::time::Instant::now();
    input.push_slice(&events(0..5)).expect("the worker lives");
    for _ in 0..3 {
        let late = live.predict(Duration::from_millis(5)).expect("the worker lives");
        assert_eq!((late.fresh, late.latency), (false, None));
        input.push_slice(&events(5..6)).expect("the worker lives");
    }
    drop(held);
    let fresh = live.predict(PATIENCE).expect("the worker lives");
    let latency = fresh.latency.expect("it is the first fresh one");
    assert!(latency >= Duration::from_millis(15) && latency <= offered.elapsed(), "{latency:?}");
    assert_eq!(live.predict(PATIENCE).expect("the worker lives").latency, None, "it was covered before");
}
