//! An engine allocates all its memory when it is made; the amount is checked.
#![allow(unsafe_code, reason = "a global allocator cannot be written without; this one only counts")]

mod frames;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use meissner_engine::filters::{
    BackgroundActivity, Chain, EventFilter, Filter, RateLimit, Refractory, Stride,
};
use meissner_engine::{
    Engine, EngineError, Event, EventCounters, Network, Normalisation, Options, Outcome, Prediction, Sensor,
    StaleReadout, Staleness,
};
use meissner_live::{Live, Overload, Predictor, QueueOptions};
use meissner_models::{Description, Weights};
use meissner_tests::shared::find_shared;
use meissner_tests::snapshots::sealed;
use meissner_verify::Random;

/// The system's allocator, counted.
struct Counting;

// For each thread separately: the harness allocates in its own thread when another test ends.
thread_local! {
    /// Number of allocations.
    static COUNT: Cell<u64> = const { Cell::new(0) };
    /// Bytes allocated and not freed.
    static HELD: Cell<i64> = const { Cell::new(0) };
    /// Maximum of `HELD`.
    static PEAK: Cell<i64> = const { Cell::new(0) };
}
/// Held by each test, because allocations of a parallel test would be counted too.
static ALONE: Mutex<()> = Mutex::new(());

/// Counts an allocation. After the thread's end there is no counter, and none is needed.
fn count_one() {
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

fn hold(bytes: i64) {
    let _ = HELD.try_with(|held| held.set(held.get() + bytes));
    let _ = PEAK.try_with(|peak| peak.set(peak.get().max(held_bytes())));
}

fn held_bytes() -> i64 {
    HELD.try_with(Cell::get).unwrap_or(0)
}

/// The result of `run`, the additional bytes that this thread then holds, and their maximum during
/// the run.
fn measured<T>(run: impl FnOnce() -> T) -> (T, [u64; 2]) {
    let before = held_bytes();
    PEAK.set(before);
    let result = run();
    let more = |bytes: i64| (bytes - before).max(0) as u64;
    (result, [more(held_bytes()), more(PEAK.get())])
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count_one();
        hold(layout.size() as i64);
        // SAFETY: the caller's promise about `layout` is the one that the allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        hold(-(layout.size() as i64));
        // SAFETY: `pointer` came from `alloc` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count_one();
        hold(size as i64);
        hold(-(layout.size() as i64));
        // SAFETY: as for `dealloc`, and the caller's promise about `size` is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Marker dots that appear and vanish in bursts, used if there is no recording.
fn synthetic() -> (Sensor, Vec<Event>) {
    let mut random = Random::new(4);
    let mut t = 0;
    let event = |i: i64| {
        t += if i % 5_000 < 4_000 { 20 } else { 300 };
        let (dot, dx, dy) = (random.below(30), random.below(9), random.below(9));
        Event::new(t, (dot % 6 * 36 + dx) as u16, (dot / 6 * 34 + dy) as u16, random.below(2) == 0)
    };
    (Sensor::new(240, 180), (0..30_000).map(event).collect())
}

/// A shipped network, by default with its own capacity.
fn shipped(name: &str, capacity: Option<usize>) -> Arc<Network> {
    let description = Description::shipped(name).expect("a shipped network");
    let network = description.network(&Weights::shipped(name).expect("shipped weights"));
    let mut parts = network.expect("the weights fit").parts().clone();
    parts.capacity = capacity.unwrap_or(parts.capacity);
    Arc::new(Network::new(parts).expect("parts that fit"))
}

/// All shipped networks that run event by event.
fn incremental() -> impl Iterator<Item = &'static str> {
    let names = Description::shipped_names().iter().copied();
    names.filter(|&name| shipped(name, None).parts().normalisation == Normalisation::Fixed)
}

#[test]
fn nothing_is_allocated_over_a_recording_from_its_first_event_on() {
    let _alone = ALONE.lock();
    let (sensor, events) = match find_shared("data/events/tactile_dots.aedat4") {
        Some(path) => {
            let recording = meissner_io::read(&path).expect("a readable recording");
            (recording.sensor.expect("AEDAT4 names its geometry"), recording.events)
        }
        None => synthetic(),
    };
    for name in ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"] {
        let mut engine = Engine::new(shipped(name, None), sensor).expect("exact");
        let before = COUNT.get();
        for (i, &event) in events.iter().enumerate() {
            engine.push(event);
            if i % 1_000 == 0 {
                engine.predict().expect("finite");
            }
        }
        assert_eq!(COUNT.get() - before, 0, "{name}");
    }
}

