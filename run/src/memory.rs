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
fn parse(status: &str, key: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn a_size_is_read_in_units_of_1024_bytes_and_is_absent_where_it_is_not_reported() {
        let status = "Name:\tmeissner\nVmPeak:\t  9 kB\nVmHWM:\t    1234 kB\nVmRSS:\t 7 kB\n";
        assert_eq!(parse(status, "VmHWM:"), Some(1234 * 1024));
        assert_eq!(parse(status, "VmRSS:"), Some(7 * 1024));
        assert_eq!(parse("Name:\tmeissner\n", "VmHWM:"), None);
        assert_eq!(parse("VmHWM:\tmany\n", "VmHWM:"), None);
    }
}
