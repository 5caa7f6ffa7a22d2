//! Tactile windows as they come out of the stream equal windows cut from all readings.
//!
//! `MEISSNER_CASES` sets the number of cases (2,000 without it).

use meissner_engine::representations::{
    ELECTRODES, Sampling, Scaling, TACTILE_CELLS, TactileForm, TactileLayout, TactileWindow,
};
use meissner_tests::cases::cases;
use proptest::prelude::*;

fn reading() -> impl Strategy<Value = [f32; ELECTRODES]> {
    let value = prop_oneof![9 => 0f32..3_600.0, 1 => Just(0.0f32)];
    proptest::collection::vec(value, ELECTRODES).prop_map(|v| v.try_into().expect("24 values"))
}

proptest! {
    #![proptest_config(cases(2_000))]

    #[test]
    fn tactile_windows_equal_windows_cut_from_all_readings(
        readings in proptest::collection::vec(reading(), 1..40),
        steps in 1usize..7,
        sampling in prop_oneof![
            Just(Sampling::Consecutive),
            Just(Sampling::Sliding),
            (1usize..5).prop_map(|stride| Sampling::Step { stride }),
        ],
        scaling in prop_oneof![
            Just(Scaling::PerImage),
            Just(Scaling::PerReading),
            Just(Scaling::Range { minimum: 0.0, maximum: 3_488.0 }),
            Just(Scaling::ReadingAndRange { minimum: 1_911.0, maximum: 3_743.0 }),
        ],
        image in any::<bool>(),
    ) {
        let image = image && !matches!(scaling, Scaling::ReadingAndRange { .. });
        let form = if image { TactileForm::Image } else { TactileForm::Reading };
        let mut window = TactileWindow::new(steps, sampling, scaling, form).expect("admissible");
        let mut streamed = vec![];
        for reading in &readings {
            streamed.extend(window.push(reading).expect("finite").map(|sequence| sequence.values.to_vec()));
        }
        let made: Vec<Vec<f32>> = readings.iter().map(|reading| make(reading, scaling, image)).collect();
        let (stride, hop) = match sampling {
            Sampling::Consecutive => (1, steps),
            Sampling::Sliding => (1, 1),
            Sampling::Step { stride } => (stride, steps),
        };
        let taken: Vec<Vec<f32>> = made.into_iter().step_by(stride).collect();
        let cut: Vec<Vec<f32>> = taken.windows(steps).step_by(hop).map(<[Vec<f32>]>::concat).collect();
        prop_assert_eq!(streamed, cut);
    }
}

/// One reading, laid out and scaled.
fn make(reading: &[f32; ELECTRODES], scaling: Scaling, image: bool) -> Vec<f32> {
    let own = |values: &[f32]| {
        let minimum = values.iter().copied().fold(f32::INFINITY, f32::min);
        (minimum, values.iter().copied().fold(f32::NEG_INFINITY, f32::max))
    };
    let scale = |values: &[f32], (minimum, maximum): (f32, f32)| -> Vec<f32> {
        let [low, high] = [minimum, maximum].map(f64::from);
        let one = |&v: &f32| if high > low { ((f64::from(v) - low) / (high - low)) as f32 } else { 0.0 };
        values.iter().map(one).collect()
    };
    let before = match scaling {
        Scaling::ReadingAndRange { minimum, maximum } => {
            return [scale(reading, own(reading)), scale(reading, (minimum, maximum))].concat();
        }
        Scaling::PerImage => reading.to_vec(),
        Scaling::PerReading => scale(reading, own(reading)),
        Scaling::Range { minimum, maximum } => scale(reading, (minimum, maximum)),
    };
    let mut cells = [0.0; TACTILE_CELLS];
    TactileLayout::new().image(&before.clone().try_into().expect("24 values"), &mut cells);
    let laid_out = if image { cells.to_vec() } else { before };
    if scaling == Scaling::PerImage { scale(&laid_out, own(&laid_out)) } else { laid_out }
}
