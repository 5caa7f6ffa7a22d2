//! The interface against the engine: the same bits, no allocation, and one thread at a time.
#![allow(
    unsafe_code,
    reason = "what is tested takes raw pointers, and allocations are counted by an allocator"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::CStr;
use std::mem::offset_of;
use std::ptr::{null, null_mut};
use std::sync::LazyLock;

use meissner::{
    Description, Engine, EngineError, Event, EventCounters, LatePolicy, Network, Options, Outcome,
    Prediction, Predictor, RestartPolicy, Sensor, Weights,
};
use meissner_c::*;
use meissner_verify::conformance::{forgets, predicts, refuses_damage, resumes, takes_slices};
use meissner_verify::{Incremental, Script, strategies};
use proptest::prelude::*;

const NAME: &CStr = c"tactip-past";
const SENSOR: Sensor = Sensor { width: 40, height: 30 };
const OUTPUTS: usize = 3;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call goes unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// An engine of the interface, for this test's thread and others.
struct Handle(*mut meissner_engine);

// SAFETY: a handle may move between threads; calls that overlap are refused.
unsafe impl Send for Handle {}
// SAFETY: as above.
unsafe impl Sync for Handle {}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: the handle is not used again.
        unsafe { meissner_engine_release(self.0) };
    }
}

impl Handle {
    fn new(late: u32, restart: u32) -> Self {
        let options = meissner_engine_options {
            size: size_of::<meissner_engine_options>(),
            memory_limit: 0,
            tolerance: 0.0,
            late,
            restart: restart.into(),
        };
        let (mut network, mut engine) = (null_mut(), null_mut());
        // SAFETY: every pointer is valid.
        unsafe {
            assert_eq!(meissner_network_open(NAME.as_ptr(), null(), null(), &raw mut network), OK);
            let [width, height] = [SENSOR.width, SENSOR.height];
            assert_eq!(meissner_engine_new(network, width, height, &raw const options, &raw mut engine), OK);
            meissner_network_release(network);
        }
        Self(engine)
    }

    fn push_events(&self, events: &[meissner_event]) -> (meissner_status, usize) {
        let mut accepted = 0;
        // SAFETY: every pointer is valid.
        let status =
            unsafe { meissner_engine_push_events(self.0, events.as_ptr(), events.len(), &raw mut accepted) };
        (status, accepted)
    }

    fn push_arrays(&self, events: &[meissner_event]) -> (meissner_status, usize) {
        let t_us: Vec<i64> = events.iter().map(|event| event.t_us).collect();
        let pixels = |of: fn(&meissner_event) -> u16| events.iter().map(of).collect::<Vec<u16>>();
        let (x, y) = (pixels(|event| event.x), pixels(|event| event.y));
        let polarity: Vec<i8> = events.iter().map(|event| event.polarity).collect();
        let mut accepted = 0;
        // SAFETY: every pointer is valid.
        let status = unsafe {
            let [x, y] = [x.as_ptr(), y.as_ptr()];
            meissner_engine_push_arrays(
                self.0,
                t_us.as_ptr(),
                x,
                y,
                polarity.as_ptr(),
                t_us.len(),
                &raw mut accepted,
            )
        };
        (status, accepted)
    }

    fn push(&self, event: meissner_event) -> (meissner_status, bool) {
        let meissner_event { t_us, x, y, polarity } = event;
        let mut accepted = false;
        // SAFETY: every pointer is valid.
        let status = unsafe { meissner_engine_push(self.0, t_us, x, y, polarity, &raw mut accepted) };
        (status, accepted)
    }

    fn advance(&self, t_us: i64) -> meissner_status {
        // SAFETY: the handle is valid.
        unsafe { meissner_engine_advance(self.0, t_us) }
    }

    fn predict(&self) -> (meissner_status, [u32; OUTPUTS]) {
        let mut values = [0.0; OUTPUTS];
        // SAFETY: every pointer is valid.
        let status = unsafe { meissner_engine_predict(self.0, values.as_mut_ptr(), OUTPUTS, null_mut()) };
        (status, values.map(f32::to_bits))
    }

    fn counters(&self) -> meissner_counters {
        let mut counters: meissner_counters = zeros();
        // SAFETY: every pointer is valid.
        assert_eq!(unsafe { meissner_engine_counters(self.0, &raw mut counters) }, OK);
        counters
    }
}

/// The interface as an engine, for the claims of every engine.
struct Spoken {
    handle: Handle,
    values: [f32; OUTPUTS],
    /// Slices that were pushed.
    slices: usize,
}

impl Spoken {
    fn new(late: u32) -> Self {
        Self { handle: Handle::new(late, MEISSNER_RESTART_RESET), values: [0.0; OUTPUTS], slices: 0 }
    }
}

