//! The settings of frame networks: which approximations, and their names.
//!
//! Enters: the parts of a network. Leaves: the settings that change it; each study adds those of
//! its frames.

use meissner_engine::frames::{
    Convolution, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions, Skip,
};
use meissner_kernels::WinogradTile;

use super::measurement::EXACT;

/// A frame network with some approximations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FrameSetting {
    pub(super) convolution: Convolution,
    pub(super) tolerance: Option<f32>,
    pub(super) thinning: Thinning,
}

/// Frames that the network does not see.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Thinning {
    #[default]
    None,
    /// All but the last `kept` of the `of` readings of a window.
    Last { kept: usize, of: usize },
    /// Every second frame; the answer to the one before stands for it.
    EverySecond,
}

/// The exact setting, Winograd's convolutions, and `tolerances`, as far as they change a network of
/// `parts`.
pub(super) fn common(parts: &FrameNetworkParts, tolerances: &[f32]) -> Vec<FrameSetting> {
    let exact = FrameSetting::default();
    let mut settings = vec![exact];
    if has_winograd(parts) {
        let tiles = [WinogradTile::Two, WinogradTile::Four];
        settings.extend(tiles.map(|tile| FrameSetting { convolution: Convolution::Winograd(tile), ..exact }));
    }
    if has_pixels_to_keep(parts) {
        settings.extend(tolerances.iter().map(|&of| FrameSetting { tolerance: Some(of), ..exact }));
    }
    settings
}

/// What cannot be approximated in the network `name` of `parts`, for people.
pub(super) fn notes(name: &str, parts: &FrameNetworkParts) -> Vec<String> {
    let mut notes = Vec::new();
    let is_3x3 = |layer: &FrameLayer| matches!(layer.kind, FrameLayerKind::Conv { kernel: 3, .. });
    if !parts.layers.iter().any(is_3x3) {
        notes.push(format!("{name}: no 3 x 3 convolution outside recurrent layers, so none by Winograd"));
    } else if !has_winograd(parts) {
        notes.push(format!(
            "{name}: convolutions of few channels, which Winograd's algorithm does not compute"
        ));
    }
    if !has_pixels_to_keep(parts) {
        notes.push(format!("{name}: no pixel that a tolerance could keep, so none with one"));
    }
    notes
}

/// Whether Winograd's algorithm computes any convolution.
pub(super) fn has_winograd(parts: &FrameNetworkParts) -> bool {
    let network = FrameNetwork::new(parts.clone(), Convolution::Winograd(WinogradTile::Two));
    network.is_ok_and(|network| network.has_winograd())
}

/// Whether a tolerance can keep any pixel: recurrent layers couple all pixels, and vectors have
/// none.
pub(super) fn has_pixels_to_keep(parts: &FrameNetworkParts) -> bool {
    use FrameLayerKind as Kind;
    let keeps = |kind: &Kind| {
        matches!(kind, Kind::Conv { .. } | Kind::UpConv { .. } | Kind::MaxPool | Kind::AveragePool { .. })
    };
    parts.layers.iter().any(|layer| keeps(&layer.kind))
}

impl FrameSetting {
    pub(super) fn name(self) -> String {
        let mut names = Vec::new();
        match self.convolution {
            Convolution::Direct => {}
            Convolution::Winograd(WinogradTile::Two) => names.push("winograd 2x2".to_owned()),
            Convolution::Winograd(WinogradTile::Four) => names.push("winograd 4x4".to_owned()),
            Convolution::Kn2row => names.push("kn2row".to_owned()),
        }
        match self.thinning {
            Thinning::None => {}
            Thinning::Last { kept, of } => names.push(format!("steps {kept} of {of}")),
            Thinning::EverySecond => names.push("every 2nd frame".to_owned()),
        }
        names.extend(self.tolerance.map(|tolerance| format!("tolerance {tolerance}")));
        if names.is_empty() { EXACT.to_owned() } else { names.join(" + ") }
    }

    /// The names of `settings` with their indices.
    pub(super) fn names(settings: &[Self]) -> Vec<(usize, String)> {
        settings.iter().map(|setting| setting.name()).enumerate().collect()
    }

    pub(super) fn options(self) -> FrameOptions {
        FrameOptions::new().with_skip(self.tolerance.map_or(Skip::Exact, Skip::Tolerance))
    }

    /// Of so many frames the network sees the first.
    pub(super) fn every(self) -> usize {
        if self.thinning == Thinning::EverySecond { 2 } else { 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::{FrameSetting, Thinning, common, notes};
    use meissner_engine::frames::FrameNetworkParts;
    use meissner_models::{FrameDescription, Weights};

    fn parts(name: &str) -> FrameNetworkParts {
        let weights = Weights::shipped(name).expect("shipped");
        FrameDescription::shipped(name).expect("shipped").network_parts(&weights).expect("they fit")
    }

    #[test]
    fn what_changes_nothing_is_left_out_and_said() {
        let names = |name: &str| -> Vec<String> {
            common(&parts(name), &[0.01, 0.1]).into_iter().map(FrameSetting::name).collect()
        };
        let all = ["exact", "winograd 2x2", "winograd 4x4", "tolerance 0.01", "tolerance 0.1"];
        assert_eq!(names("canf"), all);
        assert_eq!(notes("canf", &parts("canf")), [""; 0]);
        for coupled in ["force-tdnn", "force-convlstm", "slip-lstm"] {
            assert_eq!(names(coupled), ["exact"], "{coupled}");
            assert_eq!(notes(coupled, &parts(coupled)).len(), 2, "{coupled}");
        }
        // Three channels are convolved plane by plane.
        assert_eq!(names("force-cnnlstm"), ["exact", "tolerance 0.01", "tolerance 0.1"]);
        let [note] = &notes("force-cnnlstm", &parts("force-cnnlstm"))[..] else { panic!("one note") };
        assert!(note.contains("convolutions of few channels"), "{note}");
    }

    #[test]
    fn names_say_each_approximation() {
        let setting =
            FrameSetting { tolerance: Some(0.05), thinning: Thinning::EverySecond, ..Default::default() };
        assert_eq!((setting.name(), setting.every()), ("every 2nd frame + tolerance 0.05".to_owned(), 2));
        let thinning = Thinning::Last { kept: 3, of: 5 };
        assert_eq!(FrameSetting { thinning, ..Default::default() }.name(), "steps 3 of 5");
        assert_eq!(FrameSetting::default().every(), 1);
    }
}
