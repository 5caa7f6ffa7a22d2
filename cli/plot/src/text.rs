//! Text that fits: its width, its lines, headings of panels and legends.
//!
//! Input: text and the room for it. Output: lines, and the baseline of the last one. Widths are
//! those of a wide font, so that the text of any usual font stays in its room.

use crate::svg::{GREY, Place, SMALL, Svg};

/// Default font size in pixels.
pub(crate) const SIZE: f64 = 13.0;
/// Distance of lines of a panel's title and of the text below it.
const TITLE_LINE: f64 = 17.0;
const ABOUT_LINE: f64 = 14.0;
/// Baselines of the first line of a panel's title, and of the line below a title of one line.
const TITLE: f64 = 14.0;
const LEGEND_LINE: f64 = 15.0;
/// From the left end of a symbol to its name, and the space between two entries of a legend.
const SYMBOL: f64 = 21.0;
const APART: f64 = 18.0;
/// A bold character is at most this much wider.
const BOLD: f64 = 1.15;

/// Widths of the characters from space to `~` in `DejaVu Sans`, in hundredths of the font size.
const WIDTHS: [u8; 95] = [
    32, 40, 46, 84, 64, 95, 78, 27, 39, 39, 50, 84, 32, 36, 32, 34, 64, 64, 64, 64, 64, 64, 64, 64, 64, 64,
    34, 34, 84, 84, 84, 53, 100, 68, 69, 70, 77, 63, 58, 77, 75, 29, 29, 66, 56, 86, 75, 79, 60, 79, 69, 63,
    61, 73, 68, 99, 69, 61, 69, 39, 34, 39, 84, 50, 50, 61, 63, 55, 63, 62, 35, 63, 63, 28, 28, 58, 28, 97,
    63, 61, 63, 63, 41, 52, 39, 63, 59, 82, 59, 59, 52, 64, 34, 64, 84,
];

/// Width of `text` in pixels in a wide font of this size.
pub(crate) fn width(text: &str, size: f64) -> f64 {
    let of = |c: char| (c as usize).checked_sub(32).and_then(|i| WIDTHS.get(i)).copied().unwrap_or(100);
    text.chars().map(|c| f64::from(of(c)) / 100.0 * size).sum()
}

/// The same for bold text.
pub(crate) fn bold_width(text: &str, size: f64) -> f64 {
    BOLD * width(text, size)
}

/// The lines of `text`, broken between words if they are wider than `room`.
pub(crate) fn wrapped(text: &str, room: f64, width: impl Fn(&str) -> f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let mut begun = String::new();
        for word in line.split(' ') {
            let longer = if begun.is_empty() { word.to_owned() } else { format!("{begun} {word}") };
            if begun.is_empty() || width(&longer) <= room {
                begun = longer;
            } else {
                lines.push(std::mem::replace(&mut begun, word.to_owned()));
            }
        }
        lines.push(begun);
    }
    lines
}

/// Draws the bold title of a panel and the text below it, in lines of at most `room`. Returns the
/// baseline of the last line, at least that of a line below the title.
pub(crate) fn heading(svg: &mut Svg, title: &str, about: &str, room: f64) -> f64 {
    let mut y = TITLE;
    for line in wrapped(title, room, |line| bold_width(line, SIZE)) {
        svg.text((0.0, y), &line).bold();
        y += TITLE_LINE;
    }
    y = y.max(TITLE + TITLE_LINE);
    let mut last = y;
    for line in wrapped(about, room, |line| width(line, SMALL)) {
        svg.text((0.0, y), &line).size(SMALL).fill(GREY);
        last = y;
        y += ABOUT_LINE;
    }
    last
}

/// Draws `names` from left to right in as many rows as they need between `left` and `right`, below
/// the baseline `above`; `symbol` draws the symbol of a name at the baseline of the entry. Returns
/// the baseline of the last row.
pub(crate) fn legend<'a>(
    svg: &mut Svg,
    (left, right): (f64, f64),
    above: f64,
    names: impl Iterator<Item = &'a str>,
    mut symbol: impl FnMut(&mut Svg, usize, Place),
) -> f64 {
    let (mut x, mut y) = (left, above);
    for (i, name) in names.enumerate() {
        let entry = SYMBOL + width(name, SMALL);
        if i == 0 {
            y += TITLE_LINE;
        } else if x + entry > right {
            (x, y) = (left, y + LEGEND_LINE);
        }
        symbol(svg, i, (x, y));
        svg.text((x + SYMBOL, y), name).size(SMALL);
        x += entry + APART;
    }
    y
}

/// The start of `text` that fits.
pub(crate) fn shortened(text: &str, room: f64, width: impl Fn(&str) -> f64) -> String {
    if width(text) <= room {
        return text.to_owned();
    }
    let mut short = text.to_owned();
    while short.pop().is_some() && width(&short) + width("\u{2026}") > room {}
    short + "\u{2026}"
}

/// A whole number with a comma between thousands, as in tables.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let comma = |i: usize| i > 0 && (digits.len() - i).is_multiple_of(3);
    digits.char_indices().flat_map(|(i, c)| comma(i).then_some(',').into_iter().chain([c])).collect()
}

/// A share in percent, without the sign: two decimals, and `<0.01` for a share that is not 0 and
/// would be shown as 0.
pub fn percent(share: f64) -> String {
    let text = format!("{:.2}", 100.0 * share);
    match text.as_str() {
        "0.00" | "-0.00" if share > 0.0 => "<0.01".to_owned(),
        "-0.00" => "0.00".to_owned(),
        _ => text,
    }
}
