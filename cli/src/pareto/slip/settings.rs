//! The settings of a frame network over readings.

use std::sync::Arc;

use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions, Skip,
};
use meissner_kernels::WinogradTile;

use crate::error::CliError;
use crate::pareto::measurement::EXACT;

/// A frame network with some approximations.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Setting {
    convolution: Convolution,
    tolerance: Option<f32>,
    /// Readings of a window that are left out, from its first on.
    left_out: usize,
}

/// The settings of a network of `parts` over windows of `steps` readings.
pub(super) fn settings(parts: &FrameNetworkParts, steps: usize) -> Vec<Setting> {
    let exact = Setting::default();
    let mut settings = vec![exact];
    if has_convolutions(parts) {
        let tiles = [WinogradTile::Two, WinogradTile::Four];
        settings.extend(tiles.map(|tile| Setting { convolution: Convolution::Winograd(tile), ..exact }));
    }
    let tolerant = has_pixels_to_keep(parts);
    if tolerant {
        let tolerances = [1e-3, 1e-2, 3e-2, 1e-1];
        settings.extend(tolerances.map(|tolerance| Setting { tolerance: Some(tolerance), ..exact }));
    }
    settings.extend((1..steps.min(4)).map(|left_out| Setting { left_out, ..exact }));
    if tolerant {
        settings.extend((1..steps.min(3)).map(|left_out| Setting {
            left_out,
            tolerance: Some(1e-2),
            ..exact
        }));
    }
    settings
}

/// Whether there are convolutions that Winograd's could stand for.
pub(super) fn has_convolutions(parts: &FrameNetworkParts) -> bool {
    parts.layers.iter().any(|layer| matches!(layer.kind, FrameLayerKind::Conv { kernel: 3, .. }))
}

/// Whether a tolerance can keep any pixel: a recurrent layer couples them all, and a vector has none.
pub(super) fn has_pixels_to_keep(parts: &FrameNetworkParts) -> bool {
    use FrameLayerKind as Kind;
    let keeps = |kind: &Kind| {
        matches!(kind, Kind::Conv { .. } | Kind::UpConv { .. } | Kind::MaxPool | Kind::AveragePool { .. })
    };
    parts.layers.iter().any(|layer| keeps(&layer.kind))
}

impl Setting {
    /// Its name, for windows of `steps` readings.
    pub(super) fn name(self, steps: usize) -> String {
        let mut names = Vec::new();
        match self.convolution {
            Convolution::Direct => {}
            Convolution::Winograd(WinogradTile::Two) => names.push("winograd 2x2".to_owned()),
            Convolution::Winograd(WinogradTile::Four) => names.push("winograd 4x4".to_owned()),
        }
        if self.left_out > 0 {
            names.push(format!("steps {} of {steps}", steps - self.left_out));
        }
        names.extend(self.tolerance.map(|tolerance| format!("tolerance {tolerance}")));
        if names.is_empty() { EXACT.to_owned() } else { names.join(" + ") }
    }

    /// Readings that are taken of a window of `steps`.
    pub(super) fn steps(self, steps: usize) -> usize {
        steps - self.left_out
    }

    /// An engine of a network of `parts`.
    pub(super) fn engine(self, parts: FrameNetworkParts) -> Result<FrameEngine, CliError> {
        let skip = self.tolerance.map_or(Skip::Exact, Skip::Tolerance);
        let network = Arc::new(FrameNetwork::new(parts, self.convolution)?);
        Ok(FrameEngine::with_options(network, FrameOptions::new().with_skip(skip))?)
    }
}

#[cfg(test)]
mod tests {
    use super::settings;
    use meissner_models::{FrameDescription, Weights};

    #[test]
    fn what_changes_nothing_about_a_network_is_left_out() {
        let names = |name: &str| -> Vec<String> {
            let weights = Weights::shipped(name).expect("shipped");
            let parts = FrameDescription::shipped(name).expect("shipped").network_parts(&weights);
            settings(&parts.expect("they fit"), 5).into_iter().map(|setting| setting.name(5)).collect()
        };
        let (slip, canf) = (names("slip-tuned"), names("canf"));
        assert_eq!((slip[0].as_str(), canf[1].as_str()), ("exact", "winograd 2x2"));
        assert!(!slip.iter().any(|name| name.contains("winograd") || name.contains("tolerance")), "{slip:?}");
        for expected in ["steps 4 of 5", "steps 2 of 5"] {
            assert!(slip.iter().any(|name| name == expected), "{expected}: {slip:?}");
        }
        assert!(canf.iter().any(|name| name == "tolerance 0.01"), "{canf:?}");
        let mut sorted = canf.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!(sorted.len(), canf.len());
    }
}
