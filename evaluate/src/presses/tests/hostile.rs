//! Tables that no one should write, against recordings at the ends of time.

use std::sync::OnceLock;

use meissner_engine::Event;
use proptest::prelude::*;

use super::Folder;
use crate::presses::Options;

/// Recordings around 0, at both ends of the clock, without an event, and of the same time.
fn folder() -> &'static Folder {
    static FOLDER: OnceLock<Folder> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Folder::new();
        folder.press("a.npy", [0, 100_000], 50, 1).press("b.npy", [1_000_000, 1_200_000], 50, 2);
        for (name, t_us) in [("first.npy", i64::MIN), ("last.npy", i64::MAX), ("again.npy", i64::MAX)] {
            folder.events(name, &[Event::new(t_us, 1, 1, true)]);
        }
        folder.events("none.npy", &[]);
        folder.events("both.npy", &[Event::new(i64::MAX, 1, 1, true), Event::new(i64::MIN, 1, 1, true)]);
        folder
    })
}

fn time() -> impl Strategy<Value = i64> {
    prop_oneof![
        4 => -200_000_i64..1_500_000,
        1 => prop_oneof![Just(i64::MIN), Just(i64::MAX), Just(0), Just(1 << 60)],
        1 => any::<i64>(),
    ]
}

fn row(is_named: bool) -> impl Strategy<Value = String> {
    let name = prop_oneof!["(a|b|first|last|both|none)(\\.npy)?", "[a-c]{1,2}"];
    let value = prop_oneof!["-?[0-9]{1,3}", Just("nan".to_owned()), Just("1e300".to_owned()), "[a-b]"];
    (name, prop::option::weighted(0.9, time()), value.clone(), value).prop_map(
        move |(name, t_us, x, class)| {
            let t_us = t_us.map_or_else(String::new, |t_us| t_us.to_string());
            if is_named { format!("{name},{t_us},{x},{class}\n") } else { format!("{t_us},{x},{class}\n") }
        },
    )
}

fn table() -> impl Strategy<Value = String> {
    let header = |is_named: bool, clock: &str| {
        let recording = if is_named { "recording," } else { "" };
        format!("{recording}{clock}_us,x_deg,class\n")
    };
    (any::<bool>(), "t|host").prop_flat_map(move |(is_named, clock)| {
        let rows = prop::collection::vec(row(is_named), 1..60);
        rows.prop_map(move |rows| format!("{}{}", header(is_named, &clock), rows.concat()))
    })
}

/// The host's time of an event at the end of the clock does not exist: the first existing time was
/// used instead.
#[test]
fn a_pose_at_the_end_of_the_clock_joins_no_press_beyond_it() {
    let tables = Folder::new();
    tables.file("labels.csv", "t_us,x_deg,class\n-9223372036854775808,0,0\n");
    let labels = Some(tables.path().join("labels.csv"));
    let message = folder().refusal(&Options { labels, offset_us: Some(100_001), ..Options::default() });
    assert!(message.contains("an offset that puts poses into recordings"), "{message}");
}

proptest! {
    #[test]
    fn any_table_joins_in_order_or_is_refused(text in table(), offset in prop::option::of(time())) {
        let tables = Folder::new();
        tables.file("labels.csv", &text);
        let labels = Some(tables.path().join("labels.csv"));
        let options = Options { labels, offset_us: offset, ..Options::default() };
        let Ok(presses) = folder().try_read(&options) else { return Ok(()) };
        prop_assert!(!presses.rows.is_empty());
        let mut count = 0;
        for press in 0..presses.recordings.len() {
            let rows = presses.rows_of(press);
            count += rows.len();
            prop_assert!(rows.is_sorted_by(|a, b| a.t_us < b.t_us));
            let recording = &presses.recordings[press];
            prop_assert!(rows.is_empty() || recording.events > 0);
            for row in rows {
                prop_assert!(row.t_us >= recording.first_us.saturating_sub(100_000));
                prop_assert!(row.t_us <= recording.last_us.saturating_add(100_000));
                for label in 0..2 {
                    let value = presses.at(press, label, row.t_us);
                    prop_assert_eq!(value.unwrap_or(f64::NAN).to_bits(), row.values[label].to_bits());
                    let later = presses.at(press, label, row.t_us.saturating_add(7));
                    prop_assert!(later.is_none_or(f64::is_finite));
                }
            }
        }
        prop_assert_eq!(count, presses.rows.len());
        prop_assert_eq!(presses.summary().rows, count);
    }
}
