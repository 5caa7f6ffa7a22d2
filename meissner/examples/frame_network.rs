//! Frames of event counts through a recurrent frame network: contact force at every frame of 10 ms.
//!
//! ```text
//! cargo run --release -p meissner --example frame_network
//! ```

// ANCHOR: book
use std::error::Error;

use meissner::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, FrameShape};
use meissner::models::FrameSource;
use meissner::representations::{Completed, Consecutive, ConsecutiveFrames};
use meissner::{Event, FrameDescription, Sensor, Weights};

const SENSOR: Sensor = Sensor { width: 240, height: 180 };

fn main() -> Result<(), Box<dyn Error>> {
    let description = FrameDescription::shipped("force-lstm").ok_or("no such network")?;
    let weights = Weights::shipped("force-lstm").ok_or("no weights")?;
    let network = FrameNetwork::new(description.network_parts(&weights)?, Convolution::Direct)?;
    // Frames of events are mostly empty: `sparse` stores the answer to a frame of zeros.
    let mut engine = FrameEngine::with_options(network, FrameOptions::new().with_sparse(true))?;

    // The description says how frames are made.
    let FrameSource::EventCounts { period_us, place, maximum } = *description.source() else {
        return Err("expected frames of event counts".into());
    };
    let FrameShape::Image { width, height, .. } = description.input() else {
        return Err("expected frames that are images".into());
    };
    let crop = place.crop(u16::try_from(width)?, u16::try_from(height)?, SENSOR);
    let mut counts =
        ConsecutiveFrames::counts(SENSOR, Consecutive { period_us, ..Consecutive::new(crop) }, maximum)?;

    // A press: events at the rim of a disc that grows for 100 ms.
    let press = (0..2000_i64).map(|i| {
        let (angle, radius) = (i as f64 * 0.1, 5.0 + i as f64 * 0.02);
        let at = |centre: f64, part: f64| (centre + radius * part) as u16;
        Event::new(i * 50, at(120.0, angle.cos()), at(90.0, angle.sin()), true)
    });
    let mut result = Ok(());
    for event in press {
        counts.push(event, |completed| {
            if let (Completed::Frame(frame), Ok(())) = (completed, &result) {
                result = force(&mut engine, frame.values, frame.start_us + period_us);
            }
        });
    }
    result
}

/// Pushes a frame, and prints the force that the network predicts at its end.
fn force(engine: &mut FrameEngine, frame: &[f32], t_us: i64) -> Result<(), Box<dyn Error>> {
    engine.push(frame)?;
    println!("{:5.1} ms  {:?} N", t_us as f64 / 1e3, engine.predict()?.values);
    Ok(())
}
// ANCHOR_END: book
