//! Weights files of either kind, complete and damaged, and the errors if they do not fit.

use super::support;

use std::collections::BTreeMap;

use meissner_models::{
    Agreement, Description, FormatError, Lookalikes, ModelError, Tensor, TensorProblemKind, Weights, draw,
};
use support::torch::{Deviation, Pickle, View, archive, file, state_dict};
use support::{SMALL, bytes_of, changed, shared, to_pth};

fn small() -> Description {
    Description::parse(SMALL).expect("consistent")
}

/// A contiguous vector of `values` floats.
fn vector(values: i64) -> View<'static> {
    let shape: &'static [i64] = match values {
        3 => &[3],
        6 => &[6],
        _ => panic!("a size that the tests use"),
    };
    View { storage: "FloatStorage", key: "0", values, offset: 0, shape, strides: &[1] }
}

/// The values of the only tensor, "a".
#[track_caller]
fn read_a(bytes: &[u8]) -> Vec<f32> {
    let weights = Weights::from_bytes(bytes).expect("a readable file");
    assert_eq!(weights.names().collect::<Vec<_>>(), ["a"]);
    weights.get("a").and_then(Tensor::values).expect("floats").to_vec()
}

#[test]
fn weights_survive_safetensors_bit_for_bit() {
    let weights = draw(&small(), 5);
    let metadata = BTreeMap::from([("a".to_owned(), "b \"c\"".to_owned()), ("d".to_owned(), "e".to_owned())]);
    let bytes = weights.to_safetensors(&metadata);
    let read = Weights::from_bytes(&bytes).expect("readable");
    assert!(read.iter().eq(weights.iter()));
    assert_eq!(read.metadata(), &metadata);
    assert_eq!(read.to_safetensors(&metadata), bytes);
}

#[test]
fn weights_survive_a_state_dict_bit_for_bit() {
    let weights = draw(&small(), 5);
    let read = Weights::from_bytes(&to_pth(&weights)).expect("readable");
    assert_eq!(read, weights);
}

#[test]
fn a_file_is_what_its_content_says_whatever_its_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let weights = draw(&small(), 5);
    for (name, bytes) in
        [("a.pth", weights.to_safetensors(&BTreeMap::new())), ("b.safetensors", to_pth(&weights))]
    {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        assert!(Weights::load(&path).expect("readable").iter().eq(weights.iter()));
    }
    let missing = Weights::load(folder.path().join("none.pt"));
    assert!(matches!(missing, Err(ModelError::Read { .. })));
}

