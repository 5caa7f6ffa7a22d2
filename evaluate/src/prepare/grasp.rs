//! Grasps of simulated bolts, as events with labels.
//!
//! Enters: how many recordings, and a seed. Leaves: what [`super::film_markers`] writes, with the
//! force of each grasp along time.

use meissner_simulator::gel::GelSolver;
use meissner_simulator::grasp::{Grasp, Grip, SENSOR};
use meissner_simulator::{CameraSettings, SimulatorError};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::Prepared;
use super::filmed::prepared;
use crate::error::EvaluateError;
use crate::truth::Truth;

/// The labels of a grasp: force (N), depth (mm), area (mm2), the number of the
/// [`Phase`](meissner_simulator::grasp::Phase), diameter of the bolt (mm).
const LABELS: [&str; 5] = ["force", "depth", "area", "phase", "bolt"];

/// `recordings` grasps of bolts of 8, 12 and 16 mm in turn; `seed` determines all of them.
///
/// The file has streams as [`super::film_markers`] writes them, with `truth.force` (N),
/// `truth.depth` (mm), `truth.area` (mm2), `truth.phase` (0 grasping, 1 holding, 2 releasing) and
/// `truth.bolt` (mm). The threads of `pool` share the recordings, and change no bit of them.
///
/// Complexity: about a second of one core for each recording.
///
/// # Errors
/// As [`Grasp::film`].
pub fn grasps(recordings: usize, seed: u64, pool: &ThreadPool) -> Result<Prepared, EvaluateError> {
    let solver = Grasp::solver()?;
    let film = |solver: &mut GelSolver, number: usize| -> Result<_, SimulatorError> {
        let grasp = Grasp::drawn(seed, number);
        let (events, grips) = grasp.film(solver, CameraSettings::tactile())?;
        let label = |grip: Grip| {
            let Grip { t_us, force_n, depth_mm, area_mm2, phase } = grip;
            let number = f32::from(phase as u8);
            (t_us, [force_n as f32, depth_mm as f32, area_mm2 as f32, number, grasp.bolt_mm() as f32])
        };
        Ok((events, grips.into_iter().map(label).collect::<Vec<_>>()))
    };
    let filmed: Vec<_> = pool.install(|| {
        (0..recordings).into_par_iter().map_init(|| solver.clone(), film).collect::<Result<_, _>>()
    })?;
    let (streams, labels): (Vec<_>, Vec<_>) = filmed.into_iter().unzip();
    Ok(prepared(SENSOR, &streams, Some(Truth::of_streams(LABELS, &labels))))
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::grasps;
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
