//! Numbers and times as people read them.

use meissner_plot::grouped;
pub(crate) use meissner_plot::percent;

/// A number with three or four digits, and a comma between thousands.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        return "not a number".to_owned();
    }
    if size >= 1000.0 {
        let sign = if value < 0.0 { "-" } else { "" };
        return format!("{sign}{}", grouped(size.round() as u64));
    }
    let decimals = match size {
        100.0.. => 1,
        10.0.. => 2,
        0.1.. => 3,
        0.001.. => 4,
        _ => 6,
    };
    let text = format!("{value:.decimals$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if matches!(text, "" | "-0" | "-") { "0".to_owned() } else { text.to_owned() }
}

/// A count.
pub(crate) fn count(value: f64) -> String {
    if value >= 0.0 { grouped(value.round() as u64) } else { number(value) }
}

/// A time in the largest unit that leaves at least 1.
pub(crate) fn time(us: f64) -> String {
    match us {
        1e6.. => format!("{} s", digits(us / 1e6)),
        1e3.. => format!("{} ms", digits(us / 1e3)),
        _ => format!("{} us", digits(us)),
    }
}

/// A number with two or three digits.
fn digits(value: f64) -> String {
    let text = match value.abs() {
        1000.0.. => return number(value),
        100.0.. => return format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    };
    text.strip_suffix(".00").or(text.strip_suffix(".0")).map_or(text.clone(), str::to_owned)
}

/// A number of bytes.
pub(crate) fn bytes(bytes: f64) -> String {
    if bytes >= 1e6 { format!("{:.1} MB", bytes / 1e6) } else { format!("{:.0} kB", bytes / 1e3) }
}

/// `one`, or `many` after any other number.
pub(crate) fn counted(value: f64, one: &str, many: &str) -> String {
    let name = if value == 1.0 { one } else { many };
    format!("{} {name}", count(value))
}

/// The name of a file without its folders, and without a remark in brackets.
pub(crate) fn file_name(path: &str) -> &str {
    let path = path.split(" (").next().unwrap_or(path);
    path.rsplit(['/', '\\']).next().filter(|name| !name.is_empty()).unwrap_or(path)
}

/// Degrees instead of radians for angles that people read; any other unit stays.
pub(crate) fn shown_unit(unit: &str) -> (&str, f64) {
    match unit {
        "rad" => ("degrees", 180.0 / std::f64::consts::PI),
        "deg" => ("degrees", 1.0),
        unit => (unit, 1.0),
    }
}
