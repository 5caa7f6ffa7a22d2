//! Letters of braille under an event skin of 8 x 10 taxels (`NUSkin`), from the arrays of a
//! `NumPy` archive to labelled recordings of events.
//!
//! Input: a folder with the archive, or its path. Output: a recording of each press. A reading
//! `adc` of a taxel falls as pressure rises.
//!
//! **Times.** A host gets the readings in batches, every 15.7 ms. Within a batch, only their order
//! is correct. They are spread evenly over the time that the batch covers, which ends when it
//! arrives ([`spread`]). Host times that step back are sorted first.
//!
//! **Events.** A reading that differs from the previous one of its taxel (1,024 before the first
//! one) is an event at the position of the taxel; it is on if the pressure rises. A reading that
//! does not differ is not an event. Events do not contain the size of a change: letters are
//! distinguished equally well without it.
//!
//! **Ends.** A recording contains the events from 0.2 s before contact to 0.2 s after the lift.
//!
//! **Places.** The archive has the two halves of the skin, five columns each, in swapped order: its
//! columns 0 and 9 are adjacent on the skin. The event at its column c is in column (c + 5) mod 10.
//! So letters with adjacent dots press adjacent taxels, and the middle of the skin has the most
//! events instead of its edges.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use meissner_engine::Event;

use super::{Contact, EventDataset, EventRecording, Split};
use crate::error::IoError;
use crate::files::read_whole;
use crate::limits::{PRESS_US, PRESSES, STAMP_US};
use crate::npy::Integers;
use crate::{npy, zip};

/// The file with the presses.
const ARCHIVE: &str = "letters.npz";
/// The arrays of the archive, in the order of [`Arrays::parse`].
const ARRAYS: [&str; 10] =
    ["t_us", "taxel", "adc", "start", "letter", "number", "stamps_us", "test", "place", "letters"];
/// Columns and rows of the skin.
const SIZE: [u16; 2] = [10, 8];
/// Number of positions in the archive: taxels count from 1, so one position has no taxel.
const PLACES: usize = 81;
/// A reading without pressure, before the first one of a taxel.
const REST: i64 = 1024;
/// Time from a batch to the next.
const PERIOD_US: i64 = 15_700;
/// Readings of one batch follow the previous reading by less than this.
const WITHIN_US: i64 = 8_000;
/// Length of the part of a recording that is read before contact and after the lift.
const MARGIN_US: i64 = 200_000;
/// Columns of a half of the skin.
const HALF: u16 = 5;

impl EventDataset {
    /// Reads presses on letters of braille from `letters.npz` in `folder`, or at this path.
    /// `classes` are the names of the letters, a blank being "space", in the order of their
    /// indices; pixels are 10 columns and 8 rows of taxels. O(bytes) of the arrays; all events are
    /// held in memory.
    ///
    /// The arrays, of integers of any width:
    ///
    /// | name | shape | |
    /// |---|---|---|
    /// | `t_us` | (readings) | the host's microseconds |
    /// | `taxel` | (readings) | 1 to 80 |
    /// | `adc` | (readings) | 0 to 1,024, falling as pressure rises |
    /// | `start` | (presses + 1) | the first reading of each press, and the number of readings |
    /// | `letter`, `number` | (presses) | index into `letters`, and number of the press |
    /// | `stamps_us` | (presses, 3) | the instants of [`Contact`] |
    /// | `test` | (presses) | whether the press is for evaluation |
    /// | `place` | (81, 2) | column and row of each taxel, with the halves of the skin swapped |
    /// | `letters` | (letters) | `<U1` |
    ///
    /// A recording is called `<train|test>/<letter>/<number>`. It may have no events, if the skin
    /// did not detect the press.
    ///
    /// # Errors
    /// [`IoError`], with the path and the byte, if the archive cannot be read, lacks an array or
    /// has one twice, shapes do not fit each other, a value is out of range, a reading is ten
    /// minutes away from its press, a letter is not among `classes`, or two presses have one name.
    /// Contents beyond [`limits`](crate::limits) are refused.
    pub fn letters(folder: impl AsRef<Path>, classes: &[&str]) -> Result<Self, IoError> {
        let folder = folder.as_ref();
        let path = if folder.is_dir() { folder.join(ARCHIVE) } else { folder.to_owned() };
        let bytes = read_whole(&path)?;
        let mut found = Self::new();
        let mut contents: BTreeMap<&str, Vec<u8>> = BTreeMap::new();
        zip::for_each(&bytes, |name, content| {
            let stem = name.strip_suffix(".npy");
            match ARRAYS.into_iter().find(|known| stem == Some(*known)) {
                Some(known) if contents.insert(known, content.to_vec()).is_some() => {
                    return Err(IoError::unfit(&path, "one array of a name", format!("two of {known}")));
                }
                Some(_) => {}
                None => found.passed_over.push(path.join(name)),
            }
            Ok(())
        })
        .map_err(|error| match error {
            IoError::Unfit { .. } => error,
            _ => IoError::content(&path)(error),
        })?;
        let arrays = Arrays::parse(&path, &contents)?;
        let classes = arrays.classes(classes)?;
        let mut presses = (0..arrays.presses())
            .map(|press| arrays.recording(press, &classes))
            .collect::<Result<Vec<_>, _>>()?;
        presses.sort_by(|(a, i), (b, j)| (a.split, a.class, i).cmp(&(b.split, b.class, j)));
        let two = presses.array_windows().find(|[(a, _), (b, _)]| a.name == b.name);
        if let Some([(twice, _), _]) = two {
            return Err(IoError::unfit(&path, "one press of a name", format!("two of {}", twice.name)));
        }
        if presses.is_empty() {
            return Err(IoError::unfit(&path, "presses", "none"));
        }
        found.recordings = presses.into_iter().map(|(recording, _)| recording).collect();
        Ok(found)
    }
}

