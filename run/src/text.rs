//! Numbers, sizes of sensors and lengths of time as text, in messages and on a command line.

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

#[cfg(test)]
mod tests {
    use super::{display_us, grouped, length_us, sensor, span_us};
    use meissner_engine::Sensor;

    #[test]
    fn a_sensor_has_two_sides_of_at_least_a_pixel() {
        assert_eq!(sensor("346x260"), Ok(Sensor::new(346, 260)));
        for text in ["", "346", "346x", "0x260", "346x0", "65536x1", "70000x1", "-1x1", "3x4x5", "346X260 "] {
            assert!(sensor(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_time_is_a_number_with_its_unit_read_exactly() {
        for (text, us) in [
            ("1us", 1),
            ("500us", 500),
            ("5ms", 5_000),
            ("1.5ms", 1_500),
            ("0.000001s", 1),
            ("2s", 2_000_000),
            ("2.50s", 2_500_000),
            ("3.0us", 3),
            ("1099511627776us", 1 << 40),
        ] {
            assert_eq!(span_us(text), Ok(us), "{text}");
        }
        assert_eq!(length_us("0s"), Ok(0));
    }

    #[test]
    fn bare_numbers_other_units_and_parts_of_a_microsecond_are_refused_with_the_forms() {
        for wrong in [
            "",
            "5",
            "0.5",
            "us",
            "ms",
            ".5ms",
            "5.ms",
            "-1ms",
            "+1ms",
            "1e3us",
            "5 ms",
            "5ns",
            "1min",
            "5MS",
            "0.5us",
            "1.0005ms",
            "1.5.5ms",
            "99999999999999999999us",
            "9223372036854775807s",
        ] {
            let message = span_us(wrong).expect_err(wrong);
            assert!(message.contains("such as 500us, 1.5ms or 2s"), "{wrong}: {message}");
        }
        assert!(span_us("0us").is_err() && span_us("13000000s").is_err());
    }

    #[test]
    fn a_time_is_shown_as_it_is_read() {
        for us in [1, 999, 1_000, 1_500, 10_000, 2_000_000, 2_000_001, 1 << 40] {
            assert_eq!(span_us(&display_us(us)), Ok(us));
        }
        assert_eq!([1_500, 10_000, 60_000_000].map(display_us), ["1500us", "10ms", "60s"]);
    }

    #[test]
    fn digits_come_in_groups_of_three() {
        let texts = [0, 12, 999, 1000, 12_345, 1_234_567].map(grouped);
        assert_eq!(texts, ["0", "12", "999", "1,000", "12,345", "1,234,567"]);
    }
}
