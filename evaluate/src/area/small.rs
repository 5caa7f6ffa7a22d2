//! Small networks over pictures, for tests.

use std::path::{Path, PathBuf};

use meissner_models::TensorFile;

/// The description of a network `name` over differences of pictures of 32 x 24 pixels, divided by
/// `std`. An output of 1 is a force of `force_n` on a pixel, and a pixel is in contact above
/// `threshold_n`.
pub(crate) fn description(name: &str, std: f32, [force_n, threshold_n]: [f32; 2], layers: &str) -> String {
    format!(
        r#"
[network]
name = "{name}"
[input]
kind = "image"
channels = 3
height = 24
width = 32
frames = "picture"
difference = true
mean = [0.0, 0.0, 0.0]
std = [{std:?}, {std:?}, {std:?}]
force_mean = 0.0
force_std = {force_n:?}
pixel_mm = [0.6, 0.6]
threshold_n = {threshold_n:?}
{layers}
[output]
names = ["force"]
unit = "N per pixel"
"#
    )
}

/// Writes a network whose force on a pixel is `force_n` times the change of its red, as a share of
/// 255 levels. Returns its name for a request, and its weights.
pub(crate) fn red(folder: &Path, forces_n: [f32; 2]) -> (Vec<String>, PathBuf) {
    let head = "[[layer]]\nname = \"head\"\nkind = \"conv\"\nchannels = 1\nkernel = 1";
    let [network, weights] = ["red.toml", "red.safetensors"].map(|name| folder.join(name));
    std::fs::write(&network, description("red", 1.0, forces_n, head)).expect("it can be written");
    let mut file = TensorFile::new([("seed".to_owned(), "3".to_owned())].into());
    file.f32("head.weight", &[1, 3, 1, 1], &[1.0, 0.0, 0.0]);
    file.f32("head.bias", &[1], &[0.0]);
    std::fs::write(&weights, file.into_bytes()).expect("it can be written");
    (vec![network.display().to_string()], weights)
}
