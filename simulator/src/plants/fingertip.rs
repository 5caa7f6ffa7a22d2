//! The simulated fingertip: a soft dome on a wrist that taps a plane, and the events of its camera.
//!
//! Input: time, targets of the wrist. Output: events in order, and the fingertip's state.
//!
//! The wrist turns only between two contacts, because the model of the dome has no turn of the
//! plane during a press. The images of a tap are thus fixed when the tap begins, a tenth of a
//! second before the contact, and can be filmed ahead of real time.

use std::sync::Arc;

use meissner_engine::{Event, Sensor};

use super::datagrams::FingertipState;
use super::{Angles, tilt};
use super::{DEPTH_MM, Phase, Surface, TAP_US, Wrist, depth_mm};
use crate::camera::{Camera, CameraSettings, SimulatedEvent};
use crate::dome::{DomeView, PressTable};
use crate::error::Result;
use crate::markers::MarkerScene;
use crate::membrane::{Dome, Vector};

/// The camera's sensor, as in the training of `tactigraph-past`.
pub const FINGERTIP_SENSOR: Sensor = Sensor { width: 346, height: 260 };

/// Time between two turns of the wrist, in microseconds.
pub const TICK_US: i64 = 1000;
/// Time between two images in microseconds: no marker moves more than a fifth of a pixel.
const MOVING_US: i64 = 500;
const RESTING_US: i64 = 10_000;

/// A dome on a wrist above a plane.
#[derive(Clone, Debug)]
pub struct Fingertip {
    surface: Surface,
    wrist: Wrist,
    /// Angles of the plane relative to the dome in this tap.
    contact: Angles,
    /// Time that has passed, in ticks.
    now_us: i64,
    film: Film,
}

/// The camera and its film.
#[derive(Clone, Debug)]
struct Film {
    table: Arc<PressTable>,
    view: DomeView,
    scene: MarkerScene,
    camera: Camera,
    markers: Vec<Vector>,
    places: Vec<[f32; 2]>,
    image: Vec<f32>,
    /// Time of the newest image.
    filmed_us: i64,
    /// Events that are not taken yet.
    events: Vec<SimulatedEvent>,
}

/// The presses of the default dome for [`Fingertip::new`]. Complexity: [`PressTable::new`].
pub fn presses() -> Arc<PressTable> {
    Arc::new(PressTable::new(&Dome::default(), DEPTH_MM))
}

impl Fingertip {
    /// A fingertip before its first tap. `seed` sets the camera's noise and thresholds.
    ///
    /// # Errors
    /// Never: the camera's settings are in range.
    pub fn new(table: Arc<PressTable>, surface: Surface, seed: u64) -> Result<Self> {
        // Settings of the training, which agree with a real stream (docs/simulated-touch.md).
        let scene = MarkerScene::default();
        let mut film = Film {
            view: DomeView::new(&Dome::default(), FINGERTIP_SENSOR),
            scene,
            camera: Camera::new(FINGERTIP_SENSOR, CameraSettings::tactile(), seed)?,
            markers: Vec::with_capacity(table.count()),
            places: Vec::with_capacity(table.count()),
            image: vec![0.0; usize::from(FINGERTIP_SENSOR.width) * usize::from(FINGERTIP_SENSOR.height)],
            filmed_us: 0,
            events: Vec::new(),
            table,
        };
        let contact = surface.at(0);
        film.look(0, contact)?;
        Ok(Self { surface, wrist: Wrist::default(), contact, now_us: 0, film })
    }

    /// Sets the target of the wrist, in radians.
    pub fn aim(&mut self, target: Angles) {
        self.wrist.aim(target);
    }

    /// Lets a millisecond pass.
    pub fn tick(&mut self) {
        if Phase::at(self.now_us).0 == Phase::Free {
            self.wrist.turn(TICK_US as f64 * 1e-6);
        }
        self.now_us += TICK_US;
        if self.now_us % TAP_US == 0 {
            self.contact = self.away();
        }
    }

    /// Films an image if its content is fixed and not yet filmed; returns whether it did.
    ///
    /// # Errors
    /// Never: images are finite and in order of time.
    pub fn film_ahead(&mut self) -> Result<bool> {
        let filmed_us = self.film.filmed_us;
        let decided_us = (self.now_us / TAP_US + 1) * TAP_US;
        let moves = Phase::at(filmed_us).0.moves();
        let next_us = filmed_us + if moves { MOVING_US } else { RESTING_US };
        if next_us > decided_us {
            return Ok(false);
        }
        self.film.look(next_us, self.contact)?;
        Ok(true)
    }

    /// Appends the events from the previous call up to now to `events`.
    ///
    /// # Errors
    /// As [`Self::film_ahead`].
    pub fn take(&mut self, events: &mut Vec<Event>) -> Result<()> {
        while self.film.filmed_us < self.now_us && self.film_ahead()? {}
        let due = self.film.events.partition_point(|simulated| simulated.event.t_us <= self.now_us);
        events.extend(self.film.events.drain(..due).map(|simulated| simulated.event));
        Ok(())
    }

    /// The fingertip's knowledge of itself.
    pub fn state(&self) -> FingertipState {
        FingertipState {
            t_us: self.now_us,
            depth_mm: depth_mm(self.now_us),
            wrist: self.wrist.angles(),
            phase: Phase::at(self.now_us).0,
            tap: self.tap(),
        }
    }

    /// The angle between the dome's axis and the plane's normal, in radians: the error.
    pub fn error(&self) -> f64 {
        tilt(self.away())
    }

    /// Roll and pitch of the plane in this tap, in radians.
    pub fn plane(&self) -> Angles {
        self.surface.at(self.tap())
    }

    fn tap(&self) -> u32 {
        u32::try_from(self.now_us / TAP_US).unwrap_or(u32::MAX)
    }

    /// Angles of the plane relative to the dome.
    fn away(&self) -> Angles {
        let (plane, dome) = (self.plane(), self.wrist.angles());
        [plane[0] - dome[0], plane[1] - dome[1]]
    }
}

impl Film {
    /// Shows the camera the markers at `t_us`, in a tap on a plane of the angles `contact`.
    fn look(&mut self, t_us: i64, contact: Angles) -> Result<()> {
        let [roll, pitch] = contact;
        // Roll is -tilt sin(azimuth) and pitch tilt cos(azimuth), as in the labels of the training.
        let azimuth = libm::atan2(-roll, pitch);
        self.table.markers(tilt(contact), azimuth, depth_mm(t_us), &mut self.markers);
        self.places.clear();
        self.places.extend(self.markers.iter().map(|&marker| self.view.place(marker)));
        self.scene.draw(FINGERTIP_SENSOR, &self.places, &mut self.image);
        self.camera.push(t_us, &self.image, &mut self.events)?;
        self.filmed_us = t_us;
        Ok(())
    }
}
