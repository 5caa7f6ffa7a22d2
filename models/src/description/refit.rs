//! A description that keeps its layers of events and gets other dense layers after the readout.
//!
//! Input: the text of a description of a network over events, and the values to predict. Output:
//! the text of the new description, and the origin of its tensors. Comments are not kept.
//!
//! A readout that sums can also sum values that no layer computes: the number of events in a cell,
//! their polarities p, and with `place` also p x and p y. Two blocks without neighbours give these
//! exactly, because ELU does not change values above 0, and `elu(x - 19)` is -1 for x of at most 1:
//!
//! ```text
//! signs    u = elu(x + 10 p - 9),  v = elu(x - 10 p - 9),  w = elu(p + 1)
//! counts   1,   p = w - 1,   p x = u - v - 2 w + 2
//! ```
//!
//! `counts` also has the channels of the last layer, all 0, and is added to it as its `skip`; that
//! layer gets channels of 0 for the channels that `counts` adds.

use serde::Serialize;
use toml::{Table, Value};

use meissner_engine::Aggregation;
use meissner_kernels::Activation;

use super::frames::FrameKind;
use super::layer::activation_word;
use super::{Description, DescriptionError, Layer, LayerKind};
use crate::ModelError;
use crate::weights::names::Names;
use crate::weights::{Tensor, Weights};

const HEAD: &str = "fitted";
const SIGNS: &str = "signs";
const COUNTS: &str = "counts";
/// Beyond it, ELU is -1.
const FAR: f32 = 10.0;

/// The predictions of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outputs {
    /// Quantities: the name of each, and its unit.
    Quantities(Vec<(String, String)>),
    /// Logits of classes of these names.
    Classes(Vec<String>),
}

impl Outputs {
    /// Number of predicted values.
    pub fn len(&self) -> usize {
        match self {
            Self::Quantities(names) => names.len(),
            Self::Classes(names) => names.len(),
        }
    }

    /// Whether nothing is predicted, which is not possible in a network.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn table(&self) -> Table {
        let list = |values: Vec<&String>| Value::from(values.into_iter().cloned().collect::<Vec<_>>());
        match self {
            Self::Quantities(each) => table([
                ("names", list(each.iter().map(|(name, _)| name).collect())),
                ("unit", list(each.iter().map(|(_, unit)| unit).collect())),
            ]),
            Self::Classes(names) => table([("classes", list(names.iter().collect()))]),
        }
    }
}

/// The changes of a description.
#[derive(Clone, Debug)]
pub struct Refit<'a> {
    /// The name of the network.
    pub name: &'a str,
    /// Another length of the window.
    pub span_us: Option<i64>,
    /// Other columns and rows of the readout.
    pub grid: Option<[u32; 2]>,
    /// Whether the readout also sums events and their polarities, if it can.
    pub counts: bool,
    /// Number of layers after the readout that are kept: 0, or a number from
    /// [`Description::kept_heads`].
    pub kept: usize,
    /// Values and activations of dense layers before the last one.
    pub hidden: &'a [(usize, Activation)],
    /// Its predictions.
    pub outputs: &'a Outputs,
}

/// The first layers after a readout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptHead {
    /// Number of these layers.
    pub layers: usize,
    /// Number of values that the next layer reads.
    pub values: usize,
    /// Whether one of them is dense.
    pub has_dense: bool,
}

/// A description with other layers after its readout.
#[derive(Clone, Debug)]
pub struct Refitted {
    /// The text of the description.
    pub text: String,
    /// The same, checked.
    pub description: Description,
    /// Number of channels at the end of a row that sum events and polarities.
    pub counts: usize,
    /// Names of the dense layers that the other description does not have.
    dense: Vec<String>,
    /// Blocks that the other description does not have.
    added: Option<[String; 2]>,
}

/// A layer after a readout.
struct Behind<'a> {
    name: &'a str,
    weights: &'a str,
    from: &'a str,
    has_weights: bool,
    /// Number of values that it reads, if it is dense.
    values: Option<usize>,
}

/// The tables in a readable order.
#[derive(Serialize)]
struct Tables {
    network: Table,
    graph: Value,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    filter: Vec<Value>,
    layer: Vec<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    head: Vec<Value>,
    output: Table,
}

