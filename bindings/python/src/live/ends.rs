//! Both ends of a live engine, for threads that share them.
//!
//! The sensor's end is held for a whole push; a second push is refused. While a prediction is
//! awaited, the controller's end is released every [`LOOK`] for `close` and `counters`.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

use meissner::live::{Input, Item, Live, QueueCounters, QueueOptions};
use meissner::{EventCounters, Predictor};
use pyo3::prelude::*;

use crate::error::{Failure, Outcome};
use crate::prediction::Taken;
use crate::threads::fork_refused;

/// Wait for a prediction before signals are handled.
const LOOK: Duration = Duration::from_millis(10);

/// Counts of the queue, and of the events that the engine took.
type Counts = (QueueCounters, EventCounters);

/// The ends of a live engine.
pub(super) struct Ends<P: Predictor<Input: Item>> {
    /// The process of the thread.
    process: u32,
    input: Mutex<Input<P::Input>>,
    /// `Err` has the remaining counts after it was closed.
    live: Mutex<Result<Live<P>, Counts>>,
    /// Held by the thread that awaits a prediction.
    awaited: Mutex<()>,
    closing: AtomicBool,
}

/// The lock, unless another thread is in `method`.
fn alone<'a, T>(lock: &'a Mutex<T>, method: &str) -> Outcome<MutexGuard<'a, T>> {
    match lock.try_lock() {
        Ok(guard) => Ok(guard),
        Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
        Err(TryLockError::WouldBlock) => {
            let message = format!("{method}: expected one thread at a time, found another one in it");
            Err(Failure::Refused("LiveError", message))
        }
    }
}

fn closed() -> Failure {
    Failure::Refused("LiveError", "expected a live engine, found one that was closed".to_owned())
}

impl<P: Predictor<Input: Item> + Send + 'static> Ends<P> {
    pub(super) fn new(engine: P, options: QueueOptions) -> Outcome<Self> {
        let (input, live) = Live::spawn(engine, options)?;
        Ok(Self {
            process: process::id(),
            input: Mutex::new(input),
            live: Mutex::new(Ok(live)),
            awaited: Mutex::new(()),
            closing: AtomicBool::new(false),
        })
    }

    /// Whether its thread is in this process. In a forked child, a lock may stay locked without
    /// end.
    pub(super) fn is_here(&self) -> bool {
        self.process == process::id()
    }

    fn here(&self) -> Outcome<()> {
        if self.is_here() { Ok(()) } else { Err(fork_refused("Live")) }
    }

    /// The end of the sensor, for this thread alone.
    pub(super) fn input(&self) -> Outcome<MutexGuard<'_, Input<P::Input>>> {
        self.here()?;
        if self.is_closed() {
            return Err(closed());
        }
        alone(&self.input, "push")
    }

    fn live(&self) -> MutexGuard<'_, Result<Live<P>, Counts>> {
        self.live.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn advance(&self, py: Python<'_>, t_us: i64) -> Outcome<()> {
        let mut input = self.input()?;
        let input = &mut *input;
        py.detach(|| input.advance(t_us));
        Ok(())
    }

    /// The prediction by `deadline`. Signals are handled meanwhile.
    pub(super) fn predict(&self, py: Python<'_>, deadline: Duration) -> Outcome<Taken> {
        self.here()?;
        let _alone = alone(&self.awaited, "predict")?;
        let asked =
            py.detach(|| self.live().as_mut().map(|live| live.ask(deadline)).map_err(|_| closed()))?;
        loop {
            let taken = py.detach(|| -> Outcome<Option<Taken>> {
                if self.is_closed() {
                    return Err(closed());
                }
                let mut live = self.live();
                let live = live.as_mut().map_err(|_| closed())?;
                Ok(if live.wait(&asked, LOOK)? { Some(Taken::new(&live.timely(&asked)?)) } else { None })
            })?;
            if let Some(taken) = taken {
                return Ok(taken);
            }
            py.check_signals()?;
        }
    }

    pub(super) fn counters(&self, py: Python<'_>) -> Outcome<Counts> {
        self.here()?;
        Ok(py.detach(|| match &*self.live() {
            Ok(live) => (live.counters(), live.event_counters()),
            Err(counters) => *counters,
        }))
    }

    pub(super) fn is_closed(&self) -> bool {
        self.closing.load(Ordering::Relaxed)
    }

    /// Ends the thread; returns its engine, unless it was closed before.
    pub(super) fn close(&self, py: Python<'_>) -> Outcome<Option<P>> {
        self.here()?;
        self.closing.store(true, Ordering::Relaxed);
        py.detach(|| {
            let mut live = self.live();
            let Ok(open) = &*live else { return Ok(None) };
            let counters = (open.counters(), open.event_counters());
            let Ok(open) = std::mem::replace(&mut *live, Err(counters)) else { return Ok(None) };
            Ok(Some(open.close()?))
        })
    }
}

impl<P: Predictor<Input: Item>> Drop for Ends<P> {
    fn drop(&mut self) {
        if self.process != process::id() {
            // Its thread is in the parent, so there is no thread to wait for.
            let live = self.live.get_mut().unwrap_or_else(PoisonError::into_inner);
            std::mem::forget(std::mem::replace(live, Err(Counts::default())));
        }
    }
}
