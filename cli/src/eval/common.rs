//! What every evaluation begins and ends with: threads, and results as JSON.

use std::io;

use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;

use crate::error::CliError;

/// As many threads as were asked for, else as many as the machine has cores.
pub(super) fn pool(threads: Option<u16>) -> Result<ThreadPool, CliError> {
    let threads = threads.map_or(0, usize::from);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|source| CliError::Threads { threads, source })
}

/// `report` as one line of JSON.
pub(super) fn json(report: &impl Serialize) -> Result<Vec<u8>, io::Error> {
    let mut text = serde_json::to_vec(report)?;
    text.push(b'\n');
    Ok(text)
}