/// The arrays of an archive, with shapes that fit each other.
struct Arrays<'a> {
    path: &'a Path,
    t_us: Integers<'a, 1>,
    taxel: Integers<'a, 1>,
    adc: Integers<'a, 1>,
    start: Integers<'a, 1>,
    letter: Integers<'a, 1>,
    number: Integers<'a, 1>,
    stamps_us: Integers<'a, 2>,
    test: Integers<'a, 1>,
    /// Column and row of each taxel.
    place: Vec<[u16; 2]>,
    letters: Vec<String>,
}

impl<'a> Arrays<'a> {
    fn parse(path: &'a Path, contents: &'a BTreeMap<&str, Vec<u8>>) -> Result<Self, IoError> {
        let content = |name: &str| {
            let missing = || IoError::unfit(path, format!("an array {name}"), "none");
            contents.get(name).map(Vec::as_slice).ok_or_else(missing)
        };
        // All names before any content.
        ARRAYS.iter().try_for_each(|name| content(name).map(|_| ()))?;
        let list = |name: &str| {
            let list = Integers::<1>::of(content(name)?);
            list.map_err(IoError::content(&of_array(path, name)))
        };
        let pairs = |name: &str| {
            let pairs = Integers::<2>::of(content(name)?);
            pairs.map_err(IoError::content(&of_array(path, name)))
        };
        let arrays = Self {
            path,
            t_us: list("t_us")?,
            taxel: list("taxel")?,
            adc: list("adc")?,
            start: list("start")?,
            letter: list("letter")?,
            number: list("number")?,
            stamps_us: pairs("stamps_us")?,
            test: list("test")?,
            place: places(&pairs("place")?).map_err(IoError::content(&of_array(path, "place")))?,
            letters: letters(content("letters")?).map_err(IoError::content(&of_array(path, "letters")))?,
        };
        let [readings] = arrays.t_us.shape;
        let [presses] = arrays.letter.shape;
        if presses > PRESSES {
            let path = of_array(path, "letter");
            return Err(IoError::unfit(&path, format!("at most {PRESSES} presses"), presses.to_string()));
        }
        for (name, found, expected) in [
            ("taxel", &arrays.taxel.shape[..], &[readings][..]),
            ("adc", &arrays.adc.shape, &[readings]),
            ("start", &arrays.start.shape, &[presses.saturating_add(1)]),
            ("number", &arrays.number.shape, &[presses]),
            ("stamps_us", &arrays.stamps_us.shape, &[presses, 3]),
            ("test", &arrays.test.shape, &[presses]),
        ] {
            if found != expected {
                let expected = format!("the shape {expected:?} for {readings} readings of {presses} presses");
                return Err(IoError::unfit(&of_array(path, name), expected, format!("{found:?}")));
            }
        }
        Ok(arrays)
    }

    fn presses(&self) -> usize {
        self.letter.len()
    }

