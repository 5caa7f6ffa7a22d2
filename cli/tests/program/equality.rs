//! Incremental and batch mode give the same bits; approximations are requested by name; times at
//! which predictions are read.

use serde_json::Value;

use crate::exit_status::fails;
use crate::support::{
    INCREMENTAL, argument, bits, file, lines, meissner, message, nodes, object, text, times,
};

/// The predictions of both modes for `arguments`, which must be equal; the incremental ones with
/// their summary.
fn both(arguments: &[&str]) -> (Vec<Value>, Value) {
    let run = |mode: &str| lines(&meissner(&[&["run", "--json", "--mode", mode], arguments].concat()));
    let ((incremental, summary), (batch, from_scratch)) = (run("incremental"), run("batch"));
    assert_eq!(times(&incremental), times(&batch), "{arguments:?}");
    assert_eq!(nodes(&incremental), nodes(&batch), "{arguments:?}");
    for (i, (a, b)) in incremental.iter().zip(&batch).enumerate() {
        assert_eq!(bits(a), bits(b), "prediction {i} of {arguments:?}");
    }
    for count in ["events", "accepted", "dropped", "predictions", "nodes_max"] {
        assert_eq!(summary[count], from_scratch[count], "{count} of {arguments:?}");
    }
    for count in ["events_clamped", "events_expired", "events_evicted"] {
        assert_eq!(summary["skips"][count], from_scratch["skips"][count], "{count} of {arguments:?}");
    }
    (incremental, summary)
}

#[test]
fn every_shipped_network_predicts_alike_in_both_modes_whenever_it_is_read() {
    for network in INCREMENTAL {
        // A batch computes a whole window, which is full after 7,000 events.
        for (every, limit) in [("40000us", "12000"), ("2997", "12000"), ("end", "12000"), ("event", "300")] {
            let arguments = ["--network", network, "--every", every, "--limit", limit];
            let (predictions, summary) = both(&arguments);
            assert!(!predictions.is_empty());
            assert_eq!(summary["predictions"], predictions.len(), "{arguments:?}");
        }
    }
}

#[test]
fn two_threads_predict_what_one_does() {
    for network in ["graphres", "tactigraph-frozen"] {
        let run = |threads: &str| {
            let arguments =
                ["run", "--json", "--network", network, "--every", "300", "--limit", "3000", "--threads"];
            lines(&meissner(&[&arguments[..], &[threads]].concat())).0
        };
        let [one, two] = ["1", "2"].map(run);
        assert_eq!(times(&one), times(&two), "{network}");
        assert!(!one.is_empty() && one.iter().zip(&two).all(|(a, b)| bits(a) == bits(b)), "{network}");
    }
}

#[test]
fn they_agree_where_the_window_is_short_or_full() {
    for network in INCREMENTAL {
        let (_, summary) =
            both(&["--network", network, "--limit", "8000", "--span", "7ms", "--every", "5000us"]);
        assert!(summary["skips"]["events_expired"].as_u64() > Some(5_000));
        let (_, summary) =
            both(&["--network", network, "--limit", "8000", "--capacity", "700", "--every", "500"]);
        assert_eq!(summary["nodes_max"], 700);
        assert!(summary["skips"]["events_evicted"].as_u64() > Some(5_000));
    }
}

#[test]
fn they_agree_on_late_and_misplaced_events_and_over_gaps() {
    let mut rows = vec!["# sensor 20x10".to_owned()];
    for i in 0..400_i64 {
        // Steps back in time, pixels outside the sensor requested below, and gaps longer than the
        // window.
        let t = i * 700 - 5_000 * i64::from(i % 7 == 3) + 400_000 * (i / 150);
        rows.push(format!("{t},{},{},{}", i * 7 % 20, i * 3 % 10, i % 2));
    }
    let (_folder, path) = file("gaps.csv", rows.join("\n"));
    let ways = [("drop", "event"), ("clamp", "3000us"), ("drop", "64"), ("clamp", "end")];
    let others = ways.map(|(late, every)| (if late == "drop" { "clamp" } else { "drop" }, every));
    // Every way with every second network.
    for (network, ways) in INCREMENTAL.into_iter().zip([ways, others].into_iter().cycle()) {
        for (late, every) in ways {
            let input = [argument(&path), "--sensor", "18x10", "--network", network];
            let (_, summary) = both(&[&input[..], &["--late", late, "--every", every]].concat());
            assert!(summary["dropped"]["outside_sensor"].as_u64() > Some(0));
            let (dropped, clamped) = (&summary["dropped"]["late"], &summary["skips"]["events_clamped"]);
            assert!(if late == "drop" { dropped } else { clamped }.as_u64() > Some(0));
        }
    }
}