#[test]
fn two_threads_that_share_rows_allocate_nothing_after_their_first() {
    let _alone = ALONE.lock();
    let (sensor, events) = synthetic();
    let options = Options::new().with_all_shared();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    for name in ["graphres", "tactigraph-frozen"] {
        let mut engine = Engine::with_options(shipped(name, None), sensor, options).expect("exact");
        let [first, later] = [&events[..500], &events[500..2_000]].map(|events| {
            pool.install(|| {
                let before = COUNT.get();
                for event in events {
                    engine.push(*event);
                    engine.predict().expect("finite");
                }
                COUNT.get() - before
            })
        });
        println!("{name}: {first} allocations in the first 500 events, {later} in 1,500 more");
        assert_eq!(later, 0, "{name}");
    }
}

/// Scenes that are unlike any recording; each stresses one part of an engine.
#[derive(Clone, Copy, Debug)]
enum Scene {
    /// A hot spot that stays for a while in one cell of the search grid, then in the next.
    HotSpot,
    OnePixel,
    /// A line across the sensor, moving along it.
    Edge,
    Noise,
    /// Noise with one time stamp for all.
    AtOnce,
    /// Noise in bursts of one time stamp each: neighbours are far away.
    Bursts,
    /// A while without events, then many.
    SilenceThenBurst,
    /// Pixels as far apart as possible.
    Corners,
}

impl Scene {
    const ALL: [Self; 8] = [
        Self::HotSpot,
        Self::OnePixel,
        Self::Edge,
        Self::Noise,
        Self::AtOnce,
        Self::Bursts,
        Self::SilenceThenBurst,
        Self::Corners,
    ];

    /// Event `i` of the scene, which begins at `start`.
    fn event(self, i: i64, start: i64, sensor: Sensor, random: &mut Random) -> Event {
        let (width, height) = (u64::from(sensor.width), u64::from(sensor.height));
        let anywhere = [random.below(width), random.below(height)];
        let along = i as u64 / 60;
        let (t, [x, y]) = match self {
            Self::HotSpot => {
                let corner = [along * 8 % width, along * 8 / width * 8 % height];
                (i * 40, [corner[0] + random.below(8), corner[1] + random.below(8)])
            }
            Self::OnePixel => (i * 7, [width / 2, height / 2]),
            Self::Edge => {
                let row = random.below(height);
                (i * 90, [(along + row * width / height) % width, row])
            }
            Self::Noise => (i * 333, anywhere),
            Self::AtOnce => (0, anywhere),
            Self::Bursts => (i / 100 * 9_001, anywhere),
            Self::SilenceThenBurst => (i + i / 200 * 149_999, anywhere),
            Self::Corners => (i * 50, [i as u64 % 2 * (width - 1), i as u64 / 2 % 2 * (height - 1)]),
        };
        Event::new(start + t, x.min(width - 1) as u16, y.min(height - 1) as u16, random.below(2) == 0)
    }
}

/// Runs all scenes; returns the number of allocations meanwhile.
fn through_all_scenes(engine: &mut Engine, events: i64, every: i64) -> u64 {
    let mut random = Random::new(4);
    let before = COUNT.get();
    for (scene, start) in Scene::ALL.into_iter().zip((0..).step_by(100_000_000)) {
        for i in 0..events {
            engine.push(scene.event(i, start, engine.sensor(), &mut random));
            if i % every == 0 {
                engine.predict().expect("finite");
            }
        }
        // Half of the window leaves together, or all of it.
        match scene {
            Scene::Noise | Scene::Edge => {
                let now = engine.now_us().expect("events");
                engine.advance(now + engine.network().parts().span_us * 9 / 10);
            }
            Scene::OnePixel => engine.reset(),
            _ => {}
        }
        engine.predict().expect("finite");
    }
    COUNT.get() - before
}

#[test]
fn nothing_is_allocated_after_new_in_adversarial_scenes_of_every_shipped_network() {
    let _alone = ALONE.lock();
    for name in incremental() {
        for (sensor, capacity, events, every) in [
            (Sensor::new(34, 34), Some(50), 300, 1),
            (Sensor::new(240, 180), Some(700), 1_000, 100),
            (Sensor::new(1_280, 720), None, 600, 31),
        ] {
            let mut engine = Engine::new(shipped(name, capacity), sensor).expect("exact");
            let count = through_all_scenes(&mut engine, events, every);
            assert_eq!(count, 0, "{name} on {sensor} with a capacity of {capacity:?}");
        }
    }
}

#[test]
fn nothing_is_allocated_after_a_return_to_a_snapshot() {
    let _alone = ALONE.lock();
    for name in ["graphres", "tactigraph-past", "tactigraph-frozen"] {
        let mut engine = Engine::new(shipped(name, Some(300)), Sensor::new(240, 180)).expect("exact");
        let snapshot = engine.snapshot();
        engine.restore(&snapshot).expect("its own snapshot");
        assert_eq!(through_all_scenes(&mut engine, 600, 10), 0, "{name}, from a snapshot");
        let mut engine = Engine::new(shipped(name, Some(300)), Sensor::new(240, 180)).expect("exact");
        engine.restore_bytes(&snapshot.to_bytes()).expect("a snapshot of an equal network");
        assert_eq!(through_all_scenes(&mut engine, 600, 10), 0, "{name}, from bytes");
    }
}

