//! An SVG document as a list of elements.
//!
//! Input: shapes and text at positions in pixels, with y downwards. Output: well-formed XML. Text
//! is always escaped, numbers have at most one decimal, and equal calls give equal bytes.

use std::fmt::{self, Display, Write};

/// A position: x and y in pixels, y downwards.
pub(crate) type Place = (f64, f64);

/// Colours of series. Readers who confuse red and green can tell them apart.
pub(crate) const COLOURS: [&str; 6] = ["#0072b2", "#e69f00", "#009e73", "#cc3377", "#56b4e9", "#999999"];
/// Colours of steps of a quantity, from dark to light, also in grey.
pub(crate) const ORDERED: [&str; 6] = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#e0ca20"];
pub(crate) const INK: &str = "#222222";
pub(crate) const GREY: &str = "#555555";
pub(crate) const FRAME: &str = "#777777";
pub(crate) const WHITE: &str = "#ffffff";
/// Numbers on dark and on light colours of series.
pub(crate) const ON_DARK: &str = "#fefefe";
pub(crate) const ON_LIGHT: &str = "#000000";
/// Colour of the strongest cell of a confusion matrix.
pub(crate) const SHADE: &str = "#004880";
pub(crate) const LINE: &str = "#444444";
pub(crate) const GRID: &str = "#cccccc";
pub(crate) const FINE_GRID: &str = "#efefef";
/// The colours of pictures by their purpose, so that a page can replace them in a dark scheme.
/// Colours of series, of numbers on them and of boxes of networks are not included, because they
/// stay.
pub const PALETTE: [(&str, &str); 8] = [
    ("ground", WHITE),
    ("ink", INK),
    ("grey", GREY),
    ("frame", FRAME),
    ("line", LINE),
    ("grid", GRID),
    ("fine-grid", FINE_GRID),
    ("shade", SHADE),
];
/// Font size of notes and legends in pixels; other text has 13.
pub(crate) const SMALL: f64 = 11.5;

/// The colour of the series with this number; colours repeat.
pub(crate) fn colour(series: usize) -> &'static str {
    COLOURS[series % COLOURS.len()]
}

/// A rectangle of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Area {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
}

impl Area {
    /// The rectangle with this corner, width and height.
    pub(crate) fn at((left, top): Place, width: f64, height: f64) -> Self {
        Self { left, top, right: left + width, bottom: top + height }
    }

    /// The smallest rectangle that contains two positions, with `margin` on every side.
    pub(crate) fn spanning(a: Place, b: Place, margin: f64) -> Self {
        let (left, top) = (a.0.min(b.0) - margin, a.1.min(b.1) - margin);
        Self { left, top, right: a.0.max(b.0) + margin, bottom: a.1.max(b.1) + margin }
    }

    pub(crate) fn width(&self) -> f64 {
        self.right - self.left
    }

    pub(crate) fn height(&self) -> f64 {
        self.bottom - self.top
    }

    pub(crate) fn centre(&self) -> Place {
        (f64::midpoint(self.left, self.right), f64::midpoint(self.top, self.bottom))
    }

    /// The position in this area that is nearest to `place`.
    pub(crate) fn nearest(&self, (x, y): Place) -> Place {
        (x.clamp(self.left, self.right), y.clamp(self.top, self.bottom))
    }

    /// Whether the two areas have more than a border in common.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    /// Whether `place` is inside or on the border.
    pub(crate) fn contains(&self, place: Place) -> bool {
        self.nearest(place) == place
    }
}

/// Elements in the order in which they are drawn: later ones cover earlier ones.
#[derive(Debug, Default)]
pub(crate) struct Svg {
    elements: Vec<Element>,
}

/// One element of a document, to which attributes can be added.
#[derive(Debug)]
pub(crate) struct Element {
    tag: &'static str,
    attributes: String,
    content: String,
}

impl Svg {
    fn add(&mut self, tag: &'static str, numbers: &[(&str, f64)]) -> &mut Element {
        self.elements.push(Element { tag, attributes: String::new(), content: String::new() });
        let element = self.elements.last_mut().expect("one was pushed");
        for &(name, value) in numbers {
            element.set(name, rounded(value));
        }
        element
    }

    pub(crate) fn line(&mut self, (x1, y1): Place, (x2, y2): Place, stroke: &str) -> &mut Element {
        self.add("line", &[("x1", x1), ("y1", y1), ("x2", x2), ("y2", y2)]).set("stroke", stroke)
    }

    pub(crate) fn rect(&mut self, area: &Area, fill: &str) -> &mut Element {
        let corner = [("x", area.left), ("y", area.top), ("width", area.width()), ("height", area.height())];
        self.add("rect", &corner).set("fill", fill)
    }

    pub(crate) fn circle(&mut self, (x, y): Place, radius: f64, fill: &str) -> &mut Element {
        self.add("circle", &[("cx", x), ("cy", y), ("r", radius)]).set("fill", fill)
    }

    /// Adds a path that is not filled.
    pub(crate) fn path(&mut self, commands: &str, stroke: &str) -> &mut Element {
        self.add("path", &[]).set("d", commands).set("fill", "none").set("stroke", stroke)
    }

    /// Adds a path that is filled.
    pub(crate) fn shape(&mut self, commands: &str, fill: &str) -> &mut Element {
        self.add("path", &[]).set("d", commands).set("fill", fill)
    }

