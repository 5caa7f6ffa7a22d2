//! A confusion matrix as a grid of colours with numbers.

use std::fmt::{self, Write};

use meissner_models::metrics::Confusion;

use crate::svg::escaped;

/// Side of a cell.
const CELL: f64 = 33.0;
/// Space for the names of true classes, and for the titles.
const SIDE: f64 = 46.0;
const TOP: f64 = 66.0;
/// From this share on numbers are white.
const DARK: f64 = 0.5;

/// Width of the drawing for this many classes, with space to the next.
pub(super) const fn width(classes: usize) -> f64 {
    SIDE + CELL * classes as f64 + 26.0
}

/// Height of the drawing for this many classes, with space to the next.
pub(super) const fn height(classes: usize) -> f64 {
    TOP + CELL * classes as f64 + 34.0
}

/// Draws `confusion` of `classes` below a bold `title` and the line `about`, from the origin on.
pub(super) fn draw(
    svg: &mut String,
    (title, about): (&str, &str),
    classes: &[&str],
    confusion: &Confusion,
) -> fmt::Result {
    let end = CELL * classes.len() as f64;
    writeln!(
        svg,
        "<text x=\"0\" y=\"14\" font-weight=\"bold\">{}</text>\n\
         <text x=\"0\" y=\"31\" font-size=\"11.5\" fill=\"#555555\">{}</text>\n\
         <text transform=\"translate(10 {}) rotate(-90)\" text-anchor=\"middle\" font-size=\"11\" \
         fill=\"#555555\">true</text>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"11\" fill=\"#555555\">predicted</text>",
        escaped(title),
        escaped(about),
        TOP + end / 2.0,
        SIDE + end / 2.0,
        TOP + end + 16.0
    )?;
    for (i, class) in classes.iter().enumerate() {
        let middle = (i as f64 + 0.5) * CELL;
        writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{class}</text>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{class}</text>",
            SIDE + middle,
            TOP - 7.0,
            SIDE - 7.0,
            TOP + middle + 4.5
        )?;
    }
    for (row, counts) in confusion.rows().enumerate() {
        let sum: u64 = counts.iter().sum();
        for (column, &count) in counts.iter().enumerate() {
            // A class that was never true has a grey row without numbers.
            let share = (sum > 0).then(|| count as f64 / sum as f64);
            cell(svg, SIDE + CELL * column as f64, TOP + CELL * row as f64, share)?;
        }
    }
    writeln!(
        svg,
        "<rect x=\"{SIDE}\" y=\"{TOP}\" width=\"{end}\" height=\"{end}\" fill=\"none\" stroke=\"#777777\"/>"
    )
}

fn cell(svg: &mut String, x: f64, y: f64, share: Option<f64>) -> fmt::Result {
    let fill = share.map_or_else(|| "#eeeeee".to_owned(), colour);
    write!(
        svg,
        "<rect x=\"{x}\" y=\"{y}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"{fill}\" stroke=\"#ffffff\"/>"
    )?;
    if let Some(share) = share.filter(|&share| share > 0.0) {
        let ink = if share >= DARK { "#ffffff" } else { "#222222" };
        let percent = 100.0 * share;
        let number = if percent < 0.5 { "&lt;0.5".to_owned() } else { format!("{percent:.0}") };
        let (x, y) = (x + CELL / 2.0, y + CELL / 2.0 + 4.0);
        write!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\" font-size=\"11\" fill=\"{ink}\">{number}</text>"
        )?;
    }
    writeln!(svg)
}

/// From white to dark blue; the square root lets rare confusions be seen.
fn colour(share: f64) -> String {
    let strength = share.clamp(0.0, 1.0).sqrt();
    let channel = |dark: f64| (255.0 + (dark - 255.0) * strength).round() as u8;
    format!("#{:02x}{:02x}{:02x}", channel(0.0), channel(72.0), channel(128.0))
}

#[cfg(test)]
mod tests {
    use super::colour;

    #[test]
    fn colours_run_from_white_to_dark_blue() {
        assert_eq!([colour(0.0), colour(1.0), colour(2.0)], ["#ffffff", "#004880", "#004880"]);
        assert_eq!(colour(0.25), "#80a4c0");
    }
}