#[test]
fn a_hot_spot_over_40_cells_takes_no_more_memory_than_over_4() {
    let _alone = ALONE.lock();
    for name in ["graphres", "tactigraph-past", "tactigraph-frozen"] {
        let network = shipped(name, Some(1_024));
        let [few, many] = [4, 40].map(|cells| {
            let spot = measured(|| {
                let mut engine = Engine::new(Arc::clone(&network), Sensor::new(1_280, 720)).expect("exact");
                for i in 0..cells * 200 {
                    let (cell, pixel) = (i / 200, i % 64);
                    let (x, y) = (cell % 20 * 8 + pixel % 8, cell / 20 * 8 + pixel / 8);
                    engine.push(Event::new(i.into(), x, y, i % 3 == 0));
                    if i % 500 == 0 {
                        engine.predict().expect("finite");
                    }
                }
                engine
            });
            spot.1
        });
        println!("{name}: {few:?} bytes held and at most over 4 cells, {many:?} over 40");
        assert_eq!(few, many, "{name}");
    }
}

#[test]
fn an_engine_takes_at_most_the_bytes_that_it_tells_and_at_least_four_fifths_of_them() {
    let _alone = ALONE.lock();
    let sensors = [(34, 34), (240, 180), (346, 260), (1_280, 720)];
    for name in incremental() {
        let network = shipped(name, None);
        for (width, height) in sensors {
            let (engine, [taken, _]) =
                measured(|| Engine::new(Arc::clone(&network), Sensor::new(width, height)).expect("exact"));
            let taken = u128::from(taken);
            let told = engine.state_bytes();
            println!("{name} on {width} x {height}: {taken} bytes taken, {told} told");
            assert!(taken <= told && told * 4 <= taken * 5, "{name} on {width} x {height}");
        }
    }
}

/// An engine that reports the allocations of its thread.
struct Watched(Engine, Arc<AtomicU64>);

impl Predictor for Watched {
    type Input = Event;

    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        Ok(self.0.push(*event))
    }

    fn push_slice(&mut self, events: &[Event]) -> Result<(), EngineError> {
        self.0.push_slice(events);
        Ok(())
    }

    fn advance(&mut self, t_us: i64) {
        self.0.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.1.store(COUNT.get(), Ordering::Relaxed);
        self.0.predict()
    }

    fn reset(&mut self) {
        self.0.reset();
    }

    fn event_counters(&self) -> EventCounters {
        *self.0.event_counters()
    }
}

#[test]
fn behind_a_queue_a_second_pass_allocates_nothing_on_either_side() {
    let _alone = ALONE.lock();
    let (sensor, events) = synthetic();
    let description = Description::shipped("tactigraph-past").expect("a shipped network");
    let network = description.network(&Weights::shipped("tactigraph-past").expect("shipped weights"));
    let engine = Engine::new(network.expect("the weights fit"), sensor).expect("exact");
    let theirs = Arc::new(AtomicU64::new(0));
    let filter = BackgroundActivity::new(sensor, 1_250).expect("admissible");
    // Room for all events of a pass, so that the accepted events do not depend on the worker's
    // speed.
    let options = QueueOptions::new()
        .with_capacity(1 << 16)
        .with_overload(Overload::Filter(Chain::new(vec![Filter::BackgroundActivity(filter)])));
    let (mut input, mut live) = Live::spawn(Watched(engine, Arc::clone(&theirs)), options).expect("a thread");
    // The first prediction is computed in this thread; from here on the worker counts.
    live.predict(Duration::MAX).expect("finite");
    let span = events[events.len() - 1].t_us - events[0].t_us;
    let mut shifted = events.clone();
    let mut pass = |shift: i64| {
        shifted.iter_mut().zip(&events).for_each(|(to, event)| to.t_us = event.t_us + shift);
        let before = (COUNT.get(), theirs.load(Ordering::Relaxed));
        for events in shifted.chunks(1_000) {
            input.push_slice(events).expect("the worker lives");
            input.advance(events[events.len() - 1].t_us);
            live.predict(Duration::MAX).expect("finite");
        }
        (COUNT.get() - before.0, theirs.load(Ordering::Relaxed) - before.1)
    };
    let [first, second] = [0, span + 10 * 150_000].map(&mut pass);
    println!("{first:?} allocations here and there in the first pass, {second:?} in the second");
    assert_eq!(second, (0, 0));
}

