//! A picture with many points: 62 settings of three networks, most with error bars that touch.

use roxmltree::{Document, Node};

use super::{Errors, Setting, TradeOff};
use crate::svg::Area;
use crate::{Panel, page};

/// network, setting, us, error, low, high, on front
const CROWDED: &str = include_str!("crowded.csv");

fn crowded() -> TradeOff {
    let mut networks: Vec<String> = Vec::new();
    let mut points = Vec::new();
    for line in CROWDED.lines() {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |i: usize| fields[i].parse::<f64>().expect("a number");
        let [error, low, high] = [3, 4, 5].map(|i| 100.0 * number(i));
        let name = format!("{}, {}", fields[0], fields[1]);
        if networks.last().is_none_or(|network| network != fields[0]) {
            networks.push(fields[0].to_owned());
        }
        let on_front = fields[6] == "true";
        points.push(Setting {
            network: networks.len() - 1,
            time: number(2),
            error,
            interval: Some((low, high)),
            on_front,
            label: (on_front || fields[1] == "exact").then(|| format!("{name}, {error:.2} %")),
            tooltip: name,
        });
    }
    TradeOff {
        time_title: "time per event (us)".to_owned(),
        error_title: "wrong answers (%)".to_owned(),
        about: String::new(),
        errors: Errors::Percentages,
        networks,
        points,
    }
}

/// The numbers in the commands of a path.
fn numbers(path: &str) -> Vec<f64> {
    let parts = path.split(|c: char| c.is_ascii_alphabetic() || c == ' ');
    parts.filter_map(|part| part.parse().ok()).collect()
}

/// Areas of labels: each is drawn before its text.
fn labels(document: &Document<'_>) -> Vec<(Area, String)> {
    let texts = document.descendants().filter(|node| node.attribute("font-size") == Some("12"));
    let area = |text: Node<'_, '_>| {
        let of = text.prev_sibling_element().expect("an area is drawn before a label");
        let [x, y, width, height] = ["x", "y", "width", "height"].map(|name| {
            of.attribute(name).and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{name}: {of:?}"))
        });
        Area::at((x, y), width, height)
    };
    texts.map(|text| (area(text), text.text().unwrap_or_default().to_owned())).collect()
}

#[test]
fn no_label_covers_an_error_bar_or_a_point() {
    let picture = page("", "", &[vec![Panel::TradeOff(crowded())]]);
    let document = Document::parse(&picture).expect("it is well-formed XML");
    let paths: Vec<&str> = document.descendants().filter_map(|node| node.attribute("d")).collect();
    let bars = paths.iter().filter(|path| path.contains("h6m-3")).map(|path| {
        let numbers = numbers(path);
        Area { left: numbers[0], top: numbers[1], right: numbers[0] + 6.0, bottom: numbers[5] }
    });
    let bars: Vec<Area> = bars.collect();
    assert_eq!(bars.len(), CROWDED.lines().count());
    let labels = labels(&document);
    assert_eq!(labels.len(), 9, "{labels:?}");
    for (area, text) in &labels {
        assert!(!bars.iter().any(|bar| bar.overlaps(area)), "{text}");
    }
    assert!(picture.len() < 32 << 10, "{} bytes", picture.len());
    assert_eq!(picture, page("", "", &[vec![Panel::TradeOff(crowded())]]));
}

#[test]
fn every_label_is_in_the_picture_as_it_is_or_in_the_key() {
    let crowded = crowded();
    let picture = page("", "", &[vec![Panel::TradeOff(crowded.clone())]]);
    let document = Document::parse(&picture).expect("it is well-formed XML");
    let found: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    for point in &crowded.points {
        assert!(found.contains(&point.tooltip.as_str()), "{}: {found:?}", point.tooltip);
        assert!(point.label.as_deref().is_none_or(|label| found.contains(&label)), "{:?}", point.label);
    }
}

#[test]
fn where_points_of_networks_meet_no_colour_is_hidden_under_another() {
    let mut crowded = crowded();
    // All three networks at one position.
    for point in crowded.points.iter_mut().filter(|point| point.tooltip.ends_with(", exact")) {
        (point.time, point.error) = (10.0, 3.0);
    }
    let picture = page("", "", &[vec![Panel::TradeOff(crowded.clone())]]);
    let document = Document::parse(&picture).expect("it is well-formed XML");
    let exact = document.descendants().filter(|node| {
        let title = node.first_element_child().and_then(|title| title.text());
        node.has_tag_name("path") && title.is_some_and(|title| title.ends_with(", exact"))
    });
    let widths: Vec<f64> = exact
        .map(|node| {
            let path = node.attribute("d").expect("a shape");
            // The longest step of a shape is its width, or half of it.
            numbers(path)[2..].iter().fold(0.0, |most: f64, step| most.max(step.abs()))
        })
        .collect();
    assert_eq!(widths.len(), 3);
    assert!(widths[0] > widths[1] + 1.0 && widths[1] > widths[2] + 1.0, "later and smaller: {widths:?}");
}

#[test]
fn an_error_of_0_has_a_place_on_a_logarithmic_axis() {
    let point = |error: f64| Setting {
        network: 0,
        time: 1.0,
        error,
        interval: None,
        on_front: true,
        label: None,
        tooltip: String::new(),
    };
    let points = vec![point(0.0), point(1e-4), point(1e-7)];
    let trade_off = TradeOff { errors: Errors::Differences, points, ..crowded() };
    let field = trade_off.field();
    let [none, large, small] = [0.0, 1e-4, 1e-7].map(|error| field.y.place(error));
    assert!(large < small && small < none && none < field.area.bottom, "{large} {small} {none}");
}

#[test]
fn the_axis_of_quantities_is_as_fine_as_they_are_and_has_no_greatest_value() {
    let axis = |errors: &[f64]| {
        let point = |&error: &f64| Setting {
            network: 0,
            time: 1.0,
            error,
            interval: Some((0.0, 1.5 * error)),
            on_front: true,
            label: None,
            tooltip: String::new(),
        };
        let points = errors.iter().map(point).collect();
        let field = TradeOff { errors: Errors::Quantities, points, ..crowded() }.field();
        [errors[0], errors[1]].map(|error| field.y.place(error))
    };
    // Squared forces of a hundredth, and of several hundred N^2.
    for errors in [[0.01, 0.02], [200.0, 400.0]] {
        let [small, large] = axis(&errors);
        assert!(small - large > 100.0, "{errors:?}: {small} {large}");
    }
    assert!(axis(&[0.0, 0.0]).iter().all(|place| place.is_finite()));
}
