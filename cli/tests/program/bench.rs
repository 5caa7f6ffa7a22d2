//! `bench`: counts that fit together, independent of times.

use serde_json::Value;

use crate::exit_status::fails;
use crate::support::{argument, file, keys, meissner, meissner_reading, object, text};

/// The object that a benchmark of the first events of the embedded recording prints.
fn bench(more: &[&str]) -> Value {
    bench_of("tactigraph-past", more)
}

fn bench_of(network: &str, more: &[&str]) -> Value {
    let arguments = ["bench", "--network", network, "--limit", "1500", "--warmup", "100", "--json"];
    object(&meissner(&[&arguments[..], more].concat()))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is a number"))
}

fn count(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is a count"))
}

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().expect("a list")
}

fn assert_close(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs(), "expected {expected}, found {found}");
}

#[test]
fn the_report_has_the_documented_keys_and_ascending_quantiles() {
    let report = bench(&[]);
    assert_eq!(
        keys(&report),
        "accepted clock_us deadline dropped events events_per_s header isa latency_us lines_refused memory nodes_max passes \
         phases predictions skips slices stages threads warmup_events warnings work"
    );
    assert_eq!(keys(&report["latency_us"]), "predict push push_predict");
    for name in ["push", "predict", "push_predict"] {
        let distribution = &report["latency_us"][name];
        assert_eq!(keys(distribution), "count max mean p50 p90 p99 p999");
        let quantiles = ["p50", "p90", "p99", "p999", "max"].map(|quantile| number(&distribution[quantile]));
        assert!(quantiles.is_sorted() && quantiles[0] > 0.0, "{distribution}");
    }
    assert!(number(&report["clock_us"]) > 0.0 && count(&report["memory"]["state_bytes"]) > 0);
    let peak = report["memory"]["peak_resident_bytes"].as_u64();
    assert_eq!(peak.is_some_and(|bytes| bytes > 0), cfg!(target_os = "linux"));
}

#[test]
fn the_phases_add_up_to_the_events_of_every_pass() {
    let report = bench(&["--repeat", "2"]);
    assert_eq!((count(&report["events"]), count(&report["passes"])), (1500, 2));
    let phases = [&report["phases"]["idle"], &report["phases"]["burst"]];
    assert_eq!(phases.iter().map(|phase| count(&phase["events"])).sum::<u64>(), 1500);
    for name in ["push", "predict", "push_predict"] {
        let counts = phases.iter().map(|phase| phase["latency_us"][name]["count"].as_u64().unwrap_or(0));
        assert_eq!(counts.sum::<u64>(), 3000, "{name}");
        assert_eq!(report["latency_us"][name]["count"], 3000, "{name}");
    }
    let rows = phases
        .iter()
        .map(|phase| count(&phase["events"]) as f64 * phase["rows_per_event"].as_f64().unwrap_or(0.0));
    assert_close(rows.sum(), count(&report["skips"]["rows_recomputed"]) as f64);
}

#[test]
fn a_burst_rate_of_1_makes_a_burst_of_all_and_an_unreachable_one_of_none() {
    let all = bench(&["--burst-rate", "1"]);
    // The first event has none before it.
    assert!(count(&all["phases"]["burst"]["events"]) > 1400, "{}", all["phases"]);
    let none = bench(&["--burst-rate", "1000000000000"]);
    assert_eq!(none["phases"]["burst"]["events"], 0);
    assert_eq!(none["phases"]["burst"]["latency_us"]["push"], Value::Null);
}

#[test]
fn every_event_costs_as_many_rows_and_skips_as_in_a_run() {
    let arguments = ["run", "--network", "tactigraph-past", "--limit", "1500", "--every", "event", "--json"];
    let (_, summary) = crate::support::lines(&meissner(&arguments));
    let report = bench(&["--repeat", "2"]);
    assert_eq!(report["skips"], summary["skips"]);
    assert_eq!(report["predictions"], summary["predictions"]);
    for (work, layer) in list(&report["work"]["layers"]).iter().zip(list(&summary["skips"]["layers"])) {
        assert_eq!(work["name"], layer["name"]);
        assert_close(number(&work["rows_per_event"]) * 1500.0, number(&layer["recomputed"]));
        let expected = number(&work["rows_per_event"]) * number(&work["multiply_adds_per_row"]);
        assert_close(number(&work["multiply_adds_per_event"]), expected);
    }
}

