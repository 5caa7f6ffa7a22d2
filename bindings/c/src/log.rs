//! Warnings of the library: a function of the caller receives them, and calls return them.

use std::ffi::{CString, c_char, c_void};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use meissner::{EventCounters, Sensor};

use crate::arguments::write_bytes;
use crate::status::Failure;

/// Takes a warning, in UTF-8 and valid during the call, and the pointer that was given with the
/// function. Any thread that makes a network or an engine, or pushes events, may call it; one at a
/// time.
pub type meissner_log = Option<unsafe extern "C" fn(text: *const c_char, user: *mut c_void)>;

struct Log {
    function: meissner_log,
    user: *mut c_void,
}

// SAFETY: the pointer is only passed back to the caller's function, which any thread may call, as
// the documentation of `meissner_log` says.
unsafe impl Send for Log {}

/// Whether `LOG` has a function. Threads that must not wait for a running warning read it.
static IS_READ: AtomicBool = AtomicBool::new(false);
static LOG: Mutex<Log> = Mutex::new(Log { function: None, user: std::ptr::null_mut() });

/// Sets the function that receives warnings: about weights that are untrained or were trained on
/// another sensor, and about lost events, at most once a second for each engine. NULL, the default,
/// drops the warnings; `meissner_network_warnings` and `meissner_engine_warnings` return them. The
/// function must not call the library and must not unwind. After this call has returned, the
/// previous function is not called any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_set_log(function: meissner_log, user: *mut c_void) {
    IS_READ.store(function.is_some(), Ordering::Relaxed);
    *LOG.lock().unwrap_or_else(PoisonError::into_inner) = Log { function, user };
}

/// Whether there is a function that takes warnings.
pub(crate) fn is_read() -> bool {
    IS_READ.load(Ordering::Relaxed)
}

pub(crate) fn warn(text: &str) {
    let log = LOG.lock().unwrap_or_else(PoisonError::into_inner);
    if let (Some(function), Ok(text)) = (log.function, CString::new(text)) {
        // SAFETY: the caller's function, with the arguments that `meissner_log` promises.
        unsafe { function(text.as_ptr(), log.user) };
    }
}

/// Minimum time between two warnings about an engine's losses.
const PERIOD: Duration = Duration::from_secs(1);

/// Reasons for which more than one of a hundred events was dropped, and restarts of the clock.
pub(crate) fn warnings_of_losses(events: &EventCounters, sensor: Sensor) -> Vec<String> {
    let outside = format!(
        "outside the sensor of {sensor} pixels: the size of the sensor may not be that of the events"
    );
    let late = "earlier than one before them: the events may not be sorted by time, or the clock of the sensor went back";
    let outlier = "far ahead of those before and after them: their times are probably damaged";
    let filtered = "by the filters that the network states: a pixel of the sensor may fire all the time";
    let range =
        "too far in time from the first one: times may not be in microseconds, or the first one is wrong";
    let counts = [
        (events.outside_sensor, &*outside),
        (events.late, late),
        (events.time_out_of_range, range),
        (events.outliers, outlier),
        (events.filtered, filtered),
    ];
    let is_large = |count: u64| u128::from(count) * 100 > u128::from(events.pushed);
    let large = counts.into_iter().filter(|&(count, _)| is_large(count));
    let mut found: Vec<String> =
        large.map(|(count, why)| format!("{count} of {} events are dropped, {why}", events.pushed)).collect();
    if events.restarts > 0 {
        let times = if events.restarts == 1 { String::new() } else { format!(" {} times", events.restarts) };
        found.push(format!(
            "the clock of the sensor has restarted{times}: the network began anew, without the events before"
        ));
    }
    found
}

/// When the losses of an engine were last checked.
#[derive(Clone, Debug, Default)]
pub(crate) struct LossWatch {
    last: Option<Instant>,
}

impl LossWatch {
    /// Whether it is time to report losses. Nothing is allocated for a log that nobody reads.
    pub(crate) fn is_due(&mut self) -> bool {
        if !is_read() || self.last.is_some_and(|last| last.elapsed() < PERIOD) {
            return false;
        }
        self.last = Some(Instant::now());
        true
    }
}

/// Writes `lines` to `text`, which has room for `capacity` bytes, and the number of bytes to
/// `length`.
///
/// # Safety
/// As [`write_bytes`].
pub(crate) unsafe fn write_lines(
    text: *mut c_char,
    capacity: usize,
    length: *mut usize,
    lines: impl FnOnce() -> Result<Vec<String>, Failure>,
) -> Result<(), Failure> {
    let bytes = || {
        let lines = lines()?.iter().flat_map(|line| [line, "\n"]).collect::<String>();
        // The text contains names from files: a NUL in a name would end the text.
        Ok((lines.replace('\0', " ") + "\0").into_bytes())
    };
    // SAFETY: the caller promises it.
    unsafe { write_bytes(text.cast(), capacity, "text", length, bytes) }
}
