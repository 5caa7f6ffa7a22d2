//! Names as saved by other programs: each habit, ambiguous names, and the messages if no habit
//! fits.

use super::support;

use std::collections::BTreeMap;

use meissner_models::{
    AnyDescription, Description, FrameDescription, ModelError, Tensor, TensorProblemKind, Weights, draw,
};
use proptest::prelude::*;
use support::torch::{Pickle, View, file};
use support::{SMALL, SMALL_FRAMES, bytes_of, changed, shared, to_pth};

fn small() -> Description {
    Description::parse(SMALL).expect("consistent")
}

/// `weights` under other names.
pub(crate) fn renamed(weights: &Weights, name: impl Fn(&str) -> String) -> Weights {
    Weights::new(weights.iter().map(|(old, tensor)| (name(old), tensor.clone())))
}

/// `weights` and those of `more` together.
fn with(weights: &Weights, more: &Weights) -> Weights {
    let all = weights.iter().chain(more.iter());
    Weights::new(all.map(|(name, tensor)| (name.to_owned(), tensor.clone())))
}

/// A block's convolution and norm next to each other, as in the examples of `torch_geometric`.
fn beside(name: &str, conv: &str, norm: &str, first: usize) -> String {
    for (block, number) in [("conv1.", first), ("conv2.", first + 1)] {
        let Some(rest) = name.strip_prefix(block) else { continue };
        if let Some(rest) = rest.strip_prefix("conv.") {
            return format!("{conv}{number}.{rest}");
        }
        if let Some(rest) = rest.strip_prefix("norm.") {
            return format!("{norm}{number}.{rest}");
        }
    }
    name.to_owned()
}

/// Converts a name to that of a tensor in a file.
type Habit = fn(&str) -> String;

const HABITS: [(&str, Habit); 17] = [
    ("DataParallel", |name| format!("module.{name}")),
    ("torch.compile", |name| format!("_orig_mod.{name}")),
    ("torch.compile of DistributedDataParallel", |name| format!("_orig_mod.module.{name}")),
    ("Lightning", |name| format!("model.{name}")),
    ("Lightning with torch.compile", |name| format!("model._orig_mod.{name}")),
    ("a network called net", |name| format!("net.{name}")),
    ("blocks that were compiled", |name| name.replacen('.', "._orig_mod.", 1)),
    ("convolutions in DataParallel", |name| name.replace(".conv.", ".conv.module.")),
    ("FSDP", |name| format!("_fsdp_wrapped_module.{name}")),
    ("checkpoints of activations", |name| name.replacen('.', "._checkpoint_wrapped_module.", 1)),
    ("Opacus", |name| format!("_module.{name}")),
    ("blocks with bn", |name| name.replace(".norm.", ".bn.")),
    ("PyTorch Geometric", |name| beside(name, "conv", "norm", 1).replace("norm1.", "norm1.module.")),
    ("PyTorch Geometric, from 0", |name| beside(name, "conv", "norm", 0)),
    ("PyTorch Geometric's models", |name| beside(name, "convs.", "norms.", 0)),
    ("Open Graph Benchmark", |name| beside(name, "convs.", "bns.", 0)),
    ("Lightning with PyTorch Geometric", |name| {
        format!(
            "model.{}",
            beside(name, "conv", "batch_norm", 1).replace("batch_norm2.", "batch_norm2.module.")
        )
    }),
];

#[test]
fn names_that_differ_by_a_habit_give_the_same_network_from_files_of_both_kinds() {
    let description = small();
    let weights = draw(&description, 5);
    let expected = description.network(&weights).expect("its own names").fingerprint();
    let other = description.network(&draw(&description, 6)).expect("its own names").fingerprint();
    assert_ne!(expected, other);
    for (who, habit) in HABITS {
        let named = renamed(&weights, habit);
        assert_ne!(named, weights, "{who}");
        for bytes in [named.to_safetensors(&BTreeMap::new()), to_pth(&named)] {
            let read = Weights::from_bytes(&bytes).expect("readable");
            let network = description.network(&read).unwrap_or_else(|error| panic!("{who}: {error}"));
            assert_eq!(network.fingerprint(), expected, "{who}");
            assert!(description.unused_tensors(&read).expect("they fit").is_empty(), "{who}");
        }
    }
}

