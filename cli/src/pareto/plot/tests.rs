//! The words of the picture are those of the report.

use roxmltree::Document;

use super::svg;
use meissner_evaluate::pareto::{
    Compared, DataReport, ErrorKind, Measurement, NetworkReport, Report, SettingReport, TaskError,
};
use meissner_run::provenance::Header;

/// Two networks with three settings each, compared by an error of `kind`.
fn report(kind: ErrorKind) -> Report {
    let setting = |(name, us, error, on_front): (&str, f64, f64, bool)| {
        let interval_95 = Some((0.8 * error, 1.2 * error));
        let of = "cross-validation".to_owned();
        let task = TaskError { of, kind, error, interval_95, trials: 1100, trainings: 1 };
        SettingReport {
            setting: name.to_owned(),
            us,
            speed_up: 1.0,
            error,
            interval_95,
            on_front,
            measurement: Measurement { task: vec![task], ..Measurement::default() },
        }
    };
    let network = |name: &str, settings: [(&str, f64, f64, bool); 3]| NetworkReport {
        network: name.to_owned(),
        weights: String::new(),
        fingerprint: String::new(),
        settings: settings.map(setting).into(),
    };
    let all = [
        ("exact", 40.58, 0.0336, false),
        ("tolerance 0.1", 37.54, 0.0327, true),
        ("stride 2", 21.3, 0.05, false),
    ];
    let past =
        [("exact", 9.1, 0.041, true), ("tolerance 0.1", 9.3, 0.042, false), ("stride 2", 4.2, 0.06, true)];
    let networks = vec![network("digits-all", all), network("digits-past", past)];
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
        compared: Compared::Task(kind),
        networks,
        fastest_within: Vec::new(),
        summary: String::new(),
    }
}

#[test]
fn every_point_on_the_front_is_named_with_network_setting_and_figure() {
    let report = report(ErrorKind::WrongAnswers);
    let drawing = svg(&report);
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
fn the_axes_are_named_as_the_columns_are() {
    let report = report(ErrorKind::WrongAnswers);
    let drawing = svg(&report);
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

#[test]
fn an_error_in_a_unit_of_its_own_has_it_in_picture_table_and_comma_separated_values() {
    for (kind, label, unit) in [
        (ErrorKind::SquaredForce, "digits-past, exact, 0.0410 N^2", "N^2"),
        (ErrorKind::OneMinusIou, "digits-past, exact, 4.10 %", "share"),
    ] {
        let report = report(kind);
        let drawing = svg(&report);
        let document = Document::parse(&drawing).expect("it is well-formed XML");
        let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
        assert!(texts.contains(&label) && texts.contains(&kind.name()), "{label}: {texts:?}");
        let mut table = Vec::new();
        crate::pareto::table::write(&mut table, &report).expect("a vector takes everything");
        let table = String::from_utf8(table).expect("text");
        assert!(table.contains(kind.name()) && table.contains(&kind.text(0.041)), "{table}");
        let csv = crate::pareto::table::csv(&report);
        let column =
            csv.lines().next().and_then(|names| names.split(',').position(|name| name == "error_unit"));
        let units: Vec<_> =
            csv.lines().skip(1).map(|line| line.split(',').nth(column.expect("a column"))).collect();
        assert_eq!(units, [Some(unit); 6], "{csv}");
    }
}
