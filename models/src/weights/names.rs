//! Assigns the names of a file to those of a network.
//!
//! Input: the names that a network needs, and weights. Output: [`Names`]: the tensor of the file
//! for each needed tensor. Habits are tried in this order, and the first one with which the file
//! has every tensor is used. Each allows one further prefix of all names, such as Lightning's
//! `model.`:
//!
//! 1. the names as they are;
//! 2. with the elements of [`ELEMENTS`] left out or replaced;
//! 3. the same, and the convolutions and norms of [`SIBLINGS`] assigned to the blocks with their
//!    names or, if their number equals that of the blocks, in the order of numbers and of the
//!    description.
//!
//! Names from a map (`super::map`) are used unchanged. Invariant: no habit decides between two
//! tensors of the file. Time grows with the length of all names, not with its square.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::iter;

use super::Weights;
use crate::ModelError;

/// Elements of dotted names in files, their replacements in networks (empty: they are left out),
/// and the programs that write them. Digits at the end of a replaced element are kept: `bn1` is
/// `norm1`.
pub(crate) const ELEMENTS: [(&str, &str, &str); 10] = [
    (
        "module",
        "",
        "`DataParallel`, `DistributedDataParallel`, `AveragedModel`; `torch_geometric.nn.BatchNorm`",
    ),
    ("_orig_mod", "", "`torch.compile`"),
    ("_fsdp_wrapped_module", "", "`FullyShardedDataParallel`"),
    ("_checkpoint_wrapped_module", "", "`checkpoint_wrapper` of PyTorch"),
    ("_module", "", "Opacus"),
    ("local_nn", "", "`torch_geometric.nn.PointNetConv`"),
    ("bn", "norm", "torchvision, examples of `torch_geometric`"),
    ("batch_norm", "norm", "examples of `torch_geometric`"),
    ("bns", "norms", "examples of Open Graph Benchmark"),
    ("batch_norms", "norms", "examples of `torch_geometric`"),
];

/// Names of numbered convolutions and of their norms if no module contains both, and the programs
/// that use them. A number follows each name.
pub(crate) const SIBLINGS: [(&str, &str, &str); 2] = [
    ("conv", "norm", "examples of `torch_geometric`, the authors of the contact-angle network"),
    ("convs.", "norms.", "`torch_geometric.nn.models`"),
];

/// Longest number of a convolution in digits.
const MAX_DIGITS: usize = 6;

/// The tensor of the file for each tensor that a network needs.
#[derive(Debug)]
pub(crate) struct Names(BTreeMap<String, String>);

impl Names {
    /// The tensors of `weights` for the network of this name, which needs `needed`, in the order of
    /// its layers. If no habit finds all of them, those of the habit that finds the most.
    ///
    /// # Errors
    /// Two tensors or prefixes fit equally well, or a map names a tensor that is not needed.
    pub(crate) fn find(network: &str, needed: &[&str], weights: &Weights) -> Result<Self, ModelError> {
        let known: BTreeSet<&str> = needed.iter().copied().collect();
        let mapped = &weights.mapped;
        if let Some(name) = mapped.iter().find(|name| !known.contains(name.as_str())) {
            return Err(ModelError::Map {
                place: format!("name {name:?}"),
                expected: format!("a tensor that network {network:?} reads"),
                found: "none of this name".to_owned(),
            });
        }
        let needed: Vec<&str> = needed.iter().copied().filter(|&name| !mapped.contains(name)).collect();
        let held: Vec<&str> = weights.names().filter(|&name| !mapped.contains(name)).collect();
        let mut best = BTreeMap::new();
        for habit in [as_they_are, without_wrappers, of_siblings] {
            let Some(called) = habit(&needed, &held) else { continue };
            let found = called.under_one_prefix(network)?;
            if found.len() > best.len() {
                best = found;
            }
            if best.len() == needed.len() {
                break;
            }
        }
        let found = best.into_iter().chain(mapped.iter().map(|name| (name.as_str(), name.as_str())));
        Ok(Self(found.map(|(needed, held)| (needed.to_owned(), held.to_owned())).collect()))
    }

    /// The name in the file of the tensor with the name `needed` in the network.
    pub(crate) fn held(&self, needed: &str) -> Option<&str> {
        self.0.get(needed).map(String::as_str)
    }

