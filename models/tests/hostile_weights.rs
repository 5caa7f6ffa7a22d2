//! Weights that are damaged or request much: an error with its place or complete tensors, with a
//! few times the file's memory, and nothing executed.

use super::support;

use std::fmt::Debug;
use std::time::{Duration, Instant};

use meissner_models::{
    Description, FormatError, FrameDescription, ModelError, Tensor, TensorFile, TensorProblemKind, Weights,
    draw,
};
use support::torch::{Deviation, Pickle, View, archive, file, state_dict};
use support::{SMALL, SMALL_FRAMES};

/// Longest time for an input, whatever it requests; far more than any input here needs.
const CEILING: Duration = Duration::from_secs(10);

const VIEW: View<'static> =
    View { storage: "FloatStorage", key: "0", values: 4, offset: 0, shape: &[2, 2], strides: &[2, 1] };

/// The pickle of two tensors of one storage.
fn pickle() -> Pickle {
    state_dict(&[("a", VIEW), ("b", View { shape: &[4], strides: &[1], ..VIEW })])
}

fn values() -> Vec<u8> {
    [1.0_f32, -2.5, 0.0, 4.0].iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// The same tensors as a state dict, with records of 32 and of 64 bits, and as safetensors.
fn samples() -> [(&'static str, Vec<u8>); 3] {
    let (pickle, values) = (pickle(), values());
    let entries: [(&str, &[u8]); 2] = [("data.pkl", &pickle.0), ("data/0", &values)];
    let mut tensors = TensorFile::default();
    tensors.f32("a", &[2, 2], &[1.0, -2.5, 0.0, 4.0]);
    tensors.f32("b", &[4], &[1.0, -2.5, 0.0, 4.0]);
    [
        ("state dict", archive(&entries, Deviation::default())),
        ("state dict of 64 bits", archive(&entries, Deviation { wide: true, ..Deviation::default() })),
        ("safetensors", tensors.into_bytes()),
    ]
}

/// Reads `bytes`: if accepted, there are few more values than bytes; if refused, the reason is
/// brief.
fn read(bytes: &[u8], about: &dyn Debug) -> Result<Weights, FormatError> {
    let read = Weights::from_bytes(bytes);
    match &read {
        Ok(weights) => {
            let values = weights.iter().map(|(_, tensor)| tensor.values().map_or(0, <[f32]>::len));
            assert!(values.sum::<usize>() <= 2 * bytes.len(), "{about:?}");
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains("expected") && text.contains("found"), "{about:?}: {text}");
            assert!(text.len() < 1000, "{about:?}: {} bytes: {text:.600}", text.len());
        }
    }
    read
}

#[test]
fn a_file_cut_at_any_length_is_refused() {
    for (name, bytes) in samples() {
        assert_eq!(read(&bytes, &name).expect("whole").names().count(), 2, "{name}");
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length], &(name, length)).is_err(), "{name} cut at {length}");
        }
    }
}

#[test]
fn any_flipped_bit_gives_an_error_or_tensors() {
    for (name, bytes) in samples() {
        for bit in 0..8 * bytes.len() {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let _ = read(&flipped, &(name, bit));
        }
    }
}

#[test]
fn any_flipped_bit_of_a_pickle_with_a_right_checksum_gives_an_error_or_tensors() {
    for bit in 0..8 * pickle().0.len() {
        let mut flipped = pickle();
        flipped.0[bit / 8] ^= 1 << (bit % 8);
        let _ = read(&file(&flipped, &[("0", &values())]), &bit);
    }
}

const LENGTHS: [u64; 6] =
    [1 << 63, u64::MAX, u32::MAX as u64, 0x7fff_ffff_7fff_ffff, 0x8000_0000_8000_0000, 0];

