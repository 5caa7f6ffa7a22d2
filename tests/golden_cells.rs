//! Recurrent cells over planes and vectors against `PyTorch`'s, through the golden files of the force networks.

use meissner_kernels::{
    Activation, Dense, Isa, Lanes, Lstm, LstmParts, LstmState, Occupancy, PlanarConvLstm,
    PlanarConvLstmState, Planes, Squash, planar_average_pool,
};
use meissner_tests::shared::{Golden, assert_close};

/// The prediction of every frame of every sequence: `frame` has them one after the other, the first of a sequence marked.
fn predict(golden: &Golden, mut frame: impl FnMut(bool, Planes) -> f32) -> Vec<f32> {
    let &[_, steps, channels, height, width] = golden.shape("x") else { panic!("frames have five axes") };
    let frames = golden.floats("x").chunks_exact(channels * height * width);
    frames
        .enumerate()
        .map(|(n, x)| frame(n % steps == 0, Planes::from_values(channels, height, width, x)))
        .collect()
}

#[test]
fn the_convolutional_lstm_of_force_agrees_with_the_reference() {
    let Some(golden) = Golden::load("force_convlstm") else { return };
    let &[_, _, _, height, width] = golden.shape("x") else { panic!("frames have five axes") };
    let layers: Vec<_> = (0..4)
        .map(|n| {
            let name = |what: &str| format!("w.cells.{n}.gates.{what}");
            let inputs = golden.shape(&name("weight"))[1] - 3;
            let (weight, bias) = (golden.floats(&name("weight")), golden.floats(&name("bias")));
            PlanarConvLstm::new(inputs, 3, weight, Some(bias), Squash::Tanh).expect("the golden shapes fit")
        })
        .collect();
    let weight = Planes::zeros(3, height, width).spread(golden.floats("w.fc.weight"));
    let bias = golden.floats("w.fc.bias");
    let fc = Dense::new(1, weight.len(), 1, &weight, Some(bias), Activation::Identity).expect("they fit");
    for isa in Isa::available() {
        let mut states: Vec<_> = layers.iter().map(|layer| layer.state(height, width)).collect();
        let mut occupied = Occupancy::empty(height, width);
        let got = predict(&golden, |first, x| {
            if first {
                states.iter_mut().for_each(PlanarConvLstmState::reset);
            }
            occupied.update(&x);
            layers[0].step(isa, Some(&x), Some(&occupied), &mut states[0]);
            for n in 1..layers.len() {
                let (below, states) = states.split_at_mut(n);
                layers[n].step(isa, Some(below[n - 1].hidden()), None, &mut states[0]);
            }
            let mut out = [Lanes::ZERO];
            fc.run(isa, states[3].hidden().lanes(), &mut out);
            out[0].0[0]
        });
        assert_close(&format!("force_convlstm on {}", isa.name()), &got, golden.floats("y"), 1e-4);
    }
}

#[test]
fn the_lstm_of_force_agrees_with_the_reference() {
    let Some(golden) = Golden::load("force_lstm") else { return };
    let layers: Vec<_> = (0..6)
        .map(|n| {
            let tensor = |what: &str| golden.floats(&format!("w.lstm.{what}_l{n}"));
            Lstm::new(&LstmParts {
                inputs: golden.shape(&format!("w.lstm.weight_ih_l{n}"))[1],
                hidden: 32,
                weight_ih: tensor("weight_ih"),
                weight_hh: tensor("weight_hh"),
                bias_ih: Some(tensor("bias_ih")),
                bias_hh: Some(tensor("bias_hh")),
                squash: Squash::Tanh,
            })
            .expect("the golden shapes fit")
        })
        .collect();
    let (weight, bias) = (golden.floats("w.fc.weight"), golden.floats("w.fc.bias"));
    let fc = Dense::new(1, 32, 1, weight, Some(bias), Activation::Identity).expect("the golden shapes fit");
    for isa in Isa::available() {
        let mut states: Vec<_> = layers.iter().map(Lstm::state).collect();
        let (mut pooled, mut columns) = (Planes::zeros(2, 23, 23), Vec::new());
        let got = predict(&golden, |first, x| {
            if first {
                states.iter_mut().for_each(LstmState::reset);
            }
            planar_average_pool(&x, 5, &mut columns, &mut pooled);
            let flat: Vec<f32> = pooled.values().collect();
            for n in 0..layers.len() {
                let (below, states) = states.split_at_mut(n);
                layers[n].step(isa, below.last().map_or(&flat, LstmState::hidden), &mut states[0]);
            }
            let mut out = [Lanes::ZERO];
            fc.run(isa, states[5].hidden_lanes(), &mut out);
            out[0].0[0]
        });
        assert_close(&format!("force_lstm on {}", isa.name()), &got, golden.floats("y"), 1e-4);
    }
}
