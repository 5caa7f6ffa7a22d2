//! The value of a handle: one thread at a time uses it, and a second is refused.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::status::{Failure, Status};

/// A value behind a flag. C cannot promise that one thread at a time calls: a call that overlaps another is refused in place of
/// sharing what must not be shared.
pub(crate) struct Guarded<T> {
    busy: AtomicBool,
    /// A call did not return: the value may be in any state.
    broken: AtomicBool,
    value: UnsafeCell<T>,
}

// SAFETY: only the thread that set `busy` reaches the value, and it gives way with `Release`, so that the value goes from thread to
// thread as a whole.
unsafe impl<T: Send> Sync for Guarded<T> {}

/// Ends the use of a value, on panics too.
struct Use<'a>(&'a AtomicBool);

impl Drop for Use<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

impl<T: Send> Guarded<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { busy: AtomicBool::new(false), broken: AtomicBool::new(false), value: UnsafeCell::new(value) }
    }

    /// Runs `body` on the value.
    pub(crate) fn with<R>(&self, body: impl FnOnce(&mut T) -> Result<R, Failure>) -> Result<R, Failure> {
        if self.busy.swap(true, Ordering::Acquire) {
            return Err(Failure::new(Status::MEISSNER_BUSY, "another thread is using this handle"));
        }
        let _use = Use(&self.busy);
        if self.broken.load(Ordering::Relaxed) {
            let text = "a fault in the library during an earlier call; release this handle";
            return Err(Failure::new(Status::MEISSNER_PANICKED, text));
        }
        self.broken.store(true, Ordering::Relaxed);
        // SAFETY: `busy` was ours to set, so that no other thread is here.
        let result = body(unsafe { &mut *self.value.get() });
        self.broken.store(false, Ordering::Relaxed);
        result
    }

    pub(crate) fn into_inner(self) -> T {
        self.value.into_inner()
    }
}

#[cfg(test)]
mod tests {
    use super::{Failure, Guarded};

    #[test]
    fn a_value_in_use_is_refused_and_comes_back_after() {
        let value = Guarded::new(1);
        assert!(value.with(|_| Ok(value.with(|_| Ok(())).is_err())).unwrap());
        assert_eq!(value.with(|found| Ok(*found)).unwrap(), 1);
    }

    #[test]
    fn after_a_panic_the_value_is_refused() {
        let value = Guarded::new(1);
        let run = || value.with(|_| -> Result<(), Failure> { panic!("on purpose") });
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).is_err());
        assert!(value.with(|_| Ok(())).is_err());
    }
}
