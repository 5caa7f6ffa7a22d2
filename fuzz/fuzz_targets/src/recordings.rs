//! Bytes as recordings of events or electrodes, or as images: a typed error, or a result that keeps
//! its promises and stays the same when it is written and read again.

use std::io::{BufReader, Write};

use meissner_engine::{Event, Sensor};
use meissner_io::limits::{EXPANSION, IMAGE_PIXELS, PACKET_BYTES};
use meissner_io::{
    CsvEvents, ElectrodeSettings, Electrodes, Format, Image, ImageSequence, IoError, LabelTable, LiveEvents,
    PixelFormat, RawVideo, ReadOptions, Recording, StreamKind, TextOptions, TimeUnit, VideoFormat, decode,
    decode_image, decode_with, encode, encode_png,
};

use crate::Verdict;
use crate::oracle::Choices;

/// Longest message of an error: it quotes only a part of the file.
const MESSAGE_BYTES: usize = 8 << 10;
/// Maximum number of events that are written and read again.
const REWRITTEN: usize = 4096;
/// Maximum number of pixels of images that are written and read again.
const REWRITTEN_PIXELS: usize = 1 << 16;

/// Recordings of `format`.
///
/// # Panics
/// If a promise is broken, as every function here.
pub(crate) fn recording(format: Format, bytes: &[u8]) -> Verdict {
    salvaged(format, bytes);
    let strict = decode_with(bytes, ReadOptions::from(format).strict(true));
    match decode_with(bytes, format) {
        Ok(recording) => {
            assert_eq!(recording.format, format);
            // A strict reader refuses exactly the omitted items.
            let unplaced = recording.other_streams.iter().any(|stream| stream.kind == StreamKind::Unplaced);
            match strict {
                Ok(strict) => assert_eq!((&strict, recording.left_out.len()), (&recording, 0)),
                Err(_) => assert!(unplaced || !recording.left_out.is_empty(), "refused without a reason"),
            }
            keeps_its_promises(bytes, &recording);
            Verdict::Accepted
        }
        Err(error) => refused(&error),
    }
}

/// MCAP: its events, and its pictures, which are read from a file.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn mcap(bytes: &[u8]) -> Verdict {
    let verdict = recording(Format::Mcap, bytes);
    // If nothing could declare a topic of pictures, there is none.
    if !bytes.windows(5).any(|window| window == b"Image") && !bytes.windows(3).any(|window| window == b"lz4")
    {
        return verdict;
    }
    let mut file = tempfile::NamedTempFile::new().expect("there is a place for temporary files");
    file.write_all(bytes).expect("it can be written");
    let Ok(pictures) = ImageSequence::open(file.path()) else { return verdict };
    for picture in pictures.take(16) {
        match picture {
            Ok((_, image)) => assert_eq!(image.data.len(), image.width * image.height * Image::CHANNELS),
            Err(IoError::Content { source, .. }) => drop(refused(&source)),
            // Any bytes can be a list of files that do not exist.
            Err(error) => assert!(matches!(error, IoError::Unfit { .. } | IoError::File { .. }), "{error}"),
        }
    }
    verdict
}

/// Raw bytes of a stream, whose first byte chooses the format and the sensor: in pieces of any
/// length they give the same, every event of Prophesee's formats is on the sensor, the number of
/// bytes bounds that of the events, and a file of AEDAT4 gives the same as its reader.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn raw(bytes: &[u8]) -> Verdict {
    let Some((&choice, bytes)) = bytes.split_first() else { return Verdict::Refused };
    let format = [Format::Evt2, Format::Evt21, Format::Evt3, Format::Aedat4][usize::from(choice % 4)];
    let sensor = (choice & 0x80 == 0).then_some(Sensor::new(640, 480));
    let items = |capacity| -> Vec<Result<Event, String>> {
        let input = BufReader::with_capacity(capacity, bytes);
        let items =
            LiveEvents::raw(input, format, ReadOptions::default().sensor(sensor)).expect("a raw format");
        items.map(|item| item.map_err(|error| error.to_string())).collect()
    };
    let found = items(1 << 16);
    assert_eq!(items(1), found);
    assert_eq!(items(1_400), found);
    if format == Format::Aedat4 {
        if let Ok(recording) = decode_with(bytes, ReadOptions::from(format).strict(true)) {
            assert_eq!(found, recording.events.into_iter().map(Ok).collect::<Vec<_>>());
        }
    } else {
        let outside = |event: &&Event| sensor.is_some_and(|sensor| !sensor.contains(event.x, event.y));
        assert_eq!(found.iter().flatten().filter(outside).count(), 0, "events outside the sensor");
        assert!(found.len() <= 32 * bytes.len(), "{} items of {} bytes", found.len(), bytes.len());
    }
    if found.iter().all(Result::is_ok) { Verdict::Accepted } else { Verdict::Refused }
}