#[test]
fn predictions_come_as_often_as_they_are_asked_for() {
    assert_eq!(bench(&["--every", "100"])["predictions"], 15);
    let arguments = ["run", "--network", "tactigraph-past", "--limit", "1500", "--every", "5000us", "--json"];
    let (_, summary) = crate::support::lines(&meissner(&arguments));
    let report = bench(&["--every", "5000us"]);
    assert_eq!(report["predictions"], summary["predictions"]);
    assert_eq!(report["latency_us"]["push_predict"]["count"], 1500, "each event counts once");
}

#[test]
fn the_shares_of_the_stages_add_up_to_1() {
    for network in ["tactigraph-past", "graphres"] {
        let report = bench_of(network, &[]);
        let shares: f64 = list(&report["stages"]).iter().map(|stage| number(&stage["share"])).sum();
        assert_close(shares, 1.0);
    }
}

#[test]
fn periods_and_misses_are_those_of_the_bins() {
    let report = &bench(&["--period", "500us"])["deadline"];
    let bins = list(&report["bins"]);
    let sum = |key: &str| bins.iter().map(|bin| count(&bin[key])).sum::<u64>();
    assert_eq!(sum("periods") + count(&report["periods_without_work"]), count(&report["periods"]));
    assert_eq!(sum("periods"), count(&report["work_us"]["count"]));
    assert_eq!(sum("missed"), count(&report["missed"]));
    for bin in bins {
        let [least, seen, most] = ["events_least", "events_seen", "events_most"].map(|key| count(&bin[key]));
        assert!(least <= seen && seen <= most, "{bin}");
        assert_eq!(bin["periods"], bin["work_us"]["count"]);
    }
    assert!(bins.is_sorted_by_key(|bin| count(&bin["events_least"])));
}

#[test]
fn a_period_that_no_work_fits_in_is_missed_and_a_second_is_not() {
    let tight = &bench(&["--period", "1us"])["deadline"];
    assert!(count(&tight["missed"]) > 0 && number(&tight["excess_max_us"]) > 0.0, "{tight}");
    let (_folder, path) = file("few.csv", "# sensor 8x8\n0,1,1,1\n100,2,2,1\n900,3,3,0\n50000000,3,3,0\n");
    let arguments = ["bench", argument(&path), "--period", "1s", "--json"];
    let wide = &object(&meissner(&arguments))["deadline"];
    assert_eq!((count(&wide["missed"]), number(&wide["excess_max_us"])), (0, 0.0));
    assert_eq!((count(&wide["periods"]), &wide["excess_mean_us"]), (50, &Value::Null));
    assert_eq!(wide["sustained"]["events_per_period"], 3);
    assert_eq!(wide["sustained_is_all_seen"], true);
}

#[test]
fn the_drawing_is_well_formed_and_names_what_it_shows() {
    // A name with characters that XML must escape.
    let (folder, recording) = file("dots & <taps>.csv", "# sensor 8x8\n0,1,1,1\n100,2,2,1\n900,3,3,0\n");
    let path = folder.path().join("latency.svg");
    object(&meissner(&["bench", argument(&recording), "--svg", argument(&path), "--json"]));
    let svg = std::fs::read_to_string(&path).expect("it was written");
    let document = roxmltree::Document::parse(&svg).expect("it is well-formed XML");
    let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    for expected in
        ["Latency of tactigraph-past", "dots & <taps>.csv: 3 events", "push", "predict", "push + predict"]
    {
        assert!(texts.iter().any(|text| text.contains(expected)), "{expected}: {texts:?}");
    }
    let curves = document.descendants().filter(|node| node.has_tag_name("path")).count();
    assert!(curves >= 3, "{curves} curves");
}

