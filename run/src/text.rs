//! Numbers, sizes of sensors and lengths of time as text, in messages and on a command line.

use std::time::{SystemTime, UNIX_EPOCH};

use meissner_engine::{Network, Sensor};
pub use meissner_models::grouped;

/// The accepted forms of a time, for messages.
pub const TIME_FORMS: &str = "a time with its unit, such as 500us, 1.5ms or 2s";
/// Units with their microseconds. `s` comes last because the other units end with it.
const UNITS: [(&str, i64); 3] = [("us", 1), ("ms", 1_000), ("s", 1_000_000)];

/// Reads a time from 1 microsecond to the longest span of a window.
///
/// # Errors
/// The text is not a time in this range. The message names the expected forms.
pub fn span_us(text: &str) -> Result<i64, String> {
    within(text, 1)
}

/// Reads a time from 0 to the longest span of a window.
///
/// # Errors
/// As [`span_us`].
pub fn length_us(text: &str) -> Result<i64, String> {
    within(text, 0)
}

/// `us` microseconds as [`span_us`] reads them, in the largest unit that needs no decimals.
pub fn display_us(us: i64) -> String {
    let whole = UNITS.iter().rev().find(|(_, scale)| us % scale == 0);
    whole.map_or_else(String::new, |(unit, scale)| format!("{}{unit}", us / scale))
}

/// Reads a time of either sign, of at most 2^63 - 1 microseconds: the offset of a clock.
///
/// # Errors
/// The text is not such a time. The message names the expected forms.
pub fn signed_us(text: &str) -> Result<i64, String> {
    let (sign, size) = text.strip_prefix('-').map_or((1, text), |size| (-1, size));
    let us = microseconds(size.strip_prefix('+').filter(|_| sign > 0).unwrap_or(size));
    us.map(|us| sign * us).ok_or_else(|| format!("expected {TIME_FORMS}, or with a minus"))
}

/// The date in UTC by the system's clock, such as 2026-11-27.
pub fn date_now() -> String {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    date((since.as_secs() / 86_400) as i64)
}

/// The date `days` days after 1970-01-01, in the Gregorian calendar. In 400 years that each begin
/// in March, the lengths of months follow one line (Hinnant 2021, "chrono-compatible low-level date
/// algorithms").
pub(crate) fn date(days: i64) -> String {
    let (era, day) = ((days + 719_468).div_euclid(146_097), (days + 719_468).rem_euclid(146_097));
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let of_month = of_year - (153 * month + 2) / 5 + 1;
    let (month, next) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!("{:04}-{month:02}-{of_month:02}", year + 400 * era + next)
}

fn within(text: &str, least: i64) -> Result<i64, String> {
    let us = microseconds(text).ok_or_else(|| format!("expected {TIME_FORMS}"))?;
    let most = Network::MAX_SPAN_US;
    let range =
        || format!("expected a time from {least}us to {}, such as 500us, 1.5ms or 2s", display_us(most));
    if (least..=most).contains(&us) { Ok(us) } else { Err(range()) }
}

/// The microseconds of `text`; `None` if it is not a time, or not a whole number of microseconds.
fn microseconds(text: &str) -> Option<i64> {
    let (number, scale) = UNITS.iter().find_map(|(unit, scale)| Some((text.strip_suffix(unit)?, *scale)))?;
    let (whole, decimals) = number.split_once('.').unwrap_or((number, "0"));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(whole) || !digits(decimals) {
        return None;
    }
    let decimals = decimals.trim_end_matches('0');
    let part = 10_i64.checked_pow(decimals.len().try_into().ok()?)?;
    if scale % part != 0 {
        return None;
    }
    let decimals: i64 = if decimals.is_empty() { 0 } else { decimals.parse().ok()? };
    whole.parse::<i64>().ok()?.checked_mul(scale)?.checked_add(decimals * (scale / part))
}

/// Reads the size of a sensor, columns x rows.
///
/// # Errors
/// The text is not two numbers from 1 to 65535 around an x. The message says so.
pub fn sensor(text: &str) -> Result<Sensor, String> {
    let side = |text: &str| text.parse().ok().filter(|&side: &u16| side > 0);
    let parse = || {
        let (width, height) = text.split_once('x')?;
        Some(Sensor::new(side(width)?, side(height)?))
    };
    parse().ok_or_else(|| "expected columns x rows, each 1 to 65535, such as 346x260".to_owned())
}

/// Minimum similarity of a known name to an unknown one, from 0 to 1, at which it is suggested.
const SIMILAR: f64 = 0.7;

/// The name among `known` that is most similar to `name`, if one is similar enough.
pub fn most_similar<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let similarity = |known: &&str| strsim::jaro_winkler(name, known);
    let nearest = known.into_iter().max_by(|a, b| similarity(a).total_cmp(&similarity(b)));
    nearest.filter(|known| similarity(known) > SIMILAR)
}