/// CSV, whole and line by line: the buffer's size does not change the events, and a bad line costs
/// one item. A stream and a file are read the same.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn csv(bytes: &[u8]) -> Verdict {
    let columns = "txyp".parse().ok();
    let said = TextOptions::default().columns(columns).time_unit(TimeUnit::Microseconds);
    for options in [TextOptions::default(), said] {
        let items = |capacity| -> Vec<Result<Event, String>> {
            let items = CsvEvents::with_options(BufReader::with_capacity(capacity, bytes), options);
            items.map(|item| item.map_err(|error| error.to_string())).collect()
        };
        let (whole, pieces) = (items(1 << 16), items(7));
        // The read part of an overlong line depends on the buffer.
        let known = |items: &[Result<Event, String>]| {
            items.iter().take_while(|item| item.is_ok()).cloned().collect::<Vec<_>>()
        };
        assert_eq!((whole.len(), known(&whole)), (pieces.len(), known(&pieces)));
        let lines = bytes.split(|&b| b == b'\n').count();
        assert!(whole.len() <= lines, "{} items of {lines} lines", whole.len());
        let asked = ReadOptions::from(Format::Csv).text(options);
        let strict = decode_with(bytes, asked.strict(true)).map(|recording| recording.events);
        let read = decode_with(bytes, asked).map(|recording| recording.events);
        if options == said {
            let good: Vec<_> = whole.iter().filter_map(|item| item.clone().ok()).collect();
            assert_eq!(strict.ok(), whole.into_iter().collect::<Result<Vec<_>, _>>().ok());
            assert!(read.is_err() || read.ok() == Some(good));
        }
    }
    recording(Format::Csv, bytes)
}

/// A recording in the format that its content shows.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn any_recording(bytes: &[u8]) -> Verdict {
    match decode(bytes) {
        Ok(recording) => {
            assert_eq!(decode_with(bytes, recording.format).ok().as_ref(), Some(&recording));
            keeps_its_promises(bytes, &recording);
            Verdict::Accepted
        }
        Err(error) => refused(&error),
    }
}

/// Events made of the bytes, written and read again: refused before anything is written, or equal.
pub(crate) fn convert(bytes: &[u8]) -> Verdict {
    let mut choices = Choices::new(bytes);
    let sensor = choices.flag().then(|| Sensor::new(choices.u16(), choices.u16()));
    let far = choices.flag();
    let mut now = 0_i64;
    let mut events = Vec::new();
    while !choices.is_empty() && events.len() < REWRITTEN {
        let step = if far { choices.u64() as i64 } else { i64::from(choices.u16() as i16) };
        now = now.wrapping_add(step);
        let (x, y) = (choices.u16(), choices.u16());
        let on = choices.flag();
        events.push(Event::new(now, x, y, on));
    }
    if rewritten(sensor, &events) > 0 { Verdict::Accepted } else { Verdict::Refused }
}

/// The whole part of a file that may be cut short.
fn salvaged(format: Format, bytes: &[u8]) {
    let asked = ReadOptions::from(format).salvage(true);
    let salvaged = decode_with(bytes, asked);
    match &salvaged {
        Ok(recording) => keeps_its_promises(bytes, recording),
        Err(error) => drop(refused(error)),
    }
    // A last line without a line feed may determine the order of the columns.
    if format != Format::Csv
        && let Ok(whole) = decode_with(bytes, format)
    {
        assert_eq!(salvaged.ok().map(|recording| recording.events), Some(whole.events));
    }
}

fn refused(error: &IoError) -> Verdict {
    let message = error.to_string();
    assert!(message.contains("expected"), "{message}");
    assert!(message.len() <= MESSAGE_BYTES, "a message of {} bytes", message.len());
    Verdict::Refused
}

fn keeps_its_promises(bytes: &[u8], recording: &Recording) {
    let Recording { format, sensor, events, .. } = recording;
    let length = match bytes {
        // The maximum size to which gzip or zip may expand.
        [0x1f, 0x8b, ..] | [b'P', b'K', ..] => PACKET_BYTES + bytes.len() as u64 * EXPANSION,
        _ => bytes.len() as u64,
    };
    let most = match format {
        Format::Aedat4 => (PACKET_BYTES + length * EXPANSION) / 16,
        Format::Hdf5 => (PACKET_BYTES + length * EXPANSION) / 9,
        // Plus a block of words, before it is checked.
        Format::Mcap => PACKET_BYTES / 16 + length * 6 + (12 << 12),
        _ => length * 6,
    };
    assert!(events.len() as u64 <= most, "{} events of {length} bytes", events.len());
    if let Some(sensor) = sensor {
        assert!(events.iter().all(|e| sensor.contains(e.x, e.y)), "an event beside {sensor}");
    }
    rewritten(*sensor, &events[..events.len().min(REWRITTEN)]);
}

/// Writes `events` in every format that can contain them and reads them again; returns the number
/// of such formats.
fn rewritten(sensor: Option<Sensor>, events: &[Event]) -> usize {
    let held = Format::ALL.into_iter().filter(|format| format.is_writable()).filter(|&format| {
        let mut bytes = Vec::new();
        if let Err(error) = encode(format, sensor, events, &mut bytes) {
            refused(&error);
            assert!(bytes.is_empty(), "{format}: written before it was refused");
            return false;
        }
        let again = decode_with(&bytes, format).unwrap_or_else(|e| panic!("{format}, written here: {e}"));
        assert_eq!(again.events, events, "{format}");
        if format != Format::Npy {
            assert_eq!(again.sensor, sensor, "{format}");
        }
        true
    });
    held.count()
}

