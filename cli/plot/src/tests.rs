//! No text of a picture is cut or covers other text. Checked on the pictures of the repository, and
//! on panels with long names.

mod parts;

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};

use crate::svg::Area;
use crate::text::{bold_width, width};
use crate::{
    Bar, Bars, Distribution, LatencyCurve, Matrix, Network, Panel, Plane, Scale, Series, Setting, Style,
    TradeOff, page,
};

/// The attribute of `node` as a number.
fn number(node: Node<'_, '_>, name: &str) -> Option<f64> {
    node.attribute(name)?.parse().ok()
}

/// The areas of all text that runs from left to right, with the text. Widths are those of a wide
/// font.
fn texts(document: &Document<'_>) -> Vec<(Area, String)> {
    let of = |node: Node<'_, '_>| {
        let text = node.text()?;
        let (mut x, mut y) = (number(node, "x")?, number(node, "y")?);
        for group in node.ancestors().filter_map(|group| group.attribute("transform")) {
            let moved = group.strip_prefix("translate(")?.strip_suffix(')')?;
            let (right, down) = moved.split_once(' ')?;
            (x, y) = (x + right.parse::<f64>().ok()?, y + down.parse::<f64>().ok()?);
        }
        let size = number(node, "font-size").unwrap_or(13.0);
        let bold = node.attribute("font-weight").is_some();
        let width = if bold { bold_width(text, size) } else { width(text, size) };
        let left = match node.attribute("text-anchor") {
            Some("end") => x - width,
            Some("middle") => x - width / 2.0,
            _ => x,
        };
        // From the top of small letters to the baseline: lines may be as close as they can be read.
        Some((Area { left, top: y - 0.6 * size, right: left + width, bottom: y }, text.to_owned()))
    };
    // White copies below a text count as that text.
    let nodes =
        document.descendants().filter(|node| node.has_tag_name("text") && node.attribute("stroke").is_none());
    nodes.filter_map(of).collect()
}

/// The text that is cut or covered in a picture.
fn faults(svg: &str) -> Vec<String> {
    let document = Document::parse(svg).expect("it is well-formed XML");
    let root = document.root_element();
    let (right, bottom) =
        (number(root, "width").expect("a width"), number(root, "height").expect("a height"));
    let texts = texts(&document);
    let cut = texts
        .iter()
        .filter(|(area, _)| area.left < 0.0 || area.top < 0.0 || area.right > right || area.bottom > bottom);
    let mut faults: Vec<String> = cut.map(|(area, text)| format!("cut: {text:?} {area:?}")).collect();
    for (i, (area, text)) in texts.iter().enumerate() {
        let covered = texts[..i].iter().filter(|(other, _)| other.overlaps(area));
        faults.extend(covered.map(|(_, other)| format!("{text:?} covers {other:?}")));
    }
    if texts.len() < 4 {
        faults.push(format!("empty: {} texts", texts.len()));
    }
    faults
}

/// The SVG files below a folder of the repository.
fn pictures(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
        if entry.is_dir() && entry.file_name().is_some_and(|name| name != "target") {
            pictures(&entry, found);
        } else if entry.extension().is_some_and(|extension| extension == "svg") {
            found.push(entry);
        }
    }
}

#[test]
fn no_text_of_the_pictures_of_the_repository_is_cut_or_covered() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found = Vec::new();
    ["docs", "examples"].iter().for_each(|folder| pictures(&root.join(folder), &mut found));
    assert!(found.len() >= 5, "{found:?}");
    for path in found {
        let svg = std::fs::read_to_string(&path).expect("readable");
        assert_eq!(faults(&svg), [""; 0], "{}", path.display());
    }
}

const LONG: &str =
    "a name that goes on and on because somebody wanted to say all of it in one line of text, and more";

