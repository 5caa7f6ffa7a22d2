//! Threads: one thread at a time in an object, forks, and long work that signals can stop.
//!
//! A forked child has one thread and computes on its own threads. Objects that it cannot use raise
//! an error.

use std::ops::{Deref, DerefMut};
use std::process;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use meissner_evaluate::{EvaluateError, ProgressHandle, Workers};
use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::False;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Failure, Outcome};

/// Time between two checks whether an object is free; signals are handled at each.
const TURN_LOOK: Duration = Duration::from_micros(200);
/// Time between two checks for signals during long work.
const SIGNAL_LOOK: Duration = Duration::from_millis(50);
/// Time between two checks for the end of long work.
const END_LOOK: Duration = Duration::from_millis(2);

/// The process that uses rayon's common threads: the first one that used them.
static COMMON: OnceLock<u32> = OnceLock::new();
/// The threads of a process that was forked from it.
static OWN: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Runs `work`, which shares work between threads, on the threads of this process.
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
            // This process cannot end the threads of the parent.
            std::mem::forget(own.replace((process::id(), Arc::clone(&pool))));
            pool
        }
    };
    drop(own);
    Ok(pool.install(work))
}

/// Whether rayon's common threads belong, or would belong, to this process.
pub(crate) fn has_common_threads() -> bool {
    *COMMON.get_or_init(process::id) == process::id()
}

/// `what` needs a thread of the process that forked this one.
pub(crate) fn fork_refused(what: &str) -> Failure {
    let expected = "threads of this process";
    let advice =
        "start processes with the method \"spawn\" or \"forkserver\", or make the engine in the child";
    let message =
        format!("{what}: expected {expected}, found those of its parent, which fork left there; {advice}");
    Failure::Refused("LiveError", message)
}

/// Objects in use by a thread: address, thread and process. Changed while the interpreter lock is
/// held, so that no fork happens meanwhile.
static TAKEN: Mutex<Vec<(usize, ThreadId, u32)>> = Mutex::new(Vec::new());

/// An object of Python, for exclusive use by this thread.
pub(crate) struct Turn<'py, T: PyClass<Frozen = False>> {
    value: PyRefMut<'py, T>,
    address: usize,
}

fn taken() -> MutexGuard<'static, Vec<(usize, ThreadId, u32)>> {
    TAKEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The object, once no other thread uses it. Other threads run meanwhile, and signals are handled.
pub(crate) fn turn<'py, T: PyClass<Frozen = False>>(object: &Bound<'py, T>) -> Outcome<Turn<'py, T>> {
    let address = object.as_ptr().addr();
    loop {
        if let Ok(value) = object.try_borrow_mut() {
            taken().push((address, thread::current().id(), process::id()));
            return Ok(Turn { value, address });
        }
        let holder = taken().iter().find(|(of, ..)| *of == address).copied();
        match holder {
            Some((.., process)) if process != process::id() => return Err(fork_refused(&name(object))),
            Some((_, thread, _)) if thread == thread::current().id() => {
                let found = "one from within another (of a signal's handler, say)";
                let message = format!("{}: expected a call after the other, found {found}", name(object));
                return Err(Failure::Refused("Error", message));
            }
            _ => {}
        }
        object.py().detach(|| thread::sleep(TURN_LOOK));
        object.py().check_signals()?;
    }
}

fn name<T>(object: &Bound<'_, T>) -> String {
    object.as_any().get_type().name().map_or_else(|_| "object".to_owned(), |name| name.to_string())
}

impl<T: PyClass<Frozen = False>> Deref for Turn<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T: PyClass<Frozen = False>> DerefMut for Turn<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

impl<T: PyClass<Frozen = False>> Drop for Turn<'_, T> {
    fn drop(&mut self) {
        let mut taken = taken();
        if let Some(place) = taken.iter().rposition(|(of, ..)| *of == self.address) {
            taken.swap_remove(place);
        }
    }
}

/// Progress of work that consists of named parts.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    seen: Mutex<Seen>,
}

/// Number of finished parts, total number, and the current part.
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

/// `threads` threads that report to `watch`, or as many as there are cores.
pub(crate) fn workers(threads: Option<u16>, watch: &ProgressHandle) -> Outcome<Workers> {
    let pool = ThreadPoolBuilder::new().num_threads(threads.map_or(0, usize::from)).build();
    let pool = pool.map_err(|error| Failure::Refused("Error", format!("threads: {error}")))?;
    Ok(Workers::new(pool, watch.clone()))
}

/// The result of `work`, which runs in another thread without the interpreter lock. Meanwhile
/// `tick(done, total, name)` is called with the values of `seen`. An exception of `tick` or of a
/// signal stops the work at its next part, and is then raised.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    watch: &ProgressHandle,
    tick: &Bound<'_, PyAny>,
    seen: impl Fn() -> Seen,
    work: impl FnOnce() -> Result<T, EvaluateError> + Send,
) -> Outcome<T> {
    thread::scope(|scope| {
        let worker = scope.spawn(work);
        let mut raised = None;
        while !worker.is_finished() {
            let worker = &worker;
            py.detach(|| {
                let end = Instant::now() + SIGNAL_LOOK;
                while !worker.is_finished() && Instant::now() < end {
                    thread::sleep(END_LOOK);
                }
            });
            let Seen { done, total, name } = seen();
            let told = if raised.is_none() { tick.call1((done, total, name)).map(drop) } else { Ok(()) };
            if let Err(error) = told.and_then(|()| py.check_signals()) {
                watch.stop();
                raised.get_or_insert(error);
            }
        }
        let result = worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        match raised {
            Some(error) => Err(error.into()),
            None => Ok(result?),
        }
    })
}
