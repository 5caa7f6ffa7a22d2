//! Frames and tactile windows from the stream equal frames and windows from the complete list.
//!
//! `MEISSNER_CASES` sets the number of cases (2,000 without it).

use meissner_engine::representations::{
    Completed, Consecutive, ConsecutiveFrames, Crop, Decay, ELECTRODES, Sampling, Scaling, SignedRule,
    SlidingSigned, TACTILE_CELLS, TactileForm, TactileLayout, TactileWindow, TimeSurface, VoxelGrid,
    VoxelTime,
};
use meissner_engine::{Event, Sensor};
use meissner_tests::cases;
use meissner_tests::event_frames::{FrameKind, History, Kept, keep, place, set};
use meissner_tests::shared::shared;
use meissner_verify::Step;
use meissner_verify::strategies::steady;
use proptest::prelude::*;

/// A part of the sensor, from four numbers of any size.
fn crop(sensor: Sensor, [x, y, width, height]: [u16; 4]) -> Crop {
    let (x, y) = (x % sensor.width, y % sensor.height);
    Crop::new(x, y, 1 + width % (sensor.width - x), 1 + height % (sensor.height - y))
}

/// Every frame since the start of time, the open one last.
fn all_frames(what: FrameKind, options: Consecutive, history: &History) -> Vec<Kept> {
    let Some((epoch, now)) = history.clock() else { return vec![] };
    let mut before = vec![0.0; what.channels() * options.crop.pixels()];
    (0..=(now - epoch) / options.period_us)
        .map(|k| {
            let start_us = epoch + k * options.period_us;
            let events = history.between(start_us, start_us + options.period_us - 1);
            let frame = Kept::over(what, options.crop, &events, start_us, &before);
            before.clone_from(&frame.values);
            frame
        })
        .collect()
}

fn what() -> impl Strategy<Value = FrameKind> {
    prop_oneof![
        prop_oneof![Just(1.0f32), Just(3.0), Just(255.0)].prop_map(FrameKind::Counts),
        Just(FrameKind::Signed(SignedRule::Sum)),
        Just(FrameKind::Signed(SignedRule::Latest)),
    ]
}

