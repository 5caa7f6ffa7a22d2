//! `PyTorch` state dicts in the zip archives of `torch.save`: `data.pkl` has names, `data/<key>`
//! values.
//!
//! Input: an archive. Output: tensors by name. Invariant, checked before memory is allocated: a
//! tensor has at most as many values as its storage, and all tensors take at most eight times the
//! size of the archive.

use std::collections::{BTreeMap, BTreeSet};

use rawzip::{CompressionMethod, ZipFileHeaderRecord, ZipLocator, ZipSliceArchive};

use crate::weights::error::{FormatError, quoted};
use crate::weights::pickle;
use crate::weights::pickle::{Pickle, Scalar, Value, View};
use crate::weights::safetensors::{Tensor, float};

/// Keys under which checkpoints contain their state dict, and the programs that write them.
pub(crate) const KEYS: [(&str, &str); 5] = [
    ("state_dict", "PyTorch Lightning, examples of PyTorch"),
    ("model_state_dict", "PyTorch's tutorial on checkpoints"),
    ("model", "references of torchvision"),
    ("net", "pytorch-cifar"),
    ("module", "DeepSpeed"),
];

/// Longest `data.pkl`, for about 30,000 tensors. A byte of it may become a value of 72 bytes.
const MAX_PICKLE: usize = 1 << 22;

/// Whether `bytes` start with the magic number of `torch.save` before zip archives.
pub(super) fn is_legacy(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x80, 2, 0x8a, 10, 0x6c, 0xfc, 0x9c, 0x46, 0xf9, 0x20])
}

pub(super) fn read(bytes: &[u8]) -> Result<BTreeMap<String, Tensor>, FormatError> {
    let entries = entries(bytes)?;
    let is_root = |root: &&str| root.is_empty() || root.ends_with('/');
    let Some(root) = entries.keys().filter_map(|name| name.strip_suffix("data.pkl")).find(is_root) else {
        let found = format!("{} other entries", entries.len());
        return Err(FormatError::zip("archive", "an entry \"data.pkl\"", found));
    };
    let refuse = |name: &str, expected: String, found: String| {
        Err(FormatError::zip(&format!("{root}{name}"), expected, found))
    };
    let pickle = entries[&format!("{root}data.pkl")];
    if pickle.len() > MAX_PICKLE {
        return refuse("data.pkl", format!("at most {MAX_PICKLE} bytes"), pickle.len().to_string());
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
            return Err(FormatError::tensor(name, "name", "one tensor", "two"));
        }
    }
    Ok(tensors)
}

/// Names and tensors of a pickle.
type Views<'p, 'a> = Vec<(&'a str, &'p View<'a>)>;

/// Names and tensors of the only nested dict with tensors under one of [`KEYS`], else of the root:
/// a checkpoint may also contain another tensor, such as the last loss.
fn state_dict<'p, 'a>(pickle: &'p Pickle<'a>) -> Result<Views<'p, 'a>, FormatError> {
    let none = |found: &str| FormatError::NoStateDict { found: found.to_owned() };
    let Value::Dict(root) = pickle.root else { return Err(none(pickle.root.kind())) };
    let tensors = |dict: usize| -> Views<'p, 'a> {
        let tensor = |&(key, value): &(Value<'a>, Value<'a>)| match (key, value) {
            (Value::Str(name), Value::Tensor(tensor)) => Some((name, &pickle.tensors[tensor])),
            _ => None,
        };
        pickle.dicts[dict].iter().filter_map(tensor).collect()
    };
    // Each dict is read once, because a pickle can refer to one very often.
    let mut read = BTreeSet::from([root]);
    let mut nested = |is_known: bool| -> Vec<(&'a str, Views<'p, 'a>)> {
        let dict = |&(key, value): &(Value<'a>, Value<'a>)| match (key, value) {
            (Value::Str(key), Value::Dict(dict)) => Some((key, dict)),
            _ => None,
        };
        let dicts = pickle.dicts[root].iter().filter_map(dict);
        let dicts = dicts.filter(|(key, _)| KEYS.iter().any(|(known, _)| known == key) == is_known);
        let dicts = dicts.filter(|(_, dict)| read.insert(*dict));
        dicts.map(|(key, dict)| (key, tensors(dict))).filter(|(_, tensors)| !tensors.is_empty()).collect()
    };
    let (known, others, of_root) = (nested(true), nested(false), tensors(root));
    let keys = |dicts: &[(&str, Views<'p, 'a>)]| {
        let keys: Vec<String> = dicts.iter().take(8).map(|(key, _)| format!("\"{}\"", quoted(key))).collect();
        keys.join(", ")
    };
    match &known[..] {
        [(_, tensors)] => Ok(tensors.clone()),
        [_, _, ..] => Err(none(&format!("several, as {}: save the one that is meant", keys(&known)))),
        [] if !of_root.is_empty() => Ok(of_root),
        [] if others.is_empty() => Err(none("a dict without tensors")),
        [] => Err(none(&format!("others, as {}: save the one that is meant", keys(&others)))),
    }
}

struct Storages<'a> {
    entries: &'a BTreeMap<String, &'a [u8]>,
    root: &'a str,
    /// Values that may still be allocated.
    values_left: usize,
}