    /// The value at `i` of the array `name`, which must be in `range`.
    fn value<const N: usize>(
        &self,
        (name, array): (&str, &Integers<'_, N>),
        i: usize,
        range: Range<i64>,
    ) -> Result<i64, IoError> {
        let value = array.within(i, range);
        value.map_err(IoError::content(&of_array(self.path, name)))
    }

    /// The index among `classes` of each of the letters.
    fn classes(&self, classes: &[&str]) -> Result<Vec<usize>, IoError> {
        let class = |letter: &String| {
            classes.iter().position(|class| class == letter).ok_or_else(|| {
                let path = of_array(self.path, "letters");
                IoError::unfit(&path, format!("letters {}", classes.join(", ")), format!("{letter:?}"))
            })
        };
        self.letters.iter().map(class).collect()
    }

    /// The recording of a press, and its number.
    fn recording(&self, press: usize, classes: &[usize]) -> Result<(EventRecording, i64), IoError> {
        let letter = self.value(("letter", &self.letter), press, 0..self.letters.len() as i64)? as usize;
        let number = self.value(("number", &self.number), press, 0..i64::MAX)?;
        let test = self.value(("test", &self.test), press, 0..2)?;
        let split = if test == 1 { Split::Test } else { Split::Train };
        let mut stamps = [0; 3];
        let mut range = 0..STAMP_US;
        for (i, stamp) in stamps.iter_mut().enumerate() {
            *stamp = self.value(("stamps_us", &self.stamps_us), 3 * press + i, range)?;
            range = *stamp..stamp.saturating_add(PRESS_US);
        }
        let contact = Contact { begin_us: stamps[0], held_us: stamps[1], lifted_us: stamps[2] };
        let events = self.events(self.readings(press)?, contact)?;
        let name = format!("{split}/{}/{number}", self.letters[letter]);
        let recording =
            EventRecording { name, split, class: classes[letter], events, contact: Some(contact) };
        Ok((recording, number))
    }

    /// The readings of a press.
    fn readings(&self, press: usize) -> Result<Range<usize>, IoError> {
        let start = ("start", &self.start);
        let count = self.t_us.len() as i64;
        let most = if press == 0 { 0 } else { count };
        let from = self.value(start, press, 0..most.saturating_add(1))?;
        let least = if press + 1 == self.presses() { count } else { from };
        let until = self.value(start, press + 1, least..count.saturating_add(1))?;
        if (until - from) as u64 > PRESSES {
            let expected = format!("at most {PRESSES} readings of a press");
            let error = self.start.unlike(press + 1, expected, until - from);
            return Err(IoError::content(&of_array(self.path, "start"))(error));
        }
        Ok(from as usize..until as usize)
    }

    /// The events of a press, from its readings.
    fn events(&self, readings: Range<usize>, contact: Contact) -> Result<Vec<Event>, IoError> {
        let near = contact.begin_us - PRESS_US..contact.lifted_us + PRESS_US;
        let host = |i| self.value(("t_us", &self.t_us), i, near.clone()).map(|t_us| (t_us, i));
        let mut order = readings.map(host).collect::<Result<Vec<_>, _>>()?;
        order.sort_unstable();
        let host: Vec<i64> = order.iter().map(|(t_us, _)| *t_us).collect();
        let taken = contact.begin_us - MARGIN_US..=contact.lifted_us + MARGIN_US;
        let mut last = [REST; PLACES];
        let mut events = Vec::new();
        for ((_, i), t_us) in order.into_iter().zip(spread(&host)) {
            let taxel = self.value(("taxel", &self.taxel), i, 1..PLACES as i64)? as usize;
            let adc = self.value(("adc", &self.adc), i, 0..REST + 1)?;
            let [x, y] = self.place[taxel];
            if adc != last[taxel] && taken.contains(&t_us) {
                events.push(Event::new(t_us, x, y, adc < last[taxel]));
            }
            last[taxel] = adc;
        }
        Ok(events)
    }
}

/// The array `name` in the archive at `path`.
fn of_array(path: &Path, name: &str) -> PathBuf {
    path.join(format!("{name}.npy"))
}

/// Column and row of each taxel, with the halves in their correct order; taxel 0, which does not
/// exist, is at 0.
fn places(array: &Integers<'_, 2>) -> Result<Vec<[u16; 2]>, IoError> {
    if array.shape != [PLACES as u64, 2] {
        return Err(array.unlike(
            0,
            format!("an array of the shape ({PLACES}, 2)"),
            format!("{:?}", array.shape),
        ));
    }
    let mut places = vec![[0, 0]; PLACES];
    for (taxel, place) in places.iter_mut().enumerate().skip(1) {
        for (side, (at, size)) in place.iter_mut().zip(SIZE).enumerate() {
            *at = array.within(2 * taxel + side, 0..size.into())? as u16;
        }
        place[0] = (place[0] + HALF) % SIZE[0];
    }
    Ok(places)
}

/// The names of the letters.
fn letters(content: &[u8]) -> Result<Vec<String>, IoError> {
    let letters = npy::array_of::<1, 4>(content, "<U1")?;
    let name = |&code: &[u8; 4]| match char::from_u32(u32::from_le_bytes(code)) {
        Some(' ') => "space".to_owned(),
        letter => letter.map_or_else(String::new, String::from),
    };
    Ok(letters.values.iter().map(name).collect())
}

/// Estimated true times of readings that a host received at `host` in batches.
///
/// A batch covers the time since the one before, at most a period, and ends when its first reading
/// arrives. Its readings follow each other evenly, the last one at its end. If the input times do
/// not descend, the output times do not descend either.
fn spread(host: &[i64]) -> impl Iterator<Item = i64> {
    let mut before: Option<i64> = None;
    host.chunk_by(|earlier, later| later - earlier < WITHIN_US).flat_map(move |batch| {
        let (arrival, count) = (batch[0], batch.len() as i64);
        let covered = before.replace(arrival).map_or(PERIOD_US, |before| PERIOD_US.min(arrival - before));
        (1..=count).map(move |i| arrival - covered + covered * i / count)
    })
}
