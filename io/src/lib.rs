//! Recordings of event cameras and event-based touch: bytes to events, and events to bytes.
//!
//! [`read`] and [`decode`] find the format from the content; [`write`](fn@write) and [`encode`]
//! take it as an argument. A file that is truncated or corrupt gives an [`IoError`] with the place,
//! the expected and the actual value. Readers never panic, and never use more memory than
//! [`limits`] allows. Odd words, events and lines, such as padding or an event outside the sensor,
//! are left out and counted in [`Recording::left_out`]; [`ReadOptions::strict`] refuses them. Only
//! AEDAT4, MCAP and npy contain their length: any other file that is cut between events is a valid
//! shorter recording. With [`ReadOptions::salvage`], a file that is cut short is read up to the
//! cut, and [`Recording::salvaged`] describes the rest. Input of another kind ([`Kind`]) is refused
//! by its name.
//!
//! | format | reads | writes | geometry | module |
//! |---|---|---|---|---|
//! | AEDAT4 (uncompressed, LZ4, Zstandard) | yes | LZ4 | stream's `sizeX`, `sizeY` | `aedat4` |
//! | AEDAT 3.1 (DVS Gesture), format RAW | yes | | the source's chip, if it is known | `aedat3` |
//! | AEDAT 2.0 (jAER), DVS128 and DAVIS | yes | | the chip | `aedat2` |
//! | Prophesee EVT2 | yes | | header, if it names one | `evt2` |
//! | Prophesee EVT3 | yes | yes | header, if it names one | `evt3` |
//! | Prophesee DAT, version 2 | yes | yes | header, if it names one | `dat` |
//! | Event Stream 2 (`.es`), DVS events | yes | yes | header | `es` |
//! | N-MNIST `.bin` | yes | | always 34x34 | `nmnist` |
//! | CSV, other text ([`TextOptions`]), a [stream](LiveEvents) | yes | yes | comment | `csv` |
//! | `NumPy` structured `.npy` | yes | yes | none | `npy` |
//! | HDF5 of DSEC and Prophesee (feature `hdf5`) | yes | | Prophesee: `geometry` | `hdf5` |
//! | MCAP of ROS 2 and Foxglove | yes | yes, by message ([`McapWriter`]) | messages | `mcap` |
//!
//! A recording inside a gzip file, or the only recording in a zip archive, is unpacked first. With
//! [`ReadOptions::range`] a part is read by time ([`TimeRange`]); for AEDAT, EVT2, DAT, npy and
//! HDF5 the other parts of the file are not read.
//!
//! [`LiveEvents`] reads events as they arrive: text, records, raw bytes of Prophesee's sensors and
//! packets of iniVation's. [`EventPackets`] reads the messages of event cameras in ROS 2. The crate
//! also reads images of frame-based sensors ([`read_image`], [`ImageSequence`], [`RawVideo`],
//! [`write_png`]), readings of electrodes from CSV ([`Electrodes`]), tables of labels
//! ([`LabelTable`]), and labelled sets of recordings ([`datasets`]).
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

mod aedat2;
mod aedat3;
mod aedat4;
mod bytes;
mod codec;
mod csv;
mod dat;
pub mod datasets;
mod detect;
mod electrodes;
mod error;
mod es;
mod evt2;
mod evt3;
mod files;
mod format;
#[cfg(feature = "hdf5")]
mod hdf5;
mod image_sequence;
mod images;
mod labels;
mod left_out;
pub mod limits;
mod mcap;
mod nmnist;
mod npy;
mod options;
mod packed;
mod prophesee;
mod raw;
mod recording;
mod ros;
mod seek;
#[cfg(test)]
mod tests;
mod text;
mod wire;
mod zip;

pub use aedat2::Chip;
pub use aedat4::write::Aedat4Writer;
pub use codec::{
    HeldContent, blocks, decode, decode_with, encode, read, read_content, read_range, read_with, write,
};
pub use csv::{ColumnOrder, CsvEvents, TextOptions, TimeUnit};
pub use detect::detect;
pub use electrodes::{ELECTRODES, ElectrodeSettings, ElectrodeWarnings, Electrodes, Reading};
pub use error::{IoError, Place};
pub use files::{check_replaceable, check_writable, read_file, read_whole, replace_file, write_file};
pub use format::{EVENT_FIELDS, Foreign, Format, ImageFormat, Kind, UnknownName};
pub use image_sequence::ImageSequence;
pub use images::{
    Image, PixelFormat, RawVideo, VideoFormat, decode_image, encode_palette_png, encode_png, read_image,
    write_png,
};
pub use labels::{LabelClock, LabelColumn, LabelTable, LabelValues};
pub use left_out::{LeftOut, LeftOutKind, is_mostly_refused};
pub use mcap::write::McapWriter;
pub use options::ReadOptions;
pub use recording::{Recording, Salvage, StreamKind, StreamSummary};
pub use ros::EventPackets;
pub use seek::{Blocks, DISORDER_US, TimeRange};
pub use wire::{LiveEvents, RECORD_BYTES, event_of, record};