fn plane(names: &[&str]) -> Panel<'static> {
    let series = names.iter().enumerate().map(|(colour, name)| Series {
        name: (*name).to_owned(),
        colour,
        style: Style::Line,
        points: vec![(0.0, 1.0), (20.0, 8.0)],
    });
    Panel::Plane(Plane {
        title: "Angle between the axis of the dome and the normal of the plane that it taps".to_owned(),
        about: LONG.to_owned(),
        x_title: "time (s)".to_owned(),
        y_title: "error (degrees)".to_owned(),
        scale: Scale::FromZero,
        compact: false,
        ordered: false,
        series: series.collect(),
    })
}

#[test]
fn long_names_are_broken_into_lines_and_stay_in_the_picture() {
    let names = ["roll, predicted", "roll, true", "pitch, predicted by another", "pitch, true", "depth"];
    let beside = page(LONG, LONG, &[vec![plane(&names), plane(&names[..2])], vec![plane(&[])]]);
    assert_eq!(faults(&beside), [""; 0]);
    let counts = vec![vec![3, 1], vec![0, 1000]];
    let matrix =
        Matrix { title: LONG[..40].to_owned(), about: LONG.to_owned(), classes: &["aw", "cw"], counts };
    assert_eq!(
        faults(&page("m", "", &[vec![Panel::Matrix(matrix.clone()), Panel::Matrix(matrix)]])),
        [""; 0]
    );
}

#[test]
fn long_names_of_classes_run_upwards_beside_their_matrix() {
    let classes = ["wood", "polished steel", LONG];
    let matrix = Matrix {
        title: "Confusion".to_owned(),
        about: String::new(),
        classes: &classes,
        counts: vec![vec![3, 1, 0], vec![0, 9, 1], vec![0, 0, 4]],
    };
    let svg = page("m", "", &[vec![Panel::Matrix(matrix)]]);
    assert_eq!(faults(&svg), [""; 0]);
    assert!(svg.matches("rotate(-90)").count() == 4, "{svg}");
}

#[test]
fn rows_of_bars_and_quantiles_hold_their_names_and_numbers() {
    let names = ["conv1", LONG, "a layer of a network", ""];
    let rows = |values: &[f64]| names.iter().map(|name| ((*name).to_owned(), values.to_vec())).collect();
    let parts = |shares, values: &[f64]| {
        Panel::Parts(crate::Parts {
            title: "Rows by layer".to_owned(),
            about: LONG.to_owned(),
            parts: vec![("computed".to_owned(), 0), ("kept".to_owned(), 5)],
            x_title: "share of the rows (%)".to_owned(),
            shares,
            rows: rows(values),
        })
    };
    let quantiles = |values: &[f64]| {
        Panel::Quantiles(crate::Quantiles {
            title: "Latency".to_owned(),
            about: String::new(),
            x_title: "latency (us)".to_owned(),
            quantiles: vec!["median", "90 %", "99 %", "99.9 %", "longest"],
            rows: rows(values),
        })
    };
    for values in [[1.0, 99.0], [0.0, 1.0], [0.0, 0.0], [f64::NAN, 3e9], [1e-5, -1.0]] {
        for panel in [parts(true, &values), parts(false, &values), quantiles(&values)] {
            assert_eq!(faults(&page("t", "", &[vec![panel]])), [""; 0], "{values:?}");
        }
    }
    let five = quantiles(&[0.7, 0.8, 1.5, 30.0, 40_000.0]);
    let (figure, width) = crate::figure("latency", &five);
    assert!(Document::parse(&figure).is_ok() && width < 460.0, "{figure}");
}

#[test]
fn steps_of_a_quantity_go_from_dark_to_light() {
    let Panel::Plane(plane) = plane(&["0 to 1", "1 to 2", "2 to 3"]) else { panic!("a plane") };
    let svg = page("t", "", &[vec![Panel::Plane(Plane { ordered: true, ..plane })]]);
    let strokes = svg.split("<polyline").skip(1).map(|line| {
        let colour = line.split("stroke=\"#").nth(1).expect("a stroke");
        let part = |i: usize| f64::from(u8::from_str_radix(&colour[i..i + 2], 16).expect("a colour"));
        0.3 * part(0) + 0.6 * part(2) + 0.1 * part(4)
    });
    let lightness: Vec<f64> = strokes.collect();
    assert!(lightness.len() == 3 && lightness.is_sorted_by(|a, b| a < b), "{lightness:?}");
}