#[test]
fn strided_views_are_read_by_their_strides() {
    let data = bytes_of(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let view =
        View { storage: "FloatStorage", key: "0", values: 7, offset: 1, shape: &[3, 2], strides: &[1, 3] };
    assert_eq!(read_a(&file(&state_dict(&[("a", view)]), &[("0", &data)])), [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
}

#[test]
fn scalars_and_empty_tensors_are_read() {
    let scalar = View { storage: "FloatStorage", key: "0", values: 3, offset: 2, shape: &[], strides: &[] };
    let data = bytes_of(&[0.0, 1.0, 2.0]);
    assert_eq!(read_a(&file(&state_dict(&[("a", scalar)]), &[("0", &data)])), [2.0]);
    let empty = View { shape: &[0, 4], strides: &[4, 1], ..scalar };
    assert!(read_a(&file(&state_dict(&[("a", empty)]), &[("0", &data)])).is_empty());
}

#[test]
fn doubles_and_halves_become_floats() {
    let expected = [1.0, -0.5, 65_504.0];
    let double: Vec<u8> = expected.iter().flat_map(|&v: &f32| f64::from(v).to_le_bytes()).collect();
    let half: Vec<u8> = [0x3c00_u16, 0xb800, 0x7bff].iter().flat_map(|v| v.to_le_bytes()).collect();
    for (storage, data) in [("DoubleStorage", double), ("HalfStorage", half)] {
        let view = View { storage, ..vector(3) };
        assert_eq!(read_a(&file(&state_dict(&[("a", view)]), &[("0", &data)])), expected, "{storage}");
    }
    let brain: Vec<u8> = [0x3f80_u16, 0xbf00, 0x4780].iter().flat_map(|v| v.to_le_bytes()).collect();
    let view = View { storage: "BFloat16Storage", ..vector(3) };
    assert_eq!(read_a(&file(&state_dict(&[("a", view)]), &[("0", &brain)])), [1.0, -0.5, 65_536.0]);
}

#[test]
fn integers_are_named_but_not_read() {
    let view = View { storage: "LongStorage", key: "no such entry", ..vector(3) };
    let weights = Weights::from_bytes(&file(&state_dict(&[("steps", view)]), &[])).expect("readable");
    let steps = weights.get("steps").expect("named");
    assert_eq!((steps.shape(), steps.dtype(), steps.values()), (&[3][..], "int64", None));
}

#[test]
fn a_checkpoint_holds_its_state_dict_under_a_known_key() {
    let data = bytes_of(&[1.0, 2.0, 3.0]);
    for key in ["state_dict", "model_state_dict", "model", "net", "module"] {
        let pickle = Pickle::new()
            .raw(b"}(")
            .text("epoch")
            .int(70_000)
            .text("losses")
            .raw(b"](G\x3f\xf0\0\0\0\0\0\0e")
            .text("best")
            .raw(&[0x8a, 2, 0xff, 0xff])
            .text("done")
            .raw(&[0x88])
            .text(key)
            .ordered_dict()
            .text("a")
            .tensor(&vector(3))
            .raw(b"su.");
        assert_eq!(read_a(&file(&pickle, &[("0", &data)])), [1.0, 2.0, 3.0], "{key}");
    }
    let pickle = Pickle::new().raw(b"}(").text("epoch").int(1).raw(b"u.");
    let error = Weights::from_bytes(&file(&pickle, &[])).expect_err("no tensors");
    assert!(matches!(error, FormatError::NoStateDict { .. }), "{error}");
}

#[test]
fn parameters_are_read_as_their_tensors() {
    let parameter = Pickle::new()
        .raw(b"}")
        .text("a")
        .global("torch._utils", "_rebuild_parameter")
        .raw(b"(")
        .tensor(&vector(3))
        .raw(&[0x88])
        .ordered_dict()
        .raw(b"tRs.");
    let data = bytes_of(&[1.0, 2.0, 3.0]);
    assert_eq!(read_a(&file(&parameter, &[("0", &data)])), [1.0, 2.0, 3.0]);
}

#[test]
fn no_global_that_a_state_dict_does_not_need_is_accepted() {
    for (module, name) in [
        ("os", "system"),
        ("builtins", "eval"),
        ("torch", "load"),
        ("torch._utils", "_rebuild_tensor_v3"),
        ("collections", "defaultdict"),
        ("torch", "ComplexFloatStorage"),
    ] {
        let pickle = Pickle::new().global(module, name).raw(b"(").text("true").raw(b"tR.");
        let error = Weights::from_bytes(&file(&pickle, &[])).expect_err("refused");
        let FormatError::Pickle { at, found, .. } = &error else { panic!("{error}") };
        assert_eq!((*at, found.as_str()), (2, format!("\"{module}.{name}\"").as_str()));
    }
}

#[test]
fn no_instruction_that_a_state_dict_does_not_need_is_accepted() {
    // INST, OBJ, NEWOBJ, STACK_GLOBAL, EXT1, PERSID, REDUCE of text, BUILD of a tuple, protocol 4.
    let bodies: [&[u8]; 9] = [
        b"ios\nsystem\n",
        b"(o",
        b"\x81",
        b"\x93",
        b"\x82\x01",
        b"P0\n",
        b"X\x01\0\0\0a)R",
        b")}b",
        b"\x80\x04",
    ];
    for body in bodies {
        let pickle = Pickle::new().raw(body).raw(b".");
        let error = Weights::from_bytes(&file(&pickle, &[])).expect_err("refused");
        assert!(matches!(error, FormatError::Pickle { .. }), "{body:?}: {error}");
    }
}

#[test]
fn values_below_a_mark_cannot_be_taken() {
    for body in [&b"K\x01(R."[..], b"(.", b"u.", b"K\x01(\x85.", b"q\x00.", b"h\x00.", b""] {
        let error = Weights::from_bytes(&file(&Pickle::new().raw(body), &[])).expect_err("refused");
        assert!(matches!(error, FormatError::Pickle { .. }), "{body:?}: {error}");
    }
}

#[test]
fn deeply_nested_values_do_not_exhaust_the_stack() {
    let pickle = Pickle::new().raw(b"N").raw(&vec![0x85; 1 << 20]).raw(b".");
    let error = Weights::from_bytes(&file(&pickle, &[])).expect_err("no state dict");
    assert!(matches!(error, FormatError::NoStateDict { .. }), "{error}");
}

#[test]
fn a_tensor_stays_within_its_storage() {
    let data = bytes_of(&[1.0, 2.0, 3.0]);
    let good = vector(3);
    for (what, view) in [
        ("view", View { offset: 1, ..good }),
        ("view", View { strides: &[2], ..good }),
        ("view", View { strides: &[i64::from(i32::MAX)], ..good }),
        ("shape", View { shape: &[4], strides: &[0], ..good }),
        ("shape", View { shape: &[1 << 30, 1 << 30, 1 << 30], strides: &[0, 0, 0], ..good }),
        ("storage", View { values: 4, ..good }),
        ("storage", View { key: "1", ..good }),
        ("storage", View { storage: "DoubleStorage", ..good }),
    ] {
        let error =
            Weights::from_bytes(&file(&state_dict(&[("a", view)]), &[("0", &data)])).expect_err("refused");
        let FormatError::Tensor { tensor, what: found, .. } = &error else { panic!("{error}") };
        assert_eq!((tensor.as_str(), *found), ("a", what), "{error}");
    }
    for view in
        [View { offset: -1, ..good }, View { shape: &[-3], ..good }, View { strides: &[1, 1], ..good }]
    {
        let error =
            Weights::from_bytes(&file(&state_dict(&[("a", view)]), &[("0", &data)])).expect_err("refused");
        assert!(matches!(error, FormatError::Pickle { .. }), "{error}");
    }
}

#[test]
fn many_views_of_one_storage_cannot_take_more_than_a_multiple_of_the_file() {
    let data = bytes_of(&vec![0.5; 1 << 16]);
    let view = View {
        storage: "FloatStorage",
        key: "0",
        values: 1 << 16,
        offset: 0,
        shape: &[1 << 16],
        strides: &[1],
    };
    let names: Vec<String> = (0..100).map(|i| format!("t{i}")).collect();
    let tensors: Vec<(&str, View<'_>)> = names.iter().map(|name| (name.as_str(), view)).collect();
    let error = Weights::from_bytes(&file(&state_dict(&tensors), &[("0", &data)])).expect_err("refused");
    assert!(matches!(error, FormatError::Tensor { what: "shape", .. }), "{error}");
    assert!(
        Weights::from_bytes(&file(&state_dict(&tensors[..2]), &[("0", &data)])).is_ok(),
        "tied weights are usual"
    );
}

#[test]
fn entries_that_share_bytes_are_refused() {
    // Checked one by one, entries over the same bytes would take quadratic time.
    let data = vec![0; 600];
    let entries: [(&str, &[u8]); 3] = [("a", &data), ("b", &data), ("c", &data)];
    assert!(archive(&entries, Deviation::default()).len() < 3 * 760);
    let error =
        Weights::from_bytes(&archive(&entries, Deviation { size: Some(760), ..Deviation::default() }));
    let error = error.expect_err("refused").to_string();
    assert!(error.contains("expected entries that share no bytes: at most"), "{error}");
}

#[test]
fn a_pickle_or_a_header_beyond_its_bound_is_refused_before_it_is_read() {
    let pickle = Pickle::new().raw(&vec![b')'; 1 << 22]).raw(b".");
    let error = Weights::from_bytes(&file(&pickle, &[])).expect_err("refused").to_string();
    assert!(error.contains("data.pkl: expected at most 4194304 bytes, found 4194307"), "{error}");
    for length in [(1_u64 << 24) + 1, 1 << 63, u64::MAX] {
        let error = Weights::from_bytes(&length.to_le_bytes()).expect_err("refused").to_string();
        assert!(error.contains(&format!("at most 16777216 bytes expected, {length} found")), "{error}");
    }
}

#[test]
fn archives_with_64_bit_records_are_read() {
    let pickle = state_dict(&[("a", vector(3))]);
    let data = bytes_of(&[1.0, 2.0, 3.0]);
    let entries: [(&str, &[u8]); 2] = [("data.pkl", &pickle.0), ("data/0", &data)];
    assert_eq!(read_a(&archive(&entries, Deviation { wide: true, ..Deviation::default() })), [1.0, 2.0, 3.0]);
}

#[test]
fn archives_that_are_not_plain_are_refused() {
    let pickle = state_dict(&[("a", vector(3))]);
    let data = bytes_of(&[1.0, 2.0, 3.0]);
    let entries: [(&str, &[u8]); 2] = [("data.pkl", &pickle.0), ("data/0", &data)];
    let twice = [entries[0], entries[1], entries[1]];
    let big = [entries[0], entries[1], ("byteorder", b"big")];
    for bytes in [
        archive(&entries, Deviation { method: 8, ..Deviation::default() }),
        archive(&entries, Deviation { size: Some(0xffff_fff0), ..Deviation::default() }),
        archive(&entries, Deviation { method: 8, size: Some(0xffff_fff0), wide: true }),
        archive(&twice, Deviation::default()),
        archive(&big, Deviation::default()),
        archive(&entries[1..], Deviation::default()),
    ] {
        let error = Weights::from_bytes(&bytes).expect_err("refused");
        assert!(matches!(error, FormatError::Zip { .. }), "{error}");
    }
}

#[test]
fn the_format_before_archives_is_named() {
    let magic = [0x80, 2, 0x8a, 10, 0x6c, 0xfc, 0x9c, 0x46, 0xf9, 0x20, 0x6a, 0xa8, 0x50, 0x19, b'.'];
    assert_eq!(Weights::from_bytes(&magic), Err(FormatError::Legacy));
}

#[test]
fn bytes_of_neither_kind_are_refused() {
    for bytes in [&b""[..], b"PK\x03\x04", b"hello, world", &[0xff; 64]] {
        assert!(Weights::from_bytes(bytes).is_err());
    }
}

#[test]
fn tensors_that_no_layer_reads_are_listed() {
    let description = small();
    let extra = ["conv1.norm.num_batches_tracked", "conv1.conv.kernel_size", "conv1.conv.is_open_spline"];
    let spare = || Tensor::new(vec![1], vec![1.0]).expect("one value");
    let weights = draw(&description, 5);
    let with = weights.iter().map(|(name, t)| (name.to_owned(), t.clone()));
    let weights = Weights::new(with.chain(extra.map(|name| (name.to_owned(), spare()))));
    assert!(description.network(&weights).is_ok());
    let mut expected = extra.to_vec();
    expected.sort_unstable();
    assert_eq!(description.unused_tensors(&weights).expect("one prefix"), expected);
}

/// The problems of a network with one tensor replaced.
fn with(name: &str, tensor: Option<Tensor>) -> Vec<(String, TensorProblemKind)> {
    let description = small();
    let weights = draw(&description, 5);
    assert!(weights.get(name).is_some(), "{name} must be a tensor of the network");
    let others = weights.iter().filter(|(n, _)| *n != name).map(|(n, t)| (n.to_owned(), t.clone()));
    let weights = Weights::new(others.chain(tensor.map(|t| (name.to_owned(), t))));
    match description.network(&weights) {
        Err(ModelError::Weights { problems, .. }) => {
            problems.into_iter().map(|p| (p.tensor, p.kind)).collect()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_tensor_that_does_not_fit_is_reported_with_what_was_expected() {
    let tensor = |shape: &[usize], values: &[f32]| Tensor::new(shape.to_vec(), values.to_vec());
    let named = |name: &str, kind| vec![(name.to_owned(), kind)];
    let name = "conv1.norm.running_var";
    let (same, transposed) = (Lookalikes::default(), Lookalikes::default());
    assert_eq!(
        with(name, None),
        named(name, TensorProblemKind::Missing { expected: vec![3], same, transposed })
    );
    assert_eq!(
        with(name, tensor(&[3, 1], &[1.0; 3])),
        named(name, TensorProblemKind::Shape { expected: vec![3], found: vec![3, 1] })
    );
    assert_eq!(
        with(name, tensor(&[3], &[1.0, -1e-7, 1.0])),
        named(name, TensorProblemKind::Variance { index: 1, value: -1e-7 })
    );
    assert_eq!(
        with("fc.bias", tensor(&[1], &[f32::INFINITY])),
        named("fc.bias", TensorProblemKind::NotFinite { index: 0, value: f32::INFINITY })
    );
    let found = with("conv2.conv.lin.weight", tensor(&[3, 3], &[f32::NAN; 9]));
    assert!(matches!(found[..], [(_, TensorProblemKind::NotFinite { index: 0, .. })]), "{found:?}");
    let found = with("conv1.norm.weight", tensor(&[3], &[1.0, f32::MAX, 1.0]));
    assert!(
        matches!(found[..], [(_, TensorProblemKind::Folded { what: "scale", index: 1, .. })]),
        "{found:?}"
    );
}

#[test]
fn every_tensor_that_does_not_fit_is_reported_at_once() {
    let description = small();
    let error = description.network(&Weights::new([])).expect_err("nothing there");
    let ModelError::Weights { problems, .. } = &error else { panic!("{error}") };
    assert_eq!(problems.len(), description.tensors().len());
}

#[test]
fn integers_in_place_of_weights_are_refused_with_their_type() {
    let description = Description::parse(&changed("bias = true\n", "")).expect("consistent");
    let weights = draw(&description, 5);
    let view = View { storage: "LongStorage", key: "0", values: 1, offset: 0, shape: &[1], strides: &[1] };
    let integers = Weights::from_bytes(&file(&state_dict(&[("fc.bias", view)]), &[])).expect("readable");
    let merged = weights.iter().filter(|(n, _)| *n != "fc.bias").chain(integers.iter());
    let error = description
        .network(&Weights::new(merged.map(|(n, t)| (n.to_owned(), t.clone()))))
        .expect_err("integers");
    assert!(
        error.to_string().contains("tensor \"fc.bias\": expected floating-point values, found int64"),
        "{error}"
    );
}

#[test]
fn a_first_dense_layer_that_does_not_fit_leaves_the_others_to_be_checked() {
    let description = Description::shipped("tactigraph-past").expect("shipped");
    let weights = draw(&description, 5);
    let others = weights.iter().filter(|(name, _)| *name != "hidden.weight");
    let weights = Weights::new(others.map(|(name, t)| (name.to_owned(), t.clone())));
    let error = description.network(&weights).expect_err("a tensor is missing");
    assert!(matches!(&error, ModelError::Weights { problems, .. } if problems.len() == 1), "{error}");
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_published_checkpoint_makes_graphres() {
    let path = shared("data/checkpoints/contact_angle_graphres.safetensors");
    let weights = Weights::load(path).expect("readable");
    for name in ["graphres", "graphres-published"] {
        let description = Description::shipped(name).expect("shipped");
        let network = description.network_ignoring_preparation(&weights).expect("the published network");
        assert_eq!(network.outputs(), 2);
        assert!(description.unused_tensors(&weights).expect("no prefix").is_empty());
    }
    // And through a state dict.
    let read = Weights::from_bytes(&to_pth(&weights)).expect("readable");
    assert!(read.iter().eq(weights.iter()));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_published_checkpoint_is_recognised_and_graphres_refuses_it_by_name() {
    let path = shared("data/checkpoints/contact_angle_graphres.safetensors");
    let weights = Weights::load(path).expect("readable");
    let prefixed = weights.iter().map(|(name, tensor)| (format!("module.{name}"), tensor.clone()));
    let state_dict = Weights::from_bytes(&to_pth(&weights)).expect("readable");
    let description = |name| Description::shipped(name).expect("shipped");
    for weights in [Weights::new(prefixed), state_dict, weights] {
        assert!(weights.metadata().is_empty() && weights.card().expect("nothing to refuse").published);
        assert_eq!(description("graphres-published").agreement(&weights), Agreement::Same);
        assert!(description("graphres-published").network(&weights).is_ok());
        assert_eq!(description("graphres").agreement(&weights), Agreement::Other);
        let error = description("graphres").network(&weights).expect_err("it was trained with other scales");
        assert!(matches!(&error, ModelError::Preparation { published: Some("graphres-published"), .. }));
        let error = error.to_string();
        assert!(error.contains("published GraphRes checkpoint") && error.contains("per-graph"), "{error}");
        assert!(description("graphres").network_ignoring_preparation(&weights).is_ok());
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn a_recorded_network_has_its_weights_under_a_prefix() {
    let weights = Weights::load(shared("golden/pointnet.safetensors")).expect("readable");
    let description = Description::parse(include_str!("../../tests/pointnet.toml")).expect("consistent");
    assert!(description.network(&weights).is_ok());
    let unused = description.unused_tensors(&weights).expect("one prefix");
    assert!(unused.iter().all(|name| !name.starts_with("w.")) && unused.contains(&"edge_index".to_owned()));
    assert_eq!(weights.get("edge_index").map(Tensor::dtype), Some("I64"));
}
