use std::collections::BTreeMap;

use super::{Agreement, KEY};
use crate::{Description, FrameDescription, ModelError, Weights, draw, drawn_file};

fn shipped(name: &str) -> Description {
    Description::shipped(name).expect("shipped")
}

fn prepared(description: &Description, preparation: &str) -> Weights {
    draw(description, 1).with_metadata([(KEY.to_owned(), preparation.to_owned())].into())
}

#[test]
fn the_preparation_of_an_event_network_has_the_words_of_its_file() {
    assert_eq!(
        shipped("digits-past").preparation(),
        r#"{"kind":"knn","k":8,"candidates":"past","lifetime":"window","normalisation":"fixed","scales":[0.1,0.1176],"span_us":300000,"cells":[["1/8","1/8","1/3"]]}"#
    );
    assert_eq!(
        shipped("graphres-published").preparation(),
        r#"{"kind":"knn","k":16,"candidates":"all","normalisation":"per-graph","span_us":150000,"cells":[["16/346","12/260"]]}"#
    );
}

#[test]
fn weights_of_other_graphs_are_refused_and_taken_only_where_that_is_asked_for() {
    let graphres = shipped("graphres");
    let own = graphres.preparation();
    assert!(graphres.network(&prepared(&graphres, &own)).is_ok());
    for (from, to) in [
        ("\"k\":16", "\"k\":8"),
        ("\"all\"", "\"past\""),
        ("\"fixed\"", "\"per-graph\""),
        ("[0.5,0.4]", "[0.5,0.5]"),
        ("150000", "100000"),
        ("16/346", "1/8"),
        ("\"k\":16,", ""),
    ] {
        let found = own.replace(from, to);
        assert_ne!(found, own, "{from}");
        let weights = prepared(&graphres, &found);
        assert_eq!(graphres.agreement(&weights), Agreement::Other, "{found}");
        let error = graphres.network(&weights).expect_err(&found);
        assert!(matches!(&error, ModelError::Preparation { .. }), "{error}");
        assert!(error.to_string().contains(&found) && error.to_string().contains(&own), "{error}");
        assert!(graphres.network_ignoring_preparation(&weights).is_ok());
    }
}

#[test]
fn weights_that_say_nothing_are_taken_and_the_agreement_tells() {
    let graphres = shipped("graphres");
    let silent = Weights::new(draw(&graphres, 1).iter().map(|(name, t)| (name.to_owned(), t.clone())));
    assert_eq!(graphres.agreement(&silent), Agreement::Unstated);
    assert!(graphres.network(&silent).is_ok());
    let drawn = Weights::from_bytes(&drawn_file(&graphres, 1)).expect("readable");
    assert_eq!(graphres.agreement(&drawn), Agreement::Drawn);
}

#[test]
fn weights_without_a_lifetime_fit_both() {
    let (past, frozen) = (shipped("digits-past"), shipped("digits-frozen"));
    let without = past.preparation().replace("\"lifetime\":\"window\",", "");
    assert_eq!(past.agreement(&prepared(&past, &without)), Agreement::Same);
    assert_eq!(frozen.agreement(&prepared(&past, &without)), Agreement::Same);
    assert_eq!(frozen.agreement(&prepared(&past, &past.preparation())), Agreement::Other);
}

#[test]
fn every_shipped_network_over_events_is_trained_on_its_own_graphs() {
    for name in Description::shipped_names() {
        let weights = Weights::shipped(name).expect("shipped");
        assert_eq!(shipped(name).agreement(&weights), Agreement::Same, "{name}");
        let card = weights.card().expect("a card");
        assert_eq!((card.trained, card.sensor.is_some()), (Some(true), true), "{name}");
    }
}

fn description(network: &str, scaling: &str) -> FrameDescription {
    let text = match network {
        "slip-lstm" => include_str!("../../../networks/slip-lstm.toml"),
        _ => include_str!("../../../networks/slip-tuned.toml"),
    };
    let from = if network == "slip-lstm" { "scaling = \"reading\"" } else { "scaling = \"image\"" };
    FrameDescription::parse(&text.replace(from, &format!("scaling = {scaling}"))).expect("consistent")
}

