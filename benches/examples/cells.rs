//! Times of the recurrent cells, with random weights and inputs, on each instruction set:
//! `cargo run --release -p meissner-benches --example cells`.

use std::hint::black_box;
use std::time::Duration;

use meissner_benches::timing::median_ns;
use meissner_kernels::random::Random;
use meissner_kernels::{
    Activation, Dense, FeatureMap, Isa, Lanes, Lstm, LstmParts, LstmState, Matrix, Occupancy, PlanarConv3x3,
    PlanarConvLstm, PlanarConvLstmState, Planes, Squash, SqueezeExcite, SqueezeScratch, lstm_update_rows,
    planar_average_pool, planar_max_pool,
};

const MIN: Duration = Duration::from_millis(4);
/// Force: frames of a grasp, and their size.
const FRAMES: usize = 41;
const SIZE: usize = 115;

fn main() {
    for isa in Isa::available().into_iter().rev() {
        println!("{}", isa.name());
        let report = |what: &str, call: &mut dyn FnMut()| {
            println!("  {what:<58} {:>12.2} us", median_ns(MIN, call) / 1e3);
        };
        slip_lstm(isa, report);
        slip_gates(isa, report);
        force_lstm(isa, report);
        force_convlstm(isa, report);
        planes(isa, report);
        denses(isa, report);
        squeeze(isa, report);
    }
}

fn lstm(random: &mut Random, inputs: usize, hidden: usize) -> Lstm {
    let (ih, hh) = (random.values(4 * hidden * inputs, 0.2), random.values(4 * hidden * hidden, 0.2));
    let (bias_ih, bias_hh) = (random.values(4 * hidden, 0.2), random.values(4 * hidden, 0.2));
    Lstm::new(&LstmParts {
        inputs,
        hidden,
        weight_ih: &ih,
        weight_hh: &hh,
        bias_ih: Some(&bias_ih),
        bias_hh: Some(&bias_hh),
        squash: Squash::Tanh,
    })
    .expect("finite weights of these sizes")
}

fn dense(random: &mut Random, inputs: usize, outputs: usize, activation: Activation) -> Dense {
    let (weight, bias) = (random.values(inputs * outputs, 0.1), random.values(outputs, 0.1));
    Dense::new(1, inputs, outputs, &weight, Some(&bias), activation).expect("finite weights of these sizes")
}

/// One step of layers on top of each other.
fn steps(isa: Isa, layers: &[Lstm], x: &[f32], states: &mut [LstmState]) {
    for (n, layer) in layers.iter().enumerate() {
        let (below, states) = states.split_at_mut(n);
        layer.step(isa, below.last().map_or(x, LstmState::hidden), &mut states[0]);
    }
}

fn slip_lstm(isa: Isa, report: impl Fn(&str, &mut dyn FnMut())) {
    let random = &mut Random::new(1);
    let layers = [24, 32, 32].map(|inputs| lstm(random, inputs, 32));
    let head = [
        dense(random, 32, 32, Activation::Relu),
        dense(random, 32, 32, Activation::Relu),
        dense(random, 32, 7, Activation::Identity),
    ];
    let readings = random.values(5 * 24, 1.0);
    let mut states: Vec<_> = layers.iter().map(Lstm::state).collect();
    let (mut a, mut b) = ([Lanes::ZERO; 4], [Lanes::ZERO; 4]);
    report("slip-lstm: 5 readings through 3 layers of 32, 3 dense", &mut || {
        states.iter_mut().for_each(LstmState::reset);
        for reading in black_box(&readings).chunks_exact(24) {
            steps(isa, &layers, reading, &mut states);
        }
        head[0].run(isa, states[2].hidden_lanes(), &mut a);
        head[1].run(isa, &a, &mut b);
        head[2].run(isa, &b, &mut a[..1]);
        black_box(&a);
    });
}

fn slip_gates(isa: Isa, report: impl Fn(&str, &mut dyn FnMut())) {
    let random = &mut Random::new(2);
    let count = 12 * 11 * 32;
    let gates = random.values(4 * count, 2.0);
    // Small, so that the same gates repeated do not drive the cells far from their usual range.
    let peephole: Vec<_> = (0..3).map(|_| random.values(count, 0.1)).collect();
    let (mut cell, mut hidden) = (random.values(count, 1.0), vec![0.0; count]);
    report("slip-convlstm: gates of 12 x 11 positions of 32, peepholes", &mut || {
        let peephole = Some([&peephole[0][..], &peephole[1], &peephole[2]]);
        lstm_update_rows(isa, 32, black_box(&gates), peephole, Squash::Tanh, &mut cell, &mut hidden);
    });
}

fn force_lstm(isa: Isa, report: impl Fn(&str, &mut dyn FnMut())) {
    let random = &mut Random::new(3);
    let layers = [1058, 32, 32, 32, 32, 32].map(|inputs| lstm(random, inputs, 32));
    let mut states: Vec<_> = layers.iter().map(Lstm::state).collect();
    let x = random.values(1058, 1.0);
    report("force-lstm: a frame of 1058 through 6 layers of 32", &mut || {
        steps(isa, &layers, black_box(&x), &mut states);
    });
    let empty = vec![0.0; 1058];
    report("force-lstm: an empty frame", &mut || steps(isa, &layers, black_box(&empty), &mut states));
}

