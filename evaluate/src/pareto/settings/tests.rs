//! Which settings a network has.

mod settings {
    use crate::pareto::settings::{mean_rate, settings};
    use crate::regression::engine::row_costs;
    use meissner_engine::Event;
    use meissner_models::{Description, Weights};
    use meissner_run::model::Model;

    fn shipped(name: &str) -> meissner_engine::Network {
        let weights = Weights::shipped(name).expect("shipped");
        Description::shipped(name).expect("shipped").network(&weights).expect("they fit")
    }

    #[test]
    fn the_first_setting_is_exact_and_names_are_different() {
        for name in ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"] {
            let names: Vec<String> =
                settings(&shipped(name), 1000.0, 0).into_iter().map(|setting| setting.name).collect();
            assert_eq!(names[0], "exact");
            let mut sorted = names.clone();
            sorted.sort();
            sorted.dedup();
            assert_eq!(sorted.len(), names.len(), "{names:?}");
        }
    }

    #[test]
    fn every_setting_makes_a_network() {
        let network = shipped("tactigraph");
        for setting in settings(&network, 1000.0, 0) {
            let adapted = setting.network(&network).expect("it fits");
            assert!(setting.name != "exact" || adapted.parts().span_us == network.parts().span_us);
            assert_eq!(row_costs(&adapted).len(), network.layers().len(), "{}", setting.name);
        }
    }

    #[test]
    fn settings_that_change_nothing_are_left_out() {
        let names = |name| settings(&shipped(name), 1000.0, 0).into_iter().map(|setting| setting.name);
        let of_past: Vec<String> = names("tactigraph-past").collect();
        assert!(
            !of_past.iter().any(|name| name.contains("tolerance")),
            "rows are computed once: {of_past:?}"
        );
        assert!(!of_past.iter().any(|name| name.contains("neighbours 8")), "it has 8: {of_past:?}");
        assert!(!names("digits-frozen").any(|name| name.contains("tolerance")), "its cells have no blocks");
        assert!(names("digits-past").any(|name| name.contains("tolerance")));
    }

    #[test]
    fn a_readout_that_is_never_stale_when_it_is_read_is_left_out() {
        let stale = |every_us| -> Vec<String> {
            let settings = settings(&shipped("force-graph"), 1000.0, every_us);
            settings.into_iter().map(|setting| setting.name).filter(|name| name.contains("stale")).collect()
        };
        assert_eq!(stale(10_000), ["stale 20 ms"]);
        assert!(stale(0).iter().any(|name| name == "stale 1 ms"));
    }

    #[test]
    fn costs_of_rows_are_those_that_inspect_lists() {
        for name in ["graphres", "tactigraph", "tactigraph-past", "digits-past", "force-graph"] {
            let (description, weights) = (Description::shipped(name), Weights::shipped(name));
            let (description, weights) = (description.expect("shipped"), weights.expect("shipped"));
            let model = Model::of(&description, (&weights, String::new()), false).expect("they fit");
            assert_eq!(row_costs(&model.network), model.multiply_adds, "{name}");
        }
    }

    #[test]
    fn fewer_neighbours_are_fewer_products() {
        let network = shipped("graphres");
        let few = network.clone().with_neighbours(2).expect("it has more");
        let (all, few) = (row_costs(&network), row_costs(&few));
        assert!(few[0] < all[0] && few.last() == all.last(), "{few:?} {all:?}");
    }

    #[test]
    fn a_rate_is_of_the_time_that_passes_within_streams() {
        let stream = |times: &[i64]| times.iter().map(|&t| Event::new(t, 0, 0, true)).collect::<Vec<_>>();
        let (a, b) = (stream(&[0, 500_000]), stream(&[7_000_000, 7_500_000]));
        assert_eq!(mean_rate(&[a, b]), 4.0);
        assert_eq!(mean_rate(&[stream(&[7])]), 0.0);
    }
}

mod frame_settings {
    use crate::pareto::settings::{FrameSetting, Thinning, common, notes};
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

mod frame_network {
    use crate::pareto::settings::FrameSetting;
    use crate::pareto::slip::settings;
    use meissner_models::{FrameDescription, Weights};

    #[test]
    fn settings_that_change_nothing_are_left_out() {
        let names = |name: &str| -> Vec<String> {
            let weights = Weights::shipped(name).expect("shipped");
            let parts = FrameDescription::shipped(name).expect("shipped").network_parts(&weights);
            settings(&parts.expect("they fit"), 5).into_iter().map(FrameSetting::name).collect()
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
