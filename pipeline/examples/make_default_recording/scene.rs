//! A synthetic press and release on an optical tactile sensor: dark marker dots on a bright gel, seen by an event
//! camera. Made for demonstration and tests; no figure about real touch may rest on it.
//!
//! A contact pushes the dots under it outward and drags them sideways: a dot at distance d < R from the contact's
//! centre c moves by depth (1 - (d / R)^2)^2 (SPREAD (p - c) / R + DRAG). A pixel fires when its brightness has risen
//! or fallen by the contrast threshold since its last event; times are interpolated between the frames.
//!
//! Only integers and the f64 operations that IEEE 754 rounds exactly (+ - * / sqrt), in a fixed order: every machine
//! makes the same events.

use meissner_engine::{Event, Sensor};
use meissner_models::random::Random;

/// The simulated sensor.
pub(crate) const SENSOR: Sensor = Sensor { width: 240, height: 180 };

const DURATION_US: i64 = 600_000;
const FRAME_US: i64 = 1_000;
/// Distance between neighbouring dots, and from the border to the first, in pixels.
const PITCH: i32 = 20;
const DOT_RADIUS: f64 = 5.0;
/// Pixels over which a dot's edge goes from dark to bright.
const EDGE: f64 = 2.0;
/// Brightness in the middle of a dot; around the dots it is 1.
const DARK: f64 = 0.2;
/// A pixel fires when its brightness has changed by this factor.
const CONTRAST: f64 = 1.35;
/// Radius R of the contact.
const CONTACT_RADIUS: f64 = 80.0;
/// Largest outward displacement of a dot, in pixels.
const SPREAD: f64 = 10.0;
/// Largest sideways displacement of a dot, in pixels.
const DRAG: [f64; 2] = [3.0, -1.5];
/// Where the contact starts, in pixels, and where it has slid to when it is released.
const CONTACT: [[f64; 2]; 2] = [[108.0, 84.0], [124.0, 92.0]];
/// The press starts, is at full depth, starts to lift, has lifted.
const PHASES_US: [i64; 4] = [60_000, 180_000, 380_000, 520_000];
/// Mean time between two noise events of the whole sensor.
const NOISE_US: i64 = 1_500;
const SEED: u64 = 0x6d65_6973_736e_6572;

/// The events of the recording, in order of time, then row, then column.
pub(crate) fn press_and_release() -> Vec<Event> {
    let (width, height) = (usize::from(SENSOR.width), usize::from(SENSOR.height));
    let mut before = brightness(0);
    let mut random = Random::new(SEED);
    // A pixel at rest stands anywhere between its thresholds. All in the middle would fire together at the very end,
    // when their brightness is back where it was.
    let mut reference: Vec<f64> =
        before.iter().map(|b| b * (0.8 + below(&mut random, 1 << 16) as f64 / f64::from(1 << 17))).collect();
    let mut events = Vec::new();
    for frame in 1..=DURATION_US / FRAME_US {
        let start_us = (frame - 1) * FRAME_US;
        let now = brightness(frame * FRAME_US);
        for pixel in 0..width * height {
            let (from, to) = (before[pixel], now[pixel]);
            let reference = &mut reference[pixel];
            loop {
                let (level, on) = if to >= *reference * CONTRAST {
                    (*reference * CONTRAST, true)
                } else if to <= *reference / CONTRAST {
                    (*reference / CONTRAST, false)
                } else {
                    break;
                };
                // The line between the frames crosses the level here.
                let share = (level - from) / (to - from);
                let t_us = start_us + (share * FRAME_US as f64) as i64;
                events.push(Event::new(t_us, (pixel % width) as u16, (pixel / width) as u16, on));
                *reference = level;
            }
        }
        before = now;
    }
    add_noise(&mut events, &mut random);
    events.sort_by_key(|e| (e.t_us, e.y, e.x));
    events
}

/// How deep the contact is pressed at `t_us`, from 0 to 1.
fn depth(t_us: i64) -> f64 {
    let [press, pressed, lift, lifted] = PHASES_US;
    smooth(t_us, press, pressed) * (1.0 - smooth(t_us, lift, lifted))
}

/// 0 before `start_us`, 1 after `end_us`, 3 s^2 - 2 s^3 between.
fn smooth(t_us: i64, start_us: i64, end_us: i64) -> f64 {
    let share = (t_us - start_us).clamp(0, end_us - start_us) as f64 / (end_us - start_us) as f64;
    share * share * (3.0 - 2.0 * share)
}

/// Brightness of every pixel at `t_us`, row after row.
fn brightness(t_us: i64) -> Vec<f64> {
    let (width, height) = (i32::from(SENSOR.width), i32::from(SENSOR.height));
    let mut image = vec![1.0_f64; (width * height) as usize];
    let depth = depth(t_us);
    let slid = smooth(t_us, PHASES_US[1], PHASES_US[3]);
    let contact = [0, 1].map(|d| CONTACT[0][d] + slid * (CONTACT[1][d] - CONTACT[0][d]));
    let reach = (DOT_RADIUS + EDGE) as i32 + 1;
    for row in 0..height / PITCH {
        for column in 0..width / PITCH {
            let rest = [column, row].map(|i| f64::from(i * PITCH + PITCH / 2));
            let dot = displaced(rest, contact, depth);
            let [x, y] = dot.map(|v| v as i32);
            for py in (y - reach).max(0)..(y + reach + 1).min(height) {
                for px in (x - reach).max(0)..(x + reach + 1).min(width) {
                    let (dx, dy) = (f64::from(px) - dot[0], f64::from(py) - dot[1]);
                    let outside = ((dx * dx + dy * dy).sqrt() - DOT_RADIUS) / EDGE + 0.5;
                    let pixel = &mut image[(py * width + px) as usize];
                    *pixel = pixel.min(DARK + (1.0 - DARK) * outside.clamp(0.0, 1.0));
                }
            }
        }
    }
    image
}

/// Where a dot that rests at `rest` is under the contact.
fn displaced(rest: [f64; 2], contact: [f64; 2], depth: f64) -> [f64; 2] {
    let away = [0, 1].map(|d| (rest[d] - contact[d]) / CONTACT_RADIUS);
    let inside = 1.0 - (away[0] * away[0] + away[1] * away[1]);
    let pull = if inside > 0.0 { depth * inside * inside } else { 0.0 };
    [0, 1].map(|d| rest[d] + pull * (SPREAD * away[d] + DRAG[d]))
}

/// Background activity: events at random pixels and times, of either polarity.
fn add_noise(events: &mut Vec<Event>, random: &mut Random) {
    let mut t_us = below(random, 2 * NOISE_US);
    while t_us < DURATION_US {
        let (x, y) = (below(random, SENSOR.width.into()) as u16, below(random, SENSOR.height.into()) as u16);
        events.push(Event::new(t_us, x, y, below(random, 2) == 1));
        t_us += 1 + below(random, 2 * NOISE_US);
    }
}

/// An integer from 0 to less than `bound`.
fn below(random: &mut Random, bound: i64) -> i64 {
    (random.bits() >> 33) as i64 % bound
}
