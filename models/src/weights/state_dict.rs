//! `PyTorch` state dicts in the zip archives of `torch.save`: `data.pkl` names tensors, `data/<key>` holds their values.
//!
//! Enters: the bytes of an archive. Leaves: tensors by name. Invariant: a tensor has no more values than its storage, and
//! all tensors together take at most eight times the archive's bytes. Both are checked before any memory is allocated.

use std::collections::BTreeMap;

use super::error::{FormatError, quoted};
use super::pickle::{self, Pickle, Scalar, Value, View};
use super::tensor::Tensor;
use super::zip;

/// Keys under which checkpoints hold their state dict.
const NESTED: [&str; 3] = ["state_dict", "model_state_dict", "model"];
/// The same, for a message.
const NESTED_WORDS: &str = "\"state_dict\", \"model_state_dict\" or \"model\"";

/// Longest `data.pkl`: some 30,000 tensors. A byte of it may become a value of 72 bytes.
const LARGEST_PICKLE: usize = 1 << 22;

/// Whether `bytes` start with the magic number that `torch.save` wrote before it wrote zip archives.
pub(super) fn is_legacy(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x80, 2, 0x8a, 10, 0x6c, 0xfc, 0x9c, 0x46, 0xf9, 0x20])
}

/// Reads the tensors of a `.pt` or `.pth` file.
pub(super) fn read(bytes: &[u8]) -> Result<BTreeMap<String, Tensor>, FormatError> {
    let entries = zip::entries(bytes)?;
    let is_root = |root: &&str| root.is_empty() || root.ends_with('/');
    let Some(root) = entries.keys().filter_map(|name| name.strip_suffix("data.pkl")).find(is_root) else {
        return Err(FormatError::Zip {
            what: "archive".to_owned(),
            expected: "an entry \"data.pkl\"".to_owned(),
            found: format!("{} other entries", entries.len()),
        });
    };
    let refuse = |name: &str, expected: String, found: String| {
        Err(FormatError::Zip { what: quoted(&format!("{root}{name}")), expected, found })
    };
    let pickle = entries[&format!("{root}data.pkl")];
    if pickle.len() > LARGEST_PICKLE {
        let expected = format!("at most {LARGEST_PICKLE} bytes");
        return refuse("data.pkl", expected, pickle.len().to_string());
    }
    if let Some(order) = entries.get(&format!("{root}byteorder"))
        && order.trim_ascii() != b"little"
    {
        let found = String::from_utf8_lossy(order).chars().take(20).collect();
        return refuse("byteorder", "little".to_owned(), found);
    }
    let pickle = pickle::read(pickle)?;
    let mut storages = Storages { entries: &entries, root, values_left: 2 * bytes.len() };
    let mut tensors = BTreeMap::new();
    for (name, view) in state_dict(&pickle)? {
        let tensor = storages.tensor(name, view)?;
        if tensors.insert(name.to_owned(), tensor).is_some() {
            return Err(self::refuse(name, "name", "one tensor", "two"));
        }
    }
    Ok(tensors)
}

/// Names and tensors of the state dict in `pickle`.
fn state_dict<'p, 'a>(pickle: &'p Pickle<'a>) -> Result<Vec<(&'a str, &'p View<'a>)>, FormatError> {
    let refuse =
        |found: &str| Err(FormatError::NoStateDict { expected: NESTED_WORDS, found: found.to_owned() });
    let Value::Dict(root) = pickle.root else { return refuse(pickle.root.kind()) };
    let tensors = |dict: usize| -> Vec<(&'a str, &'p View<'a>)> {
        let tensor = |&(key, value): &(Value<'a>, Value<'a>)| match (key, value) {
            (Value::Str(name), Value::Tensor(tensor)) => Some((name, &pickle.tensors[tensor])),
            _ => None,
        };
        pickle.dicts[dict].iter().filter_map(tensor).collect()
    };
    let found = tensors(root);
    if !found.is_empty() {
        return Ok(found);
    }
    for nested in NESTED {
        let is_nested = |(key, value): &(Value<'_>, Value<'_>)| match (key, value) {
            (Value::Str(key), Value::Dict(dict)) if *key == nested => Some(*dict),
            _ => None,
        };
        if let Some(dict) = pickle.dicts[root].iter().find_map(is_nested) {
            let found = tensors(dict);
            if !found.is_empty() {
                return Ok(found);
            }
        }
    }
    refuse("a dict without tensors")
}

fn refuse(
    tensor: &str,
    what: &'static str,
    expected: impl Into<String>,
    found: impl Into<String>,
) -> FormatError {
    FormatError::Tensor { tensor: quoted(tensor), what, expected: expected.into(), found: found.into() }
}

struct Storages<'a> {
    entries: &'a BTreeMap<String, &'a [u8]>,
    root: &'a str,
    /// Values that may still be allocated.
    values_left: usize,
}

impl Storages<'_> {
    fn tensor(&mut self, name: &str, view: &View<'_>) -> Result<Tensor, FormatError> {
        let float = match view.storage.scalar {
            Scalar::Float(float) => float,
            Scalar::Other(dtype) => return Ok(Tensor::other(view.shape.clone(), dtype)),
        };
        let entry = format!("{}data/{}", self.root, view.storage.key);
        let Some(&bytes) = self.entries.get(&entry) else {
            return Err(refuse(name, "storage", format!("entry \"{}\"", quoted(&entry)), "none"));
        };
        let expected = view.storage.values.checked_mul(float.size());
        if expected != Some(bytes.len()) {
            let found = format!("{} bytes", bytes.len());
            let expected = format!("{} values of {} bytes", view.storage.values, float.size());
            return Err(refuse(name, "storage", expected, found));
        }
        let count = view.shape.iter().try_fold(1usize, |n, &size| n.checked_mul(size));
        let most = view.storage.values.min(self.values_left);
        let Some(count) = count.filter(|&count| count <= most) else {
            return Err(refuse(name, "shape", format!("at most {most} values"), format!("{:?}", view.shape)));
        };
        self.values_left -= count;
        let mut values = Vec::with_capacity(count);
        let mut index = vec![0; view.shape.len()];
        for _ in 0..count {
            // Every product is checked: offset and strides are the file's.
            let place = index
                .iter()
                .zip(&view.strides)
                .try_fold(view.offset, |place, (&i, &stride)| place.checked_add(stride.checked_mul(i)?));
            let value = place.and_then(|place| float.get(bytes, place)).ok_or_else(|| {
                let found =
                    format!("offset {}, strides {:?}, shape {:?}", view.offset, view.strides, view.shape);
                refuse(name, "view", format!("within {} values", view.storage.values), found)
            })?;
            values.push(value);
            advance(&mut index, &view.shape);
        }
        Tensor::new(view.shape.clone(), values)
            .ok_or_else(|| refuse(name, "values", count.to_string(), "another number"))
    }
}

/// The next index in row-major order.
fn advance(index: &mut [usize], shape: &[usize]) {
    for (i, &size) in index.iter_mut().zip(shape).rev() {
        *i += 1;
        if *i < size {
            return;
        }
        *i = 0;
    }
}
