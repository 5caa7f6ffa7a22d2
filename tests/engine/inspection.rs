//! The state that an engine shows to viewers.

use meissner_engine::{Batch, Candidates, ComputedRow, Engine, Event, Lifetime, Options, Stream};

use crate::recomputed_rows::{SENSOR, chain, engine, near, pool, shape};

#[test]
fn a_computed_row_says_whether_its_values_changed() {
    let mut engine = chain(&shape(near(Candidates::All), 2, vec![pool(2, 1, true)]), 5);
    // It leaves the maximum of no cell, and no edge, as they are but in its own place.
    engine.push(Event::new(0, 50, 50, true));
    engine.predict().expect("finite");
    let (computed, counters) = (engine.computed_rows(), engine.counters());
    assert_eq!(computed.len(), counters.layers.len());
    for (rows, (recomputed, counted)) in computed.iter().zip(engine.recomputed().iter().zip(&counters.layers))
    {
        assert_eq!(rows.iter().map(|row| row.row).collect::<Vec<_>>(), *recomputed);
        assert!(rows.iter().filter(|row| !row.changed).count() as u64 <= counted.unchanged);
    }
    assert!(computed[0].contains(&ComputedRow { row: 5, changed: true }), "{computed:?}");
}

#[test]
fn rows_are_recorded_while_there_is_room_for_them() {
    let mut engine = engine(shape(near(Candidates::Past(Lifetime::Frozen)), 1, vec![]).build());
    let before = engine.state_bytes();
    for t in 0..500 {
        engine.push(Event::new(t, (t % 90) as u16, 50, true));
    }
    let rows = engine.recomputed();
    assert!(rows[0].len() <= engine.nodes() && !rows.is_empty(), "{rows:?}");
    assert_eq!(engine.counters().layers[0].recomputed, 500);
    assert_eq!(engine.state_bytes(), before);
    let without = Options::new().with_poison(true);
    let without = Engine::with_options(engine.network().clone(), SENSOR, without).expect("an exact network");
    assert!(without.state_bytes() < before);
    assert!(without.computed_rows().iter().all(Vec::is_empty));
}

#[test]
fn an_engine_shows_the_cells_of_the_batch() {
    let shape = shape(near(Candidates::All), 1, vec![pool(1, 1, true), pool(1, 0, false)]);
    let mut engine = engine(shape.build());
    let events: Vec<Event> =
        (0..40u16).map(|i| Event::new(20 * i64::from(i), i * 37 % 100, i * 53 % 100, i % 3 == 0)).collect();
    engine.push_slice(&events);
    engine.predict().expect("finite");
    let batch = Batch::new(engine.network().clone(), SENSOR).expect("the sensor has pixels");
    let trace = batch.forward(Stream::new(&events)).expect("finite");
    for level in 0..3 {
        assert_eq!(engine.cells(level), trace.levels[level].cells, "level {level}");
    }
}
