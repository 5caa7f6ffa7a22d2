//! Threads that share recordings, with their progress and a way to stop them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use rayon::ThreadPool;
use rayon::prelude::*;

use crate::error::{EvaluateError, Result};

/// Progress of an evaluation, for another thread, which can also stop it.
#[derive(Clone, Debug, Default)]
pub struct ProgressHandle(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    done: AtomicU64,
    total: AtomicU64,
    stopped: AtomicBool,
}

impl ProgressHandle {
    /// Number of finished recordings, presses or windows, once for each training.
    pub fn done(&self) -> u64 {
        self.0.done.load(Ordering::Relaxed)
    }

    /// Number of all of them; 0 while the data set is read.
    pub fn total(&self) -> u64 {
        self.0.total.load(Ordering::Relaxed)
    }

    /// Lets the evaluation end with [`EvaluateError::Stopped`] before the next recording.
    pub fn stop(&self) {
        self.0.stopped.store(true, Ordering::Relaxed);
    }

    /// `Ok` unless it is stopped.
    ///
    /// # Errors
    /// [`EvaluateError::Stopped`].
    pub fn check(&self) -> Result<()> {
        if self.0.stopped.load(Ordering::Relaxed) { Err(EvaluateError::Stopped) } else { Ok(()) }
    }
}

/// Threads that share the recordings of an evaluation.
#[derive(Debug)]
pub struct Workers {
    pool: ThreadPool,
    pub(crate) watch: ProgressHandle,
}

impl From<ThreadPool> for Workers {
    fn from(pool: ThreadPool) -> Self {
        Self { pool, watch: ProgressHandle::default() }
    }
}

impl Workers {
    /// The threads of `pool`, which report to `watch`.
    pub fn new(pool: ThreadPool, watch: ProgressHandle) -> Self {
        Self { pool, watch }
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Reports the number of all items.
    pub(crate) fn expect(&self, items: usize) {
        self.watch.0.total.store(items as u64, Ordering::Relaxed);
    }

    /// The result of `work` with these threads.
    pub(crate) fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.pool.install(work)
    }

    /// The results of `work` for `items` in their order, each thread with clones of `engine`.
    ///
    /// The number of threads does not affect a result if `work` resets its engine.
    pub(crate) fn for_each<E: Clone + Sync, I: Sync, T: Send, X: Send + Into<EvaluateError>>(
        &self,
        engine: &E,
        items: &[I],
        work: impl Fn(&mut E, &I) -> Result<T, X> + Sync + Send,
    ) -> Result<Vec<T>> {
        let work = |engine: &mut E, item: &I| {
            self.watch.check()?;
            let result = work(engine, item).map_err(Into::into)?;
            self.watch.0.done.fetch_add(1, Ordering::Relaxed);
            Ok(result)
        };
        let work = || items.par_iter().map_init(|| engine.clone(), work).collect::<Vec<_>>();
        self.pool.install(work).into_iter().collect()
    }
}