impl Storages<'_> {
    fn tensor(&mut self, name: &str, view: &View<'_>) -> Result<Tensor, FormatError> {
        let dtype = match view.storage.scalar {
            Scalar::Float(dtype) => dtype,
            Scalar::Other(dtype) => return Ok(Tensor::other(view.shape.clone(), dtype)),
        };
        let refuse = |what, expected: String, found: String| FormatError::tensor(name, what, expected, found);
        let entry = format!("{}data/{}", self.root, view.storage.key);
        let Some(&bytes) = self.entries.get(&entry) else {
            return Err(refuse("storage", format!("entry \"{}\"", quoted(&entry)), "none".to_owned()));
        };
        let size = dtype.bitsize() / 8;
        if view.storage.values.checked_mul(size) != Some(bytes.len()) {
            let expected = format!("{} values of {size} bytes", view.storage.values);
            return Err(refuse("storage", expected, format!("{} bytes", bytes.len())));
        }
        let count = view.shape.iter().try_fold(1usize, |n, &size| n.checked_mul(size));
        let most = view.storage.values.min(self.values_left);
        let Some(count) = count.filter(|&count| count <= most) else {
            return Err(refuse("shape", format!("at most {most} values"), format!("{:?}", view.shape)));
        };
        self.values_left -= count;
        let mut values = Vec::with_capacity(count);
        for index in 0..count {
            let value = view.place(index).and_then(|place| float(dtype, bytes, place)).ok_or_else(|| {
                let found =
                    format!("offset {}, strides {:?}, shape {:?}", view.offset, view.strides, view.shape);
                refuse("view", format!("within {} values", view.storage.values), found)
            })?;
            values.push(value);
        }
        Tensor::new(view.shape.clone(), values)
            .ok_or_else(|| refuse("values", count.to_string(), "another number".to_owned()))
    }
}

impl View<'_> {
    /// The position in the storage of the value at a row-major index; `None` beyond the address
    /// space: offset and strides are the file's.
    fn place(&self, index: usize) -> Option<usize> {
        let (mut place, mut rest) = (self.offset, index);
        for (&size, &stride) in self.shape.iter().zip(&self.strides).rev() {
            place = place.checked_add((rest % size).checked_mul(stride)?)?;
            rest /= size;
        }
        Some(place)
    }
}

/// Start of an archive: the signature of a local header.
pub(super) const MAGIC: &[u8] = b"PK\x03\x04";
/// Length of the end record with the longest comment.
const SEARCHED: u64 = 22 + u16::MAX as u64;

pub(super) fn entries(bytes: &[u8]) -> Result<BTreeMap<String, &[u8]>, FormatError> {
    let located = ZipLocator::new().max_search_space(SEARCHED).locate_in_slice(bytes);
    let archive = located
        .map_err(|(_, error)| FormatError::zip("end record", "one in the last 64 KiB", error.to_string()))?;
    let mut entries = BTreeMap::new();
    let (mut count, mut left) = (0, bytes.len());
    for record in archive.entries() {
        let record =
            record.map_err(|error| FormatError::zip("directory", "whole records", error.to_string()))?;
        let path = record.file_path();
        let name = str::from_utf8(path.as_bytes())
            .map_err(|_| FormatError::zip("directory", "names in UTF-8", "other bytes"))?;
        let data = stored(&archive, &record, name)?;
        count += 1;
        // Entries that share bytes would take time that grows with the square of the archive.
        left = left.checked_sub(data.len()).ok_or_else(|| {
            let expected = format!("entries that share no bytes: at most {left} more");
            FormatError::zip(name, expected, format!("{} bytes", data.len()))
        })?;
        if entries.insert(name.to_owned(), (data, record.crc32())).is_some() {
            return Err(FormatError::zip(name, "one entry of a name", "two"));
        }
    }
    if count != archive.entries_hint() {
        let expected = format!("{} entries, as the end record says", archive.entries_hint());
        return Err(FormatError::zip("directory", expected, count.to_string()));
    }
    let checked = entries.into_iter().map(|(name, (data, crc))| {
        let found = rawzip::crc32(data);
        if found != crc {
            return Err(FormatError::zip(
                &name,
                format!("CRC-32 {crc:#010x}"),
                format!("{found:#010x}: damaged data"),
            ));
        }
        Ok((name, data))
    });
    checked.collect()
}

/// The bytes of an entry that is stored without compression.
fn stored<'a>(
    archive: &ZipSliceArchive<&'a [u8]>,
    record: &ZipFileHeaderRecord<'_>,
    name: &str,
) -> Result<&'a [u8], FormatError> {
    if record.flags().is_encrypted() {
        return Err(FormatError::zip(name, "no encryption", "an encrypted entry"));
    }
    let (method, stored) = (record.compression_method(), record.compressed_size_hint());
    let size = record.uncompressed_size_hint();
    if method != CompressionMethod::STORE || stored != size {
        let found = format!("method {}, {stored} bytes for {size}", method.as_u16());
        return Err(FormatError::zip(name, "a stored entry, as torch.save writes it", found));
    }
    let entry = archive.get_entry(record.wayfinder()).map_err(|error| {
        let expected = format!("{size} bytes after a local header at {}", record.local_header_offset());
        FormatError::zip(name, expected, error.to_string())
    })?;
    let (start, end) = entry.compressed_data_range();
    Ok(&archive.get_ref()[start as usize..end as usize])
}
