//! Live engines: a bounded queue, a thread that owns the engine, and predictions by a deadline.

use std::sync::Arc;
use std::time::Duration;

use meissner::live::{Input, Live, Overload, QueueCounters, QueueOptions};
use meissner::{Engine, Event};

use crate::arguments::{Versioned, array, options, place, report, report_if_wanted, room};
use crate::engine::{ENGINES, Made, from_arrays, meissner_counters, meissner_engine, meissner_event};
use crate::handles::Handles;
use crate::network::{Loaded, number};
use crate::status::{Failure, call, meissner_status};

/// The sensor's side of a live engine. One thread at a time.
pub struct meissner_input(());

/// The controller's side of a live engine. One thread at a time.
pub struct meissner_live(());

static INPUTS: Handles<meissner_input, Input> = Handles::with_threads(4, "input");
static LIVES: Handles<meissner_live, Controller> = Handles::with_threads(5, "live");

struct Controller {
    live: Live<Engine>,
    outputs: usize,
    network: Arc<Loaded>,
}

/// When the queue is full, the oldest waiting event is dropped.
pub const MEISSNER_OVERLOAD_DROP_OLDEST: u32 = 0;
/// When the queue is full, the thread that pushes waits: nothing is dropped.
pub const MEISSNER_OVERLOAD_BLOCK: u32 = 1;
/// When the queue is full, new events are dropped.
pub const MEISSNER_OVERLOAD_DROP_NEWEST: u32 = 2;
/// From half full until a quarter full, the queue takes one of every `stride` events.
pub const MEISSNER_OVERLOAD_THIN: u32 = 3;

/// Options of a live engine. 0 is the default of each.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_live_options {
    /// `sizeof(meissner_live_options)`.
    pub size: usize,
    /// Maximum number of waiting events, of 16 bytes each; 0 for 65,536.
    pub capacity: u64,
    /// Maximum number of events that the engine takes before it checks whether a prediction is due;
    /// 0 for 64.
    pub batch: u64,
    /// MEISSNER_OVERLOAD_DROP_OLDEST or another MEISSNER_OVERLOAD constant.
    pub overload: u32,
    /// Used with MEISSNER_OVERLOAD_THIN; at least 1.
    pub stride: u32,
    /// 1 if the engine computes while no event waits and no prediction is requested: answers come
    /// sooner, and more is computed in total.
    pub ahead: u64,
}

// SAFETY: `repr(C)` with only integers, the first of which is the size.
unsafe impl Versioned for meissner_live_options {}

/// Facts about a live prediction, and its age.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_timely {
    /// `sizeof(meissner_timely)`, set by the caller.
    pub size: usize,
    /// Time of the newest event that it covers; 0 before the first.
    pub t_us: i64,
    /// Events in the window.
    pub nodes: u64,
    /// Events that had been pushed at the time of the call and are not covered.
    pub behind_events: u64,
    /// Stream time in microseconds from the last covered event to the last one that had been
    /// pushed.
    pub behind_us: u64,
    /// Nanoseconds since its computation began.
    pub age_ns: u64,
    /// Nanoseconds since the call.
    pub waited_ns: u64,
    /// 1 if an event has set `t_us`.
    pub has_time: u32,
    /// 1 if it covers every event that had been pushed, except those that the queue dropped: no
    /// event waits, and the engine has lost none.
    pub fresh: u32,
    /// 1 if it was computed for this call, 0 if it is the newest prediction that was finished by
    /// the deadline.
    pub own: u32,
    /// Events since the previous prediction that the engine received and that this one does not
    /// cover: late, outside the sensor, far ahead, or held until it is clear whether the sensor's
    /// clock has restarted.
    pub lost_events: u64,
    /// Events that the queue dropped since the previous prediction.
    pub dropped_events: u64,
    /// Restarts of the sensor's clock since the previous prediction, each of which reset the
    /// engine.
    pub restarts: u64,
    /// How much the window differs from those of the training, as in `meissner_prediction`.
    pub unlike: f32,
}

// SAFETY: `repr(C)` with only numbers, the first of which is the size.
unsafe impl Versioned for meissner_timely {}

