//! The events that filters must pass, computed from all events: the slow twin of
//! `meissner_engine::filters`.

use meissner_engine::filters::RateLimit;
use meissner_engine::{Event, Sensor};

/// A filter, by its rule.
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    /// Every nth event.
    Stride(u32),
    /// At most so many events a second.
    RateLimit(u64),
    /// A neighbour within so many microseconds.
    BackgroundActivity(i64),
    /// Silence for so many microseconds.
    Refractory(i64),
    /// One event in so many microseconds, and so many at once.
    HotPixel(i64, u32),
}

/// Whether each of `events` passes `rule`.
pub fn pass(rule: Rule, sensor: Sensor, events: &[Event]) -> Vec<bool> {
    let mut passed = Vec::new();
    for i in 0..events.len() {
        let passes = match rule {
            Rule::Stride(n) => i % n as usize == 0,
            Rule::RateLimit(rate) => allowed(rate, &events[..=i], &passed),
            Rule::BackgroundActivity(us) => supported(sensor, us, &events[..=i]),
            Rule::Refractory(us) => rested(sensor, us, &events[..=i], &passed),
            Rule::HotPixel(us, burst) => calm(sensor, us, burst, &events[..=i]),
        };
        passed.push(passes);
    }
    passed
}

/// Microseconds from an `earlier` event to the last one. Filters remember the earliest of all times
/// as the one after it.
fn apart(last: Event, earlier: Event) -> i128 {
    (i128::from(last.t_us) - i128::from(earlier.t_us.max(i64::MIN + 1))).abs()
}

/// Whether depth and rate allow the last event, counted from each event that passed before. Times
/// are the newest ones so far.
fn allowed(rate: u64, events: &[Event], passed: &[bool]) -> bool {
    let depth = i128::from((rate * RateLimit::DEPTH_US).max(1_000_000));
    let newest = |i: usize| events[..=i].iter().map(|e| i128::from(e.t_us)).max().unwrap_or(0);
    let now = newest(events.len() - 1);
    let mut since = 1;
    for i in (0..passed.len()).rev().filter(|&i| passed[i]) {
        since += 1;
        if since * 1_000_000 > depth + (now - newest(i)) * i128::from(rate) {
            return false;
        }
    }
    true
}

/// Whether the latest event of a pixel around the last one's is near in time.
fn supported(sensor: Sensor, us: i64, events: &[Event]) -> bool {
    let event = events[events.len() - 1];
    if !sensor.contains(event.x, event.y) {
        return true;
    }
    let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).filter(|&d| d != (0, 0));
    around
        .filter_map(|(dx, dy)| {
            let at = (i32::from(event.x) + dx, i32::from(event.y) + dy);
            let there = |e: &&Event| (i32::from(e.x), i32::from(e.y)) == at && sensor.contains(e.x, e.y);
            events.iter().rev().find(there)
        })
        .any(|neighbour| apart(event, *neighbour) <= i128::from(us))
}

/// Whether the last passed event of the same pixel is old enough.
fn rested(sensor: Sensor, us: i64, events: &[Event], passed: &[bool]) -> bool {
    let event = events[events.len() - 1];
    let before = (0..passed.len()).rev().find(|&i| {
        let e = events[i];
        passed[i] && (e.x, e.y) == (event.x, event.y)
    });
    !sensor.contains(event.x, event.y) || before.is_none_or(|i| apart(event, events[i]) >= i128::from(us))
}

/// Whether the debt of the last event's pixel, over all its events, is at most `burst` periods.
fn calm(sensor: Sensor, us: i64, burst: u32, events: &[Event]) -> bool {
    let event = events[events.len() - 1];
    let (period, most) = (i128::from(us), i128::from(burst) * i128::from(us));
    let (mut debt, mut kept, mut last) = (0, 0, i128::from(i64::MIN));
    for e in events.iter().filter(|e| (e.x, e.y) == (event.x, event.y)) {
        let t = i128::from(e.t_us);
        // Nothing is paid off after the end of time.
        debt = ((kept - (t - last)).max(0) + period).min(i128::from(i64::MAX) - t);
        kept = debt.min(2 * most);
        last = t;
    }
    !sensor.contains(event.x, event.y) || debt <= most
}
