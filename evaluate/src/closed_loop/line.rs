//! A network between a camera and a controller, in the time of the simulation.
//!
//! The network takes one picture at a time. While it is busy, the newest picture waits.

use std::time::Duration;

use meissner_kernels::random::Random;
use meissner_simulator::plants::BallContact;
use serde::Serialize;

/// What happens to pictures and readings on their way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Delays {
    /// Factor by which the network is slower.
    pub slower: f64,
    /// Time that a reading takes to the controller, in microseconds.
    pub stale_us: u64,
    /// Share of pictures that are lost.
    pub lost: f64,
}

impl Default for Delays {
    fn default() -> Self {
        Self { slower: 1.0, stale_us: 0, lost: 0.0 }
    }
}

/// The reading of a network from a picture, and the time that it took.
pub(super) type Estimate<'a, E> = dyn FnMut(&[u8]) -> Result<(BallContact, Duration), E> + 'a;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timed {
    /// Time when the picture was taken.
    pub(super) taken_us: f64,
    /// Time when the controller has the reading.
    pub(super) ready_us: f64,
    pub(super) run_us: f64,
    pub(super) reading: BallContact,
}

/// Pictures on their way, and their readings.
pub(super) struct Line {
    delays: Delays,
    random: Random,
    free_us: f64,
    waiting: Option<(f64, Vec<u8>)>,
    /// All readings in the order of their pictures, which is also the order of their arrival.
    pub(super) readings: Vec<Timed>,
    pub(super) lost: u64,
}

impl Line {
    pub(super) fn new(delays: Delays, seed: u64) -> Self {
        let random = Random::new(seed);
        Self { delays, random, free_us: 0.0, waiting: None, readings: Vec::new(), lost: 0 }
    }

    /// A picture is taken at `now_us`, not before the last one.
    pub(super) fn push<E>(
        &mut self,
        now_us: f64,
        picture: impl FnOnce() -> Result<Vec<u8>, E>,
        estimate: &mut Estimate<'_, E>,
    ) -> Result<(), E> {
        self.advance(now_us, estimate)?;
        if self.random.uniform() < self.delays.lost {
            self.lost += 1;
            return Ok(());
        }
        self.waiting = Some((now_us, picture()?));
        self.advance(now_us, estimate)
    }

    /// Lets the network begin with the picture that waits, if it is free by `now_us`.
    pub(super) fn advance<E>(&mut self, now_us: f64, estimate: &mut Estimate<'_, E>) -> Result<(), E> {
        if self.free_us > now_us {
            return Ok(());
        }
        let Some((taken_us, picture)) = self.waiting.take() else { return Ok(()) };
        let begin_us = self.free_us.max(taken_us);
        let (reading, took) = estimate(&picture)?;
        let run_us = took.as_secs_f64() * 1e6 * self.delays.slower;
        self.free_us = begin_us + run_us;
        let ready_us = self.free_us + self.delays.stale_us as f64;
        self.readings.push(Timed { taken_us, ready_us, run_us, reading });
        Ok(())
    }

    /// The newest reading that the controller has at `now_us`.
    pub(super) fn newest(&self, now_us: f64) -> Option<&Timed> {
        self.readings.iter().rev().find(|timed| timed.ready_us <= now_us)
    }
}
