//! Files, cards and tensors of descriptions and weights.

mod bounded {
    use crate::ModelError;
    use crate::error::read;

    #[test]
    fn a_file_of_the_bound_is_read_and_one_byte_more_is_refused() {
        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = folder.path().join("file");
        std::fs::write(&path, [7; 100]).expect("a place to write to");
        assert_eq!(read(&path, 100).expect("as long as the bound"), [7; 100]);
        let error = read(&path, 99).expect_err("longer");
        assert!(matches!(error, ModelError::Large { limit: 99, found: 100, .. }), "{error}");
        assert!(matches!(read(&folder.path().join("none"), 99), Err(ModelError::Read { .. })));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_without_an_end_is_refused_at_the_bound() {
        let error = read("/dev/zero".as_ref(), 1000).expect_err("without an end");
        assert!(matches!(error, ModelError::Large { limit: 1000, found: 1001, .. }), "{error}");
    }
}

mod draw {
    use meissner_kernels::random::Random;

    use crate::draw::{hash, normal};

    #[test]
    fn the_hash_gives_its_published_value() {
        assert_eq!(hash("foobar"), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn normal_values_have_mean_0_and_variance_1() {
        let mut stream = Random::new(1);
        let values: Vec<f64> = (0..100_000).map(|_| normal(&mut stream)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.02, "mean {mean}, variance {variance}");
    }
}

mod shipped {
    use crate::{AnyDescription, Card, Weights};

    #[test]
    fn every_name_has_a_description_of_this_name_weights_and_a_card() {
        for name in AnyDescription::shipped_names() {
            assert_eq!(AnyDescription::shipped(name).expect("a description").name(), name);
            assert_eq!(Weights::shipped(name).expect("weights").card().ok(), Card::shipped(name));
        }
    }

    #[test]
    fn the_weights_of_every_network_of_quantities_state_the_ranges_of_the_training() {
        for name in AnyDescription::shipped_names() {
            let description = AnyDescription::shipped(name).expect("a description");
            let (outputs, units) = description.outputs();
            // Values of classes and of pixels have no range.
            let quantities = description.classes().is_none() && units[0] != "N/pixel";
            let ranges = Card::shipped(name).expect("a card").ranges;
            assert_eq!(ranges.map(|ranges| ranges.len()), quantities.then_some(outputs.len()), "{name}");
        }
    }

    #[test]
    fn the_weights_of_every_network_state_what_the_input_of_the_training_was_like() {
        for name in AnyDescription::shipped_names() {
            let card = Card::shipped(name).expect("a card");
            match AnyDescription::shipped(name).expect("a description") {
                AnyDescription::Events(_) => assert!(card.training_windows.is_some(), "{name}"),
                AnyDescription::Frames(of) => {
                    let frames = card.training_frames.expect(name);
                    assert!(frames.fits(of.input()), "{name}");
                    let weights = Weights::shipped(name).expect("shipped");
                    let parts = of.network_parts(&weights).expect("they fit");
                    assert_eq!(parts.training.as_ref(), Some(&frames), "{name}");
                }
            }
        }
    }
}

mod preparation {
    use std::collections::BTreeMap;

    use crate::description::preparation::{Agreement, KEY};
    use crate::{Description, FrameDescription, ModelError, Weights, draw, drawn_file};

    fn shipped(name: &str) -> Description {
        Description::shipped(name).expect("shipped")
    }

    fn prepared(description: &Description, preparation: &str) -> Weights {
        draw(description, 1).with_metadata([(KEY.to_owned(), preparation.to_owned())].into())
    }

    #[test]
    fn the_preparation_of_an_event_network_has_the_words_of_its_file() {
        assert_eq!(
            shipped("digits-past").preparation(),
            r#"{"kind":"knn","k":8,"candidates":"past","lifetime":"window","normalisation":"fixed","scales":[0.1,0.1176],"span_us":300000,"cells":[["1/8","1/8","1/3"]],"filters":[{"kind":"hot_pixel","period_us":10000,"burst":16}]}"#
        );
        assert_eq!(
            shipped("graphres-published").preparation(),
            r#"{"kind":"knn","k":16,"candidates":"all","normalisation":"per-graph","span_us":150000,"cells":[["16/346","12/260"]],"filters":[{"kind":"hot_pixel","period_us":10000,"burst":8}]}"#
        );
    }

    #[test]
    fn weights_of_other_graphs_are_refused_and_taken_only_where_that_is_asked_for() {
        let graphres = shipped("graphres");
        let own = graphres.preparation();
        assert!(graphres.network(&prepared(&graphres, &own)).is_ok());
        for (from, to) in [
            ("\"k\":16", "\"k\":8"),
            ("\"all\"", "\"past\""),
            ("\"fixed\"", "\"per-graph\""),
            ("[0.5,0.4]", "[0.5,0.5]"),
            ("150000", "100000"),
            ("16/346", "1/8"),
            ("\"k\":16,", ""),
            ("\"burst\":8", "\"burst\":9"),
            ("\"hot_pixel\"", "\"refractory\""),
            (",\"filters\":[{\"kind\":\"hot_pixel\",\"period_us\":10000,\"burst\":8}]", ""),
        ] {
            let found = own.replace(from, to);
            assert_ne!(found, own, "{from}");
            let weights = prepared(&graphres, &found);
            assert_eq!(graphres.agreement(&weights), Agreement::Other, "{found}");
            let error = graphres.network(&weights).expect_err(&found);
            assert!(matches!(&error, ModelError::Preparation { .. }), "{error}");
            assert!(error.to_string().contains(&found) && error.to_string().contains(&own), "{error}");
            assert!(graphres.network_ignoring_preparation(&weights).is_ok());
        }
    }

    #[test]
    fn weights_that_say_nothing_are_taken_and_the_agreement_tells() {
        let graphres = shipped("graphres");
        let silent = Weights::new(draw(&graphres, 1).iter().map(|(name, t)| (name.to_owned(), t.clone())));
        assert_eq!(graphres.agreement(&silent), Agreement::Unstated);
        assert!(graphres.network(&silent).is_ok());
        let drawn = Weights::from_bytes(&drawn_file(&graphres, 1)).expect("readable");
        assert_eq!(graphres.agreement(&drawn), Agreement::Drawn);
    }

    #[test]
    fn weights_without_a_lifetime_fit_both() {
        let (past, frozen) = (shipped("digits-past"), shipped("digits-frozen"));
        let without = past.preparation().replace("\"lifetime\":\"window\",", "");
        assert_eq!(past.agreement(&prepared(&past, &without)), Agreement::Same);
        assert_eq!(frozen.agreement(&prepared(&past, &without)), Agreement::Same);
        assert_eq!(frozen.agreement(&prepared(&past, &past.preparation())), Agreement::Other);
    }

    #[test]
    fn every_shipped_network_over_events_is_trained_on_its_own_graphs() {
        for name in Description::shipped_names() {
            let weights = Weights::shipped(name).expect("shipped");
            assert_eq!(shipped(name).agreement(&weights), Agreement::Same, "{name}");
            let card = weights.card().expect("a card");
            assert_eq!((card.trained, card.sensor.is_some()), (Some(true), true), "{name}");
        }
    }

    fn description(network: &str, scaling: &str) -> FrameDescription {
        let text = match network {
            "slip-lstm" => include_str!("../networks/slip-lstm.toml"),
            _ => include_str!("../networks/slip-tuned.toml"),
        };
        let from = if network == "slip-lstm" { "scaling = \"reading\"" } else { "scaling = \"image\"" };
        FrameDescription::parse(&text.replace(from, &format!("scaling = {scaling}"))).expect("consistent")
    }

    fn built(description: &FrameDescription, preparation: Option<&str>) -> Result<(), ModelError> {
        let metadata: BTreeMap<_, _> =
            preparation.iter().map(|text| (KEY.to_owned(), (*text).to_owned())).collect();
        description.network_parts(&draw(description, 1).with_metadata(metadata)).map(drop)
    }

    #[test]
    fn the_preparation_has_the_words_of_the_file() {
        let of = |network, scaling| description(network, scaling).preparation().expect("over readings");
        assert_eq!(
            of("slip-lstm", "\"reading\""),
            r#"{"frames":"electrodes","steps":5,"scaling":"reading"}"#
        );
        assert_eq!(
            of("slip-tuned", "[0, 3488.1]"),
            r#"{"frames":"tactile-image","steps":5,"scaling":[0.0,3488.1]}"#
        );
        assert_eq!(
            FrameDescription::shipped("force-lstm").expect("shipped").preparation().as_deref(),
            Some(r#"{"filters":[{"kind":"hot_pixel","period_us":10000,"burst":32}]}"#)
        );
        assert_eq!(FrameDescription::shipped("canf").expect("shipped").preparation(), None);
    }

    #[test]
    fn weights_that_say_the_same_or_nothing_fit() {
        let range = description("slip-tuned", "[0, 3488.1]");
        built(&range, None).unwrap();
        built(&range, range.preparation().as_deref()).unwrap();
        let other_words =
            r#"{ "sampling": 3, "scaling": [0, 3488.10], "steps": 5.0, "frames": "tactile-image" }"#;
        built(&range, Some(other_words)).unwrap();
    }

    #[test]
    fn a_preparation_of_two_scalings_is_read_back() {
        let text = include_str!("../networks/slip-lstm.toml")
            .replace("values = 24", "values = 48")
            .replace("scaling = \"reading\"", "scaling = [\"reading\", [1911, 3743.1]]");
        let both = FrameDescription::parse(&text).expect("consistent");
        let preparation = both.preparation().expect("over readings");
        let expected = r#"{"frames":"electrodes","steps":5,"scaling":["reading",[1911.0,3743.1]]}"#;
        assert_eq!(preparation, expected);
        built(&both, Some(&preparation)).unwrap();
        let other_words = preparation.replace("1911.0", "1911").replace("3743.1", "3743.10");
        built(&both, Some(&other_words)).unwrap();
        for scaling in [r#"["reading",[1911,3743]]"#, r#""reading""#, "[1911,3743.1]", r#"["reading"]"#] {
            let found = format!(r#"{{"frames":"electrodes","steps":5,"scaling":{scaling}}}"#);
            let error = built(&both, Some(&found)).expect_err(&found);
            assert!(matches!(error, ModelError::Preparation { .. }), "{error}");
        }
    }

    #[test]
    fn weights_that_were_trained_on_other_frames_are_refused_with_both() {
        let image = description("slip-tuned", "\"image\"");
        for found in [
            r#"{"frames":"electrodes","steps":5,"scaling":"image"}"#,
            r#"{"frames":"tactile-image","steps":4,"scaling":"image"}"#,
            r#"{"frames":"tactile-image","steps":5,"scaling":[0,3488]}"#,
            r#"{"frames":"tactile-image","steps":5}"#,
            r#"{"frames":"tactile-image","steps":5,"scaling":"image","order":"reversed"}"#,
            "image",
        ] {
            let error = built(&image, Some(found)).expect_err(found);
            assert!(matches!(error, ModelError::Preparation { .. }), "{error}");
            let message = error.to_string();
            let expected = image.preparation().expect("over readings");
            assert!(message.contains(&expected) && message.contains(found), "{message}");
        }
    }

    #[test]
    fn a_network_over_events_refuses_weights_for_readings() {
        let force = FrameDescription::shipped("force-tdnn").expect("shipped");
        let error = built(&force, Some("{}")).unwrap_err().to_string();
        assert!(error.contains("hot_pixel"), "{error}");
        let text = include_str!("../networks/force-tdnn.toml").split("[[filter]]\n").collect::<Vec<_>>();
        let (_, layers) = text[1].split_once("\n\n").expect("layers");
        let without = FrameDescription::parse(&format!("{}{layers}", text[0])).expect("consistent");
        let error = built(&without, Some("{}")).unwrap_err().to_string();
        assert!(error.contains("event-counts"), "{error}");
    }
}

mod tensors {
    use crate::description::tensors::{Listing, Tensors};
    use crate::{Tensor, Weights};

    #[test]
    fn batch_norm_is_folded_in_f64_and_rounded_once() {
        let value = |part: usize, channel: usize| 0.2 + 0.37 * part as f32 + 0.11 * channel as f32;
        let parts = ["weight", "bias", "running_mean", "running_var"];
        let weights = Weights::new(parts.iter().enumerate().map(|(part, name)| {
            let values = (0..8).map(|channel| value(part, channel)).collect();
            (format!("w.blocks.0.norm.{name}"), Tensor::new(vec![8], values).expect("eight values"))
        }));
        let mut needed = Listing::new("");
        needed.norm("blocks.0.norm", 8, 1.0);
        let needed = needed.needed();
        let mut tensors = Tensors::new("any", &needed, &weights).expect("one prefix");
        let (scale, shift) = tensors.norm("blocks.0.norm", 8).expect("all four tensors").rounded();
        let mut rounded_between = Vec::new();
        for channel in 0..8 {
            let [gamma, beta, mean, variance] = [0, 1, 2, 3].map(|part| value(part, channel));
            let exact = f64::from(gamma) / (f64::from(variance) + 1e-5).sqrt();
            assert_eq!(scale[channel], exact as f32);
            assert_eq!(shift[channel], (f64::from(beta) - f64::from(mean) * exact) as f32);
            rounded_between.push(beta - mean * (exact as f32));
        }
        assert_ne!(shift, rounded_between, "rounding in between gives other bits in some channel");
    }
}

mod card {
    use meissner_engine::frames::{FrameFeatures, TrainingFrames};
    use meissner_engine::{Sensor, TrainingWindows};

    use crate::weights::{frames_text, windows_text};
    use crate::{ModelError, Weights};

    fn saying(remarks: &[(&str, &str)]) -> Weights {
        let remarks = remarks.iter().map(|&(key, value)| (key.to_owned(), value.to_owned()));
        Weights::new([]).with_metadata(remarks.collect())
    }

    #[test]
    fn weights_say_whether_they_were_trained_and_on_what() {
        let card = saying(&[
            ("recipe", "10 epochs"),
            ("stride", "2"),
            ("sensor", "[34, 34]"),
            ("ranges", "[[-1, 0.5]]"),
        ]);
        let card = card.card().unwrap();
        assert_eq!((card.trained, card.stride, card.sensor), (Some(true), 2, Some(Sensor::new(34, 34))));
        assert_eq!(card.ranges, Some(vec![[-1.0, 0.5]]));
        let windows =
            TrainingWindows::from_parts(&[0.3; 9], (1..=9).map(|i| vec![0.1; i]).collect()).unwrap();
        let read = saying(&[("training_windows", &windows_text(&windows))])
            .card()
            .unwrap()
            .training_windows
            .unwrap();
        let unlike = |windows: &TrainingWindows| windows.unlikeness([Some(0.7); 9]);
        assert!((unlike(&read) / unlike(&windows) - 1.0).abs() < 1e-5);
        let factor = (1..=24).map(|i| vec![0.25; i]).collect();
        let frames = FrameFeatures::Values((0..48).step_by(2).collect());
        let frames = TrainingFrames::from_parts(frames, &[0.5; 24], factor).unwrap();
        let card_of = |text: &str| saying(&[("training_windows", text)]).card().unwrap();
        assert_eq!(card_of(&frames_text(&frames)).training_frames, Some(frames));
        let factor = (1..=19).map(|i| vec![0.25; i]).collect();
        let image = TrainingFrames::from_parts(FrameFeatures::Image, &[0.5; 19], factor).unwrap();
        let card = card_of(&frames_text(&image));
        assert_eq!((card.training_frames, card.training_windows), (Some(image), None));
        let of = |remarks: &[(&str, &str)]| saying(remarks).card().unwrap().trained;
        assert_eq!(of(&[("generator", "meissner_models::draw")]), Some(false));
        assert_eq!(of(&[("recipe", "none"), ("trained", "false")]), Some(false));
        assert_eq!(of(&[("about", "mine")]), None);
        let silent = saying(&[]).card().unwrap();
        assert_eq!((silent.trained, silent.stride, silent.sensor), (None, 1, None));
    }

    #[test]
    fn metadata_of_another_form_is_refused_with_its_key() {
        for (key, found) in [
            ("stride", "0"),
            ("stride", "two"),
            ("sensor", "34x34"),
            ("sensor", "[0, 3]"),
            ("trained", "yes"),
            ("ranges", "[1, 2]"),
            ("ranges", "[[2, 1]]"),
            ("training_windows", "[[1], [[2]]]"),
            ("training_windows", "[\"image\", [1], [[-2]]]"),
            ("training_windows", "[\"picture\", [1], [[2]]]"),
            ("training_windows", "[\"values\", [1], [[2]]]"),
            ("training_windows", "[\"image\", [1], [[2]], [0]]"),
            ("training_windows", "[\"values\", [1e999], [[2]], [0]]"),
        ] {
            let error = saying(&[(key, found)]).card().unwrap_err();
            assert!(matches!(&error, ModelError::Metadata { key: named, .. } if *named == key), "{error}");
            let shown = format!("{found:?}");
            assert!(error.to_string().contains(shown.trim_matches('"')), "{error}");
        }
    }
}

mod tensor {
    use safetensors::Dtype;

    use crate::weights::safetensors::float;

    #[test]
    fn a_value_past_the_end_is_none() {
        assert_eq!(float(Dtype::F32, &[0; 7], 1), None);
        assert_eq!(float(Dtype::F64, &[0; 8], usize::MAX / 4), None);
        assert_eq!(float(Dtype::BF16, &[0, 0, 0x80, 0x3f], 1), Some(1.0));
    }
}

mod safetensors {
    use safetensors::{Dtype, SafeTensors};

    use crate::weights::safetensors::TensorFile;

    fn file(order: [usize; 3]) -> Vec<u8> {
        let remark = [("of".to_owned(), "a \"test\"".to_owned())];
        let mut file = TensorFile::new(remark.into());
        for which in order {
            match which {
                0 => file.f32("a", &[1, 3], &[1.0, -2.0, 0.5]),
                1 => file.i64("b", &[2], &[-1, 1 << 40]),
                _ => file.f32("c", &[0, 4], &[]),
            }
        }
        file.into_bytes()
    }

    #[test]
    fn a_file_holds_what_was_added_whatever_the_order() {
        let bytes = file([0, 1, 2]);
        assert_eq!(bytes, file([2, 1, 0]));
        let read = SafeTensors::deserialize(&bytes).expect("a valid file");
        let integers = read.tensor("b").expect("there");
        assert_eq!((integers.dtype(), integers.shape()), (Dtype::I64, &[2][..]));
        assert_eq!(integers.data(), [(-1_i64).to_le_bytes(), (1_i64 << 40).to_le_bytes()].concat());
        assert_eq!(
            read.tensor("a").expect("there").data(),
            [1.0_f32, -2.0, 0.5].map(f32::to_le_bytes).concat()
        );
        assert_eq!(read.tensor("c").expect("there").shape(), [0, 4]);
        let (_, header) = SafeTensors::read_metadata(&bytes).expect("a valid header");
        assert_eq!(
            header.metadata().as_ref().and_then(|m| m.get("of")).map(String::as_str),
            Some("a \"test\"")
        );
    }

    #[test]
    fn arrays_start_at_multiples_of_their_values_size() {
        let bytes = file([0, 1, 2]);
        let start = 8 + u64::from_le_bytes(bytes[..8].try_into().expect("8 bytes")) as usize;
        assert!(start.is_multiple_of(8));
        assert_eq!(bytes[start..][..8], (-1_i64).to_le_bytes(), "the integers come first");
    }

    #[test]
    #[should_panic(expected = "bytes of shape")]
    fn an_array_has_as_many_values_as_its_shape() {
        TensorFile::default().f32("a", &[2, 2], &[0.0; 3]);
    }
}

mod names {
    use crate::weights::names::{ELEMENTS, SIBLINGS};
    use crate::weights::state_dict::KEYS;

    const PAGE: &str = include_str!("../../docs/weights-from-pytorch.md");

    /// Whether a line of the page has all `words`.
    fn has_line(words: &[&str]) -> bool {
        PAGE.lines().any(|line| words.iter().all(|word| line.contains(word)))
    }

    #[test]
    fn the_page_on_weights_has_every_habit_in_order_with_who_writes_it() {
        let mut after = 0;
        for (element, instead, who) in ELEMENTS {
            let instead = if instead.is_empty() { "| - |".to_owned() } else { format!("`{instead}`") };
            assert!(has_line(&[&format!("| `{element}`"), &instead, who]), "{element}");
            let place = PAGE.find(&format!("   | `{element}`")).expect("a row");
            assert!(place > after, "{element} stands before the one above it");
            after = place;
        }
        for (conv, norm, who) in SIBLINGS {
            assert!(has_line(&[&format!("| `{conv}"), &format!("`{norm}"), who]), "{conv}");
        }
        for (key, who) in KEYS {
            assert!(has_line(&[&format!("| `{key}` |"), who]), "{key}");
        }
    }
}
