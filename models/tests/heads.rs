//! Networks over events whose readout a frame network reads.

use super::support;

use meissner_engine::frames::FrameShape;
use meissner_engine::{Engine, Event, Sensor};
use meissner_models::{AnyDescription, Description, ModelError, Tensor, Weights, draw};
use support::{changed_head, with_head};

fn parse(text: &str) -> Description {
    Description::parse(text).unwrap_or_else(|error| panic!("{error}"))
}

/// [`with_head`] with two separate cells in time; a window fills three.
fn by_time() -> String {
    changed_head("grid = [2, 2]", "grid = [2, 4]\nby_time = true")
        .replace("cell = [\"1/8\", \"1/6\"]", "cell = [\"1/8\", \"1/6\"]\ntime = \"1/2\"")
}

#[test]
fn a_head_reads_an_image_of_columns_rows_and_a_channel_for_each_channel_and_age() {
    let description = parse(&by_time());
    let [image, halved, flat, fc] = description.head() else { panic!("four layers") };
    let shape = |channels, height, width| FrameShape::Image { channels, height, width };
    assert_eq!((image.input, image.output), (shape(9, 4, 2), shape(2, 4, 2)));
    assert_eq!(
        (halved.output, flat.output, fc.output),
        (shape(2, 2, 1), FrameShape::Vector(4), FrameShape::Vector(1))
    );
    assert_eq!(image.from, "grid");
    assert_eq!(image.multiply_adds, 9 * 9 * 2 * 8);
    let network = description.network(&draw(&description, 1)).expect("drawn for it");
    let head = network.parts().head.as_ref().expect("a head");
    assert_eq!((head.input(), network.outputs()), (shape(9, 4, 2), 1));
    assert_eq!(head.layers().collect::<Vec<_>>(), ["image", "halved", "flat", "fc"]);
    assert!(network.parts().dense.is_empty());
}

#[test]
fn the_tensors_of_the_head_stand_behind_those_of_the_layers() {
    let description = parse(&with_head());
    let tensors = description.tensors();
    let of_head: Vec<(&str, &[usize])> =
        tensors.iter().map(|(name, shape)| (name.as_str(), &shape[..])).skip(tensors.len() - 8).collect();
    let expected: [(&str, &[usize]); 8] = [
        ("image.weight", &[2, 3, 3, 3]),
        ("image.bias", &[2]),
        ("norm1.weight", &[2]),
        ("norm1.bias", &[2]),
        ("norm1.running_mean", &[2]),
        ("norm1.running_var", &[2]),
        ("fc.weight", &[1, 2]),
        ("fc.bias", &[1]),
    ];
    assert_eq!(of_head, expected);
    let of_layers: usize = description.layers().iter().map(|layer| layer.parameters).sum();
    assert_eq!(description.parameters(), of_layers + 2 * 27 + 2 + 2 * 2 + 2 + 1);
    let drawn = draw(&description, 1);
    assert_eq!(drawn.names().count(), tensors.len());
    assert_eq!(description.unused_tensors(&drawn).expect("no prefix"), Vec::<String>::new());
}

#[test]
fn every_tensor_of_layers_and_head_that_does_not_fit_is_reported() {
    let description = parse(&with_head());
    let drawn = draw(&description, 1);
    let kept =
        drawn.iter().filter(|(name, _)| !["conv1.conv.weight", "image.bias", "fc.bias"].contains(name));
    let weights = Weights::new(kept.map(|(name, tensor)| (name.to_owned(), tensor.clone())));
    let error = description.network(&weights).expect_err("three tensors are missing");
    let ModelError::Weights { problems, .. } = &error else { panic!("{error}") };
    let names: Vec<&str> = problems.iter().map(|problem| problem.tensor.as_str()).collect();
    assert_eq!(names, ["conv1.conv.weight", "image.bias", "fc.bias"], "{error}");
}