impl Description {
    /// The description in `text` with new dense layers after its readout. They replace its dense
    /// layers, or the layers of its head except the first `kept`. They come last; the last one is
    /// `fitted`, those before it `fitted1` and so on, or with underscores after `fitted` if other
    /// layers have such names.
    ///
    /// # Errors
    /// `text` is not a description of a network over events, or the new one is inconsistent: an
    /// invalid name, outputs with the same name, or a head that cannot be kept.
    ///
    /// # Panics
    /// Never: a checked description is a table of plain values.
    pub fn refitted(text: &str, refit: &Refit<'_>) -> Result<Refitted, DescriptionError> {
        let described = Self::parse(text)?;
        let mut root: Table = text.parse().expect("a description is a table");
        let mut part = |key: &str| root.remove(key).unwrap_or_else(|| Value::from(Table::new()));
        let (network, graph) = (part("network"), part("graph"));
        let [filter, mut layer, mut head] =
            ["filter", "layer", "head"].map(|key| part(key).as_array().cloned().unwrap_or_default());
        let mut network = network.as_table().cloned().unwrap_or_default();
        network.insert("name".to_owned(), Value::from(refit.name));
        network.extend(refit.span_us.map(|span_us| ("span_us".to_owned(), Value::from(span_us))));
        let behind = described.behind_readout();
        let (kept_behind, replaced) = behind.split_at(refit.kept.min(behind.len()));
        let stays = |layer: &Value| {
            let is = |name: &str| layer.get("name").and_then(Value::as_str) == Some(name);
            !replaced.iter().any(|replaced| is(replaced.name))
        };
        layer.retain(stays);
        head.retain(stays);
        if let Some(grid) = refit.grid {
            let entries = layer.iter_mut().filter_map(Value::as_table_mut);
            let is_readout = |layer: &&mut Table| layer.contains_key("grid");
            entries.filter(is_readout).for_each(|readout| {
                readout.insert("grid".to_owned(), Value::from(grid.map(i64::from).to_vec()));
            });
        }
        let of_events =
            described.layers.iter().filter(|layer| !matches!(layer.kind, LayerKind::Dense { .. }));
        let of_events = of_events.map(|layer| [&*layer.name, &*layer.weights]);
        let kept: Vec<[&str; 2]> =
            of_events.chain(kept_behind.iter().map(|layer| [layer.name, layer.weights])).collect();
        let free = |name: &str, count: usize| {
            let mut own = name.to_owned();
            let taken = |own: &str| {
                let mut names = (0..=count).map(|i| numbered(own, i));
                names.any(|name| kept.iter().any(|layer| layer.contains(&&*name)))
            };
            while taken(&own) {
                own.push('_');
            }
            own
        };
        let counted = described.counted();
        let last = described.countable().filter(|_| refit.counts && counted == 0);
        let (mut added, mut counts) = (None, counted);
        if let Some(last) = last {
            let names = [free(SIGNS, 0), free(COUNTS, 0)];
            counts = 2 * described.inputs().min(2);
            let channels = (last.outputs + counts) as i64;
            let entry = layer.iter_mut().filter_map(Value::as_table_mut);
            let named = |layer: &&mut Table| layer.get("name").and_then(Value::as_str) == Some(&last.name);
            if let Some(of_last) = entry.into_iter().find(named) {
                of_last.insert("channels".to_owned(), Value::from(channels));
                of_last.insert("skip".to_owned(), Value::from(&*names[1]));
            }
            let signs = if counts == 2 { 1 } else { 5 };
            for (i, channels) in [signs, channels].into_iter().enumerate() {
                layer.push(Value::from(table([
                    ("name", Value::from(&*names[i])),
                    ("kind", Value::from("spline")),
                    ("from", Value::from(if i == 0 { "events" } else { &names[0] })),
                    ("channels", Value::from(channels)),
                    ("kernel", Value::from(1)),
                    ("root", Value::from(true)),
                    ("bias", Value::from(true)),
                    ("norm", Value::from(false)),
                    ("elu", Value::from(i == 0)),
                ])));
            }
            added = Some(names);
        }
        let own = free(HEAD, refit.hidden.len());
        let last = (refit.outputs.len(), Activation::Identity);
        let mut from = replaced.first().map(|replaced| replaced.from);
        let mut dense_names = Vec::new();
        let to = if head.is_empty() { &mut layer } else { &mut head };
        for (i, &(outputs, activation)) in refit.hidden.iter().chain([&last]).enumerate() {
            let number = if i < refit.hidden.len() { i + 1 } else { 0 };
            let mut dense = table([
                ("name", Value::from(numbered(&own, number))),
                ("kind", Value::from("dense")),
                ("outputs", Value::from(outputs as i64)),
                ("activation", Value::from(activation_word(activation))),
            ]);
            dense.extend(from.take().map(|from| ("from".to_owned(), Value::from(from))));
            dense_names.push(numbered(&own, number));
            to.push(Value::from(dense));
        }
        let tables = Tables { network, graph, filter, layer, head, output: refit.outputs.table() };
        let text = toml::to_string(&tables).expect("tables of plain values");
        let description = Self::parse(&text)?;
        Ok(Refitted { text, description, counts, dense: dense_names, added })
    }

