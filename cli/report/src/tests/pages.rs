use roxmltree::Document;

use super::{outcomes, run};
use crate::{Drawing, Page, Truths, read};

fn page(texts: &[(&str, String)]) -> String {
    let results: Vec<_> = texts
        .iter()
        .flat_map(|(name, text)| read(name, text.as_bytes(), &Truths::default()).expect("a result"))
        .collect();
    Page { results: &results, drawings: &[] }.html().expect("a page")
}

/// The pictures of a page, which are well-formed.
fn pictures(page: &str) -> Vec<String> {
    let parts = page.split("<svg ").skip(1);
    let pictures = parts.map(|part| format!("<svg {}</svg>", part.split("</svg>").next().expect("an end")));
    pictures.inspect(|svg| assert!(Document::parse(svg).is_ok(), "{svg}")).collect()
}

#[test]
fn a_page_needs_nothing_else() {
    let page = page(&[("a.json", run())]);
    assert!(!page.contains("<script") && !page.contains("src=") && !page.contains("@import"));
    assert!(!page.contains("url(") && !page.contains("href=\"http"));
    assert!(page.contains("default-src 'none'"));
    assert!(pictures(&page).len() >= 5, "{page}");
}

#[test]
fn a_run_answers_first_and_says_how_it_was_made() {
    let page = page(&[("a.json", run())]);
    for expected in [
        "own made 3 predictions from press.es; the last one is 0.75 N.",
        "It keeps up with the input: 4 times as fast as it came.",
        "meissner run 'it'\\''s'",
        "P, 2 threads, linux x86_64",
        "avx2",
        "dropped: late",
    ] {
        let expected = meissner_plot::escaped(expected);
        assert!(page.contains(&expected), "{expected}: {page}");
    }
}

#[test]
fn several_results_are_compared_and_have_names_of_their_own() {
    let page = page(&[("one.json", run()), ("two.json", run())]);
    assert!(page.contains("2 results compared"));
    for name in ["one.json", "two.json"] {
        assert!(page.contains(&format!("<th scope=\"col\">{name}</th>")), "{page}");
    }
    assert!(page.contains("Predicted force"));
}

#[test]
fn names_in_a_result_cannot_break_the_page() {
    let hostile =
        run().replace("own", "<script>alert(1)</script>").replace("a/press.es", "</svg><img src=x>");
    let page = page(&[("<b>.json", hostile)]);
    assert!(!page.contains("<script") && !page.contains("<img") && !page.contains("<b>"), "{page}");
    pictures(&page);
}

#[test]
fn a_page_beyond_its_size_is_refused() {
    let results = outcomes(&run()).expect("a result");
    let drawings = [Drawing { network: "own".to_owned(), svg: " ".repeat(crate::MAX_BYTES) }];
    let error = Page { results: &results, drawings: &drawings }.html().expect_err("too large");
    assert!(error.to_string().contains("give fewer"), "{error}");
}

#[test]
fn values_that_are_missing_or_wrong_leave_a_page() {
    for command in [
        "bench",
        "fit",
        "pareto",
        "soak",
        "verify",
        "stress",
        "simulate loop",
        "sweep",
        "eval slip",
        "eval angle",
        "eval force",
        "eval area",
        "eval touch letters",
        "eval other",
    ] {
        let of = |rest: &str| format!("{{\"header\":{{\"command\":\"{command}\"}},{rest}}}");
        page(&[("a", of("\"x\":1"))]);
        page(&[(
            "a",
            of(
                r#""networks":[{"figures":3,"sets":[[]],"settings":[{}],"test":{}}],"outputs":[{}],"classes":[1],"checkpoints":[{}],"skips":[],"deadline":{"bins":[{},{}]},"latency_us":7,"checks":[{}],"mismatch":{},"cases":[{"within":0}],"functions":[{}],"truth":{},"pairs":[3,[[1],[null,2]]]"#,
            ),
        )]);
    }
}

