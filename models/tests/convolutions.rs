//! Blocks whose convolution a description chooses.

use super::support;

use meissner_engine::GraphConvolution;
use meissner_kernels::pointnet_multiply_adds;
use meissner_models::{ConvolutionKind, Description, draw};
use support::{SMALL, changed, listed, only_of};

/// The first block of [`SMALL`] as a `PointNet` block, from line 10 on.
fn pointnet(more: &str) -> String {
    let block = format!("kind = \"block\"\nconv = \"pointnet\"\nchannels = 3\n{more}");
    changed("kind = \"spline\"\nchannels = 3\nkernel = 2\n", &block)
}

#[test]
fn a_block_with_a_convolution_is_a_layer_of_that_kind() {
    let long = SMALL.replace("kind = \"spline\"", "conv = \"spline\"\nkind = \"block\"");
    let (long, short) = (Description::parse(&long).unwrap(), Description::parse(SMALL).unwrap());
    assert_eq!(long.to_table(), short.to_table());
    let json = |description: &Description| {
        let mut json = serde_json::to_value(description.summary()).unwrap();
        json["layers"].as_array_mut().unwrap().iter_mut().for_each(|layer| layer["line"] = 0.into());
        json
    };
    assert_eq!(json(&long), json(&short));
    assert_eq!(json(&short)["layers"][0]["kind"], "spline");
    assert!(json(&short)["edge_attributes"]["offset"].is_null(), "no block reads offsets");
    let named = pointnet("").replace("kind = \"block\"\nconv = \"pointnet\"", "\nkind = \"pointnet\"");
    assert_eq!(Description::parse(&named).unwrap(), Description::parse(&pointnet("")).unwrap());
}

#[test]
fn a_pointnet_block_is_described_drawn_and_built() {
    let description = Description::parse(&pointnet("")).unwrap();
    let layer = &description.layers()[0];
    assert_eq!(layer.convolution(), Some(&ConvolutionKind::PointNet));
    assert_eq!((layer.cost.multiply_adds, layer.cost.in_edges), (pointnet_multiply_adds(1, 3, 4), Some(4)));
    assert_eq!(layer.parameters, 3 * (1 + 3) + 3 + 2 * 3);
    let tensors = description.tensors();
    assert_eq!(tensors[0], ("conv1.conv.weight".to_owned(), vec![3, 4]));
    assert_eq!(tensors[1], ("conv1.conv.bias".to_owned(), vec![3]));
    assert!(tensors.contains(&("conv1.norm.running_var".to_owned(), vec![3])));
    let weights = draw(&description, 1);
    let network = description.network(&weights).expect("drawn for it");
    let GraphConvolution::PointNet(conv) = &network.level(0).blocks[0].conv else {
        panic!("a PointNet block")
    };
    let drawn = weights.get("conv1.conv.weight").and_then(|tensor| tensor.values());
    assert_eq!(drawn, Some(&conv.parts().weight[..]));
}

#[test]
fn a_pointnet_block_is_shown_as_one_in_tables_pictures_and_data() {
    let description = Description::parse(&pointnet("norm = false\n")).unwrap();
    for text in [description.to_table(), description.to_dot(), description.to_svg()] {
        assert!(text.contains("pointnet no norm"), "{text}");
    }
    let json = serde_json::to_value(description.summary()).unwrap();
    let layer = &json["layers"][0];
    assert_eq!((&layer["kind"], &layer["norm"]), (&"pointnet".into(), &false.into()));
    assert!(json["edge_attributes"]["offset"].as_str().is_some_and(|text| text.contains("/ scale")));
    let tensor = &json["tensors"][0];
    assert_eq!(tensor["shape"], serde_json::json!([3, 4]));
    let page = include_str!("../../docs/weights-from-pytorch.md");
    assert!(page.contains(tensor["meaning"].as_str().unwrap()), "the page on weights has the meaning");
}

#[test]
fn what_is_wrong_with_a_block_is_told_with_layer_and_line() {
    let problem = |text: &str| only_of(&listed(&Description::parse(text).unwrap_err()));
    assert_eq!(
        problem(&pointnet("").replace("\"pointnet\"", "\"edge\"")),
        "line 13: layer \"conv1\": conv: expected \"spline\" or \"pointnet\", found \"edge\""
    );
    assert_eq!(
        problem(&pointnet("").replace("conv = \"pointnet\"\n", "")),
        "line 10: layer \"conv1\": missing key \"conv\": expected \"spline\" or \"pointnet\""
    );
    assert_eq!(
        problem(&pointnet("kernel = 2\n")),
        "line 15: layer \"conv1\": unknown key \"kernel\": expected one of channels, conv, from, kind, name, norm, skip, \
         weights"
    );
    assert_eq!(
        problem(&pointnet("skip = \"events\"\n")),
        "line 15: layer \"conv1\": skip \"events\": expected 3 channels, found 1"
    );
    let wide = pointnet("").replacen("channels = 3", "channels = 65536", 1);
    let wide = wide.replacen(
        "conv1\"\nkind",
        "conv0\"\nkind = \"spline\"\nchannels = 65536\nkernel = 1\n\n[[layer]]\nname = \"conv1\"\nkind",
        1,
    );
    assert!(
        Description::parse(&wide)
            .unwrap_err()
            .to_string()
            .contains("layer \"conv1\": channels: expected at most 67108864 weights, found 65539 x 65536")
    );
}
