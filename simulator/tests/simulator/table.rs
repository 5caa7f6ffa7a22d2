//! Presses by interpolation, against presses that are computed.

use meissner_engine::Sensor;
use meissner_simulator::{Dome, DomeView, Press, PressTable};

#[test]
fn a_press_between_those_of_the_table_is_a_small_part_of_a_pixel_off() {
    let dome = Dome::default();
    let table = PressTable::new(&dome, 6.0);
    let view = DomeView::new(&dome, Sensor::new(346, 260));
    let mut markers = Vec::new();
    // Between tilts and directions, in several sixths of a turn, and on a press of the table.
    for (tilt_deg, azimuth_deg, depth_mm, most) in [
        (0.0, 0.0, 6.0, 1e-4),
        (2.0, 180.0, 5.0, 0.05),
        (3.0, 10.0, 5.8, 0.4),
        (9.0, 250.0, 4.25, 0.4),
        (5.0, 350.0, 6.0, 0.4),
    ] {
        let (tilt, azimuth) = (f64::to_radians(tilt_deg), f64::to_radians(azimuth_deg));
        let mut press = Press::new(&dome, tilt, azimuth);
        press.press_to(depth_mm);
        table.markers(tilt, azimuth, depth_mm, &mut markers);
        assert_eq!((markers.len(), press.markers().len()), (table.count(), table.count()));
        let away = |(&found, &expected): (&[f64; 3], &[f64; 3])| {
            let (found, expected) = (view.place(found), view.place(expected));
            (found[0] - expected[0]).hypot(found[1] - expected[1])
        };
        let mut away: Vec<f32> = markers.iter().zip(press.markers()).map(away).collect();
        away.sort_unstable_by(f32::total_cmp);
        let (median, furthest) = (away[away.len() / 2], away[away.len() - 1]);
        assert!(median < 0.1 && furthest < most, "{tilt_deg} {azimuth_deg}: {median} {furthest} pixels");
    }
}