#[test]
fn bars_and_their_numbers_have_room_however_many_there_are() {
    let bars = |mean: f64| vec![Some(Bar { mean, std: None }); 4];
    let bars = Bars {
        groups: ["Basic (trained on)", "Solids", "Small", "Textures"].map(str::to_owned).to_vec(),
        series: (0..6).map(|i| (format!("{i} {}", &LONG[..60]), bars(1.0))).collect(),
        references: vec![("others (reference)".to_owned(), vec![Some(0.5); 4])],
        y_title: "accuracy (%)".to_owned(),
        note: LONG[..70].to_owned(),
    };
    assert_eq!(faults(&page("bars", "", &[vec![Panel::Bars(bars)]])), [""; 0]);
}

#[test]
fn the_boxes_of_a_network_hold_their_text() {
    let node = |name: &'static str, kind: &str, shape: &str, from| crate::Node {
        name,
        kind: kind.to_owned(),
        shape: shape.to_owned(),
        fill: "#ffffff",
        band: Some(0),
        from,
        joins: None,
    };
    let place = "polarity of each event: -1 or 1; its place in a cell along each axis: -1 to 1";
    let boxes = vec![
        node("events", place, "3 channels", None),
        node(LONG, "spline 2x2x2 root", "3 \u{2192} 8, 221,216 parameters", Some("events")),
        crate::Node { joins: Some(("events", "+")), ..node("last", "", "", Some(LONG)) },
    ];
    let network = Network { bands: vec![LONG.repeat(2)], boxes };
    let svg = page("tactigraph-past", "a window", &[vec![Panel::Network(network)]]);
    assert_eq!(faults(&svg), [""; 0]);
    // The text of a box ends inside it.
    let document = Document::parse(&svg).expect("it is well-formed XML");
    let boxed =
        texts(&document).into_iter().filter(|(_, text)| place.contains(text.as_str()) && text.len() > 20);
    assert!(boxed.map(|(area, _)| area.right).fold(0.0, f64::max) < 24.0 + 590.0);
}

#[test]
fn symbols_of_a_legend_have_one_size_and_names_take_as_many_rows_as_they_need() {
    let networks: Vec<String> = (0..9).map(|i| format!("a-network-of-number-{i}")).collect();
    let point = |network| Setting {
        network,
        time: 10.0 * (network + 1) as f64,
        error: 1.0 + network as f64,
        interval: None,
        on_front: true,
        label: Some(format!("setting {network}")),
        tooltip: String::new(),
    };
    let trade_off = TradeOff {
        time_title: "time (us)".to_owned(),
        error_title: "wrong (%)".to_owned(),
        about: String::new(),
        errors: crate::Errors::Percentages,
        points: (0..9).map(point).collect(),
        networks,
    };
    let svg = page("t", "", &[vec![Panel::TradeOff(trade_off)]]);
    assert_eq!(faults(&svg), [""; 0]);
    // The first two shapes are those of the legend: a circle and a square.
    let shapes: Vec<&str> = svg.split(" d=\"").skip(1).take(2).collect();
    assert!(shapes[0].contains("a5 5 ") && shapes[1].contains("h10v10"), "{shapes:?}");
}

#[test]
fn a_picture_without_panels_says_so() {
    assert!(page("title", "", &[vec![]]).contains(">nothing to draw: no results<"));
}

#[test]
fn latencies_of_any_length_have_room_and_separators() {
    let curve = |name: &str, us: f64| LatencyCurve {
        name: name.to_owned(),
        dashed: false,
        points: vec![(us, 0.5), (us * 2e4, 0.0)],
    };
    let curves = vec![curve("push", 12.0), curve("push + predict", 80.0)];
    let svg = page("l", "", &[vec![Panel::Distribution(Distribution { curves })]]);
    assert_eq!(faults(&svg), [""; 0]);
    assert!(svg.contains(">240,000<"), "{svg}");
}
