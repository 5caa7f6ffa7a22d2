//! How the cost of an event grows with each quantity.

use meissner_plot::{Panel, Scale, Series, Style};
use serde_json::Value;

use crate::json::{list, number, text};
use crate::parts::{Section, Table, plane};
use crate::words::{count, number as shown, time};

/// Quantities by their key: words, and the title of an axis.
const QUANTITIES: [(&str, &str, &str); 5] = [
    ("window", "events in the window", "events in the window"),
    ("rate", "events a second", "events a second"),
    ("neighbours", "neighbours", "neighbours of an event"),
    ("channels", "channels", "channels, as a factor"),
    ("sensor", "pixels", "pixels of the sensor"),
];
/// A power with a smaller absolute value counts as none.
const FLAT: f64 = 0.1;

/// The section of a sweep.
pub(crate) fn section(object: &Value) -> Section {
    let mut section = Section::default();
    let (mut flat, mut rows) = (Vec::new(), Vec::new());
    for curve in list(object, "curves") {
        let key = text(curve, "quantity").unwrap_or("?");
        let (_, words, axis) =
            QUANTITIES.iter().copied().find(|(of, ..)| *of == key).unwrap_or((key, key, key));
        let points = list(curve, "points");
        let along = |key: &str| -> Vec<(f64, f64)> {
            let point = |point| Some((number(point, "value")?, number(point, key)?));
            points.iter().filter_map(point).collect()
        };
        let slope = |key: &str| number(curve, &format!("slopes/{key}"));
        let power = |key: &str| slope(key).map_or_else(|| "?".to_owned(), |slope| format!("{slope:.2}"));
        if let Some(median) = slope("p50") {
            if median.abs() < FLAT {
                flat.push(words);
            } else {
                let grows = format!("The median grows as the {words} to the power of {median:.2}.");
                section.answer.push(grows);
            }
            section.figure(&format!("{words}: power of the median"), Some(median));
        }
        for (key, what) in [
            ("behind_at", "The engine falls behind the stream"),
            ("late_at", "The 99 % quantile is above 1 ms"),
        ] {
            if let Some(value) = number(curve, key) {
                section.answer.push(format!("{what} from {} {words} on.", shown(value)));
            }
        }
        let series = [("p50", "median", 0), ("p99", "99 %", 1)].map(|(key, name, colour)| {
            let points = along(&format!("latency_us/{key}"));
            Series::new(format!("{name}: power {}", power(key)), colour, Style::Line, points)
        });
        let mut panel = plane(words, [axis, "push and prediction (us)"], series.into());
        panel.scale = Scale::Logarithmic;
        section.draw(
            format!(
                "Both axes are logarithmic: a slope is the power. Rows {}, memory {}.",
                power("rows"),
                power("state_bytes")
            ),
            &Panel::Plane(panel),
        );
        for point in points {
            let of = |key: &str| number(point, key);
            let value = of("value").map_or_else(String::new, shown);
            let times =
                ["latency_us/p50", "latency_us/p99"].map(|key| of(key).map_or_else(String::new, time));
            let [events, bytes] = ["nodes", "state_bytes"].map(|key| of(key).map_or_else(String::new, count));
            let of_event = of("rows_per_event").map_or_else(String::new, shown);
            rows.push(
                [vec![format!("{words}: {value}"), events], times.into(), vec![of_event, bytes]].concat(),
            );
        }
    }
    if !flat.is_empty() {
        section.answer.insert(0, format!("The median hardly depends on {}.", flat.join(", ")));
    }
    let headings = ["", "events in the window", "median", "99 %", "rows", "bytes of a new engine"];
    section.table(Table::new("Costs of an event", &headings, rows));
    let facts = [
        ("events timed for each value", number(object, "events").map(count)),
        ("events in the window, where not varied", number(object, "window").map(count)),
        ("events a second, where not varied", number(object, "rate_events_per_s").map(shown)),
        ("seed of events and weights", number(object, "seed").map(count)),
    ];
    let facts = facts.into_iter().filter_map(|(name, value)| Some(vec![name.to_owned(), value?]));
    section.table(Table::new("The sweep", &["", ""], facts.collect()));
    section
}
