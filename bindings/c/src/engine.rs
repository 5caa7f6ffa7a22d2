//! Engines over events.

use std::ffi::c_char;
use std::sync::Arc;

use meissner::{
    Engine, Event, EventCounters, LatePolicy, Options, Outcome, Predictor, RestartPolicy, Sensor,
};

use crate::arguments::{
    Versioned, array, options, place, place_if_wanted, report, report_if_wanted, room, write_bytes,
};
use crate::handles::Handles;
use crate::log::{LossWatch, warn, warnings_of_losses, write_lines};
use crate::network::{Loaded, NETWORKS, meissner_network};
use crate::status::{Failure, call, meissner_status};

/// A network over the events of a sliding window. One thread at a time.
pub struct meissner_engine(());

pub(crate) static ENGINES: Handles<meissner_engine, Made> = Handles::new(2, "engine");

/// The value behind a handle of an engine.
#[derive(Clone)]
pub(crate) struct Made {
    pub(crate) engine: Engine,
    pub(crate) network: Arc<Loaded>,
    losses: LossWatch,
}

impl Made {
    pub(crate) fn new(engine: Engine, network: Arc<Loaded>) -> Self {
        Self { engine, network, losses: LossWatch::default() }
    }

    /// All warnings: about the network, the sensor and the events.
    fn warnings(&self) -> Vec<String> {
        let sensor = self.engine.sensor();
        let mut found = self.network.warnings().to_vec();
        found.extend(self.network.warning_of_sensor(sensor));
        found.extend(warnings_of_losses(self.engine.event_counters(), sensor));
        found
    }
}

/// Pushes `length` events with `push`, which returns how many events entered. Losses are logged
/// after the handle is free again.
fn push(
    engine: *const meissner_engine,
    length: usize,
    push: impl FnOnce(&mut Engine) -> usize,
) -> Result<usize, Failure> {
    let (entered, lost) = ENGINES.with(engine, |made| {
        let restarts = made.engine.event_counters().restarts;
        let entered = push(&mut made.engine);
        let events = made.engine.event_counters();
        let lost = if (entered < length || events.restarts > restarts) && made.losses.is_due() {
            warnings_of_losses(events, made.engine.sensor())
        } else {
            Vec::new()
        };
        Ok((entered, lost))
    })?;
    lost.iter().for_each(|text| warn(text));
    Ok(entered)
}

/// A change of brightness at a pixel.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_event {
    /// Time in microseconds, on any epoch: only differences count.
    pub t_us: i64,
    /// Column, from the left.
    pub x: u16,
    /// Row, from the top.
    pub y: u16,
    /// More than 0 if the brightness rose; 0 or less if it fell.
    pub polarity: i8,
}

impl From<meissner_event> for Event {
    fn from(event: meissner_event) -> Self {
        Self::new(event.t_us, event.x, event.y, event.polarity > 0)
    }
}

/// Events that are earlier than the newest are dropped and counted.
pub const MEISSNER_LATE_DROP: u32 = 0;
/// Events that are earlier than the newest enter with its time, and are counted.
pub const MEISSNER_LATE_CLAMP: u32 = 1;

/// When the clock of the sensor restarts, the engine resets and takes the events of the new clock.
/// Events that are earlier than the window, or more than 10 s ahead, are held until later events
/// show whether the clock has restarted or a single time is wrong.
pub const MEISSNER_RESTART_RESET: u32 = 0;
/// The clock never goes back: events are late until the old time is reached again.
pub const MEISSNER_RESTART_KEEP: u32 = 1;

/// Options of an engine over events. 0 is the default of each.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_engine_options {
    /// `sizeof(meissner_engine_options)`.
    pub size: usize,
    /// Limit of the state in bytes; 0 for 4 GiB.
    pub memory_limit: u64,
    /// Largest change of a row that does not propagate, in the units of the layer: an
    /// approximation. 0 is exact.
    pub tolerance: f32,
    /// MEISSNER_LATE_DROP or MEISSNER_LATE_CLAMP.
    pub late: u32,
    /// MEISSNER_RESTART_RESET or MEISSNER_RESTART_KEEP.
    pub restart: u64,
}