/// The page of one object of `command`, with its keys.
fn of(command: &str, keys: &str) -> String {
    let object = format!(
        "{{\"header\":{{\"command\":\"{command}\",\"network\":{{\"name\":\"own\"}},\"warnings\":[]}},{keys}}}"
    );
    let page = page(&[("a.json", object.clone())]);
    assert_eq!(page, self::page(&[("a.json", object)]), "equal results give equal bytes");
    pictures(&page);
    page
}

fn holds(page: &str, expected: &[&str]) {
    for expected in expected {
        let expected = meissner_plot::escaped(expected);
        assert!(page.contains(&*expected), "{expected}: {page}");
    }
}

#[test]
fn a_verification_says_whether_bits_are_equal_and_where_they_are_not() {
    let checks = r#""seed":1,"checks":[{"name":"random streams","cases":3,"inputs":60,"comparisons":12,"rows":4000,"refused":0}]"#;
    let equal = of("verify", &format!("{checks},\"mismatch\":null"));
    holds(
        &equal,
        &["own equals full recomputation bit for bit at 12 comparisons over 3 streams.", "4,000 rows"],
    );
    assert!(!equal.contains("NaN on both sides</text>"), "{equal}");
    let differs = of(
        "verify",
        &format!(
            r#"{checks},"mismatch":{{"name":"a.csv","file":"failure.csv","steps":4,"input":3,"layer":"conv2","row":7,"difference":"row 7 of conv2 is 1 and not 2"}}"#
        ),
    );
    let lead = "own differs from full recomputation in a.csv.";
    holds(&differs, &[lead, "row 7 of conv2 is 1 and not 2", "has 4 steps: failure.csv", "The difference"]);
}

#[test]
fn stress_leads_with_the_promises_and_shows_errors_beside_their_bounds() {
    let case = |name: &str, error: f64, broken: &str| {
        format!(
            r#"{{"group":"weights","case":"{name}","network":"own","steps":9,"compared":10,"different":0,"refused":0,"infinite":0,"infinite_inside":0,"within":1e-4,"prediction":{{"absolute":1,"relative":{error:e},"rms":1}},"layer":{{"layer":"conv3","relative":2e-7}},"largest_activation":3e21,"us":5,"times_ordinary":2.5,"broken":[{broken}]}}"#
        )
    };
    let functions = r#""functions":[{"function":"tanh","inputs":100,"ulps":0.75,"at":1.5,"bound":1,"not_numbers":0,"broken":[]}]"#;
    let keys = |second: &str| format!("\"cases\":[{},{second}],{functions}", case("weights x 1e3", 3e-7, ""));
    let overflow = r#"{"group":"weights","case":"weights x 1e15","network":"own","compared":10,"different":0,"refused":10,"within":null,"prediction":null,"layer":null,"broken":[]}"#;
    let page = of("stress", &keys(overflow));
    holds(
        &page,
        &[
            "Every promise held in 2 cases and 1 function.",
            "20 of 20 predictions equal full recomputation bit for bit.",
            "Nearest to its bound against f64 is weights x 1e3, own: 3.0e-7 of the largest prediction, 1.0e-4 is promised.",
            "tanh is nearest to its bound: 0.75 units in the last place, 1 are promised.",
            "weights: error by condition",
            "weights: time by condition",
            "own: conv3",
            "10 refused (NaN)",
        ],
    );
    let page = of("stress", &keys(&case("worse", 1e-2, "\"relative error 1.0e-2\"")));
    holds(
        &page,
        &["1 promise was broken in 2 cases and 1 function.", "Broken by worse, own: relative error 1.0e-2."],
    );
}

