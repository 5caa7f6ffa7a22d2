//! The content of a consistent description, and the networks that it makes.

use super::support;

use meissner_engine::{
    Aggregation, Candidates, Lifetime, Network, NetworkParts, Normalisation, Position, Reach,
};
use meissner_models::description::frames::FrameKind;
use meissner_models::description::{CostUnit, FieldStart};
use meissner_models::{ConvolutionKind, Description, Layer, LayerKind, Weights, draw};
use support::{SMALL, changed, shipped};

fn layer<'a>(description: &'a Description, name: &str) -> &'a Layer {
    description.layers().iter().find(|layer| layer.name == name).expect("a layer of this name")
}

#[test]
fn every_shipped_network_has_its_name() {
    for name in Description::shipped_names() {
        let (description, network) = shipped(name);
        assert_eq!((description.name(), network.name()), (*name, *name));
    }
}

#[test]
fn networks_for_digits_give_a_logit_for_each_over_three_saccades() {
    for name in ["digits-all", "digits-past", "digits-frozen"] {
        let (description, network) = shipped(name);
        let (names, units) = description.outputs();
        assert_eq!((names.len(), units, network.outputs()), (10, &["logit"; 10].map(str::to_owned)[..], 10));
        assert!((0..10).all(|digit| names[digit] == digit.to_string()));
        assert_eq!(network.parts().span_us, 300_000);
    }
}

#[test]
fn networks_for_touch_give_a_logit_for_each_class_and_have_a_cell_for_each_taxel_and_40_ms() {
    for (name, classes, cells) in
        [("touch-containers", 20, 125), ("touch-letters", 27, 100), ("touch-objects", 36, 125)]
    {
        let (description, network) = shipped(name);
        let (names, units) = description.outputs();
        assert_eq!((names.len(), network.outputs()), (classes, classes));
        assert!(units.iter().all(|unit| unit == "logit"));
        assert!(classes == 27 || (0..classes).all(|class| names[class] == class.to_string()));
        assert_eq!((network.parts().span_us, network.readout_times()), (40_000 * cells, cells as usize + 1));
    }
}

#[test]
fn networks_for_the_tactip_give_depth_and_tilts_of_cells_of_four_pixels() {
    for name in ["tactip", "tactip-past", "tactip-shear"] {
        let (description, network) = shipped(name);
        assert_eq!(description.labelled_outputs(), "depth (mm), tilt_x (deg), tilt_y (deg)");
        let place = network.parts().place.expect("places are inputs");
        assert_eq!(place.map(|size| size.to_string()), ["1/32", "1/32"]);
        assert_eq!((network.outputs(), network.readout_times(), network.readout_channels()), (3, 1, 16));
    }
}

#[test]
fn the_network_for_force_gives_newtons_over_a_window_longer_than_a_grasp() {
    let (description, network) = shipped("force-graph");
    assert_eq!(description.labelled_outputs(), "force (N)");
    let place = network.parts().place.expect("places are inputs");
    assert_eq!(place.map(|size| size.to_string()), ["1/12", "1/12"]);
    assert_eq!((network.outputs(), network.parts().span_us, network.readout_channels()), (1, 500_000, 16));
}

#[test]
fn every_other_shipped_network_predicts_roll_and_pitch_in_rad() {
    let other =
        |name: &&&str| ["digits-", "touch-", "tactip", "force-"].iter().any(|start| name.starts_with(start));
    for name in Description::shipped_names().iter().filter(|name| !other(name)) {
        let (description, network) = shipped(name);
        let (names, units) = description.outputs();
        assert_eq!((names.len(), units.len(), network.outputs()), (2, 2, 2));
        assert_eq!(
            (names, units),
            (&["roll", "pitch"].map(str::to_owned)[..], &["rad", "rad"].map(str::to_owned)[..])
        );
        assert_eq!((network.parts().span_us, network.parts().capacity), (150_000, 32_768));
    }
    assert!(Description::shipped("graphress").is_none());
    assert!(Weights::shipped("graphress").is_none());
}

