//! Approximations: asked for by name, said in the summary, and exact where they are not asked for.

use serde_json::Value;

use crate::exit_status::fails;
use crate::support::{bits, file, lines, meissner, message, object, text, times};

/// Predictions and summary of `graphres` over the first events of the default recording.
fn run(more: &[&str]) -> (Vec<Value>, Value) {
    lines(&meissner(
        &[&["run", "--network", "graphres", "--json", "--limit", "4000", "--every", "200"], more].concat(),
    ))
}

fn all_bits(lines: &[Value]) -> Vec<Vec<u32>> {
    lines.iter().map(bits).collect()
}

fn count(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("a count, found {value}"))
}

#[test]
fn nothing_is_approximated_where_nothing_was_asked_for() {
    let (_, summary) = run(&[]);
    assert!(summary.get("approximations").is_none());
    assert_eq!(summary["skips"]["rows_within_tolerance"], 0);
}

#[test]
fn a_tolerance_of_zero_has_the_bits_of_none_and_a_large_one_keeps_rows() {
    let (exact, _) = run(&[]);
    let (zero, summary) = run(&["--tolerance", "0"]);
    assert_eq!(all_bits(&zero), all_bits(&exact));
    assert_eq!(summary["approximations"]["rows_within_tolerance"], 0);
    let (kept, summary) = run(&["--tolerance", "0.1"]);
    assert_ne!(all_bits(&kept), all_bits(&exact));
    assert!(count(&summary["approximations"]["rows_within_tolerance"]) > 0);
    assert_eq!(summary["skips"]["rows_within_tolerance"], summary["approximations"]["rows_within_tolerance"]);
}

#[test]
fn an_adapted_network_predicts_alike_in_both_modes_and_unlike_the_exact_one() {
    let (exact, _) = run(&[]);
    for (options, name, value) in [
        (["--neighbours", "3"], "neighbours", Value::from(3)),
        (
            ["--stride", "2"],
            "filters",
            serde_json::json!([{"name": "stride", "passed": 2000, "dropped": 2000}]),
        ),
    ] {
        let (incremental, summary) = run(&options);
        let (batch, _) = run(&[&options[..], &["--mode", "batch"]].concat());
        assert_eq!(all_bits(&incremental), all_bits(&batch), "{options:?}");
        assert_ne!(all_bits(&incremental), all_bits(&exact), "{options:?}");
        assert_eq!(summary["approximations"][name], value, "{options:?}");
    }
}

#[test]
fn events_that_a_filter_drops_are_counted_by_filter_and_never_enter() {
    for filters in [
        &["--activity-filter", "1250us"][..],
        &["--refractory", "3ms"],
        &["--rate-limit", "5000"],
        &["--stride", "7"],
        &["--stride", "2", "--rate-limit", "20000", "--activity-filter", "500us", "--refractory", "0.1ms"],
    ] {
        let (_, summary) = run(filters);
        let of_filters = summary["approximations"]["filters"].as_array().expect("filters ran");
        assert_eq!(of_filters.len(), filters.len() / 2);
        let mut left = 4000;
        for filter in of_filters {
            assert_eq!(count(&filter["passed"]) + count(&filter["dropped"]), left, "{filters:?}");
            left = count(&filter["passed"]);
        }
        assert_eq!((count(&summary["events"]), count(&summary["accepted"])), (4000, left), "{filters:?}");
        assert!(left < 4000, "{filters:?}");
    }
}

#[test]
fn a_filtered_stream_predicts_what_the_remaining_events_do() {
    let rows = |keep: i64| {
        let rows = (0..2_000_i64).filter(|i| i % keep == 0);
        let row = |i: i64| format!("{},{},{},{}\n", i * 90, i * 7 % 40, i * 3 % 30, i % 2);
        rows.map(row).fold("# sensor 40x30\n".to_owned(), |all, row| all + &row)
    };
    let (_folder, all) = file("all.csv", rows(1));
    let (_other, half) = file("half.csv", rows(2));
    let run = |path: &std::path::Path, more: &[&str]| {
        let path = path.to_str().expect("temporary paths are text");
        lines(&meissner(&[&["run", path, "--json", "--every", "5000us"], more].concat())).0
    };
    let (filtered, alone) = (run(&all, &["--stride", "2"]), run(&half, &[]));
    assert!(filtered.len() > 20);
    assert_eq!(times(&filtered), times(&alone));
    assert_eq!(all_bits(&filtered), all_bits(&alone));
}

