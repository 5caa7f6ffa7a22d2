//! Why there is no page.

use std::io;

/// Why there is no page. Messages say what was expected, what was found, and where.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file cannot be read.
    #[error("cannot read {name}")]
    Read {
        /// The file.
        name: String,
        /// Why.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{name}: expected a result of {RESULTS} in JSON, found {found}")]
    Other {
        /// The file.
        name: String,
        /// What it is.
        found: String,
    },
    /// A line is not what the program writes.
    #[error("{name}, line {line}: expected {expected}")]
    Line {
        /// The file.
        name: String,
        /// The line, from 1.
        line: u64,
        /// What stands in such a line.
        expected: &'static str,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// A line or an object has more bytes than any result.
    #[error("{name}, line {line}: expected at most {limit} bytes in one object, found more")]
    Long {
        /// The file.
        name: String,
        /// The line, from 1.
        line: u64,
        /// Bytes that are read.
        limit: usize,
    },
    /// The page would be too large to send.
    #[error("expected a page of at most {limit} bytes, found {bytes} from {results} results: give fewer")]
    Page {
        /// Bytes of a page.
        limit: usize,
        /// Bytes of this one.
        bytes: usize,
        /// Results on it.
        results: usize,
    },
}

/// What a page can show.
const RESULTS: &str = "run, play, bench, eval, pareto, verify, simulate loop or fit";