#[test]
fn a_head_that_flattens_predicts_what_a_dense_layer_over_the_readout_predicts() {
    let head = "[[head]]\nname = \"flat\"\nkind = \"flatten\"\n\n[[head]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n";
    let text = by_time();
    let (start, end) = (text.find("[[head]]").expect("there"), text.find("[output]").expect("there"));
    let with = |tables: &str| parse(&format!("{}{tables}\n{}", &text[..start], &text[end..]));
    let (image, vector) = (with(head), with("[[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n"));
    let drawn = draw(&vector, 3);
    // A dense layer reads cell after cell, the oldest last; an image is read channel after channel.
    let (channels, cells, times) = (3, 8, 3);
    let weights = Weights::new(drawn.iter().map(|(name, tensor)| {
        let mut tensor = tensor.clone();
        if name == "fc.weight" {
            let read = tensor.values().expect("floats");
            let place = |i: usize| {
                let (age, c, cell) = (i / (channels * cells), i / cells % channels, i % cells);
                (age * cells + cell) * channels + c
            };
            let values = (0..times * channels * cells).map(|i| read[place(i)]).collect();
            tensor = Tensor::new(vec![1, times * channels * cells], values).expect("as many");
        }
        (name.to_owned(), tensor)
    }));
    let predict = |description: &Description, weights: &Weights| {
        let network = description.network(weights).expect("weights of it");
        let mut engine = Engine::new(network, Sensor { width: 16, height: 12 }).expect("it runs");
        for i in 0..200_u16 {
            let event = Event { x: i * 7 % 16, y: i * 5 % 12, t_us: i64::from(i) * 900, on: i % 3 == 0 };
            engine.push(event);
        }
        f64::from(engine.predict().expect("finite").values[0])
    };
    let (image, vector) = (predict(&image, &weights), predict(&vector, &drawn));
    assert!(vector.abs() > 1e-3 && (image - vector).abs() < 1e-5 * vector.abs().max(1.0), "{image} {vector}");
}

#[test]
fn the_table_the_data_and_the_pictures_name_every_layer_of_the_head() {
    let description = AnyDescription::parse(&with_head()).expect("consistent");
    let AnyDescription::Events(events) = &description else { panic!("a network over events") };
    let json = serde_json::to_value(description.summary()).expect("data");
    assert_eq!(json["head"].as_array().map(Vec::len), Some(events.head().len()));
    assert_eq!(json["head"][0]["input"], serde_json::json!([3, 2, 2]));
    assert_eq!(json["parameters"], events.parameters());
    let table = description.to_table();
    // A line in each part of the table.
    let lines =
        |name: &str| table.lines().filter(|line| line.starts_with(name)).collect::<Vec<_>>().join("\n");
    for words in ["conv 3x3 norm relu", "grid", "3 x 2 x 2 -> 2 x 2 x 2", "216 a prediction", "the window"] {
        assert!(lines("image").contains(words), "{table}");
    }
    assert!(table.contains("a prediction through the head: 218 multiply-adds"), "{table}");
    let (dot, svg) = (description.to_dot(), description.to_svg());
    assert!(dot.contains("\"grid\" -> \"image\"") && dot.contains("\"flat\" -> \"fc\""), "{dot}");
    for layer in events.head() {
        assert!(svg.contains(&format!(">{}<", layer.name)), "{svg}");
    }
    assert!(svg.contains("3 x 2 x 2 \u{2192} 2 x 2 x 2, 60 parameters"), "{svg}");
}

#[test]
fn the_networks_for_digits_read_an_image_of_8_x_8_cells_of_64_channels() {
    for name in ["digits-all", "digits-past", "digits-frozen"] {
        let path = format!("{}/networks/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let description = Description::load(path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(description.name(), name);
        let network = description.network(&draw(&description, 1)).expect("drawn for it");
        let head = network.parts().head.as_ref().expect("a head");
        assert_eq!(head.input(), FrameShape::Image { channels: 64, height: 8, width: 8 });
        assert_eq!((network.outputs(), description.tensors().len()), (10, 32));
    }
}
