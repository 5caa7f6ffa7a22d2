//! Filters that a description states: their order, and the weights that fit.

use meissner_engine::filters::FilterRule;
use meissner_models::{Description, ModelError, Weights, draw};

fn stating(description: &Description, preparation: &str) -> Weights {
    let metadata = [("preparation".to_owned(), preparation.to_owned())].into();
    let bytes = draw(description, 1).to_file(metadata).into_bytes();
    Weights::from_bytes(&bytes).expect("weights")
}

#[test]
fn filters_of_a_description_belong_to_the_preparation_in_their_order() {
    let text = Description::shipped_text("graphres").expect("shipped");
    let (before, after) = text.split_once("[[filter]]").expect("a filter");
    let (_, after) = after.split_once("[[layer]]").expect("layers");
    let with = |filters: &str| {
        Description::parse(&format!("{before}{filters}[[layer]]{after}")).expect("consistent")
    };
    let (none, one) = (with(""), "[[filter]]\nkind = \"refractory\"\ntime_us = 1000\n");
    let other = "[[filter]]\nkind = \"activity_filter\"\ntime_us = 20000\n";
    let both = with(&format!("{one}{other}"));
    let ends = |description: &Description| description.preparation().split_off(none.preparation().len() - 1);
    assert_eq!(ends(&none), "}");
    assert_eq!(
        ends(&both),
        r#","filters":[{"kind":"refractory","time_us":1000},{"kind":"activity_filter","time_us":20000}]}"#
    );
    let rules = [FilterRule::Refractory { us: 1_000 }, FilterRule::BackgroundActivity { us: 20_000 }];
    assert_eq!((both.filters(), none.filters()), (&rules[..], &[][..]));
    let network = |of: &Description, stated: &Description| of.network(&stating(of, &stated.preparation()));
    // Weights from before filters existed fit a description without filters.
    assert!(network(&none, &none).expect("they fit").filters().is_empty());
    assert_eq!(network(&both, &both).expect("they fit").filters(), rules);
    let turned = with(&format!("{other}{one}"));
    for (of, stated) in [(&both, &none), (&none, &both), (&both, &turned)] {
        assert!(matches!(network(of, stated), Err(ModelError::Preparation { .. })));
    }
    assert_ne!(
        network(&both, &both).expect("they fit").fingerprint(),
        network(&turned, &turned).expect("they fit").fingerprint()
    );
}
