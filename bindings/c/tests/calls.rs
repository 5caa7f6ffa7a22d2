//! The interface against the engine: the same bits, no allocation, and one thread at a time.
#![allow(
    unsafe_code,
    reason = "what is tested takes raw pointers, and allocations are counted by an allocator"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::CStr;
use std::ptr::{null, null_mut};
use std::sync::LazyLock;

use meissner::{Description, Engine, Event, LatePolicy, Network, Options, Sensor, Weights};
use meissner_c::*;
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

// SAFETY: every call goes to the system's allocator as it came.
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

// SAFETY: the interface says that a handle may move between threads, and refuses calls that overlap.
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
    fn new(late: u32) -> Self {
        let options = meissner_engine_options {
            size: size_of::<meissner_engine_options>(),
            memory_limit: 0,
            tolerance: 0.0,
            late,
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
        // SAFETY: zeros are a value of the struct.
        let mut counters: meissner_counters = unsafe { std::mem::zeroed() };
        counters.size = size_of::<meissner_counters>();
        // SAFETY: every pointer is valid.
        assert_eq!(unsafe { meissner_engine_counters(self.0, &raw mut counters) }, OK);
        counters
    }
}

const OK: meissner_status = meissner_status::MEISSNER_OK;

static NETWORK: LazyLock<Network> = LazyLock::new(|| {
    let name = NAME.to_str().expect("UTF-8");
    let weights = Weights::shipped(name).expect("shipped weights");
    Description::shipped(name).expect("a shipped network").network(&weights).expect("its weights")
});

fn rust_event(event: &meissner_event) -> Event {
    Event::new(event.t_us, event.x, event.y, event.polarity > 0)
}

/// Events on and beside the sensor, many on one pixel, at times that stand still, go back and jump over the window.
fn events() -> impl Strategy<Value = Vec<meissner_event>> {
    let step = prop_oneof![8 => 0..2_000_i64, 1 => -3_000..0_i64, 1 => 200_000..500_000_i64];
    let pixel = prop_oneof![3 => (0..44_u16, 0..33_u16), 1 => Just((7, 7))];
    prop::collection::vec((step, pixel, any::<i8>()), 0..80).prop_map(|found| {
        let mut now = -5_000;
        let event = |(step, (x, y), polarity)| {
            now += step;
            meissner_event { t_us: now, x, y, polarity }
        };
        found.into_iter().map(event).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn every_way_of_pushing_gives_the_bits_of_the_engine(blocks in prop::collection::vec(events(), 1..6), clamp: bool) {
        let late = if clamp { LatePolicy::Clamp } else { LatePolicy::Drop };
        let mut expected = Engine::with_options(NETWORK.clone(), SENSOR, Options::new().with_late(late)).expect("an engine");
        let handle = Handle::new(clamp.into());
        for (i, block) in blocks.iter().enumerate() {
            let slice: Vec<Event> = block.iter().map(rust_event).collect();
            let accepted = expected.push_slice(&slice);
            let found = match i % 3 {
                0 => handle.push_events(block),
                1 => handle.push_arrays(block),
                // Events that were held enter with a later one, whose call tells of itself alone.
                _ => {
                    let before = handle.counters().accepted;
                    let all = block.iter().all(|&event| handle.push(event).0 == OK);
                    assert!(all);
                    (OK, (handle.counters().accepted - before) as usize)
                }
            };
            prop_assert_eq!(found, (OK, accepted));
            if let (Some(now), true) = (expected.now_us(), i % 2 == 0) {
                expected.advance(now + 40_000);
                prop_assert_eq!(handle.advance(now + 40_000), OK);
            }
            let values: Vec<u32> = expected.predict().expect("numbers").values.iter().map(|value| value.to_bits()).collect();
            let (status, found) = handle.predict();
            prop_assert_eq!((status, &found[..]), (OK, &values[..]));
        }
        let (counters, events) = (handle.counters(), expected.counters().events);
        prop_assert_eq!(
            [counters.pushed, counters.accepted, counters.outside_sensor, counters.late, counters.clamped, counters.expired],
            [events.pushed, events.accepted, events.outside_sensor, events.late, events.clamped, events.expired]
        );
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
    let (handle, events) = (Handle::new(0), stream(9_000));
    let (mut values, mut prediction) = ([0.0; OUTPUTS], size_of::<meissner_prediction>());
    let arrays = (vec![0_i64; 8], vec![0_u16; 8], vec![0_i8; 8]);
    let before = COUNT.get();
    for (i, block) in events.chunks(256).enumerate() {
        assert_eq!(handle.push_events(block).0, OK);
        assert_eq!(handle.push(block[0]), (OK, false), "late");
        assert_eq!(handle.advance(i as i64 * 25_600 + 30_000), OK);
        // SAFETY: every pointer is valid. A struct of its size alone is one of an older program.
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
fn a_call_that_overlaps_another_is_refused_and_counts_nothing() {
    let (handle, events) = (Handle::new(0), stream(400));
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
