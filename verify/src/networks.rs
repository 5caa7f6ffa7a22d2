//! Random networks of every kind that the engine runs.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameNetwork, FrameNetworkParts};
use meissner_engine::{
    Aggregation, Block, DenseLayer, Fraction, GraphConvolution, GraphRule, Level, Network, NetworkParts,
    Normalisation, Pooling, Position, Readout, TrainingWindows,
};
use meissner_kernels::{Activation, Dense, PointNetConv, PointNetParts, SplineConv, SplineParts};

use crate::frame_networks;
use meissner_kernels::random::Random;

/// A convolution without its numbers.
#[derive(Clone, Copy, Debug)]
pub enum ConvolutionShape {
    /// Spline, with its kernel size along x, y, t.
    Spline([usize; 3]),
    /// `PointNet`.
    PointNet,
}

impl ConvolutionShape {
    /// A convolution for each number below 8; five of them are splines of `kernel`.
    ///
    /// # Panics
    /// If `number` is 8 or more.
    pub fn of(number: u8, kernel: [usize; 3]) -> Self {
        assert!(number < 8, "one of eight");
        if number < 5 { Self::Spline(kernel) } else { Self::PointNet }
    }

    /// The convolution, with numbers drawn from `random` and the `extras` that its kind can have.
    fn build(
        self,
        inputs: usize,
        outputs: usize,
        extras: [bool; 4],
        random: &mut Random,
    ) -> GraphConvolution {
        let [root, bias, norm, elu] = extras;
        let mut values = |given: bool, count, scale| given.then(|| random.values(count, scale));
        match self {
            Self::Spline(kernel) => {
                let slots: usize = kernel.iter().product();
                let parts = SplineParts {
                    inputs,
                    outputs,
                    kernel,
                    weight: values(true, slots * inputs * outputs, 1.0).unwrap_or_default(),
                    root: values(root, inputs * outputs, 0.7),
                    bias: values(bias, outputs, 0.3),
                    norm: values(norm, outputs, 1.2).zip(values(norm, outputs, 0.3)),
                    elu,
                };
                SplineConv::new(&parts).expect("sizes fit").into()
            }
            Self::PointNet => {
                let parts = PointNetParts {
                    inputs,
                    outputs,
                    weight: values(true, (inputs + 3) * outputs, 0.7).unwrap_or_default(),
                    bias: values(bias, outputs, 0.3).unwrap_or_else(|| vec![0.0; outputs]),
                    norm: values(norm, outputs, 1.2).zip(values(norm, outputs, 0.3)),
                };
                PointNetConv::new(&parts).expect("sizes fit").into()
            }
        }
    }
}

/// A block without its numbers.
#[derive(Clone, Debug)]
pub struct BlockShape {
    /// Channels written.
    pub channels: usize,
    /// Its convolution.
    pub conv: ConvolutionShape,
    /// Picks the feature that is read from the available ones.
    pub input: usize,
    /// Picks the added feature among those that fit; `None` adds none.
    pub skip: Option<usize>,
    /// Root weight, bias, batch norm, ELU, if the convolution can have them.
    pub extras: [bool; 4],
}

/// A pooling with the level that it starts.
#[derive(Clone, Debug)]
pub struct PoolShape {
    /// Picks the pooled feature.
    pub from: usize,
    /// Cell sizes.
    pub cell: [(u32, u32); 2],
    /// Cell size in time.
    pub time: Option<(u32, u32)>,
    /// Mean rather than centre.
    pub mean: bool,
    /// The level's blocks.
    pub blocks: Vec<BlockShape>,
}

/// The fraction n / d.
fn fraction((n, d): (u32, u32)) -> Fraction {
    Fraction::new(n, d).expect("fractions are positive")
}

/// A network without its numbers.
#[derive(Clone, Debug)]
pub struct NetworkShape {
    /// Rule of the event graph.
    pub graph: GraphRule,
    /// Span in microseconds.
    pub span_us: i64,
    /// Maximum number of events in the window.
    pub capacity: usize,
    /// Sizes of the cells in which the position of an event is an input.
    pub place: Option<[(u32, u32); 2]>,
    /// Blocks of the event level.
    pub blocks: Vec<BlockShape>,
    /// Levels above.
    pub pooled: Vec<PoolShape>,
    /// Picks the feature that is read out.
    pub from: usize,
    /// Readout grid.
    pub grid: [usize; 2],
    /// Outputs of the dense layers.
    pub dense: Vec<usize>,
    /// Channels of the convolution of a head, which replaces the dense layers.
    pub head: Option<usize>,
    /// Seed of the numbers.
    pub seed: u64,
}