/// Counts of pushed events. `offered` is the sum of `delivered`, `waiting` and the dropped ones.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_queue_counters {
    /// `sizeof(meissner_queue_counters)`, set by the caller.
    pub size: usize,
    /// Events pushed.
    pub offered: u64,
    /// Events that the engine took.
    pub delivered: u64,
    /// Events that are waiting.
    pub waiting: u64,
    /// Dropped to make room for a newer one.
    pub dropped_oldest: u64,
    /// Dropped for lack of room.
    pub dropped_newest: u64,
    /// Dropped by thinning.
    pub thinned: u64,
    /// Maximum number of events that have waited at the same time.
    pub high_water: u64,
    /// Nanoseconds for which the thread that pushes has waited for room.
    pub blocked_ns: u64,
}

// SAFETY: `repr(C)` with only integers, the first of which is the size.
unsafe impl Versioned for meissner_queue_counters {}

fn queue_options(options: meissner_live_options) -> Result<QueueOptions, Failure> {
    let overload = match options.overload {
        MEISSNER_OVERLOAD_DROP_OLDEST => Overload::DropOldest,
        MEISSNER_OVERLOAD_BLOCK => Overload::Block,
        MEISSNER_OVERLOAD_DROP_NEWEST => Overload::DropNewest,
        MEISSNER_OVERLOAD_THIN => Overload::Thin { stride: options.stride },
        found => return Err(Failure::argument("overload", "0 to 3", found)),
    };
    let ahead = match options.ahead {
        0 => false,
        1 => true,
        found => return Err(Failure::argument("ahead", "0 or 1", found)),
    };
    let mut made = QueueOptions::new().with_overload(overload).with_ahead(ahead);
    if options.capacity != 0 {
        made = made.with_capacity(number(options.capacity, "capacity")?);
    }
    Ok(if options.batch == 0 { made } else { made.with_batch(number(options.batch, "batch")?) })
}

/// Starts a thread that owns an engine and reads from a queue. `input` is for the thread that has
/// the events, `live` for the thread that needs predictions. The live engine starts in the current
/// state of `engine`, which stays the caller's. `options` may be NULL. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_live_new(
    engine: *const meissner_engine,
    options: *const meissner_live_options,
    input: *mut *mut meissner_input,
    live: *mut *mut meissner_live,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (places, options) =
            unsafe { ((place(input, "input")?, place(live, "live")?), self::options(options, "options")?) };
        let options = queue_options(options)?;
        let (engine, network) =
            ENGINES.with(engine, |made| Ok((made.engine.clone(), Arc::clone(&made.network))))?;
        let outputs = engine.network().outputs();
        let (theirs, live) = Live::spawn(engine, options)?;
        let (theirs, live) = (INPUTS.add(theirs)?, LIVES.add(Controller { live, outputs, network })?);
        places.0.write(theirs);
        places.1.write(live);
        Ok(())
    })
}

/// Pushes `length` events in order: each enters the queue, or is dropped and counted. Waits only
/// with MEISSNER_OVERLOAD_BLOCK.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_input_push_events(
    input: *const meissner_input,
    events: *const meissner_event,
    length: usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let events = unsafe { array(events, length, "events") }?;
        INPUTS.with(input, |input| push_all(input, events.iter().map(|&event| event.into())))
    })
}

/// As `meissner_input_push_events`, from arrays like those of `meissner_engine_push_arrays`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_input_push_arrays(
    input: *const meissner_input,
    t_us: *const i64,
    x: *const u16,
    y: *const u16,
    polarity: *const i8,
    length: usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let events = unsafe { from_arrays(t_us, x, y, polarity, length) }?;
        INPUTS.with(input, |input| push_all(input, events))
    })
}

/// Pushes events through a small array, because the queue takes slices.
fn push_all(input: &mut Input, mut events: impl Iterator<Item = Event>) -> Result<(), Failure> {
    let mut chunk = [Event::new(0, 0, 0, false); 256];
    loop {
        let mut length = 0;
        for (place, event) in chunk.iter_mut().zip(events.by_ref()) {
            *place = event;
            length += 1;
        }
        if length == 0 {
            return Ok(());
        }
        input.push_slice(&chunk[..length])?;
    }
}

