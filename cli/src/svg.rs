//! What drawings share: the head of a file, colours, and text that cannot break it.

use std::fmt::{self, Write};

/// Colours that stay apart for those who do not see red and green apart.
pub(crate) const COLOURS: [&str; 6] = ["#0072b2", "#e69f00", "#009e73", "#cc3377", "#56b4e9", "#999999"];

/// Opens a drawing of `width` x `height` on white, with a bold `title` and a line `about` below it, both from `left` on.
pub(crate) fn head(
    svg: &mut String,
    (width, height): (f64, f64),
    left: f64,
    title: &str,
    about: &str,
) -> fmt::Result {
    writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"13\" fill=\"#222222\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n\
         <text x=\"{left}\" y=\"34\" font-size=\"18\" font-weight=\"bold\">{}</text>\n\
         <text x=\"{left}\" y=\"58\" fill=\"#555555\">{}</text>",
        escaped(title),
        escaped(about)
    )
}

/// `text` as XML holds it.
pub(crate) fn escaped(text: &str) -> String {
    // Characters that XML does not have in any form are left out.
    let text: String = text.chars().filter(|c| !c.is_control()).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn names_cannot_break_a_drawing() {
        assert_eq!(escaped("a<b>&\"c\"\u{1}"), "a&lt;b&gt;&amp;&quot;c&quot;");
    }
}
