//! Errors of a page.

use std::io;

/// The reason why there is no page. Messages state the expected and the found content, and the
/// location.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file cannot be read.
    #[error("cannot read {name}")]
    Read {
        /// The file.
        name: String,
        /// The reason.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{name}: expected a result of {RESULTS} in JSON, found {found}")]
    Other {
        /// The file.
        name: String,
        /// The kind of the file.
        found: String,
    },
    /// The program does not write such a line.
    #[error("{name}, line {line}: expected {expected}")]
    Line {
        /// The file.
        name: String,
        /// The line, from 1.
        line: u64,
        /// The expected content of the line.
        expected: &'static str,
        /// The fault in it.
        source: serde_json::Error,
    },
    /// A line or an object has more bytes than any result.
    #[error("{name}, line {line}: expected at most {limit} bytes in one object, found more")]
    Long {
        /// The file.
        name: String,
        /// The line, from 1.
        line: u64,
        /// Maximum number of bytes that are read.
        limit: usize,
    },
    /// The page would be too large to send.
    #[error("expected a page of at most {limit} bytes, found {bytes} from {results} results: give fewer")]
    Page {
        /// Maximum bytes of a page.
        limit: usize,
        /// Bytes of this one.
        bytes: usize,
        /// Number of results on it.
        results: usize,
    },
}

/// The results that a page can show.
const RESULTS: &str = "run, play, bench, eval, pareto, verify, simulate loop or fit";