#[test]
fn a_third_pass_through_filters_a_tolerance_and_a_stale_readout_allocates_nothing() {
    let _alone = ALONE.lock();
    let (sensor, events) = synthetic();
    let description = Description::shipped("graphres").expect("a shipped network");
    let network = description.network(&Weights::shipped("graphres").expect("shipped weights"));
    let options = Options::new().with_tolerance(1e-3).with_record_rows(true);
    let engine = Engine::with_options(network.expect("the weights fit"), sensor, options).expect("exact");
    let bound = Staleness::new().with_events(300).with_us(20_000);
    let mut readout = StaleReadout::new(engine, bound).expect("admissible");
    let us = BackgroundActivity::DEFAULT_US;
    let mut chain = Chain::new(vec![
        Filter::BackgroundActivity(BackgroundActivity::new(sensor, 40 * us).expect("admissible")),
        Filter::Refractory(Refractory::new(sensor, 500).expect("admissible")),
        Filter::RateLimit(RateLimit::new(30_000).expect("admissible")),
        Filter::Stride(Stride::new(2).expect("admissible")),
    ]);
    let span = events[events.len() - 1].t_us - events[0].t_us;
    let mut pass = |shift: i64| {
        let before = COUNT.get();
        // So that the same events pass.
        chain.reset();
        for (i, &event) in events.iter().enumerate() {
            let event = Event { t_us: event.t_us + shift, ..event };
            if chain.admit(event) {
                readout.push(event);
            }
            if i % 100 == 0 {
                readout.predict().expect("finite");
            }
        }
        COUNT.get() - before
    };
    // State that stays from one pass to the next shifts the times at which pooled levels are
    // computed: warm up twice.
    let [first, second, third] = [0, 1, 2].map(|i| pass(i * (span + 10 * 150_000)));
    println!("{first} allocations in the first pass, {second} in the second, {third} in the third");
    assert_eq!(third, 0);
    assert!(chain.filters().iter().all(|filter| filter.counters().dropped > 0));
    assert!(readout.stale() > 0);
}

#[test]
fn a_full_window_of_32768_events_takes_less_than_64_mib() {
    let _alone = ALONE.lock();
    let (sensor, mut events) = synthetic();
    events.extend_from_within(..5_000);
    let description = Description::shipped("tactigraph").expect("a shipped network");
    let network = description.network(&Weights::shipped("tactigraph").expect("shipped weights"));
    let network = network.expect("the weights fit");
    let (engine, [held, _]) = measured(|| {
        let mut engine = Engine::new(network, sensor).expect("exact");
        // All at one instant: none expires, and the window fills up. No pixel fires twice.
        for (i, event) in events.into_iter().enumerate() {
            let [x, y] = [i % usize::from(sensor.width), i / usize::from(sensor.width)].map(|at| at as u16);
            engine.push(Event { t_us: 0, x, y, ..event });
        }
        engine.predict().expect("finite");
        engine
    });
    println!("{held} bytes held, {} bytes of state foreseen", engine.state_bytes());
    assert_eq!(engine.nodes(), 32_768);
    assert!(held < 64 << 20, "{held} bytes");
    let foreseen = engine.state_bytes();
    assert!((foreseen * 4 / 5..=foreseen).contains(&held.into()), "{held} bytes");
}

#[test]
fn lengths_that_were_made_up_take_no_more_than_one_more_engine() {
    let _alone = ALONE.lock();
    let (sensor, events) = synthetic();
    for name in ["tactigraph-past", "tactigraph-frozen"] {
        let description = Description::shipped(name).expect("a shipped network");
        let network = description.network(&Weights::shipped(name).expect("shipped weights"));
        let options = Options::new().with_tolerance(0.01);
        let mut engine =
            Engine::with_options(network.expect("the weights fit"), sensor, options).expect("admissible");
        engine.push_slice(&events[..500]);
        engine.predict().expect("finite");
        let bytes = engine.to_bytes();
        let mut worst = 0;
        for at in (32..700).step_by(16).chain((700..bytes.len() - 24).step_by(bytes.len() / 20)) {
            let mut wrong = bytes.clone();
            wrong[at..at + 8].copy_from_slice(&(1u64 << 63).to_le_bytes());
            let wrong = sealed(wrong);
            let (refused, [_, most]) = measured(|| engine.restore_bytes(&wrong));
            worst = worst.max(most);
            if refused.is_ok() {
                engine.restore_bytes(&bytes).expect("its own bytes");
            }
        }
        println!("{name}: {worst} bytes at most, {} bytes of state foreseen", engine.state_bytes());
        assert!(u128::from(worst) < engine.state_bytes() * 5 / 4, "{name}: {worst} bytes");
    }
}
