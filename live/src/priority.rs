//! The priority of a thread among all threads of the machine.
//!
//! Linux alone has one for each thread: its niceness (sched(7)), which any thread may raise, but which only some may take back.

/// Niceness of the lowest priority.
#[cfg(target_os = "linux")]
const LOWEST: i32 = 19;

/// Gives the calling thread the lowest priority, until the niceness that it had is [restored](restore); `None` if the system refuses.
#[cfg(target_os = "linux")]
pub(crate) fn lower() -> Option<i32> {
    use rustix::process::{getpriority_process, setpriority_process};
    let before = getpriority_process(None).ok()?;
    setpriority_process(None, LOWEST).ok()?;
    Some(before)
}

/// Gives the calling thread the niceness `before` again; whether the system allows it.
#[cfg(target_os = "linux")]
pub(crate) fn restore(before: i32) -> bool {
    rustix::process::setpriority_process(None, before).is_ok()
}

/// Systems whose threads share one priority.
#[cfg(not(target_os = "linux"))]
pub(crate) fn lower() -> Option<i32> {
    None
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn restore(_: i32) -> bool {
    false
}

/// Whether a thread may restore a priority that it lowered. A thread tries it, which then ends: one that may not would keep the lowest.
pub(crate) fn is_restorable() -> bool {
    std::thread::spawn(|| lower().is_some_and(restore)).join().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::{is_restorable, lower, restore};

    #[test]
    fn a_lowered_priority_is_restored_where_the_system_allows_it() {
        if is_restorable() {
            let before = lower().expect("it could be lowered");
            assert_eq!(lower(), Some(19));
            assert!(restore(before));
            assert_eq!(lower(), Some(before));
            assert!(restore(before));
        }
    }
}
