//! The page: one text without external links.

use std::fmt::Write;

use meissner_plot::{PALETTE, escaped};

use crate::compare::{Comparison, compare, names};
use crate::error::ReportError;
use crate::json::{at, number, text, texts};
use crate::parts::{Picture, Section, Table};
use crate::read::Outcome;
use crate::sections::section;
use crate::words::file_name;

/// Maximum bytes of a page.
pub const MAX_BYTES: usize = 3_000_000;
/// Pictures wider than this, in pixels, get a separate row.
const WIDE: f64 = 640.0;
const STYLE: &str = include_str!("page.css");
/// Colours of the dark scheme for those of [`PALETTE`], in its order.
const DARK: [&str; 8] =
    ["#14181d", "#e8ebef", "#b4bcc6", "#8b95a1", "#c3c9d0", "#3a424c", "#242a31", "#5aa6e6"];

/// The drawing of a network.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The network.
    pub network: String,
    /// SVG, as `meissner inspect --svg` writes it.
    pub svg: String,
}

/// The content of a page.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// The results, in the order of the page.
    pub results: &'a [Outcome],
    /// Drawings of their networks, if there are any.
    pub drawings: &'a [Drawing],
}

impl Page<'_> {
    /// The page, as the text of a file.
    ///
    /// # Errors
    /// [`ReportError::Page`]: it has more than [`MAX_BYTES`].
    pub fn html(&self) -> Result<String, ReportError> {
        let sections: Vec<Section> = self.results.iter().map(section).collect();
        let names = names(self.results);
        let comparison = compare(self.results, &sections, &names);
        let title = match names.as_slice() {
            [one] => format!("{}: {one}", self.results[0].command),
            many => format!("{} results compared", many.len()),
        };
        let mut page = Html(String::new());
        page.head(&title);
        page.top(&title, self.results, &sections, comparison.as_ref(), &names);
        if let Some(comparison) = comparison {
            page.open("section", "comparison");
            page.element("h2", "", "Comparison");
            page.tables(&[comparison.table]);
            page.pictures(&comparison.pictures);
            page.close("section");
        }
        for (i, ((result, section), name)) in self.results.iter().zip(&sections).zip(&names).enumerate() {
            page.open("section", &format!("result-{}", i + 1));
            if self.results.len() > 1 {
                page.element("h2", "", &format!("{}. {name}", i + 1));
                page.answer(&section.answer, "");
            }
            page.result(result, section);
            page.close("section");
        }
        page.networks(self.drawings);
        page.0.push_str("</main>\n</body>\n</html>\n");
        let (bytes, results) = (page.0.len(), self.results.len());
        if bytes > MAX_BYTES {
            return Err(ReportError::Page { limit: MAX_BYTES, bytes, results });
        }
        Ok(page.0)
    }
}

/// Text of the page. Each method adds whole elements, with text escaped.
struct Html(String);

impl Html {
    fn add(&mut self, text: std::fmt::Arguments<'_>) {
        self.0.write_fmt(text).expect("writing to a string does not fail");
    }

    fn open(&mut self, tag: &str, id: &str) {
        self.add(format_args!("<{tag} id=\"{}\">\n", escaped(id)));
    }

    fn close(&mut self, tag: &str) {
        self.add(format_args!("</{tag}>\n"));
    }

    fn element(&mut self, tag: &str, class: &str, text: &str) {
        let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
        self.add(format_args!("<{tag}{class}>{}</{tag}>\n", escaped(text)));
    }