impl Predictor for Spoken {
    type Input = Event;

    /// Whether the event entered. If it did not, the interface gives no reason.
    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        let (status, entered) = self.handle.push(c_event(event));
        assert_eq!(status, OK);
        Ok(if entered { Outcome::Accepted } else { Outcome::Held })
    }

    /// Uses each way to push in turn.
    fn push_slice(&mut self, events: &[Event]) -> Result<(), EngineError> {
        let events: Vec<meissner_event> = events.iter().map(c_event).collect();
        let before = self.handle.counters().accepted;
        self.slices += 1;
        let (status, accepted) = match self.slices % 2 {
            0 => self.handle.push_events(&events),
            _ => self.handle.push_arrays(&events),
        };
        assert_eq!((status, accepted as u64), (OK, self.handle.counters().accepted - before));
        Ok(())
    }

    fn advance(&mut self, t_us: i64) {
        assert_eq!(self.handle.advance(t_us), OK);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        let mut of: meissner_prediction = zeros();
        // SAFETY: every pointer is valid.
        let status =
            unsafe { meissner_engine_predict(self.handle.0, self.values.as_mut_ptr(), OUTPUTS, &raw mut of) };
        assert_eq!(status, OK);
        let t_us = (of.has_time != 0).then_some(of.t_us);
        let unlike = Some(of.unlike).filter(|unlike| !unlike.is_nan());
        Ok(Prediction { values: &self.values, t_us, nodes: of.nodes as usize, rows: &[], unlike })
    }

    fn reset(&mut self) {
        // SAFETY: the handle is valid.
        assert_eq!(unsafe { meissner_engine_reset(self.handle.0) }, OK);
    }

    fn event_counters(&self) -> EventCounters {
        let counters = self.handle.counters();
        EventCounters {
            pushed: counters.pushed,
            accepted: counters.accepted,
            outside_sensor: counters.outside_sensor,
            late: counters.late,
            time_out_of_range: counters.time_out_of_range,
            outliers: counters.outliers,
            clamped: counters.clamped,
            expired: counters.expired,
            evicted: counters.evicted,
            restarts: counters.restarts,
            filtered: counters.filtered,
        }
    }
}

impl Incremental for Spoken {
    type Snapshot = Vec<u8>;

    fn snapshot(&self) -> Vec<u8> {
        self.to_bytes()
    }

    fn restore(&mut self, snapshot: &Vec<u8>) -> Result<(), EngineError> {
        self.restore_bytes(snapshot)
    }

    fn to_bytes(&self) -> Vec<u8> {
        let (mut bytes, mut length) = (Vec::new(), 0);
        // SAFETY: every pointer is valid.
        unsafe {
            meissner_engine_snapshot(self.handle.0, null_mut(), 0, &raw mut length);
            bytes.resize(length, 0);
            assert_eq!(
                meissner_engine_snapshot(self.handle.0, bytes.as_mut_ptr(), length, &raw mut length),
                OK
            );
        }
        bytes
    }

    fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        // SAFETY: the pointer points at `bytes.len()` bytes.
        match unsafe { meissner_engine_restore(self.handle.0, bytes.as_ptr(), bytes.len()) } {
            OK => Ok(()),
            meissner_status::MEISSNER_INVALID_SNAPSHOT => {
                let found = "bytes that the interface refuses".to_owned();
                Err(EngineError::Snapshot { what: "snapshot", expected: "its own".to_owned(), found })
            }
            other => panic!("{other:?}"),
        }
    }
}

/// A struct of the interface with zeros except for its size, its first field.
fn zeros<T>() -> T {
    // SAFETY: zeros are a value of every struct of the interface.
    unsafe {
        let mut made: T = std::mem::zeroed();
        (&raw mut made).cast::<usize>().write(size_of::<T>());
        made
    }
}

const OK: meissner_status = meissner_status::MEISSNER_OK;

static NETWORK: LazyLock<Network> = LazyLock::new(|| {
    let name = NAME.to_str().expect("UTF-8");
    let weights = Weights::shipped(name).expect("shipped weights");
    Description::shipped(name).expect("a shipped network").network(&weights).expect("its weights")
});

fn rust_event(event: &meissner_event) -> Event {
    (*event).into()
}

fn c_event(event: &Event) -> meissner_event {
    meissner_event { t_us: event.t_us, x: event.x, y: event.y, polarity: i8::from(event.on) }
}

