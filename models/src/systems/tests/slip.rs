//! Slip and digits: windows, decisions, objects.

mod digits {
    use crate::systems::digits::trained_as;

    #[test]
    fn the_frozen_network_is_the_one_over_the_past() {
        assert_eq!(
            ["digits-frozen", "digits-past", "own"].map(trained_as),
            ["digits-past", "digits-past", "own"]
        );
    }
}

mod decision {
    use proptest::prelude::*;

    use crate::systems::slip::{Decision, DecisionError, DecisionFilter};

    /// Class and number of windows held after each window.
    fn decisions(hold: u32, least: f32, windows: &[(usize, f32)]) -> Vec<Option<(usize, u64)>> {
        let mut filter = DecisionFilter::new(hold, least).unwrap();
        let decision = |&(class, probability): &(usize, f32)| filter.push(class, probability);
        windows.iter().map(decision).map(|d| d.map(|Decision { class, held }| (class, held))).collect()
    }

    #[test]
    fn with_a_hold_of_1_every_window_decides() {
        let windows = [(4, 0.2), (4, 0.9), (1, 0.3), (4, 0.3)];
        assert_eq!(decisions(1, 0.0, &windows), [(4, 1), (4, 2), (1, 1), (4, 1)].map(Some));
    }

    #[test]
    fn the_first_decision_too_needs_windows_that_agree() {
        let windows = [(2, 1.0), (0, 1.0), (0, 1.0), (0, 1.0)];
        assert_eq!(decisions(3, 0.0, &windows), [None, None, None, Some((0, 1))]);
    }

    #[test]
    fn windows_of_another_class_that_do_not_follow_each_other_change_nothing() {
        let windows = [0, 0, 1, 0, 1, 2, 1, 2, 0].map(|class| (class, 1.0));
        let last = decisions(2, 0.0, &windows).pop().flatten();
        assert_eq!(last, Some((0, 8)));
    }

    #[test]
    fn a_window_that_does_not_vote_keeps_the_decision_and_ends_a_run() {
        let windows = [(0, 0.9), (0, 0.5), (1, 0.9), (1, 0.4), (1, 0.9), (1, f32::NAN), (1, 0.9), (1, 0.9)];
        let expected = [None, Some(0), Some(0), Some(0), Some(0), Some(0), Some(0), Some(1)];
        let classes: Vec<Option<usize>> =
            decisions(2, 0.5, &windows).into_iter().map(|d| d.map(|d| d.0)).collect();
        assert_eq!(classes, expected);
    }

    #[test]
    fn after_a_reset_nothing_is_remembered() {
        let mut filter = DecisionFilter::new(2, 0.0).unwrap();
        let fresh = filter.clone();
        filter.push(2, 1.0);
        filter.reset();
        assert_eq!((filter.push(0, 1.0), filter.push(0, 1.0)), (None, Some(Decision { class: 0, held: 1 })));
        filter.push(2, 1.0);
        filter.reset();
        assert_eq!(filter, fresh);
    }

    #[test]
    fn settings_that_make_no_sense_are_refused() {
        assert_eq!(DecisionFilter::new(0, 0.5), Err(DecisionError::Hold { found: 0 }));
        for least in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
            let error = DecisionFilter::new(1, least).unwrap_err().to_string();
            let expected = "least probability of a window that votes: expected 0 to 1, found ";
            assert_eq!(error, format!("{expected}{least}"));
        }
        assert!(DecisionFilter::new(u32::MAX, 1.0).is_ok());
    }

    /// The decision after the last of `votes`: the class of its newest `hold` consecutive equal
    /// votes.
    fn decided(hold: usize, votes: &[Option<usize>]) -> Option<usize> {
        let agree =
            |run: &[Option<usize>]| run.iter().all(|vote| *vote == run[0]).then_some(run[0]).flatten();
        votes.windows(hold).rev().find_map(agree)
    }

    proptest! {
        #[test]
        fn the_decision_is_that_of_the_newest_run_in_the_whole_history(
            hold in 1_u32..5,
            least in prop_oneof![Just(0.0_f32), Just(0.5), Just(1.0)],
            windows in prop::collection::vec(
                (0_usize..3, prop_oneof![6 => Just(1.0_f32), 1 => 0.0_f32..=1.0, 1 => Just(f32::NAN)]),
                0..60,
            ),
        ) {
            let votes: Vec<Option<usize>> =
                windows.iter().map(|&(class, probability)| (probability >= least).then_some(class)).collect();
            let behind: Vec<Option<usize>> =
                (1..=votes.len()).map(|end| decided(hold as usize, &votes[..end])).collect();
            let expected: Vec<Option<(usize, u64)>> = (0..behind.len())
                .map(|window| {
                    let held = behind[..=window].iter().rev().take_while(|d| **d == behind[window]).count();
                    behind[window].map(|class| (class, held as u64))
                })
                .collect();
            prop_assert_eq!(decisions(hold, least, &windows), expected);
        }
    }
}