    /// The tensors of the file that the network reads.
    pub(crate) fn used(&self) -> BTreeSet<&str> {
        self.0.values().map(String::as_str).collect()
    }
}

/// Names changed by a habit, with their original names.
struct Called<'a> {
    needed: BTreeMap<String, &'a str>,
    held: BTreeMap<String, Vec<&'a str>>,
}

impl<'a> Called<'a> {
    /// Names changed by `called`; `None` if two needed names become equal.
    fn by(needed: &[&'a str], held: &[&'a str], called: impl Fn(&str) -> String) -> Option<Self> {
        let of: BTreeMap<String, &str> = needed.iter().map(|&name| (called(name), name)).collect();
        (of.len() == needed.len()).then(|| Self { needed: of, held: grouped(held, called) })
    }

    /// The tensor of the file for each needed one, all under one prefix: no prefix if all tensors
    /// exist without one, else the prefix with all, else the shortest of the prefixes with the
    /// most.
    fn under_one_prefix(&self, network: &str) -> Result<BTreeMap<&'a str, &'a str>, ModelError> {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for name in self.held.keys() {
            for start in starts(name).filter(|&start| self.needed.contains_key(&name[start..])) {
                *counts.entry(&name[..start]).or_default() += 1;
            }
        }
        let all = self.needed.len();
        let whole: Vec<&str> =
            counts.iter().filter(|(_, count)| **count == all).map(|(prefix, _)| *prefix).collect();
        let prefix = match &whole[..] {
            [] => {
                let most = counts.iter().max_by_key(|(prefix, count)| (**count, Reverse(prefix.len())));
                most.map_or("", |(prefix, _)| *prefix)
            }
            ["", ..] => "",
            [prefix] => *prefix,
            prefixes => {
                let prefixes = prefixes.iter().map(|&prefix| prefix.to_owned()).collect();
                return Err(ModelError::Ambiguous { network: network.to_owned(), prefixes });
            }
        };
        let mut found = BTreeMap::new();
        for (called, &needed) in &self.needed {
            match self.held.get(&format!("{prefix}{called}")).map(Vec::as_slice) {
                Some(&[held]) => {
                    found.insert(needed, held);
                }
                Some(several) if !whole.is_empty() => {
                    return Err(ModelError::Doubled {
                        network: network.to_owned(),
                        tensor: needed.to_owned(),
                        found: several.iter().map(|&held| held.to_owned()).collect(),
                    });
                }
                _ => {}
            }
        }
        Ok(found)
    }
}

/// `names` grouped by the result of `called`.
fn grouped<'a>(names: &[&'a str], called: impl Fn(&str) -> String) -> BTreeMap<String, Vec<&'a str>> {
    let mut groups: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for &name in names {
        groups.entry(called(name)).or_default().push(name);
    }
    groups
}

/// Start indices of the elements of a dotted name.
fn starts(name: &str) -> impl Iterator<Item = usize> {
    iter::once(0).chain(name.match_indices('.').map(|(dot, _)| dot + 1))
}

