//! Accuracies against time: a line for each network over a band, its 95 % interval.

use std::fmt::{self, Write};

use meissner_models::systems::digits::CLASSES;

use super::super::report::{Judged, NetworkReport};
use crate::svg::{COLOURS, escaped};

/// Width of the drawing, with space to the next.
pub(super) const WIDTH: f64 = 620.0;
/// The field of the lines.
const LEFT: f64 = 62.0;
const RIGHT: f64 = 580.0;
const TOP: f64 = 66.0;
const BOTTOM: f64 = 396.0;
/// Baseline of the first names, and how many stand beside each other.
const LEGEND: f64 = 48.0;
const IN_A_ROW: usize = 4;
/// Width of the line that is drawn last; each before it is this much wider, so that lines that meet are all seen.
const NARROWEST: f64 = 1.8;
const WIDER: f64 = 1.6;
/// Most marks of time.
const MOST_MARKS: f64 = 8.0;

/// Draws the lines of `networks` at `times_us`, each with its place among the colours, from the origin on.
pub(super) fn draw(
    svg: &mut String,
    title: &str,
    times_us: &[i64],
    networks: &[(usize, &NetworkReport, &Judged)],
) -> fmt::Result {
    writeln!(
        svg,
        "<text x=\"0\" y=\"14\" font-weight=\"bold\">Accuracy against time, {}</text>\n\
         <text x=\"0\" y=\"31\" font-size=\"11.5\" fill=\"#555555\">bands: 95 % intervals; after the end of a recording \
         its last prediction stands</text>",
        escaped(title)
    )?;
    let last_us = times_us.last().copied().unwrap_or(1);
    let x = |t_us: i64| LEFT + (RIGHT - LEFT) * t_us as f64 / last_us as f64;
    axes(svg, last_us, x)?;
    let points = |shares: &mut dyn Iterator<Item = (i64, f64)>| {
        shares.map(|(t_us, share)| format!("{:.1},{:.1}", x(t_us), y(share))).collect::<Vec<_>>().join(" ")
    };
    let colour = |place: usize| COLOURS[place % COLOURS.len()];
    let times = || times_us.iter().copied();
    // Lines over bands: each can be followed where they meet.
    for &(place, _, judged) in networks {
        let (low, high): (Vec<f64>, Vec<f64>) = judged.interval_95_at.iter().copied().unzip();
        let band = points(&mut times().zip(high).chain(times().zip(low).rev()));
        writeln!(svg, "<polygon points=\"{band}\" fill=\"{}\" fill-opacity=\"0.15\"/>", colour(place))?;
    }
    for (i, &(place, _, judged)) in networks.iter().enumerate() {
        let width = NARROWEST + WIDER * (networks.len() - 1 - i) as f64;
        let line = points(&mut times().zip(judged.accuracy_at.iter().map(|at| at.mean)));
        writeln!(
            svg,
            "<polyline points=\"{line}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width:.1}\"/>",
            colour(place)
        )?;
    }
    legend(svg, networks)
}

/// Where `share` lies.
fn y(share: f64) -> f64 {
    BOTTOM - share * (BOTTOM - TOP)
}

fn axes(svg: &mut String, last_us: i64, x: impl Fn(i64) -> f64) -> fmt::Result {
    for percent in (0..=100_u8).step_by(20) {
        let y = y(f64::from(percent) / 100.0);
        writeln!(
            svg,
            "<line x1=\"{LEFT}\" y1=\"{y:.1}\" x2=\"{RIGHT}\" y2=\"{y:.1}\" stroke=\"#dddddd\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{percent} %</text>",
            LEFT - 8.0,
            y + 4.5
        )?;
    }
    let step = step_us(last_us);
    for t_us in (0..=last_us / step).map(|i| i * step) {
        let x = x(t_us);
        writeln!(
            svg,
            "<line x1=\"{x:.1}\" y1=\"{BOTTOM}\" x2=\"{x:.1}\" y2=\"{}\" stroke=\"#777777\"/>\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            BOTTOM + 5.0,
            BOTTOM + 19.0,
            t_us as f64 / 1000.0
        )?;
    }
    let chance = y(1.0 / CLASSES.len() as f64);
    let (middle, centre) = (f64::midpoint(LEFT, RIGHT), f64::midpoint(TOP, BOTTOM));
    writeln!(
        svg,
        "<line x1=\"{LEFT}\" y1=\"{chance:.1}\" x2=\"{RIGHT}\" y2=\"{chance:.1}\" stroke=\"#777777\" \
         stroke-dasharray=\"2 3\"/>\
         <text x=\"{}\" y=\"{:.1}\" font-size=\"11\" fill=\"#555555\">chance</text>\n\
         <line x1=\"{LEFT}\" y1=\"{BOTTOM}\" x2=\"{RIGHT}\" y2=\"{BOTTOM}\" stroke=\"#777777\"/>\n\
         <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">time since the first event (ms)</text>\n\
         <text transform=\"translate(14 {centre}) rotate(-90)\" text-anchor=\"middle\">accuracy</text>",
        LEFT + 4.0,
        chance - 5.0,
        BOTTOM + 38.0
    )
}

