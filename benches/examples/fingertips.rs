//! Recordings of many fingertips for `meissner play`, and of two that misbehave.
//!
//! `cargo run --release -p meissner-benches --example fingertips -- FOLDER [COUNT]` writes
//!
//! | file | events |
//! |---|---|
//! | `00.npy`, ... | a dome is pressed to 10 mm and lifted, [`RATE`] events a second, and noise |
//! | `flood.npy` | the same over and over, [`FLOOD`] times as fast |
//! | `garbage.npy` | random positions, most outside the sensor, times that step back by up to 1 s |
//!
//! All begin and end at rest and have the same duration. Equal arguments give equal bytes.

use std::path::Path;

use meissner_benches::Result;
use meissner_engine::{Event, Sensor};
use meissner_io::Format;
use meissner_simulator::{
    Camera, CameraSettings, Dome, DomeView, MarkerScene, MarkerTracks, PressTable, SimulatedEvent,
};

const SENSOR: Sensor = Sensor { width: 346, height: 260 };
/// Events in a second of a fingertip, without the noise that a slower press adds.
const RATE: f64 = 5000.0;
/// Factor by which the flood is faster: above a million events per second.
const FLOOD: i64 = 200;
const DEPTH_MM: f64 = 10.0;
/// Number of times of a track at which markers have positions.
const STEPS: i64 = 200;
/// Duration of a first film, which shows how many events a press has.
const GUESS_US: i64 = 4_000_000;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("usage: fingertips FOLDER [COUNT]")?;
    let count = arguments.next().map_or(Ok(20), |count| count.parse::<u32>())?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let write = |name: &str, sensor, events: &[Event]| -> Result<()> {
        meissner_io::write(&folder.join(name), Format::Npy, sensor, events)?;
        println!("{name}: {} events", events.len());
        Ok(())
    };
    let table = PressTable::new(&Dome::default(), DEPTH_MM);
    // A slower press has more noise: one correction is enough.
    let guessed = film(&table, 0, GUESS_US)?.len();
    let duration_us = (guessed as f64 / RATE * 1e3) as i64 * 1000;
    let first = film(&table, 0, duration_us)?;
    println!("{:.0} events in a second", first.len() as f64 / (duration_us as f64 / 1e6));
    for number in 0..count {
        write(&format!("{number:02}.npy"), Some(SENSOR), &film(&table, number, duration_us)?)?;
    }
    let part_us = duration_us / FLOOD;
    let quick = |part: i64| {
        first.iter().map(move |event| Event { t_us: part * part_us + event.t_us / FLOOD, ..*event })
    };
    write("flood.npy", Some(SENSOR), &(0..FLOOD).flat_map(quick).collect::<Vec<_>>())?;
    write("garbage.npy", None, &garbage(&first))
}

/// The events of the fingertip of this number during a press and a lift.
fn film(table: &PressTable, number: u32, duration_us: i64) -> Result<Vec<Event>> {
    let view = DomeView::new(&Dome::default(), SENSOR);
    let (tilt, azimuth) = (PressTable::MAX_TILT * f64::from(number % 7) / 7.0, f64::from(number) * 2.4);
    let (mut markers, mut positions) = (Vec::new(), Vec::new());
    for step in 0..=STEPS {
        let share = step as f64 / STEPS as f64;
        table.markers(tilt, azimuth, DEPTH_MM * 4.0 * share * (1.0 - share), &mut markers);
        positions.extend(markers.iter().map(|&marker| view.place(marker)));
    }
    let t_us = (0..=STEPS).map(|step| duration_us * step / STEPS).collect();
    let scene = MarkerScene::default();
    let mut camera = Camera::new(SENSOR, CameraSettings::tactile(), number.into())?;
    let mut simulated: Vec<SimulatedEvent> = Vec::new();
    MarkerTracks::new(t_us, table.count(), positions)?.film(&scene, &mut camera, &mut simulated)?;
    Ok(simulated.into_iter().map(|simulated| simulated.event).collect())
}

/// As many events as `fine`, in an order that no sensor would send.
fn garbage(fine: &[Event]) -> Vec<Event> {
    // Multiplicative congruences of Knuth's MMIX: any scatter will do.
    let mut state = 1_u64;
    let mut next = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let scattered = |event: &Event| {
        let t_us = (event.t_us - next(1_000_000) as i64 * (next(4) / 3) as i64).max(0);
        Event::new(t_us, next(1200) as u16, next(900) as u16, next(2) == 0)
    };
    fine.iter().map(scattered).collect()
}
