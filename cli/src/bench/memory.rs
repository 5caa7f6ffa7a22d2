//! What the process has taken, where the platform tells it.

/// Most bytes of memory that the process has had resident so far: Linux's `VmHWM`. None elsewhere.
pub(crate) fn peak_resident_bytes() -> Option<u64> {
    parse(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// The value of the line `VmHWM:   1234 kB`, where kB means 1024 bytes.
fn parse(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn the_peak_is_read_in_units_of_1024_bytes_and_is_absent_where_it_is_not_told() {
        assert_eq!(parse("Name:\tmeissner\nVmPeak:\t  9 kB\nVmHWM:\t    1234 kB\n"), Some(1234 * 1024));
        assert_eq!(parse("Name:\tmeissner\n"), None);
        assert_eq!(parse("VmHWM:\tmany\n"), None);
    }
}
