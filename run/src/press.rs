//! What a network should say about the embedded recording, a simulated press and release.
//!
//! Enters: nothing. Leaves: times of the press, and the angles of the plane that the dome is
//! pressed on. `run/assets/README.md` says how it was made.

use crate::error::RunError;
use crate::source::embedded;

const TRUTH: &str = include_str!("../assets/dome_press.csv");

/// The press.
pub struct Press {
    /// Time of the first event, in microseconds.
    pub first_us: i64,
    /// Time of the contact, in microseconds.
    pub contact_us: i64,
    /// Time when the dome is pressed deepest, in microseconds. It is then held and lifted.
    pub end_us: i64,
    /// Angles of the plane about x and y in radians. They are those of the whole press.
    pub angles: [f64; 2],
}

impl Press {
    /// The embedded press.
    ///
    /// # Errors
    /// Never: a test reads it.
    pub fn embedded() -> Result<Self, RunError> {
        let rows = truth();
        let touched = rows.iter().position(|row| row[1] > 0.0).unwrap_or(0);
        let deepest = rows.iter().map(|row| row[1]).fold(0.0, f64::max);
        let end = rows.iter().position(|row| row[1] >= deepest).unwrap_or(0);
        Ok(Self {
            first_us: embedded()?.events.first().map_or(0, |event| event.t_us),
            contact_us: rows[touched.saturating_sub(1)][0] as i64,
            end_us: rows[end][0] as i64,
            angles: [rows[end][2], rows[end][3]],
        })
    }
}

/// Time in microseconds, depth in mm, roll and pitch in radians.
fn truth() -> Vec<[f64; 4]> {
    let number = |text: &str| text.parse().expect("the file has numbers");
    let row = |line: &str| {
        let mut values = line.split(',').map(number);
        std::array::from_fn(|_| values.next().expect("a line has four values"))
    };
    TRUTH.lines().skip(1).map(row).collect()
}

#[cfg(test)]
mod tests {
    use meissner_engine::filters::{Chain, EventFilter, Filter, Refractory};
    use meissner_engine::{Engine, Event, Sensor};
    use meissner_models::{Description, Weights};

    use super::{Press, embedded, truth};

    const SENSOR: Sensor = Sensor { width: 346, height: 260 };

    /// How far `tactigraph-past` is off at the end of the press, in degrees, if a pixel in the
    /// middle sends `rate` more events per second. The filter drops events of a pixel within
    /// `refractory_us` after its last one.
    fn error_with_hot_pixel(rate: i64, refractory_us: Option<i64>) -> f64 {
        let press = Press::embedded().expect("it can be read");
        let mut events = embedded().expect("it can be read").events;
        events.retain(|event| event.t_us <= press.end_us);
        let more = (press.end_us - press.first_us) * rate / 1_000_000;
        let times = (0..more).map(|i| press.first_us + i * 1_000_000 / rate);
        events.extend(times.map(|t_us| Event::new(t_us, 173, 130, t_us % 2 == 0)));
        events.sort_by_key(|event| event.t_us);
        let description = Description::shipped("tactigraph-past").expect("it is shipped");
        let weights = Weights::shipped("tactigraph-past").expect("they are shipped");
        let network = description.network(&weights).expect("they fit");
        let mut engine = Engine::new(network, SENSOR).expect("the sensor has pixels");
        let refractory = |us| Filter::Refractory(Refractory::new(SENSOR, us).expect("a positive time"));
        let mut filters = Chain::new(refractory_us.map(refractory).into_iter().collect());
        for event in events {
            if filters.admit(event) {
                engine.push(event);
            }
        }
        let found = engine.predict().expect("numbers").values;
        let off = press
            .angles
            .iter()
            .zip(found)
            .map(|(&truth, &value)| (truth - f64::from(value)).abs().to_degrees());
        off.fold(0.0, f64::max)
    }

    #[test]
    fn a_refractory_filter_of_a_millisecond_bounds_what_a_hot_pixel_does_to_the_angles() {
        assert!(error_with_hot_pixel(16_000, None) > 5.0, "the network sums over events");
        for rate in [0, 1_000, 16_000, 200_000] {
            let off = error_with_hot_pixel(rate, Some(1_000));
            assert!(off < 1.0, "{rate} events per second: {off} degrees");
        }
    }

    #[test]
    fn the_embedded_press_has_events_while_the_dome_moves_and_constant_angles() {
        let press = Press::embedded().expect("it can be read");
        let events = embedded().expect("it can be read").events;
        assert_eq!(events[0].t_us, press.first_us);
        let between = |from, to| events.iter().filter(|event| (from..to).contains(&event.t_us)).count();
        let [pressed, held] =
            [between(press.contact_us, press.end_us), between(press.end_us + 5_000, press.end_us + 60_000)];
        let lifted = between(press.end_us + 60_000, i64::MAX);
        assert!(pressed > 10_000 && held < 500 && lifted > 10_000, "{pressed}, {held}, {lifted}");
        let tilt = press.angles[0].hypot(press.angles[1]).to_degrees();
        assert!((tilt - 6.0).abs() < 0.01, "{tilt}");
        let rows = truth();
        assert!(rows.windows(2).all(|pair| {
            let rises = pair[0][1] <= pair[1][1];
            pair[0][0] < pair[1][0] && (rises || pair[0][0] as i64 > press.end_us)
        }));
        assert!(rows.iter().all(|row| row[2..] == press.angles));
    }
}
