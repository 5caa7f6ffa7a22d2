//! Frame networks with rounded weights.
//!
//! Every output channel has a step of its own; of a recurrent layer, every gate of every hidden value, for what it reads and
//! for its hidden state apart. Biases and peepholes stay, and batch norm is part of the weights by then.

use meissner_engine::EngineError;
use meissner_engine::frames::{FrameLayerKind, FrameNetworkParts};
use meissner_kernels::{KernelError, Precision};

/// `parts` with the weights of every layer rounded to `precision`.
pub(super) fn rounded(
    mut parts: FrameNetworkParts,
    precision: Precision,
) -> Result<FrameNetworkParts, EngineError> {
    use FrameLayerKind as Kind;
    for layer in &mut parts.layers {
        let done = match &mut layer.kind {
            Kind::Conv { channels, weight, .. } => rows(weight, *channels, precision),
            Kind::UpConv { channels, weight, .. } => columns(weight, *channels, precision),
            Kind::SqueezeExcite { reduced, down, up } => {
                let channels = down.len() / (*reduced).max(1);
                rows(down, *reduced, precision).and_then(|()| rows(up, channels, precision))
            }
            Kind::ConvLstm { hidden, weight, .. } => rows(weight, 4 * *hidden, precision),
            Kind::Lstm { hidden, weight_ih, weight_hh, .. } => {
                rows(weight_ih, 4 * *hidden, precision).and_then(|()| rows(weight_hh, 4 * *hidden, precision))
            }
            Kind::Dense { outputs, weight, .. } => rows(weight, *outputs, precision),
            Kind::MaxPool
            | Kind::AveragePool { .. }
            | Kind::GlobalAverage
            | Kind::Sum
            | Kind::Concat { .. }
            | Kind::Delay { .. }
            | Kind::Flatten => Ok(()),
        };
        done.map_err(|source| EngineError::Layer { layer: layer.name.clone(), source })?;
    }
    Ok(parts)
}

/// Weights of which each output has a row.
fn rows(weights: &mut [f32], outputs: usize, precision: Precision) -> Result<(), KernelError> {
    let row = weights.len() / outputs.max(1);
    weights.chunks_exact_mut(row.max(1)).try_for_each(|row| precision.round(row))
}

/// Weights (inputs, outputs, 2, 2).
fn columns(weights: &mut [f32], outputs: usize, precision: Precision) -> Result<(), KernelError> {
    const TAPS: usize = 4;
    for output in 0..outputs {
        let places: Vec<usize> = (0..weights.len()).filter(|i| i / TAPS % outputs == output).collect();
        let mut channel: Vec<f32> = places.iter().map(|&place| weights[place]).collect();
        precision.round(&mut channel)?;
        places.iter().zip(channel).for_each(|(&place, weight)| weights[place] = weight);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{columns, rounded, rows};
    use meissner_kernels::Precision;
    use meissner_models::{FrameDescription, Weights};

    #[test]
    fn each_output_has_a_step_of_its_own() {
        let mut weights = [1.0, 0.3, 100.0, 0.3];
        rows(&mut weights, 2, Precision::Int8).expect("finite");
        assert!((weights[1] - 0.3).abs() < 0.5 / 127.0 && weights[1] != 0.3);
        assert_eq!(weights[3], 0.0, "less than half a step of its row");
    }

    #[test]
    fn transposed_convolutions_are_rounded_by_column() {
        let mut weights: Vec<f32> = (0..16).map(|i| if i / 4 % 2 == 0 { 100.0 } else { 0.3 }).collect();
        columns(&mut weights, 2, Precision::Int8).expect("finite");
        assert!(weights.iter().all(|&w| (w - 100.0).abs() < 1e-4 || (w - 0.3).abs() < 1e-6), "{weights:?}");
    }

    #[test]
    fn a_shipped_network_is_rounded_and_stays_one() {
        for name in ["slip-best", "slip-regularised", "canf"] {
            let weights = Weights::shipped(name).expect("shipped");
            let description = FrameDescription::shipped(name).expect("shipped");
            let parts = description.network_parts(&weights).expect("they fit");
            let once = rounded(parts.clone(), Precision::Bf16).expect("finite");
            let twice = rounded(once.clone(), Precision::Bf16).expect("finite");
            let text = |parts| format!("{parts:?}");
            assert!(text(once.clone()) != text(parts), "{name}");
            assert!(text(once) == text(twice), "{name}: what is rounded stays");
        }
    }
}