#[test]
fn graphres_is_the_published_network_on_fixed_scales() {
    let (description, network) = shipped("graphres");
    let parts = network.parts();
    assert_eq!(parts.graph.reach, Reach::Knn { k: 16 });
    assert_eq!(parts.graph.candidates, Candidates::All);
    assert_eq!(parts.normalisation, Normalisation::Fixed);
    assert_eq!((parts.events.scale, parts.pooled[0].1.scale), (0.5, 0.4));
    assert_eq!(network.channels(0), [1, 8, 16, 16, 16, 32]);
    assert_eq!(network.channels(1), [32, 32, 32]);
    let skips: Vec<Option<usize>> = parts.events.blocks.iter().map(|b| b.skip).collect();
    assert_eq!(skips, [None, None, None, Some(2), None]);
    assert_eq!(parts.pooled[0].1.blocks[1].skip, Some(0));
    assert_eq!(parts.pooled[0].0.cell.map(|c| c.to_string()), ["16/346", "12/260"]);
    assert_eq!(parts.pooled[0].0.position, Position::Mean);
    // The published file has 27,296 values, of which 304 are running statistics.
    assert_eq!((description.parameters(), description.summary().values), (26_992, 27_296));
}

#[test]
fn graphres_published_has_the_same_tensors_and_its_own_normalisation() {
    let (fixed, published) = (shipped("graphres"), shipped("graphres-published"));
    assert_eq!(fixed.0.tensors(), published.0.tensors());
    assert_eq!(published.1.parts().normalisation, Normalisation::PerGraph);
}

#[test]
fn tactigraph_has_ten_blocks_on_three_levels_a_hidden_layer_and_69794_parameters() {
    let (description, network) = shipped("tactigraph");
    assert_eq!(network.channels(0), [1, 8, 8, 16, 16]);
    assert_eq!(network.channels(1), [16, 16, 16, 32]);
    assert_eq!(network.channels(2), [32, 32, 32, 32]);
    let skip =
        |level: usize| -> Vec<Option<usize>> { network.level(level).blocks.iter().map(|b| b.skip).collect() };
    assert_eq!(skip(0), [None, None, None, Some(3)]);
    assert_eq!(skip(1), [None, Some(0), None]);
    assert_eq!(skip(2), [None, None, Some(0)]);
    assert!((0..3).all(|level| network.level(level).scale == 0.5));
    assert_eq!(description.parameters(), 69_794);
}

#[test]
fn tactigraph_past_is_frozen_has_no_pooled_level_and_sums() {
    let (_, network) = shipped("tactigraph-past");
    assert_eq!(network.parts().graph.candidates, Candidates::Past(Lifetime::Frozen));
    assert_eq!(network.parts().graph.reach, Reach::Knn { k: 8 });
    assert_eq!(network.levels(), 1);
    assert_eq!(network.parts().readout.aggregation, Aggregation::Sum);
}

#[test]
fn layers_are_ordered_by_who_reads_whom_whatever_their_order_in_the_file() {
    let (head, rest) = SMALL.split_once("[[layer]]").expect("layers");
    let (layers, output) = rest.split_once("[output]").expect("an output");
    let from =
        [("conv1", "events"), ("pool1", "conv1"), ("conv2", "pool1"), ("grid", "conv2"), ("fc", "grid")];
    let mut tables: Vec<String> = layers
        .split("[[layer]]")
        .zip(from)
        .map(|(table, (_, from))| format!("[[layer]]{}\nfrom = \"{from}\"\n\n", table.trim_end()))
        .collect();
    let names = |text: &str| -> Vec<String> {
        let description = Description::parse(text).expect("consistent");
        description.layers().iter().map(|layer| layer.name.clone()).collect()
    };
    for _ in 0..tables.len() {
        tables.rotate_left(1);
        let text = format!("{head}{}[output]{output}", tables.concat());
        assert_eq!(names(&text), from.map(|(name, _)| name));
    }
}