/// Streams on and beside the sensor: steady ones, and some whose clock jumps.
fn script() -> impl Strategy<Value = Script> {
    prop_oneof![
        3 => strategies::script_on((SENSOR.width..=SENSOR.width, SENSOR.height..=SENSOR.height), 120),
        1 => strategies::unsteady_clock(150_000, 120),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_interface_keeps_the_claims_of_every_engine(
        script in script(), cuts in prop::collection::vec(1_usize..50, 1..9), clamp: bool, place in 0.0f64..1.0,
    ) {
        let (late, steps) = (if clamp { LatePolicy::Clamp } else { LatePolicy::Drop }, &script.steps);
        let mut engine = Engine::with_options(NETWORK.clone(), SENSOR, Options::new().with_late(late)).expect("an engine");
        let spoken = || Spoken::new(clamp.into());
        prop_assert_eq!(predicts(&mut spoken(), &mut engine, steps), Ok(()));
        prop_assert_eq!(takes_slices(spoken, steps, &cuts), Ok(()));
        prop_assert_eq!(forgets(spoken, steps), Ok(()));
        prop_assert_eq!(resumes(spoken, steps, (steps.len() as f64 * place) as usize), Ok(()));
        prop_assert_eq!(refuses_damage(spoken, steps, place, 3), Ok(()));
    }
}

/// Events all over the sensor, at a constant rate.
fn stream(length: i64) -> Vec<meissner_event> {
    let pixel = |i: i64, step: i64, size: u16| ((i * step + i / 7) % i64::from(size)) as u16;
    let event = |i| meissner_event {
        t_us: i * 100,
        x: pixel(i, 11, SENSOR.width),
        y: pixel(i, 5, SENSOR.height),
        polarity: (i % 2) as i8,
    };
    (0..length).map(event).collect()
}

#[test]
fn pushing_advancing_and_predicting_allocate_nothing() {
    let (handle, events) = (Handle::new(0, MEISSNER_RESTART_RESET), stream(9_000));
    let (mut values, mut prediction) = ([0.0; OUTPUTS], size_of::<meissner_prediction>());
    let arrays = (vec![0_i64; 8], vec![0_u16; 8], vec![0_i8; 8]);
    let before = COUNT.get();
    for (i, block) in events.chunks(256).enumerate() {
        assert_eq!(handle.push_events(block).0, OK);
        assert_eq!(handle.push(block[0]), (OK, false), "late");
        assert_eq!(handle.advance(i as i64 * 25_600 + 30_000), OK);
        // SAFETY: every pointer is valid. A struct with only its size comes from an older program.
        unsafe {
            let (t_us, x, polarity) = (arrays.0.as_ptr(), arrays.1.as_ptr(), arrays.2.as_ptr());
            assert_eq!(meissner_engine_push_arrays(handle.0, t_us, x, x, polarity, 8, null_mut()), OK);
            let of = (&raw mut prediction).cast();
            assert_eq!(meissner_engine_predict(handle.0, values.as_mut_ptr(), OUTPUTS, of), OK);
        }
    }
    assert_eq!(COUNT.get() - before, 0);
}

#[test]
fn the_filters_of_a_network_drop_and_count_what_they_do_in_rust() {
    let handle = Handle::new(0, MEISSNER_RESTART_RESET);
    let mut engine = Engine::new(NETWORK.clone(), SENSOR).expect("an engine");
    // Between the events of a stream, one pixel fires 10,000 times a second.
    let hot = |event: meissner_event| [event, meissner_event { x: 20, y: 15, ..event }];
    let events: Vec<meissner_event> = stream(3_000).into_iter().flat_map(hot).collect();
    let (status, accepted) = handle.push_events(&events);
    assert_eq!(status, OK);
    assert_eq!(accepted, engine.push_all(events.iter().map(rust_event)));
    let (counters, expected) = (handle.counters(), *engine.event_counters());
    assert_eq!((counters.pushed, counters.filtered), (6_000, expected.filtered));
    assert!((2_900..3_000).contains(&counters.filtered), "{counters:?}");
    let bits: Vec<u32> = engine.predict().expect("numbers").values.iter().map(|v| v.to_bits()).collect();
    assert_eq!(handle.predict(), (OK, bits.try_into().expect("as many")));
}

/// A stream, the same with the clock at 0 again, and a single time far ahead.
fn restarted() -> Vec<meissner_event> {
    let late = |event: &meissner_event| meissner_event { t_us: event.t_us + 60_000_000, ..*event };
    let mut events: Vec<_> = stream(3_000).iter().map(late).chain(stream(2_000)).collect();
    events.insert(4_000, meissner_event { t_us: i64::MAX / 2, ..events[4_000] });
    events
}

#[test]
fn an_engine_goes_on_with_the_restarted_clock_or_keeps_the_old_one_as_the_option_says() {
    for (restart, policy) in
        [(MEISSNER_RESTART_RESET, RestartPolicy::Reset), (MEISSNER_RESTART_KEEP, RestartPolicy::Keep)]
    {
        let mut expected = Engine::with_options(NETWORK.clone(), SENSOR, Options::new().with_restart(policy))
            .expect("an engine");
        let (handle, events) = (Handle::new(0, restart), restarted());
        for block in events.chunks(700) {
            let slice: Vec<Event> = block.iter().map(rust_event).collect();
            assert_eq!(handle.push_events(block), (OK, expected.push_slice(&slice)));
            let values = expected.predict().expect("numbers").values;
            assert_eq!(
                handle.predict().1[..],
                values.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
            );
        }
        let (found, events) = (handle.counters(), expected.counters().events);
        assert_eq!(
            (found.pushed, found.late, found.outliers, found.restarts),
            (events.pushed, events.late, events.outliers, events.restarts)
        );
        let resets = policy == RestartPolicy::Reset;
        assert_eq!((found.restarts, found.outliers, found.late == 0), (resets.into(), resets.into(), resets));

        // A program that was built before these counts existed has no room for them.
        // SAFETY: bytes of ones are a value of the struct.
        let mut older: meissner_counters =
            unsafe { std::mem::transmute([0xff_u8; size_of::<meissner_counters>()]) };
        older.size = offset_of!(meissner_counters, outliers);
        // SAFETY: every pointer is valid.
        assert_eq!(unsafe { meissner_engine_counters(handle.0, &raw mut older) }, OK);
        assert_eq!((older.pushed, older.outliers, older.restarts), (found.pushed, u64::MAX, u64::MAX));
    }
}

#[test]
fn a_live_prediction_says_what_the_engine_lost_and_that_the_clock_restarted() {
    let (handle, events) = (Handle::new(0, MEISSNER_RESTART_RESET), restarted());
    let (mut input, mut live) = (null_mut(), null_mut());
    let options = meissner_live_options { overload: MEISSNER_OVERLOAD_BLOCK, ..zeros() };
    // SAFETY: every pointer is valid.
    unsafe {
        assert_eq!(meissner_live_new(handle.0, &raw const options, &raw mut input, &raw mut live), OK);
        let mut told = Vec::new();
        for part in [
            &events[..3_000],
            &events[3_000..3_004],
            &events[3_004..4_000],
            &events[4_000..],
            &[events[3_500], meissner_event { x: 99, ..events[5_000] }],
        ] {
            assert_eq!(meissner_input_push_events(input, part.as_ptr(), part.len()), OK);
            let (mut values, mut timely): ([f32; OUTPUTS], meissner_timely) = ([0.0; OUTPUTS], zeros());
            assert_eq!(
                meissner_live_predict(live, u64::MAX, values.as_mut_ptr(), OUTPUTS, &raw mut timely),
                OK
            );
            told.push((timely.fresh, timely.lost_events, timely.dropped_events, timely.restarts));
        }
        // Four are held, and enter; one is far ahead; one is late, and one outside the sensor.
        let expected = [(1, 0, 0, 0), (0, 4, 0, 0), (1, 0, 0, 1), (0, 1, 0, 0), (0, 2, 0, 0)];
        assert_eq!(told, expected);
        let mut counters: meissner_counters = zeros();
        assert_eq!(meissner_live_event_counters(live, &raw mut counters), OK);
        assert_eq!((counters.accepted, counters.late, counters.outside_sensor), (5_000, 1, 1));
        assert_eq!((counters.outliers, counters.restarts, counters.predictions), (1, 1, 0));
        meissner_input_release(input);
        meissner_live_release(live);
    }
}

#[test]
fn a_call_that_overlaps_another_is_refused_and_counts_nothing() {
    let (handle, events) = (Handle::new(0, MEISSNER_RESTART_RESET), stream(400));
    let done: u64 = std::thread::scope(|scope| {
        let push = || {
            let found = events.iter().map(|&event| handle.push(event).0);
            let statuses: Vec<meissner_status> = found.collect();
            assert!(statuses.iter().all(|status| [OK, meissner_status::MEISSNER_BUSY].contains(status)));
            statuses.iter().filter(|&&status| status == OK).count() as u64
        };
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(push)).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).sum()
    });
    assert_eq!(handle.counters().pushed, done);
    assert_eq!(handle.predict().0, OK);
}

#[test]
fn texts_of_failures_belong_to_their_thread() {
    let text = || {
        // SAFETY: the text is read before another call fails.
        unsafe { CStr::from_ptr(meissner_error_text()) }.to_string_lossy().into_owned()
    };
    let mut network = null_mut();
    // SAFETY: every pointer is valid.
    let status = unsafe { meissner_network_open(c"no-such".as_ptr(), null(), null(), &raw mut network) };
    assert_eq!(status, meissner_status::MEISSNER_NOT_FOUND);
    assert!(text().contains("\"no-such\"") && network.is_null(), "{}", text());
    assert_eq!(std::thread::spawn(text).join().expect("no panic"), "");
}
