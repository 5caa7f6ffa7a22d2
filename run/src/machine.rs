//! The machine that computed a result.

use std::thread::available_parallelism;

use meissner_kernels::Isa;
use serde::Serialize;

/// The machine of this process.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
    /// Name of the processor, as reported by Linux.
    processor: Option<String>,
    /// Threads that may run at once.
    processors: Option<usize>,
    /// Operating system and architecture.
    system: String,
    /// The instruction set of the kernels.
    isa: &'static str,
}

impl Machine {
    pub(crate) fn this() -> Self {
        Self {
            processor: std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| name(&text)),
            processors: available_parallelism().ok().map(usize::from),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            isa: Isa::best().name(),
        }
    }
}

/// The name of the processor in the text of `/proc/cpuinfo`; for `aarch64` it contains none.
fn name(text: &str) -> Option<String> {
    let value = text.lines().find_map(|line| line.strip_prefix("model name"))?;
    let name = value.trim_start().strip_prefix(':')?.trim();
    (!name.is_empty()).then(|| name.to_owned())
}
