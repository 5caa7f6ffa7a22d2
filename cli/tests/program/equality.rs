//! Incremental and batch mode give the same values for the same windows at the same moments, bit
//! for bit.

use serde_json::Value;

use crate::support::{INCREMENTAL, argument, bits, file, lines, meissner, nodes, times};

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
        for every in [&["20000us"][..], &["997"], &["end"], &["event", "--limit", "300"]] {
            let arguments = [&["--network", network, "--every"], every].concat();
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
        // Steps back in time, pixels outside the sensor asked for below, and gaps longer than the
        // window.
        let t = i * 700 - 5_000 * i64::from(i % 7 == 3) + 400_000 * (i / 150);
        rows.push(format!("{t},{},{},{}", i * 7 % 20, i * 3 % 10, i % 2));
    }
    let (_folder, path) = file("gaps.csv", rows.join("\n"));
    for network in INCREMENTAL {
        for late in ["drop", "clamp"] {
            for every in ["event", "3000us", "64", "end"] {
                let arguments = [
                    argument(&path),
                    "--sensor",
                    "18x10",
                    "--network",
                    network,
                    "--late",
                    late,
                    "--every",
                    every,
                ];
                let (_, summary) = both(&arguments);
                assert!(summary["dropped"]["outside_sensor"].as_u64() > Some(0));
                let (dropped, clamped) = (&summary["dropped"]["late"], &summary["skips"]["events_clamped"]);
                assert!(if late == "drop" { dropped } else { clamped }.as_u64() > Some(0));
            }
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
