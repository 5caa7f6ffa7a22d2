//! Meissner for JavaScript: the exports of the module `meissner_wasm.js`.
//!
//! - [`Engine`]: events in, predictions out, states as bytes
//! - [`Electrodes`]: readings of 24 electrodes in, directions of slip out
//! - [`Recording`]: the events of a file in any format of `io`
//! - [`Viewer`]: the session behind the page, one recording and its network
//!
//! Times are microseconds as JavaScript's numbers, whole up to 2^53. Errors of Rust are thrown as
//! an `Error`, with their message. There is one thread, only the page's clock, and no network
//! access.

mod electrodes;
mod engine;
mod press;
mod recording;
mod viewer;

use std::fmt::Display;

use wasm_bindgen::prelude::*;

pub use electrodes::Electrodes;
pub use engine::{Engine, networks};
pub use press::{press, press_hash};
pub use recording::Recording;
pub use viewer::Viewer;

/// `error` with its sources, to be thrown.
fn thrown(error: impl std::error::Error) -> JsError {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text = format!("{text}: {error}");
        source = error.source();
    }
    JsError::new(&text)
}

/// A refusal of an argument.
fn refused(what: &str, expected: impl Display, found: impl Display) -> JsError {
    JsError::new(&format!("{what}: expected {expected}, found {found}"))
}

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console, js_name = error)]
    fn console_error(text: &str);
}

/// Shows a panic, a fault of the library, in the console; the module then stops.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| console_error(&panic.to_string())));
}