#[test]
fn an_absurd_length_anywhere_gives_an_error_or_tensors() {
    let changed = |bytes: &[u8], at: usize, width: usize, length: u64| {
        let mut changed = bytes.to_vec();
        changed[at..at + width].copy_from_slice(&length.to_le_bytes()[..width]);
        changed
    };
    for width in [2, 4, 8] {
        for length in LENGTHS {
            for (name, bytes) in samples() {
                for at in 0..=bytes.len() - width {
                    let _ = read(&changed(&bytes, at, width, length), &(name, at, width, length));
                }
            }
            let pickle = pickle().0;
            for at in 0..=pickle.len() - width {
                let pickle = Pickle(changed(&pickle, at, width, length));
                let _ = read(&file(&pickle, &[("0", &values())]), &("pickle", at, width, length));
            }
        }
    }
}

/// The bytes of a safetensors file with this header and 16 bytes of values.
fn with_header(header: &str) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &values()].concat()
}

#[test]
fn sizes_in_a_header_that_do_not_fit_its_bytes_are_refused() {
    let header = |shape: &str, offsets: &str| {
        with_header(&format!(r#"{{"a":{{"dtype":"F32","shape":{shape},"data_offsets":{offsets}}}}}"#))
    };
    read(&header("[4]", "[0,16]"), &"as it should be").expect("four values");
    for (shape, offsets) in [
        ("[9223372036854775808]", "[0,16]"),
        ("[18446744073709551615]", "[0,16]"),
        ("[4294967296,4294967296]", "[0,16]"),
        ("[4611686018427387904,4]", "[0,16]"),
        ("[18446744073709551616]", "[0,16]"),
        ("[-4]", "[0,16]"),
        ("[1e400]", "[0,16]"),
        ("[4.0]", "[0,16]"),
        ("[5]", "[0,16]"),
        ("[4]", "[0,9223372036854775808]"),
        ("[4]", "[0,18446744073709551615]"),
        ("[4]", "[16,0]"),
        ("[4]", "[4,20]"),
        ("[4]", "[0,16,16]"),
        ("4", "[0,16]"),
    ] {
        let error = read(&header(shape, offsets), &(shape, offsets)).expect_err(shape);
        assert!(matches!(error, FormatError::Safetensors(_)), "{shape} {offsets}: {error}");
    }
}

#[test]
fn a_tensor_that_is_there_twice_is_refused_by_name() {
    let tensor = |kind: &str, shape: &str| {
        format!(r#""a":{{"dtype":"{kind}","shape":{shape},"data_offsets":[0,16]}}"#)
    };
    for (first, second) in [
        (tensor("F32", "[4]"), tensor("F32", "[4]")),
        (tensor("F32", "[4]"), tensor("I32", "[4]")),
        (tensor("F32", "[4]"), tensor("F64", "[2]")),
        (tensor("F32", "[4]"), tensor("F32", "[4]").replace("\"a\"", "\"\\u0061\"")),
    ] {
        let error =
            read(&with_header(&format!("{{{first},{second}}}")), &(first, second)).expect_err("twice");
        let expected = "tensor \"a\": expected one of this name, found two";
        assert!(error.to_string().contains(expected), "{error}");
    }
    let twice = state_dict(&[("a", VIEW), ("a", VIEW)]);
    let error = read(&file(&twice, &[("0", &values())]), &"twice").expect_err("twice");
    assert_eq!(error.to_string(), "tensor \"a\": name: expected one tensor, found two");
}

#[test]
fn a_header_that_nests_without_end_is_refused() {
    for (open, close) in [("[", "]"), ("{\"a\":", "}")] {
        for count in [200, 1_000_000] {
            let nested = open.repeat(count);
            let closed = format!("{nested}0{}", close.repeat(count));
            for text in [&nested, &closed] {
                let metadata = format!(r#"{{"__metadata__":{text}}}"#);
                let tensor = format!(r#"{{"a":{text}}}"#);
                for header in [text, &metadata, &tensor] {
                    assert!(read(&with_header(header), &(open, count)).is_err());
                }
            }
        }
    }
}

/// An archive whose entries claim to unpack to `size` bytes: zip bombs, if unpacked.
fn deflated(size: u32) -> Vec<u8> {
    // Zeros deflated by zlib: each middle byte represents 1032 bytes, 206,400,128 in total.
    let start = [0xed, 0xc1, 0x31, 0x01, 0, 0, 0, 0xc2, 0xa0, 0xf5, 0x4f, 0x6d, 0x0c, 0x1f, 0xa0];
    let copies = [&start[..], &vec![0; 200_000], &[0xbe, 0x06]].concat();
    let entries: [(&str, &[u8]); 2] = [("data.pkl", &copies), ("data/0", &copies)];
    let mut bytes = archive(&entries, Deviation { method: 8, ..Deviation::default() });
    let starts: Vec<usize> =
        (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02")).collect();
    assert_eq!(starts.len(), 2);
    starts.iter().for_each(|at| bytes[at + 24..at + 28].copy_from_slice(&size.to_le_bytes()));
    bytes
}

#[test]
fn a_deflated_entry_is_refused_unread_whatever_it_would_unpack_to() {
    for size in [206_400_128, u32::MAX - 1] {
        let bytes = deflated(size);
        let start = Instant::now();
        let error = read(&bytes, &size).expect_err("deflated");
        let expected = format!(
            "zip archive: archive/data.pkl: expected a stored entry, as torch.save writes it, found method 8, 200017 \
             bytes for {size}"
        );
        assert_eq!(error.to_string(), expected);
        assert!(start.elapsed() < CEILING);
    }
}

#[test]
fn values_that_are_remembered_and_repeated_take_no_more_than_the_pickle() {
    // Each tuple contains the previous one twice: 2^100,000 values if unfolded; a tensor has this
    // shape.
    let doubled = [b'h', 0, b'h', 0, 0x86, b'q', 0].repeat(100_000);
    let start = Instant::now();
    let laughs = Pickle::new().raw(b"Nq\0").raw(&doubled).raw(b".");
    let error = read(&file(&laughs, &[]), &"laughs").expect_err("no state dict");
    assert!(matches!(error, FormatError::NoStateDict { .. }), "{error}");

    // A shape of a million sizes, which many tensors use.
    let sizes = Pickle::new().raw(b"(").raw(&[b'K', 1].repeat(1 << 20)).raw(b"tq\0.");
    let shape = &sizes.0[2..sizes.0.len() - 1];
    let view = state_dict(&[("a", VIEW)]);
    let reduce = view.0.windows(3).position(|w| w == [b'K', 0, b'(']).expect("offset, then the shape");
    let long = [&view.0[..reduce + 2], shape, b"h\0", &view.0[reduce + 12..]].concat();
    let error = read(&file(&Pickle(long), &[("0", &values())]), &"long").expect_err("a million sizes");
    assert!(matches!(error, FormatError::Pickle { .. }), "{error}");
    assert!(start.elapsed() < CEILING, "{:?}", start.elapsed());
}

#[test]
fn messages_quote_what_a_file_says_in_part() {
    let long = format!("\u{1b}[2J{}", "n".repeat(60_000));
    let header =
        with_header(&format!(r#"{{"a{}":{{"dtype":"F32","shape":[4],"data_offsets":[0,12]}}}}"#, &long[4..]));
    let view = View { shape: &[9], strides: &[1], ..VIEW };
    let named = file(&state_dict(&[(&long, view)]), &[("0", &values())]);
    let keyed = file(&state_dict(&[("a", View { key: &long, ..VIEW })]), &[("0", &values())]);
    let pickle = pickle();
    let entries: [(&str, &[u8]); 3] = [("data.pkl", &pickle.0), (&long, b"x"), (&long, b"x")];
    for bytes in [header, named, keyed, archive(&entries, Deviation::default())] {
        let error = read(&bytes, &"long").expect_err("what does not fit").to_string();
        assert!(error.len() < 500 && !error.contains('\u{1b}'), "{error:.600}");
    }
}

/// The errors of a network of each kind for weights with one tensor changed by `change`.
fn refusals(change: impl Fn(&Tensor) -> Tensor) -> [(String, ModelError); 2] {
    let changed = |weights: &Weights, name: &str| {
        let tensors = weights.iter().map(|(found, tensor)| {
            (found.to_owned(), if found == name { change(tensor) } else { tensor.clone() })
        });
        Weights::new(tensors)
    };
    let events = Description::parse(SMALL).expect("consistent");
    let of_events = events.network(&changed(&draw(&events, 5), "fc.weight")).expect_err("events");
    let frames = FrameDescription::parse(SMALL_FRAMES).expect("consistent");
    let of_frames = frames.network_parts(&changed(&draw(&frames, 5), "conv1.weight")).expect_err("frames");
    [("fc.weight".to_owned(), of_events), ("conv1.weight".to_owned(), of_frames)]
}

/// The only problem of each refusal, which names its tensor.
fn problems(change: impl Fn(&Tensor) -> Tensor) -> [TensorProblemKind; 2] {
    refusals(change).map(|(name, error)| match error {
        ModelError::Weights { mut problems, .. } if problems.len() == 1 => {
            let problem = problems.remove(0);
            assert_eq!(problem.tensor, name);
            problem.kind
        }
        error => panic!("{error}"),
    })
}

#[test]
fn weights_that_are_not_finite_are_refused_by_tensor_and_index_in_networks_of_both_kinds() {
    for value in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let found = problems(|tensor| {
            let mut values = tensor.values().expect("floats").to_vec();
            values[2] = value;
            Tensor::new(tensor.shape().to_vec(), values).expect("the same number")
        });
        for problem in found {
            let TensorProblemKind::NotFinite { index: 2, value: found } = problem else {
                panic!("{problem}")
            };
            assert_eq!(found.to_bits(), value.to_bits());
        }
    }
}

#[test]
fn doubles_beyond_the_range_of_floats_are_refused_as_not_finite() {
    let bytes: Vec<u8> = [1e300_f64, 1.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let view = View { storage: "DoubleStorage", key: "0", values: 2, offset: 0, shape: &[2], strides: &[1] };
    let read = read(&file(&state_dict(&[("a", view)]), &[("0", &bytes)]), &"doubles").expect("readable");
    assert_eq!(read.get("a").and_then(Tensor::values), Some(&[f32::INFINITY, 1.0][..]));
    let infinite = |tensor: &Tensor| {
        let count = tensor.shape().iter().product();
        Tensor::new(tensor.shape().to_vec(), vec![f32::INFINITY; count]).expect("as many")
    };
    for problem in problems(infinite) {
        assert!(matches!(problem, TensorProblemKind::NotFinite { index: 0, .. }), "{problem}");
    }
}

#[test]
fn a_tensor_of_another_shape_or_type_is_refused_in_networks_of_both_kinds() {
    for problem in problems(|_| Tensor::new(vec![0, 1 << 40], vec![]).expect("no values")) {
        let TensorProblemKind::Shape { expected, found } = problem else { panic!("{problem}") };
        assert_eq!(found, [0, 1 << 40]);
        assert!(!expected.is_empty() && expected != found);
    }
    let integers = |tensor: &Tensor| {
        let shape: Vec<i64> = tensor.shape().iter().map(|&size| size as i64).collect();
        let strides = vec![0; shape.len()];
        let view = View { storage: "IntStorage", shape: &shape, strides: &strides, ..VIEW };
        let weights = read(&file(&state_dict(&[("a", view)]), &[]), &"integers").expect("readable");
        weights.get("a").expect("there").clone()
    };
    for problem in problems(integers) {
        assert_eq!(problem, TensorProblemKind::Dtype { found: "int32".to_owned() });
    }
}
