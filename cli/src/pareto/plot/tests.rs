//! A drawing with as many points as there are: 62 settings of three networks, most with error bars that meet.

use roxmltree::{Document, Node};

use super::labels::Area;
use super::svg;
use crate::pareto::measurement::{Measurement, Task};
use crate::pareto::report::{Compared, DataReport, NetworkReport, Report, SettingReport};
use meissner_pipeline::provenance::Header;

/// network, setting, us, error, low, high, on front
const CROWDED: &str = include_str!("crowded.csv");

fn report() -> Report {
    let mut networks: Vec<NetworkReport> = Vec::new();
    for line in CROWDED.lines() {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |i: usize| fields[i].parse::<f64>().expect("a number");
        let (error, interval_95) = (number(3), (number(4), number(5)));
        let of = "cross-validation".to_owned();
        let measurement =
            Measurement::of_nothing(vec![Task { of, error, interval_95, trials: 1100, trainings: 1 }]);
        let setting = SettingReport {
            setting: fields[1].to_owned(),
            us: number(2),
            speed_up: 1.0,
            error,
            interval_95: Some(interval_95),
            on_front: fields[6] == "true",
            measurement,
        };
        match networks.last_mut().filter(|network| network.network == fields[0]) {
            Some(network) => network.settings.push(setting),
            None => networks.push(NetworkReport {
                network: fields[0].to_owned(),
                weights: String::new(),
                fingerprint: String::new(),
                settings: vec![setting],
            }),
        }
    }
    let data = DataReport {
        name: "nmnist".to_owned(),
        recordings: 1100,
        size: 4_518_827,
        timed: 6868,
        fingerprint: String::new(),
    };
    Report {
        header: Header::default(),
        system: "digits",
        unit: "event",
        data,
        repeats: 3,
        isa: "avx512",
        notes: Vec::new(),
        compared: Compared::TaskError,
        networks,
        fastest_within: Vec::new(),
        words: String::new(),
    }
}

fn number(node: &Node<'_, '_>, name: &str) -> f64 {
    node.attribute(name).and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{name}: {node:?}"))
}

/// The numbers in the data of a path.
fn numbers(path: &str) -> Vec<f64> {
    let parts = path.split(|c: char| c.is_ascii_alphabetic() || c == ' ');
    parts.filter_map(|part| part.parse().ok()).collect()
}

/// Boxes of labels: each stands before its text.
fn labels(document: &Document<'_>) -> Vec<(Area, String)> {
    let texts = document.descendants().filter(|node| node.attribute("font-size") == Some("12"));
    let area = |text: Node<'_, '_>| {
        let of = text.prev_sibling_element().expect("a box stands before a label");
        let (left, top) = (number(&of, "x"), number(&of, "y"));
        Area { left, top, right: left + number(&of, "width"), bottom: top + number(&of, "height") }
    };
    texts.map(|text| (area(text), text.text().unwrap_or_default().to_owned())).collect()
}

#[test]
fn no_label_covers_an_error_bar_or_a_point() {
    let drawing = svg(&report());
    let document = Document::parse(&drawing).expect("it is well-formed XML");
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
}

#[test]
fn every_point_on_the_front_is_named_with_network_setting_and_figure() {
    let (report, drawing) = (report(), svg(&report()));
    let document = Document::parse(&drawing).expect("it is well-formed XML");
    let found: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    for network in &report.networks {
        for setting in network.settings.iter().filter(|setting| setting.on_front) {
            let figure = setting.error_text(report.compared);
            let expected = format!("{}, {}, {figure} %", network.network, setting.setting);
            assert!(found.contains(&expected.as_str()), "{expected}: {found:?}");
        }
    }
}

#[test]
fn where_points_of_networks_meet_no_colour_is_hidden_under_another() {
    let mut report = report();
    // All three networks at one place.
    for network in &mut report.networks {
        network.settings[0].us = 10.0;
        network.settings[0].error = 0.03;
    }
    let drawing = svg(&report);
    let document = Document::parse(&drawing).expect("it is well-formed XML");
    let exact = document.descendants().filter(|node| {
        let title = node.first_element_child().and_then(|title| title.text());
        title.is_some_and(|title| title.contains(", exact: "))
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
fn the_axes_are_named_as_the_columns_are() {
    let (report, drawing) = (report(), svg(&report()));
    let document = Document::parse(&drawing).expect("it is well-formed XML");
    let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    let mut table = Vec::new();
    crate::pareto::table::write(&mut table, &report).expect("a vector takes everything");
    let table = String::from_utf8(table).expect("text");
    for name in [report.time_name().as_str(), report.error_name()] {
        assert!(texts.contains(&name) && table.contains(name), "{name}");
    }
    for setting in report.networks.iter().flat_map(|network| &network.settings) {
        let time = setting.time_text();
        let title = format!("{}: {} {time},", setting.setting, report.time_name());
        assert!(texts.iter().any(|text| text.contains(&title)), "{title}");
        assert!(table.lines().any(|line| line.contains(&setting.setting) && line.contains(&time)), "{time}");
    }
}
