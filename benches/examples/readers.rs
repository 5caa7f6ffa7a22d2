//! Events per second from a file of each format in the page cache: `cargo run --release -p
//! meissner-benches --example readers -- [FOLDER] [--json]`.
//!
//! The files stay in FOLDER for `benches/peers/readers.py`. Every file is checked before it is
//! timed.

use std::fs;
use std::path::{Path, PathBuf};

use meissner_benches::timing::median_ms;
use meissner_engine::Event;
use meissner_io::{Format, IoError, ReadOptions, TimeRange, read, read_with};

use meissner_io_tests::codecs::aedat::{DAVIS346, aedat2, aedat3, davis_records};
use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet};
use meissner_io_tests::codecs::mcap::{channel, file, message, mono_packet, packed_chunk, schema};
use meissner_io_tests::codecs::{SENSOR, encoded, evt2, evt2_words, evt21, evt21_words};

/// Number of events of a file.
const EVENTS: i64 = 1_000_000;
/// Number of reads of a file.
const RUNS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let json = arguments.iter().any(|argument| argument == "--json");
    let folder = arguments.iter().find(|argument| !argument.starts_with("--"));
    let folder = folder.map_or_else(|| std::env::temp_dir().join("meissner-readers"), PathBuf::from);
    fs::create_dir_all(&folder)?;
    let events = events();
    for (name, bytes) in files(&events) {
        let path = folder.join(name);
        fs::write(&path, &bytes)?;
        let bytes_per_event = bytes.len() as f64 / EVENTS as f64;
        drop(bytes);
        assert_eq!(read(&path)?.events, events, "{name}");
        let whole_ms = time(&path, ReadOptions::default())?;
        // A hundredth from the middle.
        let middle = EVENTS * STEP_US / 2;
        let part = TimeRange::since_first(middle..middle + EVENTS * STEP_US / 100);
        let part_ms = time(&path, ReadOptions::default().range(part))?;
        let rate = EVENTS as f64 / whole_ms * 1e3;
        if json {
            println!(
                "{{\"file\":\"{name}\",\"bytes_per_event\":{bytes_per_event:.3},\"events_per_s\":{rate:.0},\"part_ms\":{part_ms:.3}}}"
            );
        } else {
            let rate = rate / 1e6;
            println!(
                "{name:<20} {bytes_per_event:>6.2} bytes/event {rate:>8.1} M events/s, 1 % in {part_ms:>8.3} ms"
            );
        }
    }
    Ok(())
}

fn time(path: &Path, options: ReadOptions) -> Result<f64, IoError> {
    median_ms(RUNS, || read_with(path, options).map(drop))
}

/// Mean microseconds from event to event: a hundred seconds in total.
const STEP_US: i64 = 100;

/// A dot that moves in a circle, with noise.
fn events() -> Vec<Event> {
    let event = |i: i64| {
        let (angle, noise) = (i as f64 * 1e-4, (i * 7919 % 1009) as f64 / 1009.0);
        let radius = 60.0 + 30.0 * noise;
        let (x, y) = (173.0 + radius * angle.cos(), 130.0 + radius * angle.sin());
        Event::new(i * STEP_US + i % 7, x as u16, y as u16, i * 31 % 5 < 2)
    };
    (0..EVENTS).map(event).collect()
}

/// The name and the content of each file.
fn files(events: &[Event]) -> Vec<(&'static str, Vec<u8>)> {
    let aedat4 = |compression| {
        let mut file = File::new(compression, Some(SENSOR));
        events.chunks(5_000).for_each(|events| file.push(0, &event_packet(events)));
        file.bytes()
    };
    let header = "% evt 2.0\n% format EVT2;height=260;width=346\n% geometry 346x260\n% end\n";
    let written = |format| encoded(format, Some(SENSOR), events);
    vec![
        ("events.lz4.aedat4", aedat4(Compression::Lz4)),
        ("events.zstd.aedat4", aedat4(Compression::Zstd)),
        ("events.3.aedat", aedat3(events, 5_000)),
        ("events.2.aedat", aedat2(&DAVIS346, &davis_records(SENSOR, events))),
        ("events.evt2.raw", evt2(header, &evt2_words(events))),
        (
            "events.evt21.raw",
            evt21(
                "% evt 2.1\n% format EVT21;height=260;width=346;endianness=little\n% end\n",
                &evt21_words(events),
                false,
            ),
        ),
        ("events.evt3.raw", written(Format::Evt3)),
        ("events.own.aedat4", written(Format::Aedat4)),
        ("events.dat", written(Format::Dat)),
        ("events.es", written(Format::Es)),
        ("events.csv", written(Format::Csv)),
        ("events.npy", written(Format::Npy)),
        ("events.lz4.mcap", written(Format::Mcap)),
        ("events.zstd.mcap", bag(events)),
    ]
}

/// A bag with packets of 5,000 events in chunks of Zstandard.
fn bag(events: &[Event]) -> Vec<u8> {
    let declared = [schema(1, "event_camera_msgs/msg/EventPacket"), channel(1, 1, "/events", "cdr")];
    let chunks = events.chunks(5_000).zip(0..).map(|(events, seq)| {
        let packet = mono_packet(SENSOR, seq, events);
        let records =
            [if seq == 0 { declared.concat() } else { Vec::new() }, message(1, 0, &packet)].concat();
        packed_chunk("zstd", &records, &Compression::Zstd.pack(&records))
    });
    file(&chunks.collect::<Vec<_>>())
}