#[test]
fn branches_that_could_come_in_any_order_keep_that_of_the_file() {
    let branches = |first: &str, second: &str| {
        let branch = |name: &str| {
            format!(
                "[[layer]]\nname = \"{name}\"\nkind = \"spline\"\nchannels = 3\nkernel = 2\nfrom = \"conv1\"\n\n"
            )
        };
        let join = "[[layer]]\nname = \"join\"\nkind = \"spline\"\nchannels = 3\nkernel = 2\nfrom = \"b\"\nskip = \"a\"\n\n";
        changed(
            "[[layer]]\nname = \"pool1\"",
            &format!("{}{}{join}[[layer]]\nname = \"pool1\"", branch(first), branch(second)),
        )
    };
    for (first, second) in [("a", "b"), ("b", "a")] {
        let description = Description::parse(&branches(first, second)).expect("consistent");
        let names: Vec<&str> = description.layers().iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names[..5], ["conv1", first, second, "join", "pool1"]);
        let network = description.network(&draw(&description, 1)).expect("drawn for it");
        let blocks = &network.parts().events.blocks;
        assert_eq!((blocks[1].input, blocks[2].input), (1, 1));
        let place = |name: &str| 2 + usize::from(name == second);
        assert_eq!((blocks[3].input, blocks[3].skip), (place("b"), Some(place("a"))));
    }
}

#[test]
fn poolings_chain_without_blocks_between_them() {
    let text = changed(
        "name = \"pool1\"\nkind",
        "name = \"pool0\"\nkind = \"pool\"\ncell = [\"1/16\", \"1/12\"]\ntime = \"1/3\"\nposition = \"centre\"\nscale = 0.1\n\n[[layer]]\nname = \"pool1\"\ntime = \"2/3\"\nkind",
    );
    let description = Description::parse(&text).expect("consistent");
    assert_eq!(description.levels(), 3);
    let network = description.network(&draw(&description, 1)).expect("drawn for it");
    assert_eq!(network.parts().pooled[0].0.time.map(|t| t.to_string()).as_deref(), Some("1/3"));
    assert_eq!(network.parts().pooled[0].0.position, Position::Centre);
    assert_eq!(
        layer(&description, "conv2").cost.in_edges,
        Some(26),
        "a cell in time and space touches 26 others"
    );
}

#[test]
fn a_kernel_of_two_sizes_leaves_time_out() {
    let description = Description::parse(SMALL).expect("consistent");
    let Some(&ConvolutionKind::Spline { kernel, .. }) = layer(&description, "conv2").convolution() else {
        panic!("a spline")
    };
    assert_eq!(kernel, [2, 3, 1]);
    let tensors: Vec<(String, Vec<usize>)> = description.tensors();
    assert!(tensors.contains(&("conv2.conv.weight".to_owned(), vec![6, 3, 3])));
    assert!(tensors.contains(&("conv2.conv.lin.weight".to_owned(), vec![3, 3])));
    assert!(tensors.contains(&("conv2.conv.bias".to_owned(), vec![3])));
}

#[test]
fn multiply_adds_are_those_that_the_kernels_count() {
    for name in Description::shipped_names() {
        let (description, network) = shipped(name);
        for level in 0..network.levels() {
            for block in &network.level(level).blocks {
                let cost = layer(&description, &block.name).cost;
                let edges = cost.in_edges.expect("a spline block has in-edges");
                assert_eq!(edges, if level == 0 { network.parts().graph.reach.most() } else { 8 });
                assert_eq!((cost.multiply_adds, cost.per), (block.conv.multiply_adds(edges), CostUnit::Row));
            }
        }
    }
    let description = Description::parse(SMALL).expect("consistent");
    let network = description.network(&draw(&description, 1)).expect("drawn for it");
    let block = &network.level(1).blocks[0];
    assert_eq!(layer(&description, "conv2").cost.multiply_adds, block.conv.multiply_adds(8));
}