    fn head(&mut self, title: &str) {
        self.0.push_str("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
        self.0.push_str("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n");
        // Nothing is loaded, independent of the names in a result.
        self.0.push_str(
            "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
             img-src data:\">\n",
        );
        self.add(format_args!("<title>{}</title>\n<style>\n{STYLE}", escaped(title)));
        self.0.push_str("@media (prefers-color-scheme: dark) {\n  @media screen {\n");
        for ((name, light), dark) in PALETTE.iter().zip(DARK) {
            // The name is for the reader of the page's source.
            self.add(format_args!("    /* {name} */\n"));
            for part in ["fill", "stroke"] {
                self.add(format_args!("    figure:not(.paper) svg[{part}=\"{light}\"], figure:not(.paper) svg [{part}=\"{light}\"] {{ {part}: {dark} }}\n"));
            }
        }
        self.0.push_str("  }\n}\n</style>\n</head>\n<body>\n<main>\n");
    }

    /// Title, answers and contents.
    fn top(
        &mut self,
        title: &str,
        results: &[Outcome],
        sections: &[Section],
        comparison: Option<&Comparison>,
        names: &[String],
    ) {
        self.0.push_str("<header>\n");
        self.element("p", "kind", "Meissner report");
        self.element("h1", "", title);
        match (comparison, sections) {
            (Some(comparison), _) => self.answer(&comparison.answer, "lead"),
            (None, [section]) => self.answer(&section.answer, "lead"),
            _ => self.element("p", "lead", "There are no results."),
        }
        if results.len() > 1 {
            self.0.push_str("<nav aria-label=\"Results\">\n<ol>\n");
            for (i, (section, name)) in sections.iter().zip(names).enumerate() {
                let first = section.answer.first().map_or("", String::as_str);
                // The name appears once.
                let first = first.strip_prefix(name.as_str()).unwrap_or(first);
                let (link, name, first) = (i + 1, escaped(name), escaped(first));
                self.add(format_args!("<li><a href=\"#result-{link}\">{name}</a> {first}</li>\n"));
            }
            self.0.push_str("</ol>\n</nav>\n");
        }
        self.0.push_str("</header>\n");
    }

    fn answer(&mut self, sentences: &[String], class: &str) {
        if let [first, rest @ ..] = sentences {
            self.element("p", class, first);
            match rest {
                [] => {}
                [_] | [_, _] => self.element("p", "", &rest.join(" ")),
                _ => {
                    self.0.push_str("<ul>\n");
                    rest.iter().for_each(|sentence| self.element("li", "", sentence));
                    self.0.push_str("</ul>\n");
                }
            }
        }
    }

    fn result(&mut self, result: &Outcome, section: &Section) {
        let warnings = texts(&result.header, "warnings").into_iter().map(str::to_owned);
        let losses = match &result.body {
            crate::read::Body::Object(object) => crate::json::list(object, "warnings"),
            crate::read::Body::Stream(stream) => {
                stream.summary.as_ref().map_or(&[][..], |summary| crate::json::list(summary, "warnings"))
            }
        };
        let losses = losses.iter().filter_map(|loss| text(loss, "message")).map(str::to_owned);
        let notes: Vec<String> = result.notes.iter().cloned().chain(warnings).chain(losses).collect();
        if !notes.is_empty() {
            self.0.push_str("<ul class=\"notes\">\n");
            notes.iter().for_each(|note| self.element("li", "", note));
            self.0.push_str("</ul>\n");
        }
        self.pictures(&section.pictures);
        self.tables(&section.tables);
        self.origin(result);
    }

    /// The command, its input and its options.
    fn origin(&mut self, result: &Outcome) {
        let header = &result.header;
        self.element("h3", "", "How it was made");
        self.0.push_str("<dl>\n");
        let words = texts(header, "made/arguments");
        let command =
            (!words.is_empty()).then(|| words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "));
        if let Some(command) = &command {
            self.add(format_args!("<dt>command</dt><dd><code>{}</code></dd>\n", escaped(command)));
        }
        let sensor = crate::json::numbers(header, "input/sensor");
        let sensor = match sensor.as_slice() {
            [width, height] => format!(", {width}x{height} pixels"),
            _ => String::new(),
        };
        let events =
            number(header, "input/events").map(|events| format!(", {} events", crate::words::count(events)));
        let format = text(header, "input/format").map(|format| format!(", {format}")).unwrap_or_default();
        let machine = at(header, "made/machine");
        let isa = machine.and_then(|machine| text(machine, "isa")).or(match &result.body {
            crate::read::Body::Object(object) => text(object, "isa"),
            crate::read::Body::Stream(_) => None,
        });
        let threads = machine.and_then(|machine| number(machine, "processors"));
        let machine = machine.map(|machine| {
            let name = text(machine, "processor").unwrap_or("an unknown processor");
            let system = text(machine, "system").unwrap_or("an unknown system");
            let threads =
                threads.map_or_else(String::new, |n| format!(", {} threads", crate::words::count(n)));
            format!("{name}{threads}, {system}")
        });
        let window = number(header, "network/span_us").zip(number(header, "network/capacity")).map(
            |(span, capacity)| {
                format!("{}, at most {} events", crate::words::time(span), crate::words::count(capacity))
            },
        );
        let facts = [
            ("result", Some(file_name(&result.name).to_owned())),
            ("input", Some(format!("{}{format}{sensor}{}", result.input(), events.unwrap_or_default()))),
            ("network", result.network().map(str::to_owned)),
            (
                "weights",
                text(header, "weights/source").map(|source| described(source, text(header, "weights/about"))),
            ),
            ("window", window),
            ("fingerprint", text(header, "network/fingerprint").map(str::to_owned)),
            ("program", text(header, "meissner").map(|version| format!("meissner {version}"))),
            ("machine", machine),
            ("instructions", isa.map(str::to_owned)),
        ];
        for (name, value) in facts {
            if let Some(value) = value {
                self.add(format_args!("<dt>{name}</dt><dd>{}</dd>\n", escaped(&value)));
            }
        }
        self.0.push_str("</dl>\n");
    }

    fn pictures(&mut self, pictures: &[Picture]) {
        if pictures.is_empty() {
            return;
        }
        self.0.push_str("<div class=\"pictures\">\n");
        for Picture { svg, width, caption } in pictures {
            let class = if *width > WIDE { " class=\"wide\"" } else { "" };
            // A picture that is wider than the screen can be scrolled, also by keys.
            self.add(format_args!(
                "<figure{class}>\n<div class=\"scroll\" tabindex=\"0\" style=\"--width: {width}px\">\n{svg}</div>\n<figcaption>{}</figcaption>\n</figure>\n",
                escaped(caption)
            ));
        }
        self.0.push_str("</div>\n");
    }

    fn tables(&mut self, tables: &[Table]) {
        if tables.iter().all(|table| table.rows.is_empty()) {
            return;
        }
        self.0.push_str("<div class=\"tables\">\n");
        for Table { caption, headings, rows } in tables.iter().filter(|table| !table.rows.is_empty()) {
            self.0.push_str("<div class=\"scroll\" tabindex=\"0\">\n<table>\n");
            self.element("caption", "", caption);
            if headings.iter().any(|heading| !heading.is_empty()) {
                self.0.push_str("<thead><tr>");
                for heading in headings {
                    self.add(format_args!("<th scope=\"col\">{}</th>", escaped(heading)));
                }
                self.0.push_str("</tr></thead>\n");
            }
            self.0.push_str("<tbody>\n");
            for row in rows {
                self.0.push_str("<tr>");
                for (i, cell) in row.iter().enumerate() {
                    let cell = escaped(cell);
                    if i == 0 {
                        self.add(format_args!("<th scope=\"row\">{cell}</th>"));
                    } else {
                        self.add(format_args!("<td>{cell}</td>"));
                    }
                }
                self.0.push_str("</tr>\n");
            }
            self.0.push_str("</tbody>\n</table>\n</div>\n");
        }
        self.0.push_str("</div>\n");
    }

    fn networks(&mut self, drawings: &[Drawing]) {
        if drawings.is_empty() {
            return;
        }
        self.open("section", "networks");
        self.element("h2", "", "Networks");
        for Drawing { network, svg } in drawings {
            let name = escaped(network);
            self.add(format_args!(
                "<details open><summary>{name}</summary>\n<figure class=\"paper wide\"><div class=\"scroll\" tabindex=\"0\">\n{svg}</div></figure></details>\n"
            ));
        }
        self.close("section");
    }
}

/// The source of weights, with their own remark, once.
fn described(source: &str, about: Option<&str>) -> String {
    match about {
        Some(about) if !source.contains(about) => format!("{source} ({about})"),
        _ => source.to_owned(),
    }
}

/// A word of a command line as a shell reads it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,@%+".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}