// SAFETY: `repr(C)` with only numbers, the first of which is the size.
unsafe impl Versioned for meissner_engine_options {}

/// Facts about a prediction.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_prediction {
    /// `sizeof(meissner_prediction)`, set by the caller.
    pub size: usize,
    /// Time of the newest event or frame that it covers; 0 before the first.
    pub t_us: i64,
    /// 1 if an event or a frame has set the time.
    pub has_time: u32,
    /// Events in the window; for a frame engine, frames since the last reset.
    pub nodes: u64,
    /// Rows that were computed since the previous prediction, over all layers.
    pub rows: u64,
    /// How much the window or the newest frames differ from those of the training. Fewer than 1 in
    /// 1,000 of the training's were above 1. NaN if the weights do not say what the training's were
    /// like.
    pub unlike: f32,
}

// SAFETY: `repr(C)` with only numbers, the first of which is the size.
unsafe impl Versioned for meissner_prediction {}

/// Counts of events since the engine was made. `pushed` is the sum of `accepted` and of the counts
/// of the five reasons for which events are dropped.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_counters {
    /// `sizeof(meissner_counters)`, set by the caller.
    pub size: usize,
    /// Events pushed, without those that are held.
    pub pushed: u64,
    /// Events that entered the window.
    pub accepted: u64,
    /// Dropped: not on the sensor.
    pub outside_sensor: u64,
    /// Dropped: earlier than the newest.
    pub late: u64,
    /// Dropped: too far from the first event for 64 bits.
    pub time_out_of_range: u64,
    /// Late events that entered with the newest time.
    pub clamped: u64,
    /// Events that left because they were older than the window.
    pub expired: u64,
    /// Events that left earlier because the window was full.
    pub evicted: u64,
    /// Predictions read; 0 for a live engine.
    pub predictions: u64,
    /// Of these, predictions for which nothing had changed.
    pub reused: u64,
    /// Dropped: a single time far ahead.
    pub outliers: u64,
    /// Restarts of the sensor's clock, each of which reset the engine.
    pub restarts: u64,
    /// Dropped: by a filter that the network states, such as one for pixels that fire all the time.
    pub filtered: u64,
}

impl From<EventCounters> for meissner_counters {
    fn from(found: EventCounters) -> Self {
        Self {
            size: 0,
            pushed: found.pushed,
            accepted: found.accepted,
            outside_sensor: found.outside_sensor,
            late: found.late,
            time_out_of_range: found.time_out_of_range,
            clamped: found.clamped,
            expired: found.expired,
            evicted: found.evicted,
            predictions: 0,
            reused: 0,
            outliers: found.outliers,
            restarts: found.restarts,
            filtered: found.filtered,
        }
    }
}

// SAFETY: `repr(C)` with only integers, the first of which is the size.
unsafe impl Versioned for meissner_counters {}

/// Counts of rows of a layer, or of its pixels in a frame network, since the engine was made.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_layer_counters {
    /// Computed.
    pub computed: u64,
    /// Kept, because nothing that they depend on had changed.
    pub kept: u64,
    /// Computed, with the same bits as before.
    pub unchanged: u64,
}

fn engine_options(options: meissner_engine_options) -> Result<Options, Failure> {
    let late = match options.late {
        MEISSNER_LATE_DROP => LatePolicy::Drop,
        MEISSNER_LATE_CLAMP => LatePolicy::Clamp,
        found => return Err(Failure::argument("late", "0 or 1", found)),
    };
    let restart = match u32::try_from(options.restart) {
        Ok(MEISSNER_RESTART_RESET) => RestartPolicy::Reset,
        Ok(MEISSNER_RESTART_KEEP) => RestartPolicy::Keep,
        _ => return Err(Failure::argument("restart", "0 or 1", options.restart)),
    };
    let made = Options::new().with_tolerance(options.tolerance).with_late(late).with_restart(restart);
    Ok(if options.memory_limit == 0 { made } else { made.with_memory_limit(options.memory_limit.into()) })
}