    /// The tensors of `weights` that the network reads, under the names of the description.
    ///
    /// # Errors
    /// As [`Self::network`], if the tensors cannot be identified.
    pub fn named(&self, weights: &Weights) -> Result<Weights, ModelError> {
        let needed = self.tensors();
        let names: Vec<&str> = needed.iter().map(|(name, _)| name.as_str()).collect();
        let found = Names::find(self.name(), &names, weights)?;
        let tensor = |name: &&str| Some(((*name).to_owned(), weights.get(found.held(name)?)?.clone()));
        Ok(Weights::new(names.iter().filter_map(tensor)))
    }

    /// The positions at which other dense layers can begin after kept layers with weights: at the
    /// first dense layer, and at the last layer if it is dense. For each, the number of kept layers
    /// after the readout, and the number of values that the next one reads.
    pub fn kept_heads(&self) -> Vec<KeptHead> {
        let behind = self.behind_readout();
        let first = behind.iter().position(|layer| layer.values.is_some());
        // In a head with branches, other layers can read a layer.
        let is_chain = |&layers: &usize| behind.windows(2).take(layers).all(|of| of[1].from == of[0].name);
        let mut places: Vec<usize> =
            first.filter(is_chain).into_iter().chain(behind.len().checked_sub(1)).collect();
        places.dedup();
        let of = |layers: usize| {
            let values = behind[layers].values?;
            let is_learnt = behind[..layers].iter().any(|layer| layer.has_weights);
            is_learnt.then_some(KeptHead { layers, values, has_dense: first < Some(layers) })
        };
        places.into_iter().filter_map(of).collect()
    }

    /// The layers after the readout: dense layers, or those of the head. The last one predicts.
    fn behind_readout(&self) -> Vec<Behind<'_>> {
        let dense = self.layers.iter().filter(|layer| matches!(layer.kind, LayerKind::Dense { .. }));
        let dense = dense.map(|layer| Behind {
            name: &layer.name,
            weights: &layer.weights,
            from: &layer.from,
            has_weights: true,
            values: Some(layer.inputs),
        });
        let head = self.head.iter().map(|layer| Behind {
            name: &layer.name,
            weights: &layer.weights,
            from: &layer.from,
            has_weights: layer.parameters > 0,
            values: matches!(layer.kind, FrameKind::Dense { .. }).then(|| layer.input.values()),
        });
        dense.chain(head).collect()
    }

    /// The layer that the readout sums, if counts can be added to it: a spline block without a skip
    /// that no other layer reads.
    fn countable(&self) -> Option<&Layer> {
        let last = self.summed()?;
        let is_free = matches!(last.kind, LayerKind::Block { skip: None, .. });
        let reads = |layer: &&Layer| {
            let skip = if let LayerKind::Block { skip, .. } = &layer.kind { skip.as_ref() } else { None };
            layer.from == last.name || skip == Some(&last.name)
        };
        let is_spline = last.kind.word() == "spline";
        (is_free && is_spline && self.layers.iter().filter(reads).count() == 1).then_some(last)
    }

    /// Number of channels of the readout that are counts already.
    fn counted(&self) -> usize {
        let of = |last: &Layer| {
            let LayerKind::Block { skip: Some(skip), .. } = &last.kind else { return None };
            let skip = self.layers.iter().find(|layer| layer.name == *skip)?;
            let is_counts = skip.name.starts_with(COUNTS) && skip.from.starts_with(SIGNS);
            is_counts.then_some(2 * self.inputs().min(2))
        };
        self.summed().and_then(of).unwrap_or(0)
    }

    /// The layer of events whose rows the readout sums.
    fn summed(&self) -> Option<&Layer> {
        let sums =
            |layer: &&Layer| matches!(layer.kind, LayerKind::Readout { aggregation: Aggregation::Sum, .. });
        let readout = self.layers.iter().find(sums)?;
        self.layers.iter().find(|layer| layer.name == readout.from)
    }
}

