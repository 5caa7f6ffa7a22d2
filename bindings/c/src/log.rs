//! What the library has to say that is no error.

use std::ffi::{CString, c_char, c_void};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Takes a warning, in UTF-8 and valid during the call, and the pointer that was given with the function. Any thread that makes a network
/// or an engine, or pushes events, may call it; one at a time.
pub type meissner_log = Option<unsafe extern "C" fn(text: *const c_char, user: *mut c_void)>;

struct Log {
    function: meissner_log,
    user: *mut c_void,
}

// SAFETY: the pointer is only handed back to the caller, who was told that any thread does so.
unsafe impl Send for Log {}

/// Of `LOG`, for whoever must not wait while a warning is told.
static IS_READ: AtomicBool = AtomicBool::new(false);
static LOG: Mutex<Log> = Mutex::new(Log { function: None, user: std::ptr::null_mut() });

/// Sets the function that takes warnings: weights that are untrained or were trained on another sensor, and lost events, at most once a
/// second for each engine. NULL, the default, drops them; `meissner_network_warnings` and `meissner_engine_warnings` return them. The
/// function must call none of the library, must not unwind, and is not called any more once this call has returned.
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
        // SAFETY: the caller's function, with what it was promised.
        unsafe { function(text.as_ptr(), log.user) };
    }
}
