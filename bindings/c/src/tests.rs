//! Handles and warnings.

use std::ptr::null;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use meissner::{EventCounters, Sensor};

use crate::handles::{CHUNK, CHUNKS, Handles, SLOT_BITS, index, place};
use crate::log::warnings_of_losses;
use crate::status::{Failure, Status};

struct Kind;
type Table<T> = Handles<Kind, T>;

fn status<T>(found: Result<T, Failure>) -> Status {
    found.err().map_or(Status::MEISSNER_OK, |failure| failure.status())
}

#[test]
fn chunks_hold_every_slot_once() {
    let places: Vec<_> = (0..CHUNK * 15).map(place).collect();
    let expected = (0..4).flat_map(|chunk| (0..CHUNK << chunk).map(move |place| (chunk, place)));
    assert_eq!(places, expected.collect::<Vec<_>>());
    assert_eq!(place(CHUNK * ((1 << CHUNKS) - 1)), (CHUNKS, 0));
    const { assert!(CHUNK * ((1 << CHUNKS) - 1) < 1 << SLOT_BITS) };
}

#[test]
fn a_value_in_use_is_refused_and_comes_back_after() {
    let table = Table::new(1, "value");
    let handle = table.add(1).unwrap();
    let busy =
        table.with(handle, |_| Ok([status(table.with(handle, |_| Ok(()))), status(table.take(handle))]));
    assert_eq!(busy.unwrap(), [Status::MEISSNER_BUSY; 2]);
    assert_eq!(table.with(handle, |found| Ok(*found)).unwrap(), 1);
    assert_eq!(table.take(handle).unwrap(), 1);
}

#[test]
fn after_a_panic_the_value_is_refused_and_its_slot_serves_again_after_the_release() {
    let table = Table::new(1, "value");
    let handle = table.add(1).unwrap();
    let run = || table.with(handle, |_| -> Result<(), Failure> { panic!("on purpose") });
    assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).is_err());
    assert_eq!(status(table.with(handle, |_| Ok(()))), Status::MEISSNER_PANICKED);
    assert_eq!(status(table.take(handle)), Status::MEISSNER_PANICKED);
    table.release(handle);
    let other = table.add(2).unwrap();
    assert_eq!(table.with(other, |found| Ok(*found)).unwrap(), 2);
}

#[test]
fn a_handle_that_has_ended_stays_so_while_its_slot_serves_another() {
    let table = Table::new(1, "value");
    let old = table.add(1).unwrap();
    table.release(old);
    table.release(old);
    let new = table.add(2).unwrap();
    assert_eq!((index(old), status(table.get(old))), (index(new), Status::MEISSNER_CLOSED));
    assert_eq!(status(table.with(old, |_| Ok(()))), Status::MEISSNER_CLOSED);
    assert_eq!(status(table.take(old)), Status::MEISSNER_CLOSED);
    table.release(old);
    assert_eq!(table.get(new).unwrap(), 2);
}

#[test]
fn what_is_no_handle_is_refused() {
    let (table, others) = (Table::new(1, "value"), Table::new(2, "other"));
    let (handle, other) = (table.add(1).unwrap(), others.add(2).unwrap());
    let on_the_stack = 0_u64;
    let wrong = [null(), other, handle.wrapping_byte_add(1), handle.wrapping_byte_add(1 << 12)];
    for wrong in wrong.into_iter().chain([(&raw const on_the_stack).cast()]) {
        assert_eq!(status(table.get(wrong)), Status::MEISSNER_INVALID_ARGUMENT, "{wrong:p}");
        table.release(wrong);
    }
    assert_eq!((table.get(handle).unwrap(), others.get(other).unwrap()), (1, 2));
}

#[test]
fn a_release_waits_for_the_call_inside_and_lets_no_other_in() {
    struct Sends(*mut Kind);
    // SAFETY: a handle is a number, and nothing is stored at that address.
    unsafe impl Send for Sends {}

    let table = Table::new(1, "value");
    let (told, tells) = mpsc::channel();
    let handle = table.add(Told(told)).unwrap();
    thread::scope(|scope| {
        let within = table.with(handle, |_| {
            let sent = Sends(handle);
            let table = &table;
            scope.spawn(move || {
                let Sends(handle) = { sent };
                table.release(handle);
            });
            while status(table.with(handle, |_| Ok(()))) == Status::MEISSNER_BUSY {
                thread::yield_now();
            }
            assert_eq!(status(table.take(handle)), Status::MEISSNER_CLOSED);
            assert!(tells.recv_timeout(Duration::from_millis(20)).is_err(), "not while it is in use");
            Ok(())
        });
        within.unwrap();
    });
    tells.recv().expect("dropped by the release");
}

/// Sends a message when it is dropped.
struct Told(mpsc::Sender<()>);

impl Drop for Told {
    fn drop(&mut self) {
        self.0.send(()).expect("somebody listens");
    }
}

#[test]
fn more_than_a_hundredth_is_warned_of_and_a_hundredth_is_not() {
    let events = EventCounters { pushed: 1000, outside_sensor: 10, late: 11, ..EventCounters::default() };
    let found = warnings_of_losses(&events, Sensor::new(4, 4));
    assert!(found.len() == 1 && found[0].starts_with("11 of 1000 events are dropped, earlier"), "{found:?}");
    assert!(warnings_of_losses(&EventCounters::default(), Sensor::new(4, 4)).is_empty());
    let events = EventCounters { pushed: 1000, restarts: 2, outliers: 11, ..EventCounters::default() };
    let found = warnings_of_losses(&events, Sensor::new(4, 4));
    assert!(
        found.len() == 2 && found[0].starts_with("11 of 1000 events are dropped, far ahead"),
        "{found:?}"
    );
    assert!(found[1].starts_with("the clock of the sensor has restarted 2 times"), "{found:?}");
}