#[test]
fn names_of_frame_networks_and_of_pointnet_blocks_differ_by_habits_too() {
    let frames =
        FrameDescription::parse(&SMALL_FRAMES.replacen("kernel = 3", "kernel = 3\nnorm = \"norm1\"", 1));
    let frames = frames.expect("consistent");
    let weights = draw(&frames, 5);
    let expected = frames.network_parts(&weights).expect("its own names");
    let habits: [Habit; 3] = [
        |name| format!("module.{name}"),
        |name| name.replace("norm1.", "bn1."),
        |name| format!("net.{}", name.replace("gates.", "gates._orig_mod.")),
    ];
    for habit in habits {
        let parts = frames.network_parts(&renamed(&weights, habit)).expect("a habit");
        assert_eq!(format!("{parts:?}"), format!("{expected:?}"));
    }

    let spline = "kind = \"spline\"\nchannels = 3\nkernel = 2";
    let text = changed(spline, "kind = \"pointnet\"\nchannels = 3");
    let pointnet = Description::parse(&text).expect("consistent");
    let weights = draw(&pointnet, 5);
    let named = renamed(&weights, |name| {
        let name = beside(name, "conv", "norm", 1);
        name.replace("conv1.", "conv1.local_nn.").replace("norm", "bn")
    });
    let expected = pointnet.network(&weights).expect("its own names").fingerprint();
    assert_eq!(pointnet.network(&named).expect("a habit").fingerprint(), expected);
}

#[test]
fn blocks_of_other_names_are_matched_in_the_order_of_the_description() {
    let text = changed("kernel = 2\n", "kernel = 2\nweights = \"stem\"\n");
    let description = Description::parse(&text).expect("consistent");
    let weights = draw(&description, 5);
    let named = renamed(&weights, |name| beside(&name.replacen("stem.", "conv1.", 1), "conv", "norm", 7));
    let expected = description.network(&weights).expect("its own names").fingerprint();
    assert_eq!(description.network(&named).expect("by their order").fingerprint(), expected);
}

#[test]
fn blocks_whose_numbers_do_not_ascend_are_not_guessed() {
    let text = SMALL.replace("\"conv1\"", "\"b2\"").replace("\"conv2\"", "\"b1\"");
    let description = Description::parse(&text).expect("consistent");
    let named = renamed(&draw(&description, 5), |name| {
        beside(&name.replace("b2.", "conv1.").replace("b1.", "conv2."), "conv", "norm", 1)
    });
    let error = description.network(&named).expect_err("first b2, then b1").to_string();
    assert!(error.contains("tensor \"b2.conv.weight\": expected shape [8, 1, 3], found no such"), "{error}");
    assert!(error.contains("left over of this shape: \"conv1.weight\""), "{error}");
}

#[test]
fn blocks_called_as_the_convolutions_are_matched_by_name_in_any_order_beside_others() {
    let text = SMALL.replace("conv1", "convX").replace("conv2", "conv1").replace("convX", "conv2");
    for text in [SMALL, &text] {
        let description = Description::parse(text).expect("consistent");
        let weights = draw(&description, 5);
        let named = renamed(&weights, |name| beside(name, "conv", "norm", 1));
        let more = Weights::new([("conv3.weight".to_owned(), tensor(&[8, 3, 3]))]);
        let expected = description.network(&weights).expect("its own names").fingerprint();
        let network = description.network(&with(&named, &more)).expect("by name");
        assert_eq!(network.fingerprint(), expected);
    }
}

#[test]
fn another_number_of_convolutions_of_other_names_is_not_guessed() {
    let description = small();
    let named = renamed(&draw(&description, 5), |name| beside(name, "conv", "norm", 0));
    let more = Weights::new([("conv7.weight".to_owned(), tensor(&[8, 3, 3]))]);
    assert!(description.network(&with(&named, &more)).is_err());
}

fn tensor(shape: &[usize]) -> Tensor {
    Tensor::new(shape.to_vec(), vec![0.5; shape.iter().product()]).expect("as many values")
}

#[test]
fn one_further_prefix_is_taken_off() {
    let description = small();
    let weights = draw(&description, 5);
    for prefix in ["w.", "module.", "model.net."] {
        let named = renamed(&weights, |name| format!("{prefix}{name}"));
        assert!(description.network(&named).is_ok(), "{prefix}");
    }
}