impl Refitted {
    /// The weights: layers of events from `base`, weights of the other description under its names
    /// ([`Description::named`]), and for each dense layer its factors (output, input) and its bias.
    ///
    /// # Panics
    /// A layer of `head` has another number of values than the description.
    pub fn weights(&self, base: &Weights, head: &[(Vec<f32>, Vec<f32>)]) -> Weights {
        let of_layer = |(name, (weight, bias)): (&String, &'_ (Vec<f32>, Vec<f32>))| {
            [(format!("{name}.weight"), weight.clone()), (format!("{name}.bias"), bias.clone())]
        };
        let of_head: Vec<(String, Vec<f32>)> = self.dense.iter().zip(head).flat_map(of_layer).collect();
        Weights::new(self.description.tensors().into_iter().filter_map(|(name, shape)| {
            let values = if let Some((_, values)) = of_head.iter().find(|(other, _)| *other == name) {
                values.clone()
            } else if let Some(values) = self.constants(&name) {
                values
            } else {
                widened(base.get(&name)?, &shape, if name.ends_with("running_var") { 1.0 } else { 0.0 })
            };
            let tensor = Tensor::new(shape, values).expect("a head has the values of its description");
            Some((name, tensor))
        }))
    }

    /// The values of a tensor of the added blocks.
    fn constants(&self, name: &str) -> Option<Vec<f32>> {
        let block = self.added.as_ref()?.iter().position(|block| name.starts_with(&format!("{block}.")))?;
        let with_place = self.counts == 4;
        let layer = self
            .description
            .layers
            .iter()
            .find(|layer| Some(&layer.name) == self.added.as_ref().map(|names| &names[block]))?;
        let (root, bias): (Vec<Vec<f32>>, Vec<f32>) = match (block, with_place) {
            (0, false) => (vec![vec![1.0]], vec![1.0]),
            (0, true) => (
                vec![
                    vec![1.0, 0.0, 0.0],
                    vec![FAR, 1.0, 0.0],
                    vec![-FAR, 1.0, 0.0],
                    vec![FAR, 0.0, 1.0],
                    vec![-FAR, 0.0, 1.0],
                ],
                vec![1.0, 1.0 - FAR, 1.0 - FAR, 1.0 - FAR, 1.0 - FAR],
            ),
            (_, false) => (vec![vec![0.0], vec![1.0]], vec![1.0, -1.0]),
            (_, true) => (
                vec![
                    vec![0.0; 5],
                    vec![1.0, 0.0, 0.0, 0.0, 0.0],
                    vec![-2.0, 1.0, -1.0, 0.0, 0.0],
                    vec![-2.0, 0.0, 0.0, 1.0, -1.0],
                ],
                vec![1.0, -1.0, 2.0, 2.0],
            ),
        };
        let none = layer.outputs - bias.len();
        let values = if name.ends_with("conv.lin.weight") {
            [vec![0.0; none * layer.inputs], root.concat()].concat()
        } else if name.ends_with("conv.bias") {
            [vec![0.0; none], bias].concat()
        } else {
            vec![0.0; layer.inputs * layer.outputs]
        };
        Some(values)
    }
}

/// The values of `tensor` in a larger `shape`; all other values are `rest`.
fn widened(tensor: &Tensor, shape: &[usize], rest: f32) -> Vec<f32> {
    let values = tensor.values().unwrap_or_default();
    if tensor.shape() == shape {
        return values.to_vec();
    }
    let count = shape.iter().product();
    (0..count)
        .map(|place: usize| {
            let (mut left, mut from, mut step) = (place, 0, 1);
            for (&side, &old) in shape.iter().zip(tensor.shape()).rev() {
                let at = left % side;
                left /= side;
                if at >= old {
                    return rest;
                }
                from += at * step;
                step *= old;
            }
            values[from]
        })
        .collect()
}

fn numbered(name: &str, number: usize) -> String {
    if number == 0 { name.to_owned() } else { format!("{name}{number}") }
}

fn table<const N: usize>(entries: [(&str, Value); N]) -> Table {
    Table::from_iter(entries.map(|(key, value)| (key.to_owned(), value)))
}
