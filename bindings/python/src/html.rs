//! What a notebook shows of an object: a table of two or more columns.

use std::fmt::Write;

use meissner::EventCounters;

/// A table with a title, of rows of texts.
pub(crate) fn table<const N: usize>(title: &str, rows: &[[String; N]]) -> String {
    let mut html = format!("<table><caption>{}</caption><tbody>", escaped(title));
    for row in rows {
        html.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            let tag = if i == 0 { "th" } else { "td" };
            let _ = write!(html, "<{tag} style=\"text-align:left\">{}</{tag}>", escaped(cell));
        }
        html.push_str("</tr>");
    }
    html + "</tbody></table>"
}

/// The rows of an engine's counts: what came, and what was lost, by reason.
pub(crate) fn of_events(events: EventCounters) -> Vec<[String; 2]> {
    let mut rows = vec![["events pushed".to_owned(), events.pushed.to_string()]];
    let lost = [
        ("outside the sensor, dropped", events.outside_sensor),
        ("late, dropped", events.late),
        ("time out of range, dropped", events.time_out_of_range),
        ("far ahead, dropped", events.outliers),
        ("late, with the newest time", events.clamped),
        ("restarts of the sensor's clock", events.restarts),
    ];
    let lost = lost.into_iter().filter(|(_, count)| *count > 0);
    rows.extend(lost.map(|(name, count)| [name.to_owned(), count.to_string()]));
    rows
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
