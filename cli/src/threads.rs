//! Threads that share independent work.

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::CliError;

/// A pool of `threads` threads, or of as many as the machine has cores.
pub(crate) fn pool(threads: Option<u16>) -> Result<ThreadPool, CliError> {
    let threads = threads.map_or(0, usize::from);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|source| CliError::Threads { threads, source })
}
