//! What a loop in real time asks of the operating system: absolute sleeps, a fixed priority, memory that stays in place.
//!
//! Times are durations since some start that never steps back. A request that is refused is an error with the reason, and the loop goes
//! on without it. On systems other than Linux, sleeps are relative and the other requests are refused.

/// Priorities of the threads: a thread that waits for another's work stands above it, so that it runs as soon as the work is done.
pub mod priority {
    /// The simulated fingertip: the world goes on whether anyone else has time, but not at the cost of those who watch it.
    pub const FINGERTIP: u8 = 50;
    /// The engine's thread.
    pub const ENGINE: u8 = 60;
    /// The thread that takes events from the sensor.
    pub const FEED: u8 = 70;
    /// The loop.
    pub const LOOP: u8 = 80;
}

#[cfg(target_os = "linux")]
pub use linux::{computing_time, lock_memory, now, raise, sleep_until};
#[cfg(not(target_os = "linux"))]
pub use other::{computing_time, lock_memory, now, raise, sleep_until};

#[cfg(target_os = "linux")]
mod linux {
    use std::time::Duration;

    use rustix::mm::{MlockAllFlags, mlockall};
    use rustix::thread::clock_nanosleep_absolute;
    use rustix::time::{ClockId, Timespec, clock_gettime};
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
        set_thread_priority_and_policy, thread_native_id,
    };

    /// The time.
    pub fn now() -> Duration {
        duration(clock_gettime(ClockId::Monotonic))
    }

    /// The time for which this thread had a processor.
    pub fn computing_time() -> Duration {
        duration(clock_gettime(ClockId::ThreadCPUTime))
    }

    /// Sleeps until `time`, which may have passed.
    pub fn sleep_until(time: Duration) {
        let at = Timespec { tv_sec: time.as_secs() as i64, tv_nsec: i64::from(time.subsec_nanos()) };
        // A signal interrupts a sleep; the time is absolute, so the same call goes on with it.
        while clock_nanosleep_absolute(ClockId::Monotonic, &at) == Err(rustix::io::Errno::INTR) {}
    }

    /// Gives this thread, and threads that it starts later, a fixed priority under `SCHED_FIFO`.
    ///
    /// # Errors
    /// The reason of the refusal.
    pub fn raise(priority: u8) -> Result<(), String> {
        let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        let value = ThreadPriorityValue::try_from(priority).map_err(|error| format!("{error:?}"))?;
        set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
            .map_err(|error| error.to_string())
    }

    /// Keeps all memory of the process in place, that which it has and that which it will have.
    ///
    /// # Errors
    /// The reason of the refusal.
    pub fn lock_memory() -> Result<(), String> {
        mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| error.to_string())
    }

    fn duration(time: Timespec) -> Duration {
        Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
    }
}

#[cfg(not(target_os = "linux"))]
mod other {
    use std::sync::OnceLock;
    use std::time::{Duration, Instant};

    const REFUSAL: &str = "not on this operating system";

    /// The time.
    pub fn now() -> Duration {
        static START: OnceLock<Instant> = OnceLock::new();
        START.get_or_init(Instant::now).elapsed()
    }

    /// The time: waits count as computing, so that the engine is never blamed too little.
    pub fn computing_time() -> Duration {
        now()
    }

    /// Sleeps until `time`, which may have passed.
    pub fn sleep_until(time: Duration) {
        std::thread::sleep(time.saturating_sub(now()));
    }

    /// Refuses.
    ///
    /// # Errors
    /// Always.
    pub fn raise(_priority: u8) -> Result<(), String> {
        Err(REFUSAL.to_owned())
    }

    /// Refuses.
    ///
    /// # Errors
    /// Always.
    pub fn lock_memory() -> Result<(), String> {
        Err(REFUSAL.to_owned())
    }
}
