//! Files of `torch.save` that are not a state dict, or contain several.

use super::support;

use meissner_models::{FormatError, Weights};
use support::torch::{Pickle, View, file};

/// An instance of a class in protocol 2, with the memos of Python's pickler.
fn instance(pickle: Pickle, module: &str, name: &str) -> Pickle {
    pickle.global(module, name).raw(b"q\x00)\x81q\x01}q\x02").text("training").raw(b"\x88sb")
}

fn refusal(pickle: &Pickle) -> FormatError {
    Weights::from_bytes(&file(pickle, &[("0", &[0; 8])])).expect_err("refused")
}

#[test]
fn a_whole_module_is_refused_by_saying_so_and_what_to_save_instead() {
    let error = refusal(&instance(Pickle::new(), "__main__", "Net").raw(b"."));
    assert_eq!(error, FormatError::Object { at: 2, class: "__main__.Net".to_owned() });
    let text = error.to_string();
    for part in [
        "expected a state dict, found an object of class \"__main__.Net\", as torch.save(model) writes it",
        "torch.save(model.state_dict(), \"weights.pth\")",
        "nothing was executed",
    ] {
        assert!(text.contains(part), "{text}");
    }
    for (module, name) in [("torch.nn.modules.container", "Sequential"), ("models.graphres", "GraphRes")] {
        let class = format!("{module}.{name}");
        let inner = instance(Pickle::new().raw(b"}(").text("model"), module, name).raw(b"u.");
        assert!(matches!(refusal(&inner), FormatError::Object { class: found, .. } if found == class));
        let without_memo = Pickle::new().global(module, name).raw(b")\x81.");
        assert!(matches!(refusal(&without_memo), FormatError::Object { at: 2, .. }));
        let long_memo = Pickle::new().global(module, name).raw(b"r\x00\x01\x00\x00)\x81.");
        assert!(matches!(refusal(&long_memo), FormatError::Object { at: 2, .. }));
    }
}

#[test]
fn a_script_of_torch_jit_is_refused_with_its_own_advice() {
    let text = refusal(&instance(Pickle::new(), "__torch__.models", "Net").raw(b".")).to_string();
    assert!(text.contains("as torch.jit.save(model) writes it"), "{text}");
    assert!(text.contains("torch.save(torch.jit.load(FILE).state_dict(), \"weights.pth\")"), "{text}");
}

#[test]
fn an_object_whose_making_would_execute_something_is_refused_before_it() {
    // REDUCE of another callable, and a class whose arguments are not empty.
    for body in [
        &b"cos\nsystem\nq\x00X\x04\0\0\0trueq\x01\x85q\x02Rq\x03."[..],
        b"c__main__\nNet\nq\x00K\x01\x85\x81.",
    ] {
        let error = refusal(&Pickle::new().raw(body));
        assert!(matches!(error, FormatError::Pickle { at: 2, .. }), "{error}");
        assert!(error.to_string().contains("torch.save(model.state_dict(), FILE)"), "{error}");
    }
    // An instance of a class that the reader knows does not give this error.
    let error = refusal(&Pickle::new().raw(b"ccollections\nOrderedDict\n)\x81."));
    assert!(matches!(error, FormatError::Pickle { .. }), "{error}");
}

/// Dicts with one tensor under these keys, and tensors of the root.
fn checkpoint(keys: &[&str], of_root: &[&str]) -> Result<Weights, FormatError> {
    let view = View { storage: "FloatStorage", key: "0", values: 2, offset: 0, shape: &[2], strides: &[1] };
    let mut pickle = Pickle::new().raw(b"}(");
    for name in of_root {
        pickle = pickle.text(name).tensor(&view);
    }
    for (number, key) in keys.iter().enumerate() {
        pickle = pickle.text(key).ordered_dict().text(&format!("t{number}")).tensor(&view).raw(b"s");
    }
    Weights::from_bytes(&file(&pickle.raw(b"u."), &[("0", &[0; 8])]))
}

#[test]
fn a_state_dict_under_a_known_key_goes_before_tensors_beside_it() {
    let names = |weights: Weights| weights.names().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(names(checkpoint(&["state_dict"], &["loss"]).expect("one")), ["t0"]);
    assert_eq!(names(checkpoint(&["ema", "net"], &["loss"]).expect("one")), ["t1"]);
    assert_eq!(names(checkpoint(&["ema"], &["fc.weight"]).expect("of the root")), ["fc.weight"]);
}

#[test]
fn several_state_dicts_are_refused_by_their_keys() {
    for (keys, found) in [
        (&["model", "net"][..], "found several, as \"model\", \"net\""),
        (&["generator", "critic"], "found others, as \"generator\", \"critic\""),
    ] {
        let error = checkpoint(keys, &[]).expect_err("which?");
        assert!(matches!(error, FormatError::NoStateDict { .. }), "{error}");
        assert!(error.to_string().contains(found), "{error}");
    }
}

#[test]
fn a_dict_that_a_pickle_names_very_often_is_read_once() {
    let view = View { storage: "FloatStorage", key: "0", values: 2, offset: 0, shape: &[2], strides: &[1] };
    let mut pickle = Pickle::new().raw(b"}(").text("x").raw(b"q\x00").tensor(&view).raw(b"q\x01");
    pickle = pickle.text("y").ordered_dict().raw(b"q\x02(").raw(&b"h\0h\x01".repeat(400_000)).raw(b"u");
    pickle = pickle.text("model").raw(b"q\x03h\x02").raw(&b"h\x03h\x02".repeat(400_000)).raw(b"u.");
    let read = Weights::from_bytes(&file(&pickle, &[("0", &[0; 8])]));
    assert!(matches!(read, Err(FormatError::Tensor { what: "name", .. })), "{read:?}");
}
