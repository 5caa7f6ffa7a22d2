//! Events and predictions between the processes of one host, in shared memory.
//!
//! ```text
//! driver ----- NAME/events: slices of 16-byte records ----> inference ----- NAME/predictions: f32 ----> controller
//!        ----- NAME/events: "there is a slice" ----------->           ----- "there is a prediction" -->
//! ```
//!
//! The driver writes each record once, into shared memory. The inference reads it there: the
//! payload is never copied again. A process that waits sleeps until it is notified.
//!
//! | module | contents |
//! |---|---|
//! | [`wire`] | what lies in shared memory: records, and the headers of slices and predictions |
//! | [`channel`] | one service of iceoryx2 with its notifications; sizes, overflow, other versions |
//! | [`driver`] | events into slices, and the clock that processes share |
//! | [`inference`] | slices into predictions: `meissner_packets`, without any of iceoryx2 |
//! | [`node`] | the process that does so |
//! | [`controller`] | the process that takes predictions, and the latencies on their way |

pub mod channel;
pub mod controller;
pub mod driver;
pub mod error;
pub mod inference;
pub mod node;
pub mod wire;

pub use error::Error;