fn force_convlstm(isa: Isa, report: impl Fn(&str, &mut dyn FnMut())) {
    let random = &mut Random::new(4);
    let layers = [2, 3, 3, 3].map(|inputs| {
        let weight = random.values(12 * (inputs + 3) * 9, 0.2);
        let bias = random.values(12, 0.1);
        PlanarConvLstm::new(inputs, 3, &weight, Some(&bias), Squash::Tanh).expect("finite weights")
    });
    let mut states = layers.each_ref().map(|layer| layer.state(SIZE, SIZE));
    let mut hidden = [(); 4].map(|()| Planes::zeros(3, SIZE, SIZE));
    let x = Planes::from_values(2, SIZE, SIZE, &random.values(2 * SIZE * SIZE, 1.0));
    let below = Planes::from_values(3, SIZE, SIZE, &random.values(3 * SIZE * SIZE, 1.0));
    report("force-convlstm: a layer of 3 and a frame of 115 x 115", &mut || {
        layers[1].step(isa, Some(black_box(&below)), None, &mut states[1], &mut hidden[1]);
    });
    let mut occupied = Occupancy::empty(SIZE, SIZE);
    report("force-convlstm: first layer, full frame", &mut || {
        occupied.update(black_box(&x));
        layers[0].step(isa, Some(&x), Some(&occupied), &mut states[0], &mut hidden[0]);
    });
    let empty = Planes::zeros(2, SIZE, SIZE);
    report("force-convlstm: first layer, empty frame", &mut || {
        occupied.update(black_box(&empty));
        layers[0].step(isa, Some(&empty), Some(&occupied), &mut states[0], &mut hidden[0]);
    });
    report("force-convlstm: 41 frames through 4 layers", &mut || {
        states.iter_mut().for_each(PlanarConvLstmState::reset);
        hidden.iter_mut().for_each(Planes::clear);
        for _ in 0..FRAMES {
            for (n, (layer, state)) in layers.iter().zip(&mut states).enumerate() {
                let (below, above) = hidden.split_at_mut(n);
                layer.step(isa, Some(below.last().unwrap_or(black_box(&x))), None, state, &mut above[0]);
            }
        }
    });
}

fn planes(isa: Isa, report: impl Fn(&str, &mut dyn FnMut())) {
    let random = &mut Random::new(5);
    let x = Planes::from_values(3, SIZE, SIZE, &random.values(3 * SIZE * SIZE, 1.0));
    let mut out = Planes::zeros(3, SIZE, SIZE);
    let conv = PlanarConv3x3::new([3, 0], 3, &random.values(81, 1.0), None, true).expect("finite weights");
    let region = out.region();
    report("3 x 3 convolution, 3 to 3 planes of 115 x 115", &mut || {
        conv.run(isa, [Some(black_box(&x)), None], None, &region, &mut out);
    });
    let mut pooled = Planes::zeros(3, SIZE / 2, SIZE / 2);
    report("2 x 2 maximum pooling of 3 planes", &mut || planar_max_pool(black_box(&x), &mut pooled));
    let (mut pooled, mut columns) = (Planes::zeros(3, SIZE / 5, SIZE / 5), Vec::new());
    report("5 x 5 average pooling of 3 planes", &mut || {
        planar_average_pool(black_box(&x), 5, &mut columns, &mut pooled);
    });
    let weight = x.spread(&random.values(3 * SIZE * SIZE, 0.1));
    let dense = Dense::new(1, weight.len(), 1, &weight, None, Activation::Identity).expect("finite weights");
    report("dense layer from 3 planes to 1", &mut || {
        dense.run(isa, black_box(&x).lanes(), black_box(&mut [Lanes::ZERO]));
    });
}

fn denses(isa: Isa, report: impl Fn(&str, &mut dyn FnMut())) {
    let random = &mut Random::new(6);
    for (inputs, outputs) in [(4224, 32), (5120, 256)] {
        let dense = dense(random, inputs, outputs, Activation::Relu);
        let x = Matrix::from_rows(inputs, &random.values(inputs, 1.0));
        let mut out = Matrix::zeros(1, outputs);
        report(&format!("dense layer {inputs} to {outputs}"), &mut || {
            dense.run(isa, black_box(&x).lanes(), out.row_mut(0));
        });
    }
}

fn squeeze(isa: Isa, report: impl Fn(&str, &mut dyn FnMut())) {
    let random = &mut Random::new(7);
    let (height, width, channels) = (60, 80, 128);
    let block = SqueezeExcite::new(channels, 8, &random.values(1024, 0.5), &random.values(1024, 0.5))
        .expect("finite weights");
    let image = random.values(height * width * channels, 1.0);
    let image = FeatureMap::from_pixels([height, width, channels], 0, &image).expect("a map's size");
    let (mut out, mut scratch) = (image.clone(), SqueezeScratch::default());
    report("squeeze and excitation of 60 x 80 positions of 128", &mut || {
        block.run(isa, image.view(), out.band(), &mut scratch).expect("maps of one size");
    });
}
