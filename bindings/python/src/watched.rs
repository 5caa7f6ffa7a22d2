//! Long work in a thread, while this one handles signals and tells how far it is.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use meissner_evaluate::{EvaluateError, ProgressHandle, Workers};
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;

use crate::error::{Failure, Outcome};

/// Time between two looks at signals.
const LOOK: Duration = Duration::from_millis(50);
/// Time between two looks at the end of the work.
const END: Duration = Duration::from_millis(2);

/// How far work is that consists of named parts.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    seen: Mutex<Seen>,
}

/// Done, of so many, and the part at work.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seen {
    pub(crate) done: u64,
    pub(crate) total: u64,
    pub(crate) name: String,
}

impl Parts {
    pub(crate) fn set(&self, change: impl FnOnce(&mut Seen)) {
        change(&mut self.seen.lock().unwrap_or_else(PoisonError::into_inner));
    }

    pub(crate) fn get(&self) -> Seen {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// `threads` threads that tell `watch`, or as many as there are cores.
pub(crate) fn workers(threads: Option<u16>, watch: &ProgressHandle) -> Outcome<Workers> {
    let pool = ThreadPoolBuilder::new().num_threads(threads.map_or(0, usize::from)).build();
    let pool = pool.map_err(|error| Failure::Refused("Error", format!("threads: {error}")))?;
    Ok(Workers::new(pool, watch.clone()))
}

/// The result of `work`, which runs in another thread without the interpreter. Every now and then `tick(done, total, name)` is called
/// with what `seen` says. An exception of it or of a signal stops the work at its next part, and is raised then.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    watch: &ProgressHandle,
    tick: &Bound<'_, PyAny>,
    seen: impl Fn() -> Seen,
    work: impl FnOnce() -> Result<T, EvaluateError> + Send,
) -> Outcome<T> {
    std::thread::scope(|scope| {
        let thread = scope.spawn(work);
        let mut raised = None;
        while !thread.is_finished() {
            let thread = &thread;
            py.detach(|| {
                let end = std::time::Instant::now() + LOOK;
                while !thread.is_finished() && std::time::Instant::now() < end {
                    std::thread::sleep(END);
                }
            });
            let Seen { done, total, name } = seen();
            let told = if raised.is_none() { tick.call1((done, total, name)).map(drop) } else { Ok(()) };
            if let Err(error) = told.and_then(|()| py.check_signals()) {
                watch.stop();
                raised.get_or_insert(error);
            }
        }
        let result = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        match raised {
            Some(error) => Err(error.into()),
            None => Ok(result?),
        }
    })
}