mod objects {
    use crate::systems::slip::{Object, ObjectSet};

    #[test]
    fn every_object_is_in_one_set() {
        let mut all: Vec<&str> = ObjectSet::ALL.iter().flat_map(|set| set.objects()).copied().collect();
        for &name in &all {
            let object = Object::of("n/any1", name).unwrap();
            assert!(object.set.objects().contains(&name) && !object.misspelt, "{name}");
        }
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 11);
    }

    #[test]
    fn a_misspelt_object_is_the_one_that_is_meant() {
        let object = Object::of("s/strippes305", "strippes").unwrap();
        assert_eq!(object, Object { name: "striped", set: ObjectSet::Textures, misspelt: true });
    }

    #[test]
    fn another_object_is_refused_with_its_recording() {
        let error = Object::of("n/cup1", "cup").unwrap_err().to_string();
        assert!(
            error.contains("n/cup1") && error.contains("\"cup\"") && error.contains("striped"),
            "{error}"
        );
    }
}

mod windows {
    use crate::FrameDescription;
    use crate::systems::slip::SlipWindows;

    fn windows(network: &str) -> SlipWindows {
        SlipWindows::new(&FrameDescription::shipped(network).expect("shipped")).expect("over readings")
    }

    #[test]
    fn windows_do_not_overlap_and_what_fills_none_is_left_out() {
        let readings: Vec<[f32; 24]> =
            (0..13).map(|i| std::array::from_fn(|e| (i * 100 + e) as f32)).collect();
        let mut frames = Vec::new();
        let mut windows = windows("slip-lstm");
        // An incomplete window at the end of a stretch does not continue in the next stretch.
        assert_eq!(windows.cut(&readings[..3], &mut frames), Ok(0));
        assert_eq!(windows.cut(&readings, &mut frames), Ok(2));
        assert_eq!((frames.len(), frames[0], frames[23]), (2 * 5 * 24, 0.0, 1.0));
    }

    #[test]
    fn sampling_of_a_running_network_does_not_count() {
        let text = include_str!("../../../networks/slip-lstm.toml").replace("\"consecutive\"", "\"sliding\"");
        let sliding = FrameDescription::parse(&text).expect("consistent");
        let mut windows = SlipWindows::new(&sliding).expect("over readings");
        assert_eq!(windows.cut(&[[1.0; 24]; 10], &mut Vec::new()), Ok(2));
    }

    #[test]
    fn frames_have_the_shape_of_the_networks_input() {
        assert_eq!(windows("slip-lstm").frame_shape(), [24]);
        assert_eq!(windows("slip-tuned").frame_shape(), [1, 12, 11]);
        assert_eq!(windows("slip-tuned").frame_len(), 132);
    }

    #[test]
    fn readings_that_are_scaled_twice_fill_48_values() {
        let text = include_str!("../../../networks/slip-lstm.toml")
            .replace("values = 24", "values = 48")
            .replace("scaling = \"reading\"", "scaling = [\"reading\", [0, 4]]");
        let both = FrameDescription::parse(&text).expect("consistent");
        let mut windows = SlipWindows::new(&both).expect("over readings");
        assert_eq!((windows.frame_shape(), windows.frame_len()), (&[48][..], 48));
        let mut frames = Vec::new();
        assert_eq!(windows.cut(&[[3.0; 24]; 5], &mut frames), Ok(1));
        assert_eq!(frames, [[0.0; 24], [0.75; 24]].concat().repeat(5));
    }

    #[test]
    fn networks_of_other_systems_are_refused() {
        let description = FrameDescription::shipped("force-lstm").expect("shipped");
        let error = SlipWindows::new(&description).unwrap_err().to_string();
        assert!(error.contains("force-lstm") && error.contains("\"event-counts\""), "{error}");
        let text =
            include_str!("../../../networks/slip-lstm.toml").replace("\"aw\", \"cw\"", "\"cw\", \"aw\"");
        let swapped = FrameDescription::parse(&text).expect("consistent");
        assert!(SlipWindows::new(&swapped).unwrap_err().to_string().contains("found cw, aw"));
    }
}