fn as_they_are<'a>(needed: &[&'a str], held: &[&'a str]) -> Option<Called<'a>> {
    Called::by(needed, held, str::to_owned)
}

fn without_wrappers<'a>(needed: &[&'a str], held: &[&'a str]) -> Option<Called<'a>> {
    Called::by(needed, held, unwrapped)
}

/// `name` with the elements of [`ELEMENTS`] left out or replaced.
fn unwrapped(name: &str) -> String {
    let mut result = String::with_capacity(name.len());
    let mut is_first = true;
    for element in name.split('.') {
        let stem = element.trim_end_matches(|c: char| c.is_ascii_digit());
        let digits = &element[stem.len()..];
        let (stem, digits) = match ELEMENTS.iter().find(|(known, ..)| *known == stem) {
            Some((_, "", _)) if digits.is_empty() => continue,
            Some((_, "", _)) | None => (element, ""),
            Some((_, instead, _)) => (*instead, digits),
        };
        if !is_first {
            result.push('.');
        }
        is_first = false;
        result.push_str(stem);
        result.push_str(digits);
    }
    result
}

fn of_siblings<'a>(needed: &[&'a str], held: &[&'a str]) -> Option<Called<'a>> {
    let blocks = blocks(needed);
    let held: Vec<(String, &str)> = held.iter().map(|&name| (unwrapped(name), name)).collect();
    let mut numbers: BTreeMap<(&str, usize), BTreeSet<u32>> = BTreeMap::new();
    for sibling in held.iter().filter_map(|(name, _)| sibling(name)).filter(|sibling| sibling.part == CONV) {
        numbers.entry((sibling.prefix, sibling.row)).or_default().insert(sibling.number);
    }
    let of = |(&(prefix, row), numbers)| Some(((prefix, row), by_number(&blocks, row, numbers)?));
    let blocks: BTreeMap<(&str, usize), BTreeMap<u32, &str>> = numbers.iter().filter_map(of).collect();
    if blocks.is_empty() {
        return None;
    }
    let called = |name: &str| {
        let of_block = |sibling: Sibling<'_>| {
            let Sibling { prefix, row, number, part, rest } = sibling;
            let block = blocks.get(&(prefix, row))?.get(&number)?;
            Some(format!("{prefix}{block}.{part}.{rest}"))
        };
        let name = unwrapped(name);
        sibling(&name).and_then(of_block).unwrap_or(name)
    };
    let held: Vec<&str> = held.iter().map(|&(_, name)| name).collect();
    let needed = Called::by(needed, &[], unwrapped)?.needed;
    Some(Called { needed, held: grouped(&held, called) })
}

/// Name element of a block's convolution.
const CONV: &str = "conv";
const NORM: &str = "norm";

/// The blocks that have these tensors, in their order: each is a module with a convolution.
fn blocks(needed: &[&str]) -> Vec<String> {
    let mut blocks: Vec<String> = Vec::new();
    for name in needed {
        let name = unwrapped(name);
        let Some((block, _)) = name.rsplit_once(".conv.") else { continue };
        if blocks.last().is_none_or(|last| last != block) {
            blocks.push(block.to_owned());
        }
    }
    blocks
}

/// The block of each of these `numbers` of convolutions: the block of its name if all blocks have
/// such names, else the blocks in their order if there are as many. `None` for another number of
/// blocks, or if numbers at the end of their names contradict their order.
fn by_number<'b>(
    blocks: &'b [String],
    row: usize,
    numbers: &BTreeSet<u32>,
) -> Option<BTreeMap<u32, &'b str>> {
    let named =
        |block: &'b String| Some((block.strip_prefix(SIBLINGS[row].0)?.parse().ok()?, block.as_str()));
    let of_names: Option<BTreeMap<u32, &str>> = blocks.iter().map(named).collect();
    let fit = |named: &BTreeMap<u32, &str>| named.keys().all(|number| numbers.contains(number));
    if let Some(named) = of_names.filter(fit) {
        return Some(named).filter(|named| !named.is_empty());
    }
    let mut last: BTreeMap<&str, u64> = BTreeMap::new();
    for block in blocks {
        let stem = block.trim_end_matches(|c: char| c.is_ascii_digit());
        let Ok(number) = block[stem.len()..].parse() else { continue };
        if last.insert(stem, number).is_some_and(|before| before >= number) {
            return None;
        }
    }
    let in_order = || numbers.iter().copied().zip(blocks.iter().map(String::as_str)).collect();
    (numbers.len() == blocks.len()).then(in_order)
}

/// A tensor of a numbered convolution or norm.
struct Sibling<'a> {
    prefix: &'a str,
    /// Of [`SIBLINGS`].
    row: usize,
    number: u32,
    /// [`CONV`] or [`NORM`].
    part: &'static str,
    rest: &'a str,
}

fn sibling(name: &str) -> Option<Sibling<'_>> {
    let mut places = starts(name).flat_map(|start| (0..SIBLINGS.len()).map(move |row| (start, row)));
    places.find_map(|(start, row)| {
        let (conv, norm, _) = SIBLINGS[row];
        [(conv, CONV), (norm, NORM)].into_iter().find_map(|(stem, part)| {
            let (number, rest) = name[start..].strip_prefix(stem)?.split_once('.')?;
            let is_number = number.len() <= MAX_DIGITS && number.bytes().all(|c| c.is_ascii_digit());
            let number = number.parse().ok().filter(|_| is_number)?;
            Some(Sibling { prefix: &name[..start], row, number, part, rest })
        })
    })
}