#[test]
fn no_events_have_no_figures_and_still_a_report() {
    let (folder, recording) = file("none.csv", "# sensor 8x8\nt,x,y,p\n");
    let path = folder.path().join("none.svg");
    let report = object(&meissner(&["bench", argument(&recording), "--svg", argument(&path), "--json"]));
    assert_eq!((count(&report["events"]), &report["latency_us"]["push"]), (0, &Value::Null));
    assert_eq!((count(&report["deadline"]["periods"]), list(&report["stages"]).len()), (0, 0));
    let svg = std::fs::read_to_string(&path).expect("it was written");
    assert!(roxmltree::Document::parse(&svg).is_ok() && svg.contains("no events"));
    assert!(meissner(&["bench", argument(&recording)]).status.success());
}

#[test]
fn slices_are_timed_with_a_prediction_each() {
    let report = &bench(&["--slice", "60", "--repeat", "2"])["slices"];
    assert_eq!((count(&report["events"]), count(&report["latency_us"]["count"])), (60, 50));
    assert!(report["events_per_s"].as_f64().is_some_and(|rate| rate > 0.0));
    fails(&meissner(&["bench", "--slice", "0"]), 2, &["--slice", "a number of events from 1 on"]);
}

#[test]
fn the_table_names_every_part() {
    let output = meissner(&["bench", "--network", "tactigraph-past", "--limit", "500"]);
    let table = text(&output);
    for part in [
        "push + predict",
        "phase",
        "conv3",
        "kept (%)",
        "multiply-adds",
        "event graph",
        "of state",
        "64 events, predict",
        "deadline",
    ] {
        assert!(table.contains(part), "{part}: {table}");
    }
}

#[test]
fn standard_input_is_read_to_its_end_and_then_measured() {
    let report = object(&meissner_reading(
        &["bench", "-", "--sensor", "8x8", "--json"],
        "0,1,1,1\n9,2,2,1\n9,9,2,1\n",
    ));
    assert_eq!((count(&report["events"]), count(&report["dropped"]["outside_sensor"])), (3, 1));
}

#[test]
fn a_sweep_times_every_value_of_a_quantity_and_names_the_power() {
    let arguments = ["bench", "--sweep=neighbours,channels", "--limit", "3"];
    let sweep = |more: &[&str]| meissner(&[&arguments, more].concat());
    let report = object(&sweep(&["--json"]));
    assert_eq!(keys(&report), "curves events header isa rate_events_per_s seed window");
    let names: Vec<_> = list(&report["curves"]).iter().map(|curve| &curve["quantity"]).collect();
    assert_eq!(names, ["neighbours", "channels"]);
    for curve in list(&report["curves"]) {
        assert_eq!(keys(curve), "behind_at late_at points quantity slopes");
        assert_eq!(keys(&curve["slopes"]), "p50 p99 rows state_bytes");
        assert_eq!(curve["slopes"]["rows"], 0.0, "an event of the past costs a row a block");
        for point in list(&curve["points"]) {
            assert_eq!(keys(point), "latency_us nodes rate_events_per_s rows_per_event state_bytes value");
            assert_eq!((&point["latency_us"]["count"], &point["rows_per_event"]), (&3.into(), &3.0.into()));
        }
    }
    let table = text(&sweep(&[]));
    assert!(table.contains("grows with the power") && table.contains("neighbours of an event"), "{table}");
}

#[test]
fn a_sweep_draws_its_events_and_refuses_what_belongs_to_a_recording() {
    for (option, more) in [
        ("--late", &["--late", "clamp"][..]),
        ("--compare", &["--compare", "event-frame-cnn"]),
        ("INPUT", &["some.csv"]),
        ("--limit", &["--limit", "0"]),
    ] {
        let arguments = [&["bench", "--sweep=rate"], more].concat();
        fails(&meissner(&arguments), 2, &[option]);
    }
    fails(&meissner(&["bench", "--sweep", "--network", "canf-live"]), 1, &["a network over events"]);
}
