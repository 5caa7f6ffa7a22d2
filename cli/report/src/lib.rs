//! Makes one page of HTML from results of the `meissner` program, to keep, to print and to send.
//!
//! Input: the JSON that `run`, `play`, `bench`, `eval`, `pareto`, `verify`, `simulate loop` and
//! `fit` write (`docs/json.md`), and the truth from tables, if given. Output: one page that needs
//! neither network nor scripts. Equal results give equal bytes.
//!
//! | file | contents |
//! |---|---|
//! | `read`, `stream`, `truth` | a file to an [`Outcome`]: predictions in bounded memory |
//! | `decimated` | a line of millions of points, reduced to 512 |
//! | `sections` | the section of each kind of result: an answer, facts, pictures, tables |
//! | `compare` | several results side by side |
//! | `parts`, `words`, `json` | parts of a section, numbers for people, lookups |
//! | `html` | the page, with `page.css` |
//!
//! Pictures are those of `meissner-plot`.
//!
//! ```
//! use meissner_report::{Page, Truths, read};
//!
//! let lines = concat!(
//!     r#"{"header":{"meissner":"0.1.0","schema":1,"command":"run","input":{"name":"press.es"},"#,
//!     r#""network":{"name":"own"},"outputs":[{"name":"force","unit":"N"}],"warnings":[]}}"#,
//!     "\n",
//!     r#"{"t_us":1000,"value":[0.5],"nodes":3,"update_us":2.0}"#,
//!     "\n",
//!     r#"{"t_us":2000,"value":[0.75],"nodes":4,"update_us":2.5}"#,
//!     "\n",
//! );
//! let results = read("press.jsonl", lines.as_bytes(), &Truths::default())?;
//! let page = Page { results: &results, drawings: &[] }.html()?;
//! assert!(page.contains("0.75 N") && page.starts_with("<!DOCTYPE html>"));
//! # Ok::<(), meissner_report::ReportError>(())
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod compare;
mod decimated;
mod error;
mod html;
mod json;
mod parts;
mod read;
mod sections;
mod stream;
#[cfg(test)]
mod tests;
mod truth;
mod words;

pub use error::ReportError;
pub use html::{Drawing, MAX_BYTES, Page};
pub use read::{Outcome, read};
pub use truth::{Truth, Truths};
