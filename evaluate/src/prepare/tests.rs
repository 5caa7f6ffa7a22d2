//! Simulated presses and grasps.

mod dome {
    use meissner_engine::Sensor;

    use crate::prepare::dome::{record, rising_time};

    #[test]
    fn the_depth_rises_as_the_smooth_step_says() {
        for i in 0..=10 {
            let time = f64::from(i) / 10.0;
            let share = time * time * (3.0 - 2.0 * time);
            assert!((rising_time(share) - time).abs() < 1e-9, "{share}");
        }
    }

    #[test]
    fn a_recorded_press_fills_the_image_and_moves_every_ring() {
        let recorded = record(0.1, 0.7, Sensor::new(346, 260));
        assert_eq!(recorded.len(), 31);
        for (i, at) in recorded.iter().enumerate() {
            assert!((at.depth_mm - 0.5 * i as f64).abs() < 1e-9);
            assert!(
                at.markers.iter().all(|&[x, y]| (0.0..345.0).contains(&x) && (0.0..259.0).contains(&y)),
                "{i}"
            );
        }
        assert!(recorded.windows(2).all(|pair| pair[1].force_n >= pair[0].force_n - 0.05));
        let moved = |i: usize| {
            let [from, to] = [&recorded[0].markers[i], &recorded[30].markers[i]];
            (to[0] - from[0]).hypot(to[1] - from[1])
        };
        // The first marker of each ring that is not the top.
        assert!((1..=7).all(|ring| moved(1 + 3 * ring * (ring - 1)) > 1.0));
    }
}

mod grasp {
    use rayon::ThreadPoolBuilder;

    use crate::prepare::filmed::grasps;
    use crate::streams::Streams;

    #[test]
    fn a_file_of_grasps_is_read_again_and_has_the_same_bytes_on_any_number_of_threads() {
        let bytes = |threads| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            grasps(2, 9, &pool).expect("recordings").file.into_bytes()
        };
        let one = bytes(1);
        assert!(one == bytes(2), "the bytes of two threads differ");
        let streams = Streams::from_bytes(&one).expect("a file of streams");
        assert_eq!(streams.parts().len(), 2);
        let labels = streams.labels(1).expect("labels");
        assert_eq!(labels.t_us.last(), Some(&410_000));
        let names: Vec<&str> = labels.values.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["area", "bolt", "depth", "force", "phase"]);
    }
}
