use super::SlipWindows;
use crate::FrameDescription;

fn windows(network: &str) -> SlipWindows {
    SlipWindows::new(&FrameDescription::shipped(network).expect("shipped")).expect("over readings")
}

#[test]
fn windows_do_not_overlap_and_what_fills_none_is_left_out() {
    let readings: Vec<[f32; 24]> = (0..13).map(|i| std::array::from_fn(|e| (i * 100 + e) as f32)).collect();
    let mut frames = Vec::new();
    let mut windows = windows("slip-lstm");
    // A part of a window before, as a stretch leaves it, does not reach into the next stretch.
    assert_eq!(windows.cut(&readings[..3], &mut frames), Ok(0));
    assert_eq!(windows.cut(&readings, &mut frames), Ok(2));
    assert_eq!((frames.len(), frames[0], frames[23]), (2 * 5 * 24, 0.0, 1.0));
}

#[test]
fn sampling_of_a_running_network_does_not_count() {
    let text = include_str!("../../../../networks/slip-lstm.toml").replace("\"consecutive\"", "\"sliding\"");
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
    let text = include_str!("../../../../networks/slip-lstm.toml")
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
        include_str!("../../../../networks/slip-lstm.toml").replace("\"aw\", \"cw\"", "\"cw\", \"aw\"");
    let swapped = FrameDescription::parse(&text).expect("consistent");
    assert!(SlipWindows::new(&swapped).unwrap_err().to_string().contains("found cw, aw"));
}
