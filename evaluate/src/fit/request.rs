//! The request: a network whose layers of events are kept, labels, and how they are fitted.

use std::path::PathBuf;

use meissner_engine::{Aggregation, Normalisation, Sensor};
use meissner_kernels::Activation;
use meissner_models::description::{Outputs, Refit, Refitted};
use meissner_models::{Description, LayerKind, ModelError, Weights};
use meissner_run::RunError;
use meissner_run::model::{WeightsFile, describe, description_text, labelled, weights};
use serde::Serialize;

use crate::error::{EvaluateError, RequestPart, Result};

/// Default of [`Options::folds`].
pub const DEFAULT_FOLDS: usize = 5;
/// Default of [`Options::ages`].
pub const DEFAULT_AGES: usize = 1;

/// Pixels a side of the smallest cells that are halved by default.
const CELL: u32 = 4;
/// Maximum number of cells of a grid that was made finer.
const MAX_CELLS: u32 = 2304;

/// What is fitted, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of a shipped network over events, or path of a description file.
    pub network: String,
    /// File with its weights; `None` selects those shipped with it.
    pub weights: Option<PathBuf>,
    /// Rules that map the names in this file to the network's, as [`WeightsFile::map`].
    pub map: Vec<String>,
    /// The name of the fitted network.
    pub name: String,
    /// Names of the labels; `None`: all numbers, or else the first label of classes.
    pub labels: Option<Vec<String>>,
    /// Another length of the window, in microseconds.
    pub span_us: Option<i64>,
    /// Columns and rows of the readout; `None`: those of the network, or smaller cells where it
    /// sums.
    pub grid: Option<[u32; 2]>,
    /// Number of units of a perceptron for each fold; 0: no perceptron.
    pub hidden: usize,
    /// Number of parts of the presses, each of which is held out once.
    pub folds: usize,
    /// Number of random instants of each press, in addition to its end.
    pub ages: usize,
    /// Each press is also read moved by so many pixels to the left, right, top and bottom; 0: only
    /// as it is.
    pub shift: u16,
    /// Seed of random instants, of the presses of a learning curve, and of intervals.
    pub seed: u64,
}

impl Options {
    /// Options for `network` with its shipped weights, and the name of the fitted one.
    pub fn new(network: impl Into<String>, name: impl Into<String>) -> Self {
        Self {
            network: network.into(),
            weights: None,
            map: Vec::new(),
            name: name.into(),
            labels: None,
            span_us: None,
            grid: None,
            hidden: 0,
            folds: DEFAULT_FOLDS,
            ages: DEFAULT_AGES,
            shift: 0,
            seed: 0,
        }
    }
}

/// The layers between the readout and the fitted layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "head")]
pub enum Head {
    /// Nothing: the fitted layers read the readout.
    New,
    /// The first layers behind the readout.
    Kept {
        /// Number of these layers.
        layers: usize,
        /// Number of values that the next layer reads.
        #[serde(skip)]
        values: usize,
    },
}

/// The network whose layers of events are kept.
pub(super) struct Base {
    pub(super) name: String,
    pub(super) description: Description,
    pub(super) weights: Weights,
    /// The same, under the names of the description.
    pub(super) named: Weights,
    pub(super) label: String,
    pub(super) stride: usize,
    /// The text of the description.
    text: String,
}

impl Base {
    /// The network of `options`.
    pub(super) fn load(options: &Options) -> Result<Self> {
        let name = &options.network;
        let (description, shipped) = describe(name)?;
        let refused = |expected: &str, found: &str| {
            Err(EvaluateError::request(RequestPart::Networks, expected, format!("{name}, {found}")))
        };
        if !description.layers().iter().any(|layer| layer.convolution().is_some()) {
            return refused("a network with layers of events", "whose readout reads the events themselves");
        }
        if description.normalisation() == Normalisation::PerGraph {
            return refused("a network that runs event by event", "where one event can change every row");
        }
        let file = options.weights.as_deref().map(|path| WeightsFile { path, map: &options.map });
        let (weights, label) = weights(name, shipped, file)?;
        let card = weights.card().map_err(|source| RunError::weights(label.clone(), source))?;
        let text = description_text(name, shipped)?;
        let label = labelled(label, &weights);
        let (of, stride) = (description.name().to_owned(), card.stride);
        let named = description.named(&weights);
        let named = named.map_err(|source| RunError::weights(label.clone(), source))?;
        Ok(Self { name: of, description, stride, weights, named, label, text })
    }

    /// The heads that can stay with the readout of `options`. Heads with dense layers have seen the
    /// presses that these layers were fitted to.
    pub(super) fn kept_heads(&self, options: &Options, has_seen: bool) -> Vec<Head> {
        let mut heads = self.description.kept_heads();
        heads.retain(|kept| options.grid.is_none() && !(has_seen && kept.has_dense));
        heads.iter().map(|kept| Head::Kept { layers: kept.layers, values: kept.values }).collect()
    }

    /// Its layers up to `head`, and dense layers that predict `outputs`.
    pub(super) fn refitted(
        &self,
        (options, sensor): (&Options, Sensor),
        head: Head,
        outputs: &Outputs,
        hidden: &[(usize, Activation)],
    ) -> Result<Refitted> {
        let (name, span_us) = (&options.name, options.span_us);
        let kept = if let Head::Kept { layers, .. } = head { layers } else { 0 };
        let is_new = kept == 0;
        let grid = options.grid.or_else(|| self.finer_grid(sensor)).filter(|_| is_new);
        let refit = Refit { name, span_us, grid, counts: is_new, kept, hidden, outputs };
        let inconsistent =
            |error| RunError::description(options.name.clone(), ModelError::Description(error));
        Ok(Description::refitted(&self.text, &refit).map_err(inconsistent)?)
    }

    /// The grid of a readout that sums, with cells halved while they have more pixels along a side
    /// than [`CELL`], because small motions show in small cells.
    fn finer_grid(&self, sensor: Sensor) -> Option<[u32; 2]> {
        let sums = self.description.layers().iter().find_map(|layer| match layer.kind {
            LayerKind::Readout { columns, rows, aggregation: Aggregation::Sum, .. } => Some([columns, rows]),
            _ => None,
        });
        let mut grid = sums?.map(|side| side as u32);
        let sides = [sensor.width, sensor.height].map(u32::from);
        let is_coarse = |grid: [u32; 2]| grid.iter().zip(sides).all(|(cells, side)| side > CELL * cells);
        while is_coarse(grid) && 4 * grid[0] * grid[1] <= MAX_CELLS {
            grid = grid.map(|cells| 2 * cells);
        }
        Some(grid)
    }

    /// Its weights do not fit.
    pub(super) fn unfit(&self, source: ModelError) -> EvaluateError {
        RunError::weights(self.label.clone(), source).into()
    }
}