#[test]
fn a_stale_prediction_stands_with_its_time_until_it_is_too_old() {
    let (exact, _) = run(&[]);
    let (stale, summary) = run(&["--stale-events", "600"]);
    assert_eq!(stale.len(), exact.len());
    // Read every 200 events: each third one is computed.
    for (i, (stale, exact)) in stale.iter().zip(exact.chunks(3).flat_map(|c| [&c[0]; 3])).enumerate() {
        assert_eq!((bits(stale), &stale["t_us"]), (bits(exact), &exact["t_us"]), "prediction {i}");
    }
    assert_eq!(count(&summary["predictions"]), stale.len() as u64);
    let stood = count(&summary["approximations"]["stale_predictions"]);
    assert_eq!(stood, (stale.len() - stale.len().div_ceil(3)) as u64);
    let (_, summary) = run(&["--stale-time", "1us"]);
    assert_eq!(summary["approximations"]["stale_us"], 1);
}

#[test]
fn batch_mode_refuses_what_says_what_may_be_kept() {
    for option in ["--tolerance=0.1", "--stale-events=5", "--stale-time=5us"] {
        let name = option.split('=').next().expect("an option has a name");
        fails(&meissner(&["run", "--mode", "batch", option]), 2, &[name, "--mode incremental", "batch"]);
    }
}

#[test]
fn approximations_that_make_no_sense_are_bad_usage() {
    for options in [
        ["--tolerance", "-1"],
        ["--tolerance", "inf"],
        ["--neighbours", "0"],
        ["--neighbours", "255"],
        ["--stride", "0"],
        ["--rate-limit", "0"],
        ["--activity-filter", "0us"],
        ["--refractory", "-5"],
        ["--stale-events", "0"],
        ["--stale-time", "0us"],
    ] {
        fails(&meissner(&[&["run"], &options[..]].concat()), 2, &["error: "]);
    }
    let compare = ["bench", "--compare", "event-frame-cnn", "--tolerance", "1"];
    fails(&meissner(&compare), 2, &["--compare", "--tolerance"]);
    let frames = ["bench", "--network", "event-frame-cnn", "--stride", "2"];
    fails(&meissner(&frames), 2, &["--stride", "a network over events", "event-frame-cnn"]);
}

#[test]
fn both_programs_tell_people_what_was_approximated() {
    let options = ["--tolerance", "0.05", "--neighbours", "5", "--stride", "2", "--stale-events", "300"];
    let said = [
        "stride dropped 1,000 of 2,000 events",
        "at most 5 neighbours an event",
        "recomputed rows within 0.05 kept",
        "predictions stood and were not computed",
    ];
    for program in [&["run", "--limit", "2000", "--every", "100"][..], &["bench", "--limit", "2000"]] {
        let output = meissner(&[program, &options].concat());
        assert!(output.status.success(), "{}", message(&output));
        for line in said {
            assert!(text(&output).contains(line), "{line}: {}", text(&output));
        }
    }
}

#[test]
fn a_benchmark_counts_the_events_that_came() {
    let output = meissner(&["bench", "--json", "--limit", "1500", "--stride", "3", "--tolerance", "0.01"]);
    let report = object(&output);
    assert_eq!((count(&report["events"]), count(&report["accepted"])), (1500, 500));
    assert_eq!(report["latency_us"]["push"]["count"], 1500);
    assert_eq!(report["approximations"]["filters"][0]["dropped"], 1000);
    assert_eq!(report["predictions"], 500);
}