/// Makes an engine for a network over events and a sensor of `width` x `height` pixels. `options`
/// may be NULL. Allocates: the whole state is made here.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_new(
    network: *const meissner_network,
    width: u16,
    height: u16,
    options: *const meissner_engine_options,
    result: *mut *mut meissner_engine,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (result, options) = unsafe { (place(result, "result")?, self::options(options, "options")?) };
        let (network, options) = (NETWORKS.get(network)?, engine_options(options)?);
        let sensor = Sensor::new(width, height);
        let engine = Engine::with_options(network.of_events()?.clone(), sensor, options)?;
        let warning = network.warning_of_sensor(sensor);
        result.write(ENGINES.add(Made::new(engine, network))?);
        warning.iter().for_each(|text| warn(text));
        Ok(())
    })
}

/// Makes an engine in the state of another. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_clone(
    engine: *const meissner_engine,
    result: *mut *mut meissner_engine,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let result = unsafe { place(result, "result") }?;
        let clone = ENGINES.with(engine, |made| Ok(made.clone()))?;
        result.write(ENGINES.add(clone)?);
        Ok(())
    })
}

/// Pushes an event. `accepted`, which may be NULL, is set to whether the event entered the window;
/// a dropped event is counted. An event whose time does not agree with the clock is held. It has
/// not entered yet: it enters, or is counted as dropped, with a later event.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_push(
    engine: *const meissner_engine,
    t_us: i64,
    x: u16,
    y: u16,
    polarity: i8,
    accepted: *mut bool,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let accepted = unsafe { place_if_wanted(accepted, "accepted") }?;
        let event = Event::new(t_us, x, y, polarity > 0);
        let entered = push(engine, 1, |engine| usize::from(engine.push(event) == Outcome::Accepted))?;
        accepted.into_iter().for_each(|accepted| accepted.write(entered == 1));
        Ok(())
    })
}

/// Pushes `length` events in order. `accepted`, which may be NULL, is set to the number of events
/// that entered the window. It can be more than `length`, because it includes events that were held
/// before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_push_events(
    engine: *const meissner_engine,
    events: *const meissner_event,
    length: usize,
    accepted: *mut usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (events, accepted) =
            unsafe { (array(events, length, "events")?, place_if_wanted(accepted, "accepted")?) };
        let events = events.iter().map(|&event| event.into());
        let entered = push(engine, length, |engine| engine.push_all(events))?;
        accepted.into_iter().for_each(|accepted| accepted.write(entered));
        Ok(())
    })
}

/// Pushes `length` events in order. Their times in microseconds, columns, rows and polarities are
/// in separate arrays. `accepted`, which may be NULL, is set to the number of events that entered
/// the window.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_push_arrays(
    engine: *const meissner_engine,
    t_us: *const i64,
    x: *const u16,
    y: *const u16,
    polarity: *const i8,
    length: usize,
    accepted: *mut usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (events, accepted) =
            unsafe { (from_arrays(t_us, x, y, polarity, length)?, place_if_wanted(accepted, "accepted")?) };
        let entered = push(engine, length, |engine| engine.push_all(events))?;
        accepted.into_iter().for_each(|accepted| accepted.write(entered));
        Ok(())
    })
}

/// Events from arrays of their parts.
///
/// # Safety
/// As [`array`], for each pointer.
pub(crate) unsafe fn from_arrays<'a>(
    t_us: *const i64,
    x: *const u16,
    y: *const u16,
    polarity: *const i8,
    length: usize,
) -> Result<impl Iterator<Item = Event> + use<'a>, Failure> {
    // SAFETY: the caller promises it.
    let (t_us, x, y, polarity): (&'a [i64], &'a [u16], &'a [u16], &'a [i8]) = unsafe {
        (
            array(t_us, length, "t_us")?,
            array(x, length, "x")?,
            array(y, length, "y")?,
            array(polarity, length, "polarity")?,
        )
    };
    let pixels = x.iter().zip(y).zip(polarity);
    Ok(t_us.iter().zip(pixels).map(|(&t_us, ((&x, &y), &polarity))| Event::new(t_us, x, y, polarity > 0)))
}

