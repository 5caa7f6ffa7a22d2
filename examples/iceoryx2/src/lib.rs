//! Events and predictions between the processes of one host, in shared memory.
//!
//! ```text
//! driver -- NAME/events: slices of records --> inference -- NAME/predictions: f32 --> controller
//!        -- "there is a slice" -------------->           -- "there is a prediction" ->
//! ```
//!
//! The driver writes each record once, into shared memory. The inference reads it there: the
//! payload is never copied again. A process that waits sleeps until it is notified.
//!
//! | module | contents |
//! |---|---|
//! | [`wire`] | the data in shared memory: records, and the headers of slices and predictions |
//! | [`channel`] | one service of iceoryx2 with its notifications |
//! | [`driver`] | events into slices, and the clock that processes share |
//!
//! The program has the processes: `drive`, `infer`, `watch`.

pub mod channel;
pub mod driver;
pub mod wire;
