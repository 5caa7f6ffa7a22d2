//! Events and predictions between the processes of one host, in shared memory.
//!
//! ```text
//! driver ----- NAME/events: slices of 16-byte records ----> inference ----- NAME/predictions: f32 ----> controller
//!        ----- NAME/events: "there is a slice" ----------->           ----- "there is a prediction" -->
//! ```
//!
//! The driver writes each record once, into shared memory. The inference reads it there: the payload is never copied again. A process that
//! waits sleeps until it is notified.
//!
//! | module | contents |
//! |---|---|
//! | [`wire`] | what lies in shared memory: records, and the headers of slices and predictions |
//! | [`channel`] | one service of iceoryx2 with its notifications; sizes, overflow, other versions |
//! | [`driver`], [`feed`] | events into slices, when they are due or as they arrive |
//! | [`losses`] | slices that did not arrive, with the reason |
//! | [`inference`] | slices into predictions, without any of iceoryx2 |
//! | [`node`] | the process that does so |
//! | [`controller`] | the process that takes predictions, and the latencies on their way |
//! | [`hop`] | the latency of one hop alone |
//! | [`clock`] | the clock that processes share |

pub mod channel;
pub mod clock;
pub mod controller;
pub mod driver;
pub mod error;
pub mod feed;
pub mod hop;
pub mod inference;
pub mod losses;
pub mod node;
pub mod wire;

pub use error::Error;
