//! Recordings of event cameras and event-based touch: bytes in, events out, and back.
//!
//! [`read`] and [`decode`] find the format from the content; [`write`](fn@write) and [`encode`] are told it.
//! A file that is truncated or corrupt gives an [`IoError`] that names the place, what was expected and what
//! was found: never a panic, never the events before a fault as if they were all, and never more memory than
//! [`limits`] states. EVT2, EVT3, DAT, N-MNIST and CSV do not say how long they are: cut exactly between two of
//! their words, events or lines, they are shorter recordings, and nobody can tell. With [`ReadOptions::salvage`] a file that is
//! cut short gives what is whole, and [`Recording::salvaged`] says what is not. Input of another kind ([`Kind`]) is refused
//! by name.
//!
//! | format | reads | writes | geometry | module |
//! |---|---|---|---|---|
//! | AEDAT4 (uncompressed, LZ4, Zstandard) | yes | | stream's `sizeX`, `sizeY` | `aedat4` |
//! | Prophesee EVT2 | yes | | header, where it says so | `evt2` |
//! | Prophesee EVT3 | yes | yes | header, where it says so | `evt3` |
//! | Prophesee DAT, version 2 | yes | yes | header, where it says so | `dat` |
//! | N-MNIST `.bin` | yes | | always 34x34 | `nmnist` |
//! | CSV and other text, in any order of columns ([`TextOptions`]), also line by line from a stream ([`CsvEvents`]) | yes | yes | `# sensor WxH` comment | `csv` |
//! | `NumPy` structured `.npy` | yes | yes | none | `npy` |
//!
//! Beside them: images for frame-based sensors ([`read_image`], [`ImageSequence`], [`write_png`]) and readings of
//! electrodes from CSV ([`Electrodes`]), and labelled sets of such recordings ([`datasets`]).
//!
//! ```
//! use meissner_engine::{Event, Sensor};
//! use meissner_io::{Format, decode, encode};
//!
//! let events = [Event::new(10, 3, 4, true), Event::new(12, 3, 5, false)];
//! let mut bytes = Vec::new();
//! encode(Format::Evt3, Some(Sensor::new(346, 260)), &events, &mut bytes)?;
//!
//! let recording = decode(&bytes)?;
//! assert_eq!(recording.format, Format::Evt3);
//! assert_eq!(recording.sensor, Some(Sensor::new(346, 260)));
//! assert_eq!(recording.events, events);
//! # Ok::<(), meissner_io::IoError>(())
//! ```
#![forbid(unsafe_code)]

mod aedat4;
mod atomic;
mod bytes;
mod check;
mod codec;
mod csv;
mod dat;
pub mod datasets;
mod detect;
mod electrodes;
mod error;
mod evt2;
mod evt3;
mod format;
mod images;
mod kind;
pub mod limits;
mod names;
mod natural;
mod nmnist;
mod npy;
mod prophesee;
mod recording;

pub use atomic::replace_file;
pub use codec::{ReadOptions, decode, decode_as, decode_with, encode, read, read_as, read_with, write};
pub use csv::{ColumnOrder, CsvEvents, TextOptions, TimeUnit};
pub use detect::detect;
pub use electrodes::{ELECTRODES, ElectrodeSettings, ElectrodeWarnings, Electrodes, Reading};
pub use error::{IoError, Place};
pub use format::Format;
pub use images::{
    Image, ImageError, ImageFormat, ImageSequence, decode_image, encode_png, read_image, write_png,
};
pub use kind::{Foreign, Kind};
pub use recording::{Recording, Salvage, StreamKind, StreamSummary};