fn built(description: &FrameDescription, preparation: Option<&str>) -> Result<(), ModelError> {
    let metadata: BTreeMap<_, _> =
        preparation.iter().map(|text| (KEY.to_owned(), (*text).to_owned())).collect();
    description.network_parts(&draw(description, 1).with_metadata(metadata)).map(drop)
}

#[test]
fn the_preparation_has_the_words_of_the_file() {
    let of = |network, scaling| description(network, scaling).preparation().expect("over readings");
    assert_eq!(of("slip-lstm", "\"reading\""), r#"{"frames":"electrodes","steps":5,"scaling":"reading"}"#);
    assert_eq!(
        of("slip-tuned", "[0, 3488.1]"),
        r#"{"frames":"tactile-image","steps":5,"scaling":[0.0,3488.1]}"#
    );
    assert_eq!(FrameDescription::shipped("force-lstm").expect("shipped").preparation(), None);
}

#[test]
fn weights_that_say_the_same_or_nothing_fit() {
    let range = description("slip-tuned", "[0, 3488.1]");
    built(&range, None).unwrap();
    built(&range, range.preparation().as_deref()).unwrap();
    let other_words =
        r#"{ "sampling": 3, "scaling": [0, 3488.10], "steps": 5.0, "frames": "tactile-image" }"#;
    built(&range, Some(other_words)).unwrap();
}

#[test]
fn a_preparation_of_two_scalings_is_read_back() {
    let text = include_str!("../../../networks/slip-lstm.toml")
        .replace("values = 24", "values = 48")
        .replace("scaling = \"reading\"", "scaling = [\"reading\", [1911, 3743.1]]");
    let both = FrameDescription::parse(&text).expect("consistent");
    let preparation = both.preparation().expect("over readings");
    let expected = r#"{"frames":"electrodes","steps":5,"scaling":["reading",[1911.0,3743.1]]}"#;
    assert_eq!(preparation, expected);
    built(&both, Some(&preparation)).unwrap();
    let other_words = preparation.replace("1911.0", "1911").replace("3743.1", "3743.10");
    built(&both, Some(&other_words)).unwrap();
    for scaling in [r#"["reading",[1911,3743]]"#, r#""reading""#, "[1911,3743.1]", r#"["reading"]"#] {
        let found = format!(r#"{{"frames":"electrodes","steps":5,"scaling":{scaling}}}"#);
        let error = built(&both, Some(&found)).expect_err(&found);
        assert!(matches!(error, ModelError::Preparation { .. }), "{error}");
    }
}

#[test]
fn weights_that_were_trained_on_other_frames_are_refused_with_both() {
    let image = description("slip-tuned", "\"image\"");
    for found in [
        r#"{"frames":"electrodes","steps":5,"scaling":"image"}"#,
        r#"{"frames":"tactile-image","steps":4,"scaling":"image"}"#,
        r#"{"frames":"tactile-image","steps":5,"scaling":[0,3488]}"#,
        r#"{"frames":"tactile-image","steps":5}"#,
        r#"{"frames":"tactile-image","steps":5,"scaling":"image","order":"reversed"}"#,
        "image",
    ] {
        let error = built(&image, Some(found)).expect_err(found);
        assert!(matches!(error, ModelError::Preparation { .. }), "{error}");
        let message = error.to_string();
        let expected = image.preparation().expect("over readings");
        assert!(message.contains(&expected) && message.contains(found), "{message}");
    }
}

#[test]
fn a_network_over_events_refuses_weights_for_readings() {
    let force = FrameDescription::shipped("force-tdnn").expect("shipped");
    let error = built(&force, Some("{}")).unwrap_err().to_string();
    assert!(error.contains("event-counts"), "{error}");
}
