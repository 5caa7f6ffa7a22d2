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
    for command in
        ["bench", "fit", "pareto", "soak", "eval slip", "eval angle", "eval touch letters", "eval other"]
    {
        let of = |rest: &str| format!("{{\"header\":{{\"command\":\"{command}\"}},{rest}}}");
        page(&[("a", of("\"x\":1"))]);
        page(&[(
            "a",
            of(
                r#""networks":[{"figures":3,"sets":[[]],"settings":[{}],"test":{}}],"outputs":[{}],"classes":[1],"checkpoints":[{}],"skips":[],"deadline":{"bins":[{},{}]},"latency_us":7"#,
            ),
        )]);
    }
}