    /// Adds an error bar between two y coordinates.
    pub(crate) fn error_bar(&mut self, x: f64, (low, high): (f64, f64), stroke: &str) -> &mut Element {
        self.path(&format!("M{:.1} {high:.1}h6m-3 0V{low:.1}m-3 0h6", x - 3.0), stroke)
    }

    /// Adds an open line through `places`.
    pub(crate) fn polyline(&mut self, places: impl Iterator<Item = Place>, stroke: &str) -> &mut Element {
        self.add("polyline", &[]).set("points", listed(places)).set("fill", "none").set("stroke", stroke)
    }

    /// Adds a filled polygon with corners at `places`.
    pub(crate) fn polygon(&mut self, places: impl Iterator<Item = Place>, fill: &str) -> &mut Element {
        self.add("polygon", &[]).set("points", listed(places)).set("fill", fill)
    }

    /// Adds text whose baseline starts at a position.
    pub(crate) fn text(&mut self, (x, y): Place, text: &str) -> &mut Element {
        let element = self.add("text", &[("x", x), ("y", y)]);
        element.content = escaped(text);
        element
    }

    /// Adds text that runs upwards, centred on a position.
    pub(crate) fn text_upwards(&mut self, (x, y): Place, text: &str) -> &mut Element {
        let element = self.add("text", &[]).set("transform", format!("translate({x:.1} {y:.1}) rotate(-90)"));
        element.content = escaped(text);
        element.middle()
    }

    /// Adds an entry of a legend: a piece of a line, and the name of the series to its right.
    pub(crate) fn key(&mut self, (x, y): Place, name: &str, stroke: &str, dashes: &str) {
        self.line((x, y - 4.0), (x + 24.0, y - 4.0), stroke).width(2.2).dashes(dashes);
        self.text((x + 32.0, y), name);
    }

    /// Adds `other`, moved by `offset`.
    pub(crate) fn group(&mut self, offset: Place, other: &Self) {
        let group =
            self.add("g", &[]).set("transform", format!("translate({:.1} {:.1})", offset.0, offset.1));
        group.content = format!("\n{other}");
    }

    /// The document of this width and height, on a white background, with a name for screen
    /// readers.
    pub(crate) fn document(&self, (width, height): Place, name: &str) -> String {
        let (width, height) = (width.ceil(), height.ceil());
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" fill=\"{INK}\">\n\
             <title>{}</title>\n<rect width=\"{width}\" height=\"{height}\" fill=\"{WHITE}\"/>\n{self}</svg>\n",
            escaped(name)
        )
    }
}

impl Svg {
    /// An element of a page of HTML, with a name for screen readers.
    pub(crate) fn element(&self, (width, height): Place, name: &str) -> String {
        let (width, height) = (width.ceil(), height.ceil());
        format!(
            "<svg role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {width} {height}\" \
             font-size=\"13\" fill=\"{INK}\">\n{self}</svg>\n",
            escaped(name)
        )
    }
}

impl Element {
    /// Adds an attribute. `name` and `value` come from the program: they are not escaped.
    pub(crate) fn set(&mut self, name: &str, value: impl Display) -> &mut Self {
        write!(self.attributes, " {name}=\"{value}\"").expect("writing to a string does not fail");
        self
    }

    pub(crate) fn end(&mut self) -> &mut Self {
        self.set("text-anchor", "end")
    }

    pub(crate) fn middle(&mut self) -> &mut Self {
        self.set("text-anchor", "middle")
    }

    pub(crate) fn bold(&mut self) -> &mut Self {
        self.set("font-weight", "bold")
    }

    pub(crate) fn size(&mut self, pixels: f64) -> &mut Self {
        self.set("font-size", pixels)
    }

    pub(crate) fn fill(&mut self, colour: &str) -> &mut Self {
        self.set("fill", colour)
    }

    /// Sets the width of the stroke in pixels.
    pub(crate) fn width(&mut self, pixels: f64) -> &mut Self {
        self.set("stroke-width", rounded(pixels))
    }

    /// Dashes the stroke: lengths of dashes and gaps in pixels; solid if `lengths` is empty.
    pub(crate) fn dashes(&mut self, lengths: &str) -> &mut Self {
        if lengths.is_empty() { self } else { self.set("stroke-dasharray", lengths) }
    }

    /// Adds text that a browser shows while the pointer is over the element.
    pub(crate) fn tooltip(&mut self, text: &str) -> &mut Self {
        self.content = format!("<title>{}</title>", escaped(text));
        self
    }
}

impl Display for Svg {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.elements.iter().try_for_each(|Element { tag, attributes, content }| {
            if content.is_empty() {
                writeln!(f, "<{tag}{attributes}/>")
            } else {
                writeln!(f, "<{tag}{attributes}>{content}</{tag}>")
            }
        })
    }
}

/// `value` with at most one decimal. Adding 0 makes -0 positive.
fn rounded(value: f64) -> f64 {
    (value * 10.0).round() / 10.0 + 0.0
}

fn listed(places: impl Iterator<Item = Place>) -> String {
    places.map(|(x, y)| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

/// `text` for XML and HTML, without characters that XML cannot contain.
pub fn escaped(text: &str) -> String {
    let text: String =
        text.chars().filter(|c| !c.is_control() && !('\u{fffe}'..='\u{ffff}').contains(c)).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