impl NetworkShape {
    /// The network, with numbers drawn from the seed.
    ///
    /// # Panics
    /// If the engine refuses the network: the strategies make only admissible networks.
    pub fn build(&self) -> Network {
        self.build_with_head().0
    }

    /// The same, with the parameters of its head, if it has one.
    ///
    /// # Panics
    /// As [`Self::build`].
    pub fn build_with_head(&self) -> (Network, Option<FrameNetworkParts>) {
        let mut random = Random::new(self.seed);
        let inputs = if self.place.is_some() { 3 } else { 1 };
        let (events, mut channels) = level(&self.blocks, inputs, &mut random);
        let mut pooled = Vec::new();
        let mut timed = true;
        for (i, shape) in self.pooled.iter().enumerate() {
            let from = shape.from % channels.len();
            timed &= shape.time.is_some();
            let pooling = Pooling {
                name: format!("pool{}", i + 1),
                from,
                cell: shape.cell.map(fraction),
                // Cells in time need cells in time below.
                time: shape.time.filter(|_| timed).map(fraction),
                position: if shape.mean { Position::Mean } else { Position::Centre },
            };
            let (level, next) = level(&shape.blocks, channels[from], &mut random);
            pooled.push((pooling, level));
            channels = next;
        }
        // Cells in time can stay apart if all poolings have the same cells in time.
        let time = pooled.first().and_then(|(pooling, _): &(Pooling, Level)| pooling.time);
        let same = pooled.iter().all(|(pooling, _)| pooling.time == time);
        let time = time.filter(|_| same && self.seed.is_multiple_of(2));
        // Only events can be summed; every second network without poolings sums them.
        let sums = pooled.is_empty() && self.seed.is_multiple_of(2);
        let readout = Readout {
            from: self.from % channels.len(),
            columns: self.grid[0],
            rows: self.grid[1],
            aggregation: if sums { Aggregation::Sum } else { Aggregation::Max },
            by_time: time.is_some(),
        };
        let times = time.map_or(1, |size| size.cells() + 1);
        let (mut segments, mut inputs) = (self.grid[0] * self.grid[1] * times, channels[readout.from]);
        let head_parts = self.head.map(|convolved| {
            let image = [times * inputs, self.grid[1], self.grid[0]];
            let outputs = self.dense.last().copied().unwrap_or(1);
            frame_networks::head(image, convolved, outputs, random.bits())
        });
        // Heads of descriptions keep their products; every third head here does not.
        let convolution = if self.seed.is_multiple_of(3) { Convolution::Direct } else { Convolution::Kn2row };
        let head = head_parts
            .clone()
            .map(|parts| Arc::new(FrameNetwork::new(parts, convolution).expect("the layers fit")));
        let mut dense = Vec::new();
        for (i, &outputs) in self.dense.iter().enumerate().filter(|_| head.is_none()) {
            let weight = random.values(segments * inputs * outputs, 0.5);
            let bias = random.values(outputs, 0.5);
            let activation = [Activation::Identity, Activation::Relu, Activation::Elu][i % 3];
            let dense_layer = Dense::new(segments, inputs, outputs, &weight, Some(&bias), activation);
            dense.push(DenseLayer { name: format!("fc{}", i + 1), dense: dense_layer.expect("sizes fit") });
            (segments, inputs) = (1, outputs);
        }
        let parts = NetworkParts {
            name: "random".to_owned(),
            span_us: self.span_us,
            capacity: self.capacity,
            graph: self.graph,
            normalisation: Normalisation::Fixed,
            place: self.place.map(|cell| cell.map(fraction)),
            events,
            pooled,
            readout,
            dense,
            head,
        };
        // Arbitrary statistics: they change no value.
        let windows = TrainingWindows::from_parts(&[0.5; 9], (1..=9).map(|i| vec![1.0; i]).collect());
        (Network::new(parts).expect("the parts fit").with_training_windows(windows), head_parts)
    }
}

fn level(blocks: &[BlockShape], inputs: usize, random: &mut Random) -> (Level, Vec<usize>) {
    let mut channels = vec![inputs];
    let mut out = Vec::new();
    for (i, shape) in blocks.iter().enumerate() {
        let input = shape.input % channels.len();
        let (inputs, outputs) = (channels[input], shape.channels);
        let fitting: Vec<usize> = (0..channels.len()).filter(|&f| channels[f] == outputs).collect();
        let skip = shape.skip.filter(|_| !fitting.is_empty()).map(|pick| fitting[pick % fitting.len()]);
        let conv = shape.conv.build(inputs, outputs, shape.extras, random);
        out.push(Block { name: format!("conv{}_{}", inputs, i + 1), input, skip, conv });
        channels.push(outputs);
    }
    (Level { scale: 0.5 + (random.below(3) as f32) * 0.25, blocks: out }, channels)
}
