//! The examples run to their end, without arguments.

use std::process::Command;

/// Standard output of the example `name`, which `cargo test` has built beside this program.
fn run(name: &str) -> String {
    let program = std::env::current_exe().expect("this program has a path");
    let folder =
        program.parent().and_then(|deps| deps.parent()).expect("it lies in a folder of the target folder");
    let path = folder.join("examples").join(name).with_extension(std::env::consts::EXE_EXTENSION);
    let output = Command::new(&path).output().expect("`cargo test -p meissner` builds the examples");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("it prints text")
}

#[test]
fn a_recording_is_streamed_with_a_prediction_every_10_ms() {
    assert_eq!(run("stream_a_recording").lines().filter(|line| line.contains(" events ")).count(), 31);
}

#[test]
fn a_frame_network_predicts_a_force_at_the_end_of_each_frame() {
    let text = run("frame_network");
    assert_eq!(text.lines().filter(|line| line.ends_with(" N")).count(), 9, "{text}");
}

#[test]
fn an_own_description_runs_and_equals_batch() {
    assert!(run("own_description").contains("bit for bit"));
}

#[test]
fn weights_are_listed_with_the_shapes_that_are_expected_and_found() {
    let text = run("weights_from_pytorch");
    assert!(text.contains("blocks.0.conv.weight: expected [8, 3, 8], found Some([8, 3, 8])"), "{text}");
}
