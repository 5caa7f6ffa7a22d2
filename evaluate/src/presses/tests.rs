//! Presses with labels as people keep them: what is joined, and each oddity.

mod clocks;
mod hostile;
mod joined;
mod oddities;
mod prepared;

use std::fmt::Write;
use std::fs;
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_io::Format;
use tempfile::TempDir;

use super::{Oddity, OddityKind, Options, Presses};
use crate::error::Result;

const SENSOR: Sensor = Sensor { width: 32, height: 24 };

/// A folder of recordings, with tables.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("there is a place for temporary files"))
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// Adds a recording of `events` events from `first_us` to `last_us`; `seed` makes it unique.
    fn press(&self, name: &str, [first_us, last_us]: [i64; 2], events: i64, seed: i64) -> &Self {
        let span = last_us - first_us;
        let event = |i: i64| {
            let t_us = first_us + span * i / (events - 1).max(1);
            let (x, y) = ((i * 7 + seed) % 32, (i * 5 + seed / 32) % 24);
            Event::new(t_us, x as u16, y as u16, i % 2 == 0)
        };
        self.events(name, &(0..events).map(event).collect::<Vec<_>>())
    }

    fn events(&self, name: &str, events: &[Event]) -> &Self {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("it can be made");
        let format = Format::from_path(&path).expect("a format");
        meissner_io::write(&path, format, Some(SENSOR), events).expect("it can be written");
        self
    }

    fn file(&self, name: &str, text: &str) -> &Self {
        fs::write(self.path().join(name), text).expect("it can be written");
        self
    }

    /// Three presses of 100 ms, one after the other.
    fn three() -> Self {
        let folder = Self::new();
        for i in 0..3 {
            let first_us = i * 1_000_000;
            folder.press(&format!("press{i}.es"), [first_us, first_us + 100_000], 200, i);
        }
        folder
    }

    fn read(&self) -> Presses {
        self.try_read(&Options::default()).unwrap_or_else(|error| panic!("{error}"))
    }

    fn try_read(&self, options: &Options) -> Result<Presses> {
        Presses::read(self.path(), options)
    }

    fn refusal(&self, options: &Options) -> String {
        match self.try_read(options) {
            Ok(presses) => panic!("expected an error, found {:?}", presses.rows),
            Err(error) => {
                let mut text = error.to_string();
                let mut source = std::error::Error::source(&error);
                while let Some(error) = source {
                    let _ = write!(text, ": {error}");
                    source = error.source();
                }
                text
            }
        }
    }
}

/// The oddity of this kind.
fn odd(presses: &Presses, kind: OddityKind) -> &Oddity {
    let found = presses.odd.iter().find(|odd| odd.kind == kind);
    found.unwrap_or_else(|| panic!("{kind:?} among {:?}", presses.odd))
}

/// The kinds of all oddities.
fn kinds(presses: &Presses) -> Vec<OddityKind> {
    presses.odd.iter().map(|odd| odd.kind).collect()
}