#[test]
fn two_prefixes_that_fit_are_refused_by_name_whatever_the_habit() {
    let description = small();
    let weights = draw(&description, 5);
    let layouts: [Habit; 3] =
        [str::to_owned, |name| beside(name, "convs.", "bns.", 0), |name| name.replace(".norm.", ".bn.")];
    for layout in layouts {
        let [student, teacher] = ["student.", "teacher."]
            .map(|prefix| renamed(&weights, |name| format!("{prefix}{}", layout(name))));
        let error = description.network(&with(&student, &teacher)).expect_err("which of both?");
        let ModelError::Ambiguous { prefixes, .. } = &error else { panic!("{error}") };
        assert_eq!(*prefixes, ["student.", "teacher."]);
    }
    // If there are names without a prefix, they are used.
    let ema = renamed(&weights, |name| format!("ema.{name}"));
    assert!(description.network(&with(&weights, &ema)).is_ok());
}

#[test]
fn two_tensors_that_could_be_one_are_refused_by_name() {
    let description = small();
    let inner = renamed(&draw(&description, 5), |name| name.replacen('.', ".module.", 1));
    let compiled = Weights::new([("fc._orig_mod.weight".to_owned(), tensor(&[1, 12]))]);
    let error = description.network(&with(&inner, &compiled)).expect_err("which of both?");
    let ModelError::Doubled { tensor, found, .. } = &error else { panic!("{error}") };
    assert_eq!(
        (tensor.as_str(), &found[..]),
        ("fc.weight", &["fc._orig_mod.weight", "fc.module.weight"].map(str::to_owned)[..])
    );
    let message =
        "tensor \"fc.weight\": expected one in the file, found \"fc._orig_mod.weight\", \"fc.module.weight\"";
    assert!(error.to_string().contains(message), "{error}");

    let named = |conv: &str, norm: &str, first| {
        renamed(&draw(&description, 5), |name| beside(name, conv, norm, first))
    };
    let both = with(&named("conv", "norm", 1), &named("convs.", "norms.", 0));
    assert!(matches!(description.network(&both), Err(ModelError::Doubled { .. })));
}

#[test]
fn a_missing_tensor_is_said_with_those_of_its_shape_that_are_left_over() {
    let description = small();
    let weights = draw(&description, 5);
    let foreign = renamed(&weights, |name| match name {
        "conv1.conv.weight" => "embedding.kernel".to_owned(),
        "fc.weight" => "head.weight".to_owned(),
        _ => name.to_owned(),
    });
    let ints =
        Weights::new([("steps".to_owned(), tensor(&[8, 3, 1])), ("fc.scale".to_owned(), tensor(&[12, 1]))]);
    let error = description.network(&with(&foreign, &ints)).expect_err("two are missing");
    let text = error.to_string();
    for line in [
        "tensor \"conv1.conv.weight\": expected shape [8, 1, 3], found no such tensor; left over of this shape: \
         \"embedding.kernel\"; left over of this shape transposed: \"steps\"",
        "tensor \"fc.weight\": expected shape [1, 12], found no such tensor; left over of this shape: \"head.weight\"; \
         left over of this shape transposed: \"fc.scale\"",
    ] {
        assert!(text.contains(line), "{text}");
    }
    assert!(!text.contains("conv2.conv.weight"), "read tensors are no candidates: {text}");
}

#[test]
fn of_many_missing_tensors_the_first_are_named_and_the_others_counted() {
    let description = small();
    let weights = draw(&description, 5);
    let foreign = renamed(&weights, |name| format!("{name}_"));
    let error = description.network(&foreign).expect_err("all are missing");
    let ModelError::Weights { problems, .. } = &error else { panic!("{error}") };
    assert_eq!(problems.len(), description.tensors().len());
    let of_three = weights.iter().filter(|(_, tensor)| tensor.shape() == [3]).count();
    let norm = problems.iter().find(|problem| problem.tensor == "conv2.norm.weight").expect("missing too");
    let TensorProblemKind::Missing { same, transposed, .. } = &norm.kind else { panic!("{norm}") };
    assert_eq!((same.names.len(), same.count, transposed.count), (4, of_three, 0));
    let text = error.to_string();
    assert!(text.ends_with(&format!("and {} tensors more that are missing", problems.len() - 8)), "{text}");
    assert_eq!(text.lines().count(), 9, "{text}");
    assert!(text.contains(&format!("\"conv1.norm.weight_\" and {} more", of_three - 4)), "{text}");
}

