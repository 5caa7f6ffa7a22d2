//! Lookups in parsed JSON. A missing value, or a value of another type, counts as absent.

use serde_json::Value;

/// The value at a path such as `latency_us/push`.
pub(crate) fn at<'a>(value: &'a Value, path: &str) -> Option<&'a Value> {
    let found = path.split('/').try_fold(value, |value, key| value.get(key))?;
    (!found.is_null()).then_some(found)
}

/// The number at a path.
pub(crate) fn number(value: &Value, path: &str) -> Option<f64> {
    at(value, path)?.as_f64()
}

/// The text at a path.
pub(crate) fn text<'a>(value: &'a Value, path: &str) -> Option<&'a str> {
    at(value, path)?.as_str()
}

/// The list at a path; empty if there is none.
pub(crate) fn list<'a>(value: &'a Value, path: &str) -> &'a [Value] {
    at(value, path).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// The texts of a list.
pub(crate) fn texts<'a>(value: &'a Value, path: &str) -> Vec<&'a str> {
    list(value, path).iter().filter_map(Value::as_str).collect()
}

/// The numbers of a list; NaN for other values.
pub(crate) fn numbers(value: &Value, path: &str) -> Vec<f64> {
    list(value, path).iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
}

/// A list of pairs of numbers; other values are left out.
pub(crate) fn pairs(list: &Value) -> Vec<(f64, f64)> {
    let pair = |pair: &Value| Some((pair.get(0)?.as_f64()?, pair.get(1)?.as_f64()?));
    list.as_array().into_iter().flatten().filter_map(pair).collect()
}

/// The rows of a matrix of counts.
pub(crate) fn counts(value: &Value, path: &str) -> Vec<Vec<u64>> {
    let row =
        |row: &Value| row.as_array().into_iter().flatten().map(|count| count.as_u64().unwrap_or(0)).collect();
    list(value, path).iter().map(row).collect()
}

/// Names of quantiles, as the program writes them.
pub(crate) const QUANTILES: [&str; 5] = ["p50", "p90", "p99", "p999", "max"];

/// The quantiles of the distribution at a path.
pub(crate) fn quantiles(value: &Value, path: &str) -> Option<Vec<f64>> {
    let of = at(value, path)?;
    QUANTILES.iter().map(|name| number(of, name)).collect()
}
