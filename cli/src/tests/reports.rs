//! Figures, tables and pictures of reports.

mod eval {
    use meissner_evaluate::metrics::Confusion;

    use crate::eval::confusion;

    #[test]
    fn a_confusion_counts_predictions_of_one_training_for_any_number_of_them() {
        let text = |trainings: usize| {
            let mut matrix = Confusion::new(2);
            for _ in 0..trainings {
                [(0, 0), (0, 0), (0, 1), (1, 1)]
                    .into_iter()
                    .for_each(|(truth, found)| matrix.add(truth, found));
            }
            let mut text = Vec::new();
            confusion(&mut text, "own", &["n", "s"], "windows", &matrix, trainings)
                .expect("a vector takes everything");
            String::from_utf8(text).expect("text")
        };
        assert_eq!(text(5), text(1));
        assert!(text(5).contains("n  66.7   33.3        3"), "{}", text(5));
    }
}

mod info {
    use meissner_engine::Event;

    use crate::info::{late, peak};

    #[test]
    fn the_peak_is_over_any_millisecond_not_over_aligned_ones() {
        assert_eq!(peak(&[]), 0);
        assert_eq!(peak(&[0, 900, 1100, 1899, 1900]), 3);
        assert_eq!(peak(&[i64::MIN, 0, i64::MAX]), 1);
    }

    #[test]
    fn late_events_are_those_behind_the_newest() {
        let events = [5, 3, 4, 5, 6, 2].map(|t| Event::new(t, 0, 0, true));
        assert_eq!(late(&events), 3);
    }
}

mod networks {
    use meissner_models::AnyDescription;

    use crate::networks::{Entry, PURPOSES, SYSTEMS, write};

    #[test]
    fn every_shipped_network_has_a_system_and_a_purpose() {
        let mut names: Vec<&str> = AnyDescription::shipped_names().collect();
        names.sort_unstable();
        assert!(names.iter().eq(PURPOSES.iter().map(|(name, ..)| name)));
        assert!(PURPOSES.iter().all(|(_, system, _)| SYSTEMS.contains(system)));
    }

    #[test]
    fn every_network_is_listed_with_what_it_predicts_for_people() {
        let entries: Vec<Entry> = AnyDescription::shipped_names().filter_map(Entry::of).collect();
        let mut text = Vec::new();
        write(&mut text, &entries).expect("a vector takes everything");
        let text = String::from_utf8(text).expect("text");
        assert_eq!(text.matches("      predicts ").count(), entries.len());
        for expected in [
            "roll, pitch (deg)",
            "depth (mm), tilt_x",
            "anticlockwise, clockwise",
            "classes 0 to 9",
            "force (N)",
        ] {
            assert!(text.contains(expected), "{expected}: {text}");
        }
        assert!(!text.contains("(rad)"), "{text}");
    }

    #[test]
    fn every_shipped_network_is_trained() {
        for name in AnyDescription::shipped_names() {
            assert!(Entry::of(name).is_some_and(|entry| entry.trained), "{name}");
        }
    }
}

mod pareto_table {
    use crate::pareto::table::{error, quoted, us};

    #[test]
    fn fields_cannot_break_a_line() {
        assert_eq!([quoted("stride 2"), quoted("a,\"b\"")], ["stride 2", "\"a,\"\"b\"\"\""]);
    }

    #[test]
    fn figures_have_the_digits_that_count() {
        assert_eq!([us(1.234), us(123.4)], ["1.23", "123.4"]);
        assert_eq!([error(0.0), error(0.00123)], ["0", "1.2e-3"]);
    }
}

mod text {
    use crate::text::Table;

    #[test]
    fn a_table_that_is_wider_than_a_terminal_becomes_several_with_the_same_first_column() {
        let headings: Vec<String> = (0..12).map(|i| format!("heading {i}")).collect();
        let mut table = Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>());
        table.row((0..12).map(|i| i.to_string()));
        let lines = table.lines();
        assert!(lines.len() == 5 && lines[2].is_empty(), "{lines:?}");
        assert!(lines.iter().all(|line| line.chars().count() <= 80), "{lines:?}");
        assert!(lines[3].starts_with("  heading 0") && lines[3].ends_with("heading 11"), "{lines:?}");
        let words = lines.join(" ");
        assert!(headings.iter().all(|heading| words.contains(heading.as_str())), "{lines:?}");
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let mut table = Table::new(&["layer", "rows"]);
        table.row(["a".to_owned(), "12,345".to_owned()]);
        let mut text = Vec::new();
        table.write(&mut text).expect("a vector takes everything");
        assert_eq!(String::from_utf8_lossy(&text), "  layer    rows\n  a      12,345\n");
    }
}

mod folded {
    use std::io::Write;

    use crate::text::Folded;

    fn through(text: &str, for_people: bool) -> String {
        let mut out = Vec::new();
        let mut folded = Folded::new(&mut out, for_people);
        // In pieces, as formatted text arrives.
        for piece in text.as_bytes().chunks(7) {
            folded.write_all(piece).expect("a vector takes everything");
        }
        folded.flush().expect("a vector takes everything");
        String::from_utf8(out).expect("text stays text")
    }

    #[test]
    fn a_long_line_goes_on_below_its_text_and_no_word_is_broken() {
        let text = format!("measured     {}end\nshort\n", "nineteen characters ".repeat(6));
        let folded = through(&text, true);
        assert!(folded.lines().all(|line| line.chars().count() <= 80), "{folded}");
        assert!(folded.lines().nth(1).is_some_and(|line| line.starts_with("             n")), "{folded}");
        assert!(folded.split_whitespace().eq(text.split_whitespace()));
        assert!(folded.ends_with("end\nshort\n"));
    }

    #[test]
    fn short_lines_long_words_and_text_for_programs_stay_as_they_are() {
        for text in ["a  b\n\n  c\nno end", &format!("{}\n", "x".repeat(100))] {
            assert_eq!(through(text, true), text);
        }
        let json = format!("{{\"a\": \"{}\"}}\n", "b ".repeat(100));
        assert_eq!(through(&json, false), json);
    }
}

mod pareto_plot {
    use meissner_evaluate::pareto::{
        Compared, DataReport, ErrorKind, Measurement, NetworkReport, Report, SettingReport, TaskError,
    };
    use meissner_run::provenance::Header;
    use roxmltree::Document;

    use crate::pareto::plot::svg;

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
        let past = [
            ("exact", 9.1, 0.041, true),
            ("tolerance 0.1", 9.3, 0.042, false),
            ("stride 2", 4.2, 0.06, true),
        ];
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
            assert!(
                table.lines().any(|line| line.contains(&setting.setting) && line.contains(&time)),
                "{time}"
            );
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
}
