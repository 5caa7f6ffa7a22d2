//! Threads that share work.

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::CliError;

/// A pool of `threads` threads, or of as many as the machine has cores.
pub(crate) fn pool(threads: Option<u16>) -> Result<ThreadPool, CliError> {
    let threads = threads.map_or(0, usize::from);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|source| CliError::Threads { threads, source })
}

/// The pool whose two threads share the work of one engine, if `threads` is 2; the calling thread is one of them while the pool is there.
pub(crate) fn shared(threads: Option<u8>) -> Result<Option<ThreadPool>, CliError> {
    let two = || ThreadPoolBuilder::new().num_threads(2).use_current_thread().build();
    (threads == Some(2)).then(two).transpose().map_err(|source| CliError::Threads { threads: 2, source })
}