#[test]
fn receptive_fields_count_hops_on_each_level_down_to_the_events() {
    let description = Description::shipped("tactigraph").expect("shipped");
    let hops = |name: &str| -> Vec<usize> {
        layer(&description, name).field.steps.iter().map(|step| step.hops).collect()
    };
    assert_eq!(hops("conv1"), [1]);
    assert_eq!(hops("conv4"), [4]);
    assert_eq!(hops("pool1"), [0, 4]);
    assert_eq!(hops("conv6"), [2, 4]);
    assert_eq!(hops("conv10"), [3, 3, 4]);
    let field = |name: &str| layer(&description, name).field.to_string();
    assert_eq!(field("conv4"), "4 hops of events");
    assert_eq!(field("pool1"), "one 8/346 x 6/260 cell, 4 hops of events");
    assert_eq!(field("conv6"), "2 hops of 8/346 x 6/260 cells, 4 hops of events");
    assert_eq!(
        field("grid"),
        "1/4 x 1/4 of the image, 3 hops of 16/346 x 12/260 cells, 3 hops of 8/346 x 6/260 cells, 4 hops of events"
    );
    assert_eq!(layer(&description, "fc").field.from, FieldStart::Window);
}

#[test]
fn the_table_the_data_and_the_pictures_name_every_layer() {
    for name in Description::shipped_names() {
        let (description, _) = shipped(name);
        let json = serde_json::to_value(description.summary()).expect("data");
        assert_eq!(json["layers"].as_array().map(Vec::len), Some(description.layers().len()));
        assert_eq!(json["parameters"], description.parameters());
        let texts = [description.to_table(), description.to_dot(), description.to_svg(), json.to_string()];
        for layer in description.layers() {
            assert!(texts.iter().all(|text| text.contains(&layer.name)), "{}", layer.name);
        }
        assert!(texts[1].starts_with("digraph") && texts[1].trim_end().ends_with('}'));
        let skips = |l: &&Layer| matches!(l.kind, LayerKind::Block { skip: Some(_), .. });
        let joins = description.head().iter().filter(|l| matches!(l.kind, FrameKind::Concat { .. })).count();
        let seconds = description.layers().iter().filter(skips).count() + joins;
        assert_eq!(texts[1].matches("style = dashed").count(), seconds);
        assert_eq!(texts[2].matches("stroke-dasharray").count(), seconds);
    }
}

#[test]
fn large_numbers_in_the_pictures_have_commas() {
    let svg = shipped("tactigraph-past").0.to_svg();
    assert!(
        svg.contains("16 \u{2192} 6,912") && svg.contains("6,912 \u{2192} 32, 221,216 parameters"),
        "{svg}"
    );
}

#[test]
fn names_are_escaped_in_the_pictures() {
    let name = r#"a<b>&"c""#;
    let text = SMALL.replace("\"conv1\"", &format!("'{name}'"));
    let description = Description::parse(&text).expect("consistent");
    assert!(description.to_svg().contains("a&lt;b&gt;&amp;&quot;c&quot;"));
    assert!(!description.to_svg().contains("a<b>"));
    assert!(description.to_dot().contains(r#""a<b>&\"c\"" -> "pool1""#));
}

#[test]
fn the_place_in_a_cell_adds_two_inputs_and_belongs_to_the_preparation() {
    let text = changed("[network]\n", "[network]\nplace = [\"1/9\", \"2/7\"]\n");
    let description = Description::parse(&text).expect("consistent");
    assert_eq!((description.inputs(), Description::parse(SMALL).expect("consistent").inputs()), (3, 1));
    let needed = |description: &Description| {
        let tensors = description.tensors();
        tensors
            .into_iter()
            .find(|(name, _)| name == "conv1.conv.weight")
            .expect("the first block has a weight")
            .1
    };
    assert_eq!(needed(&description)[1], 3);
    let network = description.network(&draw(&description, 7)).expect("weights of these shapes");
    let cell = network.parts().place.expect("places are inputs").map(|size| size.to_string());
    assert_eq!(cell, ["1/9", "2/7"]);
    assert!(
        description.preparation().ends_with(",\"place\":[\"1/9\",\"2/7\"]}"),
        "{}",
        description.preparation()
    );
    assert!(description.to_table().contains("place in a cell of 1/9 x 2/7"), "{}", description.to_table());
    let without = Description::parse(SMALL).expect("consistent");
    let drawn = |place| Network::new(NetworkParts { place, ..network.parts().clone() });
    assert!(drawn(network.parts().place).is_ok() && drawn(None).is_err(), "the block reads three channels");
    assert_ne!(without.preparation(), description.preparation());
}
