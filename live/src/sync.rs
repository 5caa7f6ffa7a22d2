//! Locks, threads and the clock: the standard library's, or those of the model checker loom.
//!
//! Under `--cfg meissner_loom`, loom runs every order in which threads can take the lock and wake
//! each other (`interleavings.rs`). Its clock stands still until a test moves it.

#[cfg(all(test, meissner_loom))]
pub(crate) use checked::{Condvar, Instant, JoinHandle, Mutex, MutexGuard, thread};
#[cfg(not(all(test, meissner_loom)))]
pub(crate) use {
    std::sync::{Condvar, Mutex, MutexGuard},
    std::thread::{self, JoinHandle},
    std::time::Instant,
};

#[cfg(all(test, meissner_loom))]
pub(crate) mod checked {
    //! loom's locks and threads, condition variables whose wake-ups can be left out one by one, and
    //! a clock.

    use std::collections::BTreeSet;
    use std::panic::Location;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::sync::{LockResult, PoisonError};
    use std::time::Duration;

    pub(crate) use loom::sync::{Mutex, MutexGuard};
    pub(crate) use loom::thread::{self, JoinHandle};

    /// Line of the caller whose wake-up is left out, or 0; and the lines that have woken a thread
    /// so far.
    pub(crate) static WAKE_UPS: std::sync::Mutex<(u32, BTreeSet<u32>)> =
        std::sync::Mutex::new((0, BTreeSet::new()));
    /// The time, in nanoseconds.
    static NOW: AtomicU64 = AtomicU64::new(0);

    #[derive(Debug)]
    pub(crate) struct Condvar(loom::sync::Condvar);

    impl Condvar {
        pub(crate) fn new() -> Self {
            Self(loom::sync::Condvar::new())
        }

        pub(crate) fn wait<'a, T>(&self, guard: MutexGuard<'a, T>) -> LockResult<MutexGuard<'a, T>> {
            self.0.wait(guard)
        }

        /// Waits until it is woken: a move of the clock wakes the waiting threads.
        pub(crate) fn wait_timeout<'a, T>(
            &self,
            guard: MutexGuard<'a, T>,
            _: Duration,
        ) -> LockResult<(MutexGuard<'a, T>, ())> {
            let woken = self.wait(guard).unwrap_or_else(PoisonError::into_inner);
            Ok((woken, ()))
        }

        /// Wakes all threads that may wait until a time.
        pub(crate) fn time_out(&self) {
            self.0.notify_all();
        }

        #[track_caller]
        pub(crate) fn notify_one(&self) {
            if is_heard() {
                self.0.notify_one();
            }
        }

        #[track_caller]
        pub(crate) fn notify_all(&self) {
            if is_heard() {
                self.0.notify_all();
            }
        }
    }

    /// Whether the wake-up of the caller is not left out.
    #[track_caller]
    fn is_heard() -> bool {
        let line = Location::caller().line();
        let mut wake_ups = WAKE_UPS.lock().unwrap_or_else(PoisonError::into_inner);
        wake_ups.1.insert(line);
        wake_ups.0 != line
    }

    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub(crate) struct Instant(Duration);

    impl Instant {
        pub(crate) fn now() -> Self {
            Self(Duration::from_nanos(NOW.load(Ordering::SeqCst)))
        }

        /// Moves the clock.
        pub(crate) fn set(now: Duration) {
            NOW.store(now.as_nanos() as u64, Ordering::SeqCst);
        }

        pub(crate) fn checked_add(self, more: Duration) -> Option<Self> {
            self.0.checked_add(more).map(Self)
        }

        pub(crate) fn saturating_duration_since(self, earlier: Self) -> Duration {
            self.0.saturating_sub(earlier.0)
        }

        pub(crate) fn elapsed(self) -> Duration {
            Self::now().saturating_duration_since(self)
        }
    }

    impl std::ops::Sub for Instant {
        type Output = Duration;

        fn sub(self, earlier: Self) -> Duration {
            self.saturating_duration_since(earlier)
        }
    }
}
