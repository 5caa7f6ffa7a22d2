//! The embedded recording.

#[path = "../examples/make_default_recording/scene.rs"]
mod scene;

use meissner_io::Format;

#[test]
fn the_embedded_file_is_what_the_scene_makes() {
    let mut made = Vec::new();
    meissner_io::encode(Format::Evt3, Some(scene::SENSOR), &scene::press_and_release(), &mut made)
        .expect("EVT3 holds the scene");
    let kept = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/press_release_synthetic.evt3"))
        .expect("the repository holds the file");
    assert!(made == kept, "write the file again: see pipeline/assets/README.md");
    assert!(kept.len() < 150_000, "{} bytes", kept.len());
}

#[test]
fn it_presses_and_releases() {
    let events = scene::press_and_release();
    let during = |from: i64, to: i64| events.iter().filter(|e| (from..to).contains(&e.t_us)).count();
    assert!((10_000..=20_000).contains(&events.len()), "{} events", events.len());
    assert!(during(0, 60_000) < 100 && during(520_000, 600_000) < 100, "it starts and ends at rest");
    assert!(during(60_000, 180_000) > 5_000 && during(380_000, 520_000) > 5_000, "dots move out and back");
}
