//! A description whose layers of events and readout stay, with one dense layer behind the readout.
//!
//! Enters: the text of a description of a network over events, and what is to be predicted. Leaves:
//! the text of the other description. Comments are not kept.

use serde::Serialize;
use toml::{Table, Value};

use super::{Description, DescriptionError, LayerKind};

const LAYER: &str = "fitted";

/// What a network predicts.
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

    /// Whether nothing is predicted, which no network does.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn table(&self) -> Table {
        let list = |values: Vec<&String>| Value::from(values.into_iter().cloned().collect::<Vec<_>>());
        match self {
            Self::Quantities(each) => Table::from_iter([
                ("names".to_owned(), list(each.iter().map(|(name, _)| name).collect())),
                ("unit".to_owned(), list(each.iter().map(|(_, unit)| unit).collect())),
            ]),
            Self::Classes(names) => Table::from_iter([("classes".to_owned(), list(names.iter().collect()))]),
        }
    }
}

/// The tables in the order in which people read them.
#[derive(Serialize)]
struct Refitted {
    network: Value,
    graph: Value,
    layer: Vec<Value>,
    output: Table,
}

impl Description {
    /// The text of the description in `text` with the name `name`, whose readout one dense layer
    /// reads: instead of its dense layers, or of the layers of its head. The dense layer comes last
    /// and has the tensors `fitted.weight` (outputs, inputs) and `fitted.bias`, or with underscores
    /// behind `fitted` where the layers of events have such names.
    ///
    /// # Errors
    /// `text` is no description of a network over events, or the new one is inconsistent: a name
    /// that is none, or outputs of one name.
    ///
    /// # Panics
    /// Never: a checked description is a table of plain values.
    pub fn with_dense_head(text: &str, name: &str, outputs: &Outputs) -> Result<String, DescriptionError> {
        let described = Self::parse(text)?;
        let mut root: Table = text.parse().expect("a description is a table");
        let mut part = |key: &str| root.remove(key).unwrap_or_else(|| Value::from(Table::new()));
        let (mut network, graph, layers) = (part("network"), part("graph"), part("layer"));
        if let Some(network) = network.as_table_mut() {
            network.insert("name".to_owned(), Value::from(name));
        }
        let mut layer: Vec<Value> = layers.as_array().cloned().unwrap_or_default();
        layer.retain(|layer| layer.get("kind").and_then(Value::as_str) != Some("dense"));
        let kept = || described.layers.iter().filter(|layer| !matches!(layer.kind, LayerKind::Dense { .. }));
        let mut own = LAYER.to_owned();
        while kept().any(|layer| layer.name == own || layer.weights == own) {
            own.push('_');
        }
        let dense = [
            ("name", Value::from(own)),
            ("kind", Value::from("dense")),
            ("outputs", Value::from(outputs.len() as i64)),
        ];
        layer.push(Value::from(Table::from_iter(dense.map(|(key, value)| (key.to_owned(), value)))));
        let refitted = Refitted { network, graph, layer, output: outputs.table() };
        let text = toml::to_string(&refitted).expect("tables of plain values");
        Self::parse(&text)?;
        Ok(text)
    }
}
