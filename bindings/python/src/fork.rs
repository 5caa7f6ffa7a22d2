//! Forks: a child has one thread, the one that forked. It computes on threads of its own, and is told what it cannot use.

use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Failure, Outcome};

/// The process that uses rayon's common threads: the first one that did.
static COMMON: OnceLock<u32> = OnceLock::new();
/// The threads of a process that was forked from it.
static OWN: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Runs `work`, which shares work between threads, on those of this process.
pub(crate) fn on_own_threads<R: Send>(work: impl FnOnce() -> R + Send) -> Outcome<R> {
    if has_common_threads() {
        return Ok(work());
    }
    let mut own = OWN.lock().unwrap_or_else(PoisonError::into_inner);
    let pool = match &*own {
        Some((process, pool)) if *process == process::id() => Arc::clone(pool),
        _ => {
            let pool = ThreadPoolBuilder::new().build();
            let pool = pool.map_err(|error| Failure::Refused("Error", format!("threads: {error}")))?;
            let pool = Arc::new(pool);
            // The threads of the parent cannot be ended from here.
            std::mem::forget(own.replace((process::id(), Arc::clone(&pool))));
            pool
        }
    };
    drop(own);
    Ok(pool.install(work))
}

/// Whether rayon's common threads are, or would be, those of this process.
pub(crate) fn has_common_threads() -> bool {
    *COMMON.get_or_init(process::id) == process::id()
}

/// `what` needs a thread of the process that forked this one.
pub(crate) fn refused(what: &str) -> Failure {
    let expected = "threads of this process";
    let advice =
        "start processes with the method \"spawn\" or \"forkserver\", or make the engine in the child";
    let message =
        format!("{what}: expected {expected}, found those of its parent, which fork left there; {advice}");
    Failure::Refused("LiveError", message)
}
