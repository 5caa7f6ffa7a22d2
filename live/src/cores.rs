//! The cores that threads can be pinned to.

/// The cores that this process may use, ascending; empty if the system does not say.
pub fn cores() -> Vec<usize> {
    core_affinity::get_core_ids().unwrap_or_default().into_iter().map(|core| core.id).collect()
}

/// Pins the calling thread to `core`; whether it is pinned.
pub(crate) fn pin(core: usize) -> bool {
    cores().contains(&core) && core_affinity::set_for_current(core_affinity::CoreId { id: core })
}