/// Advances the clock to `t_us` after the events pushed so far. No earlier event may follow: it
/// would be late.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_input_advance(input: *const meissner_input, t_us: i64) -> meissner_status {
    call(|| INPUTS.act(input, |input| input.advance(t_us)))
}

/// Gives the prediction for all events pushed so far or, after `deadline_ns` nanoseconds, the
/// newest finished prediction, with its age; UINT64_MAX waits for all events. Writes the network's
/// outputs to `values`, which has room for `length` values, and facts about the prediction to
/// `timely`, which may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_live_predict(
    live: *const meissner_live,
    deadline_ns: u64,
    values: *mut f32,
    length: usize,
    timely: *mut meissner_timely,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (values, timely) =
            unsafe { (room(values, length, "values")?, report_if_wanted(timely, "timely")?) };
        let deadline =
            if deadline_ns == u64::MAX { Duration::MAX } else { Duration::from_nanos(deadline_ns) };
        LIVES.with(live, |Controller { live, outputs, .. }| {
            values.fits(*outputs)?;
            let found = live.predict(deadline)?;
            let of = meissner_timely {
                size: 0,
                t_us: found.t_us.unwrap_or(0),
                nodes: found.nodes as u64,
                behind_events: found.behind_events,
                behind_us: found.behind_us,
                age_ns: nanoseconds(found.age),
                waited_ns: nanoseconds(found.waited),
                has_time: found.t_us.is_some().into(),
                fresh: found.fresh.into(),
                own: found.own.into(),
                lost_events: found.lost_events,
                dropped_events: found.dropped_events,
                restarts: found.restarts,
                unlike: found.unlike.unwrap_or(f32::NAN),
            };
            values.copy(found.values)?;
            timely.into_iter().for_each(|timely| timely.write(of));
            Ok(())
        })
    })
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Counts of pushed events.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_live_counters(
    live: *const meissner_live,
    counters: *mut meissner_queue_counters,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let counters = unsafe { report(counters, "counters") }?;
        let found: QueueCounters = LIVES.with(live, |of| Ok(of.live.counters()))?;
        counters.write(meissner_queue_counters {
            size: 0,
            offered: found.offered,
            delivered: found.delivered,
            waiting: found.waiting,
            dropped_oldest: found.dropped_oldest,
            dropped_newest: found.dropped_newest,
            thinned: found.thinned,
            high_water: found.high_water,
            blocked_ns: nanoseconds(found.blocked),
        });
        Ok(())
    })
}

/// The engine's counts of events, as of the newest prediction or of a later batch.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_live_event_counters(
    live: *const meissner_live,
    counters: *mut meissner_counters,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let counters = unsafe { report(counters, "counters") }?;
        let found = LIVES.with(live, |of| Ok(of.live.event_counters()))?;
        counters.write(found.into());
        Ok(())
    })
}

/// Ends a live engine, as `meissner_live_release` does, and returns its engine through `engine`.
/// Waiting events are discarded: predict first with a deadline of UINT64_MAX so that the engine
/// takes them. While another thread is in a call with `live`, the status is MEISSNER_BUSY and
/// nothing has changed. After MEISSNER_OK and MEISSNER_PANICKED, the handle has ended.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_live_close(
    live: *mut meissner_live,
    engine: *mut *mut meissner_engine,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let engine = unsafe { place(engine, "engine") }?;
        let Controller { live, network, .. } = LIVES.take(live)?;
        engine.write(ENGINES.add(Made::new(live.close()?, network))?);
        Ok(())
    })
}

/// Ends a live engine and its thread. Waits for the call of another thread that is using it.
/// Waiting events are discarded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_live_release(live: *mut meissner_live) {
    LIVES.release(live);
}

/// Ends the sensor's side. Waits for the call of another thread that is using it. The controller's
/// side keeps working.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_input_release(input: *mut meissner_input) {
    INPUTS.release(input);
}