#[test]
fn a_network_without_an_incremental_form_runs_in_batch_mode() {
    let output = meissner(&[
        "run",
        "--network",
        "graphres-published",
        "--mode",
        "batch",
        "--limit",
        "15000",
        "--every",
        "3000",
        "--json",
    ]);
    let (predictions, _) = lines(&output);
    assert_eq!(predictions.len(), 5);
    for line in predictions {
        let rows: Vec<u64> =
            line["rows"].as_array().expect("rows of layers").iter().filter_map(Value::as_u64).collect();
        assert_eq!(rows[..5], [line["nodes"].as_u64().expect("a count"); 5], "every row of the event level");
    }
}

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
        let row = |i: i64| format!("{},{},{},{}\n", i * 90, i * 7 % 40, i / 40 % 30, i % 2);
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

/// Predictions of the default network on `events`, lines of CSV.
fn read(events: &str, every: &str, more: &[&str]) -> Vec<serde_json::Value> {
    let (_folder, path) = file("events.csv", events);
    let arguments = [&["run", argument(&path), "--sensor", "8x8", "--every", every, "--json"], more].concat();
    lines(&meissner(&arguments)).0
}

#[test]
fn after_every_accepted_event() {
    let predictions = read("10,1,1,1\n12,9,1,1\n12,2,1,0\n15,3,1,1\n", "event", &[]);
    assert_eq!(times(&predictions), [Some(10), Some(12), Some(15)]);
    assert_eq!(nodes(&predictions), [1, 2, 3]);
}

#[test]
fn after_every_second_event_and_not_for_a_remainder() {
    let predictions = read("10,1,1,1\n12,2,1,1\n15,3,1,1\n", "2", &[]);
    assert_eq!(times(&predictions), [Some(12)]);
}

#[test]
fn at_the_end_of_nothing_there_is_a_prediction_without_a_time() {
    let predictions = read("t,x,y,p\n", "end", &[]);
    assert_eq!(times(&predictions), [None]);
    assert_eq!(nodes(&predictions), [0]);
}

#[test]
fn nothing_at_all_has_no_periods() {
    assert_eq!(times(&read("t,x,y,p\n", "10us", &[])), []);
}

#[test]
fn a_period_holds_the_event_at_its_end_and_the_last_one_covers_the_last_event() {
    let predictions = read("10,1,1,1\n20,2,1,1\n21,3,1,1\n22,4,1,1\n", "10us", &[]);
    assert_eq!(times(&predictions), [Some(20), Some(22)]);
    assert_eq!(nodes(&predictions), [2, 4]);
}

#[test]
fn in_a_gap_predictions_go_on_until_the_window_is_empty_and_resume_with_the_next_event() {
    let year_us = 31_557_600_000_000_i64;
    // A second event confirms the year.
    let events = format!("0,1,1,1\n5,2,1,1\n{0},3,1,1\n{0},4,1,1\n", year_us + 3);
    let predictions = read(&events, "10us", &["--span", "25us"]);
    assert_eq!(times(&predictions), [Some(5), Some(5), Some(5), Some(5), Some(year_us + 3)]);
    // Due at 10, 20, 30 (the event at 0 has left, the one at 5 is 25 us old), 40, and after the
    // year.
    assert_eq!(nodes(&predictions), [2, 2, 1, 0, 2]);
}

#[test]
fn the_limit_counts_events_taken() {
    for limit in [0, 1, 250] {
        let output = meissner(&["run", "--limit", &limit.to_string(), "--every", "event", "--json"]);
        let (predictions, summary) = lines(&output);
        assert_eq!(summary["events"], limit);
        assert_eq!(predictions.len(), limit);
    }
}