proptest! {
    #![proptest_config(cases(2_000))]

    #[test]
    fn consecutive_frames_equal_frames_from_all_events(
        script in steady(120),
        corner in any::<[u16; 4]>(),
        period_us in prop_oneof![40i64..200, 200i64..3_000],
        start in proptest::option::of(-500i64..500),
        what in what(),
    ) {
        let options = Consecutive {
            crop: crop(script.sensor, corner),
            period_us,
            start_us: start.map(|start| script.origin_us + start),
        };
        let mut frames = what.frames(script.sensor, options);
        let mut history = History::new(script.sensor, options.start_us);
        let values = what.channels() * options.crop.pixels();
        let mut kept = vec![];
        for step in &script.steps {
            match *step {
                Step::Push(event) => {
                    history.push(event);
                    frames.push(event, |completed| keep(&mut kept, values, completed));
                }
                Step::Advance(now) => {
                    history.advance(now);
                    frames.advance(now, |completed| keep(&mut kept, values, completed));
                }
                Step::Predict => {
                    let _ = frames.open();
                }
                Step::Reset => {
                    kept.extend(frames.open().map(Kept::of));
                    prop_assert_eq!(&kept, &all_frames(what, options, &history));
                    kept.clear();
                    history.reset();
                    frames.reset();
                }
                Step::Snapshot | Step::Bytes => {}
            }
        }
        kept.extend(frames.open().map(Kept::of));
        prop_assert_eq!(&kept, &all_frames(what, options, &history));
    }

    #[test]
    fn a_sliding_frame_equals_the_frame_from_the_events_of_its_span(
        script in steady(200),
        corner in any::<[u16; 4]>(),
        span_us in prop_oneof![1i64..100, 100i64..3_000],
        capacity in prop_oneof![1usize..40, Just(1_000)],
        rule in prop_oneof![Just(SignedRule::Sum), Just(SignedRule::Latest)],
    ) {
        let (sensor, crop) = (script.sensor, crop(script.sensor, corner));
        let mut sliding = SlidingSigned::new(sensor, crop, rule, span_us, capacity).expect("admissible");
        let mut history = History::new(sensor, None);
        let mut before = vec![0.0; crop.pixels()];
        for step in &script.steps {
            match *step {
                Step::Push(event) => {
                    history.push(event);
                    sliding.push(event);
                }
                Step::Advance(now) => {
                    history.advance(now);
                    sliding.advance(now);
                }
                Step::Reset => {
                    history.reset();
                    sliding.reset();
                }
                Step::Predict | Step::Snapshot | Step::Bytes => {
                    let (start_us, mut events) = history.clock().map_or((0, vec![]), |(_, now)| {
                        (now - span_us, history.between(now - span_us, now))
                    });
                    events.retain(|event| place(crop, event).is_some());
                    events.drain(..events.len().saturating_sub(capacity));
                    let expected = Kept::over(FrameKind::Signed(rule), crop, &events, start_us, &before);
                    let frame = Kept::of(sliding.frame());
                    prop_assert_eq!(&frame, &expected);
                    before = frame.values;
                }
            }
        }
    }

    #[test]
    fn a_time_surface_decays_from_the_latest_event_of_each_pixel_and_polarity(
        script in steady(200),
        corner in any::<[u16; 4]>(),
        scale in prop_oneof![0.5f32..20.0, 20f32..5_000.0],
        linear in any::<bool>(),
    ) {
        let (sensor, crop) = (script.sensor, crop(script.sensor, corner));
        let decay = if linear { Decay::Linear { span_us: scale } } else { Decay::Exponential { tau_us: scale } };
        let mut surface = TimeSurface::new(sensor, crop, decay).expect("admissible");
        let mut history = History::new(sensor, None);
        for step in &script.steps {
            match *step {
                Step::Push(event) => {
                    history.push(event);
                    surface.push(event);
                }
                Step::Advance(now) => {
                    history.advance(now);
                    surface.advance(now);
                }
                Step::Reset => {
                    history.reset();
                    surface.reset();
                }
                Step::Predict | Step::Snapshot | Step::Bytes => {
                    let surface = surface.surface();
                    let now = history.clock().map(|(_, now)| now);
                    prop_assert_eq!(surface.at_us, now);
                    let events = history.between(i64::MIN, i64::MAX);
                    let mut latest = vec![None; surface.values.len()];
                    for event in &events {
                        if let Some(pixel) = place(crop, event) {
                            latest[usize::from(event.on) * crop.pixels() + pixel] = Some(event.t_us);
                        }
                    }
                    for (&value, &latest) in surface.values.iter().zip(&latest) {
                        let age = latest.and_then(|latest: i64| Some(now? - latest));
                        prop_assert_eq!(value, age.map_or(0.0, |age| decay.value(age)));
                        let age = age.map_or(f64::INFINITY, |age| age as f64 / f64::from(scale));
                        let exact = if linear { (1.0 - age).max(0.0) } else { (-age).exp() };
                        prop_assert!((f64::from(value) - exact).abs() < 2e-7, "{} {}", value, exact);
                    }
                    let active = (0u32..).zip(surface.values).filter(|(_, value)| **value != 0.0);
                    prop_assert_eq!(set(surface.active), active.map(|(i, _)| i).collect());
                }
            }
        }
    }

    #[test]
    fn a_voxel_grid_equals_its_formula_and_is_free_of_order(
        script in steady(120),
        corner in any::<[u16; 4]>(),
        bins in 1usize..12,
        centres in any::<bool>(),
        window in (-20i64..200, prop_oneof![Just(0i64), 1i64..50, 50i64..5_000]),
    ) {
        let (sensor, crop) = (script.sensor, crop(script.sensor, corner));
        let start = script.origin_us + window.0;
        let end = start + window.1;
        let time = if centres { VoxelTime::Centres } else { VoxelTime::Bins };
        let mut grid = VoxelGrid::new(sensor, crop, bins, time, 0..=77).expect("admissible");
        grid.push(Event::new(5, crop.x, crop.y, true));
        grid.restart(start..=end).expect("admissible");
        let events: Vec<Event> = script.steps.iter().filter_map(Step::input).copied().collect();
        let mut expected = vec![0f64; bins * crop.pixels()];
        for &event in &events {
            let pixel = place(crop, &event).filter(|_| (start..=end).contains(&event.t_us));
            prop_assert_eq!(grid.push(event), pixel.is_some());
            let Some(pixel) = pixel else { continue };
            let steps = if centres { bins - 1 } else { bins } as f64;
            let tau = if end > start { steps * (event.t_us - start) as f64 / (end - start) as f64 } else { 0.0 };
            for (bin, values) in expected.chunks_exact_mut(crop.pixels()).enumerate() {
                let weight = (1.0 - (bin as f64 - tau).abs()).max(0.0);
                values[pixel] += if event.on { weight } else { -weight };
            }
        }
        let values = grid.frame().values.to_vec();
        for (value, expected) in values.iter().zip(&expected) {
            prop_assert!((f64::from(*value) - expected).abs() <= 1e-12 + expected.abs() * 6e-8, "{} {}", value, expected);
        }
        grid.restart(start..=end).expect("admissible");
        for &event in events.iter().rev() {
            grid.push(event);
            grid.frame();
        }
        prop_assert_eq!(grid.frame().values, &values[..]);
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn counts_of_a_recording_add_up_to_its_events() {
    let path = shared("data/events/tactile_dots.aedat4");
    let recording = meissner_io::read(&path).expect("a readable recording");
    let sensor = recording.sensor.expect("AEDAT4 names its geometry");
    let options = Consecutive::new(Crop::new(60, 30, 115, 115));
    let mut counts = ConsecutiveFrames::counts(sensor, options, 1.0).expect("admissible");
    let (mut sum, mut frames, mut empty, mut touched) = (0.0, 0, 0, 0);
    let mut note = |completed: Completed<'_>| {
        frames += completed.count();
        match completed {
            Completed::Frame(frame) => {
                let total: f64 = frame.values.iter().copied().map(f64::from).sum();
                assert_eq!(total, (frame.events[0] + frame.events[1]) as f64);
                sum += total;
                touched += frame.touched.len();
            }
            Completed::Empty(run) => empty += run.count,
        }
    };
    for &event in &recording.events {
        counts.push(event, &mut note);
    }
    let (first, last) = (recording.events[0].t_us, recording.events[recording.events.len() - 1].t_us);
    counts.advance(last + options.period_us, &mut note);
    let inside = recording.events.iter().filter(|event| place(options.crop, event).is_some()).count();
    println!("{frames} frames, {empty} of them empty, {touched} pixels touched, {inside} events inside");
    assert_eq!(frames, ((last - first) / options.period_us + 1) as u64);
    assert_eq!(sum, inside as f64);
}

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