#[test]
fn a_sweep_leads_with_the_powers_and_where_promises_end() {
    let point = |value: f64, p50: f64| {
        format!(
            r#"{{"value":{value},"nodes":{value},"latency_us":{{"p50":{p50},"p99":{}}},"rows_per_event":3,"state_bytes":2048}}"#,
            3.0 * p50
        )
    };
    let curve = |quantity: &str, slope: f64, ends: &str| {
        let points = [point(1e3, 1.5), point(1e5, 15.0)].join(",");
        format!(
            r#"{{"quantity":"{quantity}","points":[{points}],"slopes":{{"p50":{slope},"p99":0.52,"rows":0,"state_bytes":null}},{ends}}}"#
        )
    };
    let curves = [
        curve("window", 0.5, r#""behind_at":100000,"late_at":null"#),
        curve("sensor", 0.02, r#""behind_at":null,"late_at":null"#),
    ];
    let keys = format!(
        r#""events":2000,"window":10000,"rate_events_per_s":66666.7,"seed":0,"curves":[{}]"#,
        curves.join(",")
    );
    let page = of("sweep", &keys);
    holds(
        &page,
        &[
            "The median hardly depends on pixels.",
            "The median grows as the events in the window to the power of 0.50.",
            "The engine falls behind the stream from 100,000 events in the window on.",
            "median: power 0.50",
            "99 %: power 0.52",
            "Rows 0.00, memory ?.",
            "events in the window: 1,000",
            "66,667",
        ],
    );
}

#[test]
fn a_loop_leads_with_how_well_it_follows_and_shows_goal_course_error_and_latency() {
    let row = |name: &str, error: f64, age: f64| {
        format!(
            r#"{{"name":"{name}","error":{error},"rms":0.2,"reading_error":0.1,"run_us":4000,"age_us":{age},"pictures":50,"read":40,"pictures_lost":4,"on_front":true,"trace":[[0,0.4,0],[0.04,0.41,0.3],[0.08,0.42,0.45]]}}"#
        )
    };
    let keys = format!(
        r#""goal":"saw-tooth","seconds":2,"rate_hz":25,"seed":0,"notes":["one note"],"truth":{},"networks":[{{"network":{{"name":"canf-plain"}},"rows":[{},{}]}}]"#,
        row("the truth", 0.03, 0.0),
        row("as it is", 0.05, 30_000.0),
        row("100 ms later", 0.25, 130_000.0)
    );
    let page = of("simulate loop", &keys);
    holds(
        &page,
        &[
            "With canf-plain, the force is off its saw-tooth by 0.05 N in the mean. A controller that knows the truth is off by 0.03 N.",
            "It takes 4 ms for a picture and reads 40 of 50 pictures; the controller moves by readings that are 30 ms old.",
            "It follows worst with 100 ms later: off by 0.25 N.",
            "mean error (N)",
            "canf-plain: distance from the goal",
            "Age of readings",
            "replaced by newer ones",
            "one note",
        ],
    );
    // Goal and course: of the network and of the truth.
    assert_eq!(page.matches(">reached<").count(), 2);
}

#[test]
fn regressions_show_what_was_predicted_over_what_was_true() {
    let pairs = "[[0.1,0.2],[0.4,0.3],[0.9,1.1]]";
    let part = |name: &str| {
        let figure = r#"{"mean":0.25,"std":0.02}"#;
        format!(
            r#"{{"part":"{name}","frames":99,"mse":{figure},"mse_std":{{"mean":0.0625,"std":null}},"mae":{figure},"mae_std":{figure},"time_warping":{{"mean":1.7,"std":null}},"bhattacharyya":{{"mean":0.07,"std":null}}}}"#
        )
    };
    let doubts = r#""doubts":{"predictions":99,"unlike":9,"bad":8,"bad_unlike":7}"#;
    let force = of(
        "eval force",
        &format!(
            r#""data":{{"variance":0.81}},"networks":[{{"network":{{"name":"force-tdnn"}},"pairs":{pairs},"figures":{{"trainings":5,"parts":[{},{}],"contact":[{}],"newest":null,{doubts}}}}}]"#,
            part("all"),
            part("holding"),
            part("touched")
        ),
    );
    holds(
        &force,
        &[
            "Its mean squared error is 0.25 N^2; always to say the mean force has 0.81 N^2.",
            "3 of 99 are drawn, with those farthest off.",
            "predicted (N)",
            "force-tdnn, holding",
            "force-tdnn, touched",
            "0.0625",
            "Bhattacharyya",
            "0.07",
            "bad and unlike",
        ],
    );
    let area = of(
        "eval area",
        &format!(
            r#""data":[{{"file":"a/b.npz","pictures":3,"difference":{{"threshold":12,"iou":{{"mean":0.3,"std":0.1}},"centroid_mm":{{"mean":1.5,"std":null}},"area_mm2":{{"mean":9,"std":null}}}},"stereo":{{"threshold":0.06,"iou":{{"mean":0.4,"std":0.1}},"iou_even":null,"force_n":{{"mean":1.25,"std":null}},"centroid_mm":null,"area_mm2":{{"mean":8,"std":null}}}}}}],"networks":[{{"network":{{"name":"canf"}},"trainings":[{{"seed":1,"sets":[{{"pictures":3,"iou":{{"mean":0.7,"std":0.2}},"iou_even":{{"mean":0.65,"std":0.3}},"force_n":{{"mean":0.8,"std":null}},"centroid_mm":{{"mean":0.4,"std":null}},"area_mm2":{{"mean":2,"std":null}},"kinds":{{"ball":{{"pictures":3,"iou":{{"mean":0.7,"std":0.2}},"force_n":null}}}},"multiply_adds":5000000,"update_us":3500,"pairs":{pairs},{doubts}}}]}}]}}]"#
        ),
    );
    holds(
        &area,
        &[
            "an IoU of 0.7 and a force that is off by 0.8 N",
            "image difference above 12, b.npz",
            "stereo, deeper than 0.06 mm, b.npz",
            "1.25",
            "0.7 \u{b1} 0.2",
            "0.65 \u{b1} 0.3",
            "3.50 ms",
            "predicted (N)",
            "canf, b.npz, ball",
        ],
    );
    let fit = of(
        "fit",
        &format!(
            r#""data":{{"presses":3}},"outputs":[{{"name":"roll","unit":"deg","error":{{"mean":1,"interval":[0.5,1.5]}},"constant":{{"mean":2,"interval":[1,3]}}}}],"pairs":[{pairs}]"#
        ),
    );
    holds(&fit, &["predicted (degrees)", "at the end of presses that were held out"]);
    let angle = of(
        "eval angle",
        &format!(
            r#""times_us":[0,1000],"networks":[{{"network":{{"name":"past"}},"pairs":[{pairs}],"figures":{{"presses":3,"settled_share":0.25,"outputs":[{{"name":"roll","unit":"deg","mean_absolute":{{"mean":0.6,"std":null}},"std":{{"mean":0.5,"std":null}},"newest":null,"mean_absolute_at":[{{"mean":2}},{{"mean":1}}]}}],"angles":null}}}}]"#
        ),
    );
    holds(
        &angle,
        &[
            "past is off by 0.6 degrees in roll",
            "from 25.00 % of the press on",
            "past, roll",
            "predicted (degrees)",
        ],
    );
    // A constant truth tells nothing.
    let constant = of(
        "eval force",
        &format!(
            r#""networks":[{{"network":{{"name":"a"}},"pairs":[[1,2],[1,3]],"figures":{{"parts":[{}]}}}}]"#,
            part("all")
        ),
    );
    assert!(!constant.contains("predicted (N)"));
}

#[test]
fn slip_has_precision_recall_and_f1_beside_accuracy_with_references() {
    let figure = r#"{"mean":0.5744,"std":0.0241}"#;
    let scores = format!(
        r#""windows":70,"trainings":5,"accuracy":{figure},"precision":{{"mean":0.6636,"std":null}},"recall":{{"mean":0.5742,"std":null}},"f1":{{"mean":0.585,"std":null}},"confusion":[[30,5],[5,30]]"#
    );
    let page = of(
        "eval slip",
        &format!(
            r#""classes":["n","s"],"networks":[{{"network":{{"name":"slip-lstm"}},"sets":[{{"set":"Small","trained_on":false,{scores},"doubts":{{"predictions":70,"unlike":1,"bad":30,"bad_unlike":1}}}}],"cross_validation":[{{"scheme":"recordings",{scores}}}]}}],"references":[{{"name":"tuned LSTM","about":"five trainings","accuracy":{{"Small":0.7241}}}}]"#
        ),
    );
    holds(
        &page,
        &[
            "57.44 % (Small)",
            "precision (%)",
            "66.36",
            "58.5",
            "tuned LSTM, Small (reference)",
            "72.41",
            "tuned LSTM: five trainings.",
            "slip-lstm, by recordings",
            "bad and unlike",
        ],
    );
}