/// Advances the clock to `t_us` without an event: events older than the window leave. Earlier times
/// change nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_advance(
    engine: *const meissner_engine,
    t_us: i64,
) -> meissner_status {
    call(|| ENGINES.act(engine, |made| made.engine.advance(t_us)))
}

/// Predicts for the current window: writes the network's outputs to `values`, which has room for
/// `length` values, and facts about the prediction to `prediction`, which may be NULL. Nothing is
/// computed if `length` is less than the number of outputs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_predict(
    engine: *const meissner_engine,
    values: *mut f32,
    length: usize,
    prediction: *mut meissner_prediction,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (values, prediction) =
            unsafe { (room(values, length, "values")?, report_if_wanted(prediction, "prediction")?) };
        ENGINES.with(engine, |made| {
            values.fits(made.engine.network().outputs())?;
            let found = Predictor::predict(&mut made.engine)?;
            let of = meissner_prediction {
                size: 0,
                t_us: found.t_us.unwrap_or(0),
                has_time: found.t_us.is_some().into(),
                nodes: found.nodes as u64,
                rows: found.rows.iter().sum(),
                unlike: found.unlike.unwrap_or(f32::NAN),
            };
            values.copy(found.values)?;
            prediction.into_iter().for_each(|prediction| prediction.write(of));
            Ok(())
        })
    })
}

/// Removes all events; the next one may have any time. Counters stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_reset(engine: *const meissner_engine) -> meissner_status {
    call(|| ENGINES.act(engine, |made| made.engine.reset()))
}

/// Counts of events and predictions. Allocates temporary memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_counters(
    engine: *const meissner_engine,
    counters: *mut meissner_counters,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let counters = unsafe { report(counters, "counters") }?;
        let found = ENGINES.with(engine, |made| Ok(made.engine.counters()))?;
        let (predictions, reused) = (found.predictions.read, found.predictions.reused);
        counters.write(meissner_counters { predictions, reused, ..found.events.into() });
        Ok(())
    })
}

/// Counts of rows for each layer; `meissner_network_info` has the number of layers. Allocates
/// temporary memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_layer_counters(
    engine: *const meissner_engine,
    layers: *mut meissner_layer_counters,
    length: usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let layers = unsafe { room(layers, length, "layers") }?;
        let found = ENGINES.with(engine, |made| Ok(made.engine.counters()))?;
        let counts = found.layers.iter().map(|layer| meissner_layer_counters {
            computed: layer.recomputed,
            kept: layer.kept,
            unchanged: layer.unchanged,
        });
        layers.copy(&counts.collect::<Vec<_>>())
    })
}

/// Writes the warnings about an engine, as `meissner_network_warnings` does: about its network, a
/// sensor that is not the training's, each reason for which more than one of a hundred events has
/// been dropped, and restarts of the sensor's clock.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_warnings(
    engine: *const meissner_engine,
    text: *mut c_char,
    capacity: usize,
    length: *mut usize,
) -> meissner_status {
    call(|| {
        let lines = || ENGINES.with(engine, |made| Ok(made.warnings()));
        // SAFETY: the callers' rules at the top of the header.
        unsafe { write_lines(text, capacity, length, lines) }
    })
}

/// Writes the state as bytes to `bytes`, which has room for `capacity` bytes, and their number to
/// `length`. If there is too little room, only `length` is written: call with a `capacity` of 0 to
/// get it. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_snapshot(
    engine: *const meissner_engine,
    bytes: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> meissner_status {
    let state = || ENGINES.with(engine, |made| Ok(made.engine.to_bytes()));
    // SAFETY: the callers' rules at the top of the header.
    call(|| unsafe { write_bytes(bytes, capacity, "bytes", length, state) })
}

/// Sets the engine to the state of a snapshot of an engine with the same network, sensor and
/// options. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_restore(
    engine: *const meissner_engine,
    bytes: *const u8,
    length: usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let bytes = unsafe { array(bytes, length, "bytes") }?;
        ENGINES.with(engine, |made| Ok(made.engine.restore_bytes(bytes)?))
    })
}

/// Ends an engine. Waits for the call of another thread that is using it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_engine_release(engine: *mut meissner_engine) {
    ENGINES.release(engine);
}
