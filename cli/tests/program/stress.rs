//! `meissner verify --stress` in its short form: every promise holds, and errors are what they were
//! when they were measured.

use serde_json::Value;

use crate::exit_status::fails;
use crate::support::{meissner, message, object, text};

/// Largest relative error of a prediction that each group may show in its short form. Measured,
/// with AVX-512: 7e-7 over streams, 9e-7 over weights (3.4e-4 where activations are denormal:
/// trained weights are small, so that fewer bits are left; the case itself promises 1e-3), 1.1e-5
/// over states, 2.5e-6 over images (1.8e-3 where pixels are denormal). Other instruction sets give
/// the same bits; what differs is the platform's f64 library, by 2^-29 of such errors. Five times
/// is left for other networks and streams under the same names.
const BOUNDS: [(&str, f64, f64); 4] =
    [("streams", 4e-6, 4e-6), ("weights", 5e-6, 1e-3), ("recurrent", 6e-5, 6e-5), ("winograd", 1.5e-5, 1e-2)];

#[test]
fn every_promise_holds_under_stress() {
    let output = meissner(&["verify", "--stress", "--quick", "--json"]);
    assert!(output.status.success(), "{}\n{}", message(&output), text(&output));
    let report = object(&output);
    assert_eq!((&report["broken"], &report["header"]["command"]), (&0.into(), &"stress".into()), "{report}");
    let cases = report["cases"].as_array().expect("cases");
    for (group, bound, denormal) in BOUNDS {
        let of_group: Vec<&Value> = cases.iter().filter(|case| case["group"] == group).collect();
        assert!(of_group.len() >= 12, "{group}: {} cases", of_group.len());
        for case in of_group {
            let name = format!("{group}, {}, {}", case["case"], case["network"]);
            assert_eq!((&case["different"], &case["not_numbers"]), (&0.into(), &0.into()), "{name}");
            assert!(case["compared"].as_u64().is_some_and(|compared| compared >= 12), "{name}: {case}");
            let bound = if name.contains("denormal") { denormal } else { bound };
            if let Some(relative) = case["prediction"]["relative"].as_f64() {
                assert!(relative <= bound, "{name}: {relative:e}, expected at most {bound:e}");
            } else {
                assert!(case["refused"].as_u64().is_some_and(|refused| refused > 0), "{name}: {case}");
            }
        }
    }
    let functions = report["functions"].as_array().expect("functions");
    assert_eq!(functions.len(), 5);
    for function in functions {
        let (ulps, bound) = (function["ulps"].as_f64(), function["bound"].as_f64());
        assert!(ulps > Some(0.5) && ulps <= bound, "{function}");
    }
}

#[test]
fn cases_are_listed_and_chosen_by_their_names() {
    let list = text(&meissner(&["verify", "--stress", "--list"]));
    for group in ["streams: one pixel: graphres", "weights: ", "recurrent: ", "winograd: ", "functions: tanh"]
    {
        assert!(list.contains(group), "{group}: {list}");
    }
    let some =
        text(&meissner(&["verify", "--stress", "--list", "--only", "one instant", "--only", "sigmoid"]));
    assert!(some.contains("streams: one instant: graphres") && some.contains("functions: sigmoid"), "{some}");
    assert!(!some.contains("recurrent"), "{some}");
}

#[test]
fn the_former_name_lists_the_same_cases() {
    let list = |arguments: &[&str]| text(&meissner(arguments));
    assert_eq!(
        list(&["stress", "--list", "--only", "tanh"]),
        list(&["verify", "--stress", "--list", "--only", "tanh"])
    );
    fails(&meissner(&["stress", "--only", "nothing of that name"]), 2, &["--only", "nothing of that name"]);
}

#[test]
fn only_its_own_options_go_with_stress() {
    for more in [
        &["graphres"][..],
        &["--sensor", "8x8"],
        &["--seed", "3"],
        &["--events", "9"],
        &["--cases", "9"],
        &["--soak"],
    ] {
        fails(&meissner(&[&["verify", "--stress"], more].concat()), 2, &["--stress"]);
    }
    fails(&meissner(&["verify", "graphres", "--quick"]), 2, &["--stress"]);
}

#[test]
fn a_name_of_no_case_is_bad_usage() {
    fails(
        &meissner(&["verify", "--stress", "--only", "nothing of that name"]),
        2,
        &["--only", "nothing of that name"],
    );
}

#[test]
fn tables_are_text_or_markdown() {
    let only = ["verify", "--stress", "--quick", "--only", "sensor of one pixel", "--only", "exp"];
    let plain = text(&meissner(&only));
    assert!(plain.contains("sensor of one pixel") && plain.contains("largest error (ULP)"), "{plain}");
    let markdown = text(&meissner(&[&only[..], &["--markdown"]].concat()));
    assert!(markdown.contains("| sensor of one pixel | graphres | 160 |"), "{markdown}");
}
