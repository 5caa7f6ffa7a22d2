//! Memory of the process, if the platform reports it.

/// Peak resident memory of the process so far, in bytes: `VmHWM` on Linux, `None` elsewhere.
pub fn peak_resident_bytes() -> Option<u64> {
    read("VmHWM:")
}

/// Resident memory of the process, in bytes: `VmRSS` on Linux, `None` elsewhere.
pub fn resident_bytes() -> Option<u64> {
    read("VmRSS:")
}

fn read(key: &str) -> Option<u64> {
    parse(&std::fs::read_to_string("/proc/self/status").ok()?, key)
}

/// The value of the line `key   1234 kB`, where kB means 1024 bytes.
pub(crate) fn parse(status: &str, key: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}