/// Names above the field, so that they cover nothing in it.
fn legend(svg: &mut String, networks: &[(usize, &NetworkReport, &Judged)]) -> fmt::Result {
    for (i, (place, network, judged)) in networks.iter().enumerate() {
        let (row, column) = (i / IN_A_ROW, i % IN_A_ROW);
        let x = LEFT + (RIGHT - LEFT) / IN_A_ROW.min(networks.len()) as f64 * column as f64;
        let y = LEGEND + 12.0 * row as f64;
        let colour = COLOURS[place % COLOURS.len()];
        let (name, percent) = (escaped(&network.network), 100.0 * judged.accuracy.mean);
        writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"16\" height=\"4\" fill=\"{colour}\"/>\
             <text x=\"{:.1}\" y=\"{y:.1}\" font-size=\"11.5\">{name}, {percent:.1} %</text>",
            y - 6.0,
            x + 21.0
        )?;
    }
    Ok(())
}

/// The least of 1, 2, 5, 10, 20, ... tenths of a millisecond that gives no more than [`MOST_MARKS`] marks.
fn step_us(last_us: i64) -> i64 {
    let steps = (2..).flat_map(|power| [1, 2, 5].map(|digit| digit * 10_i64.pow(power)));
    let mut enough = steps.filter(|&step| last_us as f64 / step as f64 <= MOST_MARKS);
    enough.next().expect("a power of ten is large enough")
}

#[cfg(test)]
mod tests {
    use meissner_models::metrics::{Confusion, MeanStd};
    use roxmltree::Document;

    use super::{Judged, NetworkReport, TOP, draw, step_us};
    use meissner_pipeline::provenance::ModelCard;

    #[test]
    fn marks_are_round_and_few() {
        assert_eq!([310_000, 160_000, 100, 8_388_608].map(step_us), [50_000, 20_000, 100, 2_000_000]);
    }

    #[test]
    fn lines_that_meet_are_all_seen_and_names_stand_outside_the_field() {
        let mean = MeanStd { mean: 0.5, std: None };
        let judged = || Judged {
            recordings: 10,
            trainings: 1,
            accuracy: mean,
            interval_95: (0.4, 0.6),
            settled_us: None,
            confusion: Confusion::new(10),
            accuracy_at: vec![mean; 2],
            interval_95_at: vec![(0.4, 0.6); 2],
            each: Vec::new(),
        };
        let network = |name: &str| NetworkReport {
            card: ModelCard::default(),
            network: name.to_owned(),
            weights: String::new(),
            stride: 1,
            test: None,
            cross_validation: None,
        };
        let (networks, judged) = (["a", "b", "c"].map(network), judged());
        let networks: Vec<_> =
            networks.iter().enumerate().map(|(i, network)| (i, network, &judged)).collect();
        let mut svg = "<svg>".to_owned();
        draw(&mut svg, "test split", &[1000, 2000], &networks).expect("a string takes everything");
        svg += "</svg>";
        let document = Document::parse(&svg).expect("it is well-formed XML");
        let number = |text: Option<&str>| text.and_then(|text| text.parse::<f64>().ok()).expect("a number");
        let lines = document.descendants().filter(|node| node.has_tag_name("polyline"));
        let widths: Vec<f64> = lines.map(|line| number(line.attribute("stroke-width"))).collect();
        assert!(widths.len() == 3 && widths.windows(2).all(|two| two[0] > two[1] + 1.0), "{widths:?}");
        let names = document.descendants().filter(|node| {
            node.has_tag_name("text") && node.text().is_some_and(|text| text.ends_with(", 50.0 %"))
        });
        let heights: Vec<f64> = names.map(|name| number(name.attribute("y"))).collect();
        assert!(heights.len() == 3 && heights.iter().all(|&y| y < TOP), "{heights:?}");
    }
}
