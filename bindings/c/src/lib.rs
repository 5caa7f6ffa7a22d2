//! The C and C++ interface of the engine, as `include/meissner.h` declares it.
//!
//! ```text
//! C program -> meissner_c: arguments checked, panics caught -> meissner: Engine, FrameEngine, Live
//! ```
//!
//! | file | functions |
//! |---|---|
//! | `network.rs` | `meissner_network_*`: descriptions with weights, from names, files, bytes |
//! | `engine.rs` | `meissner_engine_*`: events to predictions |
//! | `frames.rs` | `meissner_frames_*`: frames to predictions |
//! | `live.rs` | `meissner_input_*`, `meissner_live_*`: a queue, a thread, deadlines |
//! | `log.rs` | `meissner_set_log`, and the warnings that it receives |
//! | `handles.rs` | the values behind handles, and which thread may use them when |
//! | `status.rs` | results of calls, and their texts |
//!
//! The header's comments state what callers must know. A test generates the header from this
//! source.
#![expect(unsafe_code, reason = "the interface is made of raw pointers; each use of one says why it holds")]
#![allow(non_camel_case_types, reason = "the names are those of the header")]
#![expect(
    clippy::missing_safety_doc,
    reason = "what callers must keep is said once, at the top of the header"
)]
#![expect(clippy::doc_markdown, reason = "comments go into the header, which is no Markdown")]

mod arguments;
mod engine;
mod frames;
mod handles;
mod live;
mod log;
mod network;
mod status;
#[cfg(test)]
mod tests;

use std::ffi::{CStr, c_char};

pub use engine::*;
pub use frames::*;
pub use live::*;
pub use log::*;
pub use network::*;
pub use status::*;

/// The version of the library: 65536 times the major, 256 times the minor and the patch number.
#[unsafe(no_mangle)]
pub extern "C" fn meissner_version() -> u32 {
    let number = |text: &str| text.parse::<u32>().unwrap_or(0);
    (number(env!("CARGO_PKG_VERSION_MAJOR")) << 16)
        + (number(env!("CARGO_PKG_VERSION_MINOR")) << 8)
        + number(env!("CARGO_PKG_VERSION_PATCH"))
}

/// The version as text, for example "0.2.0". The pointer stays valid.
#[unsafe(no_mangle)]
pub extern "C" fn meissner_version_text() -> *const c_char {
    const TEXT: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    TEXT.as_ptr().cast()
}

/// Whether this library and this processor have a feature: "events", "frames" and "live" name parts
/// of the interface, other names instruction sets ("portable", "avx2", "avx512").
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_has_feature(name: *const c_char) -> bool {
    if name.is_null() {
        return false;
    }
    // SAFETY: the caller passes a string that ends in NUL.
    let name = unsafe { CStr::from_ptr(name) }.to_bytes();
    [&b"events"[..], b"frames", b"live"].contains(&name)
        || meissner::Isa::available().iter().any(|isa| isa.name().as_bytes() == name)
}