#[test]
fn a_tensor_that_does_not_fit_is_said_by_its_name_in_the_file_too() {
    let description = small();
    let named = renamed(&draw(&description, 5), |name| beside(name, "conv", "norm", 1));
    let tensors = named.iter().map(|(name, old)| match name {
        "conv2.weight" => (name.to_owned(), tensor(&[2, 3, 3])),
        _ => (name.to_owned(), old.clone()),
    });
    let error = description.network(&Weights::new(tensors)).expect_err("another kernel").to_string();
    let expected = "tensor \"conv2.conv.weight\" (in the file \"conv2.weight\"): expected shape";
    assert!(error.contains(expected) && error.contains("found [2, 3, 3]"), "{error}");
}

#[test]
fn names_of_very_many_elements_take_no_long_time() {
    let description = small();
    let weights = draw(&description, 5);
    let long = |element: &str| element.repeat(1 << 20) + "fc.weight";
    let more =
        |elements: &[&str]| Weights::new(elements.iter().map(|element| (long(element), tensor(&[1, 12]))));
    assert!(description.network(&with(&weights, &more(&["a.", "module.", "conv1.", "."]))).is_ok());
    let named = renamed(&weights, |name| beside(name, "conv", "norm", 1));
    assert!(description.network(&with(&named, &more(&["a.", "conv1.", "."]))).is_ok());
    // Without wrappers it is a second "fc.weight".
    assert!(description.network(&with(&named, &more(&["module."]))).is_err());
}

/// A Lightning checkpoint: names with the module's attribute, and many other entries.
fn lightning(weights: &Weights) -> Vec<u8> {
    let all: Vec<(String, Vec<i64>, Vec<u8>)> = weights
        .iter()
        .map(|(name, tensor)| {
            let shape = tensor.shape().iter().map(|&size| size as i64).collect();
            (format!("model.{name}"), shape, bytes_of(tensor.values().expect("floats")))
        })
        .collect();
    let score = View { storage: "FloatStorage", key: "best", values: 1, offset: 0, shape: &[], strides: &[] };
    let mut pickle = Pickle::new().raw(b"}(").text("epoch").int(9).text("best_score").tensor(&score);
    pickle =
        pickle.text("pytorch-lightning_version").text("2.4.0").text("state_dict").ordered_dict().raw(b"(");
    let strides = |shape: &[i64]| -> Vec<i64> {
        (0..shape.len()).map(|axis| shape[axis + 1..].iter().product()).collect()
    };
    for (key, (name, shape, data)) in all.iter().enumerate() {
        let (key, strides) = (key.to_string(), strides(shape));
        let values = data.len() as i64 / 4;
        let view = View { storage: "FloatStorage", key: &key, values, offset: 0, shape, strides: &strides };
        pickle = pickle.text(name).tensor(&view);
    }
    pickle = pickle.raw(b"u").text("callbacks").raw(b"}").text("ModelCheckpoint").raw(b"}(");
    pickle = pickle.text("best_model_score").tensor(&score).text("best_k_models").raw(b"}").text("a.ckpt");
    pickle = pickle.tensor(&score).raw(b"su").raw(b"s").text("optimizer_states").raw(b"](}").text("state");
    pickle = pickle.raw(b"}").int(0).raw(b"}").text("exp_avg").tensor(&score).raw(b"sss").raw(b"e");
    pickle = pickle
        .text("hyper_parameters")
        .raw(b"}")
        .text("lr")
        .raw(b"G\x3f\x50\x62\x4d\xd2\xf1\xa9\xfcs")
        .raw(b"u.");
    let keys: Vec<String> = (0..all.len()).map(|key| key.to_string()).collect();
    let mut storages: Vec<(&str, &[u8])> =
        keys.iter().zip(&all).map(|(key, (.., data))| (key.as_str(), &data[..])).collect();
    storages.push(("best", &[0; 4]));
    file(&pickle, &storages)
}

