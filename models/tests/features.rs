//! The cargo features that hold the weights of the shipped networks.

use std::collections::{BTreeMap, BTreeSet};

use meissner_models::{AnyDescription, Weights};

fn features() -> BTreeMap<String, Vec<String>> {
    #[derive(serde::Deserialize)]
    struct Manifest {
        features: BTreeMap<String, Vec<String>>,
    }
    let manifest: Manifest = toml::from_str(include_str!("../Cargo.toml")).expect("a manifest");
    manifest.features
}

#[test]
fn every_shipped_network_is_a_feature_of_one_task_and_all_are_on_by_default() {
    let features = features();
    let names: BTreeSet<&str> = AnyDescription::shipped_names().collect();
    for name in &names {
        // Exactly one feature of the crate, which contains its weights.
        let [weights] = &features[*name][..] else { panic!("{name}: {:?}", features[*name]) };
        let of = if *name == "digits-frozen" { "digits-past" } else { name };
        let task =
            features["shipped"].iter().find(|&task| features[task].iter().any(|of_task| of_task == name));
        assert_eq!(weights, &format!("meissner-weights-{}/{of}", task.expect("a network has a task")));
    }
    assert_eq!(features["default"], ["shipped"]);
    let of_tasks: Vec<&str> =
        features["shipped"].iter().flat_map(|task| &features[task]).map(String::as_str).collect();
    assert_eq!(of_tasks.iter().copied().collect::<BTreeSet<_>>(), names);
    assert_eq!(of_tasks.len(), names.len());
}

#[test]
fn weights_are_there_or_left_out_with_the_feature_that_has_them() {
    for name in AnyDescription::shipped_names() {
        match Weights::left_out(name) {
            None => assert!(Weights::shipped(name).is_some()),
            Some(error) => {
                assert!(Weights::shipped(name).is_none());
                assert!(error.to_string().contains(&format!("the feature {name:?} of meissner-models")));
            }
        }
    }
    assert!(Weights::left_out("unknown").is_none() && Weights::shipped("unknown").is_none());
}