/// Readings of electrodes, in pieces and whole.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn electrodes(bytes: &[u8]) -> Verdict {
    let read = |capacity| {
        let mut readings =
            Electrodes::new(BufReader::with_capacity(capacity, bytes), ElectrodeSettings::default());
        let (mut line, mut delivered, mut refused) = (0, Vec::new(), 0);
        while let Some(item) = readings.next() {
            match item {
                Ok(reading) => {
                    assert!(reading.line > line, "line {} after line {line}", reading.line);
                    assert!(reading.values.iter().all(|value| value.is_finite()));
                    line = reading.line;
                    delivered.push((reading, readings.follows()));
                }
                Err(error) => {
                    let message = error.to_string();
                    assert!(message.contains("expected"), "{message}");
                    refused += 1;
                }
            }
        }
        assert!(readings.next().is_none(), "an item after the end");
        (delivered, refused, readings.warnings())
    };
    let (delivered, refused, warnings) = read(1 << 16);
    // Times may be infinite in seconds although they are finite in their unit.
    assert_eq!(format!("{:?}", (&delivered, refused, warnings)), format!("{:?}", read(5)));
    if refused == 0 { Verdict::Accepted } else { Verdict::Refused }
}

/// Raw video, whose first four bytes choose its size and pixels: its whole pictures and one error
/// about a rest, in pieces of any length.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn video(bytes: &[u8]) -> Verdict {
    let &[width, height, shift, pixels, ref bytes @ ..] = bytes else { return Verdict::Refused };
    let [width, height] = [width, height].map(|side| u64::from(side) << (shift % 56));
    let pixels = [PixelFormat::Rgb24, PixelFormat::Bgr24, PixelFormat::Gray8][usize::from(pixels % 3)];
    let format = match VideoFormat::new(width, height, pixels) {
        Ok(format) => format,
        Err(error) => {
            assert!(error.to_string().contains("expected"), "{error}");
            return Verdict::Refused;
        }
    };
    assert!((1..=IMAGE_PIXELS).contains(&(width * height)));
    let items = |capacity| -> Vec<Result<Image, String>> {
        let items = RawVideo::new(BufReader::with_capacity(capacity, bytes), format);
        items.map(|item| item.map_err(|error| error.to_string())).collect()
    };
    let found = items(1 << 16);
    assert_eq!(items(1), found);
    let (whole, rest) = (bytes.len() / format.bytes(), bytes.len() % format.bytes());
    let images: Vec<_> = found.iter().map_while(|item| item.as_ref().ok()).collect();
    assert!(images.len() == whole && found.len() == whole + usize::from(rest > 0 || whole == 0));
    assert!(images.iter().all(|image| image.data.len() as u64 == width * height * Image::CHANNELS as u64));
    if found.len() == whole { Verdict::Accepted } else { Verdict::Refused }
}

/// Tables of labels: rows in the order of their lines, with a value or none for every label, and
/// classes that have a name. An added comment and another line end change nothing.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn labels(bytes: &[u8]) -> Verdict {
    let table = match LabelTable::parse(bytes) {
        Ok(table) => table,
        Err(error) => return refused(&error),
    };
    let rows = table.rows();
    assert!(rows > 0 && rows < bytes.len() && !table.labels.is_empty());
    assert!(table.lines.is_sorted_by(|a, b| a < b), "lines {:?}", table.lines);
    assert_eq!(table.times_us.len(), rows);
    assert!(table.recordings.as_ref().is_none_or(|recordings| recordings.len() == rows));
    for label in &table.labels {
        let classes = label.classes().len();
        for value in (0..rows).filter_map(|row| label.value(row)) {
            assert!(value.is_finite() && (classes == 0 || value < classes as f64), "{}: {value}", label.name);
        }
        assert!(label.refused.iter().all(|(row, _)| label.value(*row).is_none()));
    }
    let commented = [bytes, b"\n# the end\r\n"].concat();
    // NaN, which stands for a missing value, is not equal to itself.
    assert_eq!(format!("{:?}", LabelTable::parse(&commented)), format!("{:?}", Ok::<_, IoError>(table)));
    Verdict::Accepted
}

/// PNG, JPEG and PNM.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn image(bytes: &[u8]) -> Verdict {
    let image = match decode_image(bytes) {
        Ok(image) => image,
        Err(error) => {
            let message = error.to_string();
            assert!(message.contains("expected"), "{message}");
            return Verdict::Refused;
        }
    };
    let pixels = image.width * image.height;
    assert!((1..=IMAGE_PIXELS as usize).contains(&pixels), "{pixels} pixels");
    assert_eq!(image.data.len(), pixels * Image::CHANNELS);
    if pixels <= REWRITTEN_PIXELS {
        let png = encode_png(image.width, image.height, &image.data).expect("an image can be written");
        assert_eq!(decode_image(&png).expect("what was written can be read"), image);
    }
    Verdict::Accepted
}
