//! Parts of the section of a result, before they are HTML.

use meissner_plot::{Panel, Parts, Plane, Quantiles, Series, Style, figure};

use crate::json::QUANTILES;
use crate::words::count;

/// The section of a result.
#[derive(Default)]
pub(crate) struct Section {
    /// The answer to a person's first question: the first sentence, and more.
    pub(crate) answer: Vec<String>,
    /// Figures by which results are compared: a name with its unit, and the value.
    pub(crate) figures: Vec<(String, f64)>,
    /// The main distribution of times in microseconds: what is timed, and its quantiles.
    pub(crate) times: Option<(String, Vec<f64>)>,
    pub(crate) pictures: Vec<Picture>,
    pub(crate) tables: Vec<Table>,
}

/// A picture with its caption.
pub(crate) struct Picture {
    pub(crate) svg: String,
    /// Width in pixels.
    pub(crate) width: f64,
    pub(crate) caption: String,
}

/// A table: a caption, headings, and rows of a name and cells.
pub(crate) struct Table {
    pub(crate) caption: String,
    pub(crate) headings: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Section {
    /// Adds a panel with a `caption`, which explains its content and how to read it.
    pub(crate) fn draw(&mut self, caption: impl Into<String>, panel: &Panel<'_>) {
        self.pictures.push(Picture::new(caption, panel));
    }

    /// Adds a table, unless it has no rows.
    pub(crate) fn table(&mut self, table: Table) {
        if !table.rows.is_empty() {
            self.tables.push(table);
        }
    }

    /// Adds a figure, if there is one.
    pub(crate) fn figure(&mut self, name: &str, value: Option<f64>) {
        if let Some(value) = value.filter(|value| value.is_finite()) {
            self.figures.push((name.to_owned(), value));
        }
    }

    /// Adds a picture and a table of quantiles of times in microseconds.
    pub(crate) fn latencies(&mut self, caption: &str, rows: Vec<(String, Vec<f64>)>) {
        if rows.is_empty() {
            return;
        }
        self.draw(caption, &Panel::Quantiles(quantiles("Latency", "", rows.clone())));
        let cells = |(name, quantiles): (String, Vec<f64>)| {
            std::iter::once(name).chain(quantiles.into_iter().map(crate::words::time)).collect()
        };
        let headings = ["", "median", "90 %", "99 %", "99.9 %", "longest"];
        self.table(Table::new("Latency", &headings, rows.into_iter().map(cells).collect()));
    }
}

impl Picture {
    pub(crate) fn new(caption: impl Into<String>, panel: &Panel<'_>) -> Self {
        let caption = caption.into();
        let (svg, width) = figure(&caption, panel);
        Self { svg, width, caption }
    }
}

impl Table {
    pub(crate) fn new(caption: impl Into<String>, headings: &[&str], rows: Vec<Vec<String>>) -> Self {
        let headings = headings.iter().map(|&heading| heading.to_owned()).collect();
        Self { caption: caption.into(), headings, rows }
    }
}

/// A panel of quantiles of times in microseconds.
pub(crate) fn quantiles(title: &str, about: &str, rows: Vec<(String, Vec<f64>)>) -> Quantiles {
    let names = ["median", "90 %", "99 %", "99.9 %", "longest"];
    Quantiles {
        title: title.to_owned(),
        about: about.to_owned(),
        x_title: "latency (us)".to_owned(),
        quantiles: names[..QUANTILES.len()].to_vec(),
        rows,
    }
}

/// A panel of lines in the size of a page.
pub(crate) fn plane(title: &str, axes: [&str; 2], series: Vec<Series>) -> Plane {
    Plane { compact: true, series, ..Plane::new(title, axes) }
}

/// Adds predicted over true values, unless the truth is constant. `what` names the values, and
/// `many` is their total number.
pub(crate) fn predicted(
    section: &mut Section,
    title: &str,
    unit: &str,
    points: Vec<(f64, f64)>,
    (what, many): (&str, f64),
) {
    if points.iter().all(|point| point.0 == points[0].0) {
        return;
    }
    let few = points.len() as f64;
    let share = if few < many {
        format!(" {} of {} are drawn, with those farthest off.", count(few), count(many))
    } else {
        String::new()
    };
    let caption = format!("Predicted over true values, {what}. On the dashed line they are equal.{share}");
    let dots = Series::new("predicted", 0, Style::Dots, points);
    let panel = Plane { compact: true, ..Plane::predicted(title, unit, vec![dots]) };
    section.draw(caption, &Panel::Plane(panel));
}

/// A panel of bars, each of which is divided into shares.
pub(crate) fn shares(
    title: &str,
    x_title: &str,
    parts: &[(&str, usize)],
    rows: Vec<(String, Vec<f64>)>,
) -> Parts {
    let parts = parts.iter().map(|&(part, colour)| (part.to_owned(), colour)).collect();
    Parts {
        title: title.to_owned(),
        about: String::new(),
        parts,
        x_title: x_title.to_owned(),
        shares: true,
        rows,
    }
}

/// A panel of bars of one part.
pub(crate) fn bars(title: &str, x_title: &str, rows: Vec<(String, f64)>) -> Parts {
    Parts {
        title: title.to_owned(),
        about: String::new(),
        parts: Vec::new(),
        x_title: x_title.to_owned(),
        shares: false,
        rows: rows.into_iter().map(|(name, value)| (name, vec![value])).collect(),
    }
}