#[test]
fn a_lightning_checkpoint_is_read_as_it_is() {
    let description = small();
    let weights = draw(&description, 5);
    let read = Weights::from_bytes(&lightning(&weights)).expect("readable");
    let expected = description.network(&weights).expect("its own names").fingerprint();
    assert_eq!(description.network(&read).expect("a prefix").fingerprint(), expected);
    let beside = renamed(&weights, |name| beside(name, "conv", "norm", 1));
    let read = Weights::from_bytes(&lightning(&beside)).expect("readable");
    assert_eq!(description.network(&read).expect("a habit").fingerprint(), expected);
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_checkpoint_of_the_contact_angle_authors_is_read_as_they_publish_it() {
    let read = |name: &str| Weights::load(shared(&format!("data/checkpoints/{name}"))).expect("readable");
    let published = read("contact_angle_graphres_as_published.pth");
    let renamed = read("contact_angle_graphres.safetensors");
    assert!(
        published.get("norm7.module.running_var").is_some() && published.card().expect("known").published
    );
    let description = Description::shipped("graphres-published").expect("shipped");
    let expected = description.network(&renamed).expect("its own names").fingerprint();
    assert_eq!(description.network(&published).expect("a habit").fingerprint(), expected);
    let unused = description.unused_tensors(&published).expect("a habit");
    let kept = ["num_batches_tracked", "kernel_size", "is_open_spline"];
    assert_eq!(unused.len(), 21);
    assert!(unused.iter().all(|name| kept.iter().any(|end| name.ends_with(end))), "{unused:?}");
    // Another network reports the tensors that do not fit.
    let other =
        Description::parse(&changed("channels = 3", "channels = 4").replace("skip = \"pool1\"\n", ""));
    let error = other
        .expect("consistent")
        .network_ignoring_preparation(&published)
        .expect_err("two blocks")
        .to_string();
    assert!(error.contains("found no such tensor"), "{error}");
}

#[test]
fn every_shipped_network_is_read_with_wrappers_and_a_prefix() {
    for name in AnyDescription::shipped_names() {
        let weights = Weights::shipped(name).expect("shipped");
        let wrapped =
            renamed(&weights, |name| format!("model._orig_mod.{}", name.replacen('.', ".module.", 1)));
        let fits = match AnyDescription::shipped(name).expect("shipped") {
            AnyDescription::Events(description) => description.network(&wrapped).map(drop),
            AnyDescription::Frames(description) => description.network_parts(&wrapped).map(drop),
        };
        assert!(fits.is_ok(), "{name}: {fits:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn renaming_all_tensors_by_a_random_habit_loads_the_same_bits(
        layout in 0..HABITS.len(),
        prefix in prop::sample::select(vec!["", "model.", "net.", "encoder.graph."]),
        wrappers in prop::collection::vec(
            (0..9_usize, prop::sample::select(vec!["module", "_orig_mod", "_module"])), 0..40),
        seed in any::<u64>(),
        zipped in any::<bool>(),
    ) {
        let description = small();
        let weights = draw(&description, seed);
        let mut wrappers = wrappers.into_iter().cycle();
        let mut named = BTreeMap::new();
        for (name, tensor) in weights.iter() {
            let name = format!("{prefix}{}", HABITS[layout].1(name));
            let mut elements: Vec<&str> = name.split('.').collect();
            if let Some((place, wrapper)) = wrappers.next() && place < elements.len() {
                elements.insert(place, wrapper);
            }
            named.insert(elements.join("."), tensor.clone());
        }
        prop_assert_eq!(named.len(), weights.names().count());
        let named = Weights::new(named);
        let bytes = if zipped { to_pth(&named) } else { named.to_safetensors(&BTreeMap::new()) };
        let read = Weights::from_bytes(&bytes).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let network = description.network(&read).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let expected = description.network(&weights).expect("its own names");
        prop_assert_eq!(network.fingerprint(), expected.fingerprint());
    }

    #[test]
    fn any_names_are_read_or_refused(
        names in prop::collection::vec("(module\\.|conv1\\.|conv2\\.|norm1\\.|conv\\.|norm\\.|a\\.){0,4}(weight|bias|lin\\.weight)", 14),
    ) {
        let description = small();
        let weights = draw(&description, 1);
        let named = Weights::new(names.into_iter().zip(weights.iter().map(|(_, tensor)| tensor.clone())));
        if let Err(error) = description.network(&named) {
            prop_assert!(error.to_string().contains("expected"), "{error}");
        }
    }
}
