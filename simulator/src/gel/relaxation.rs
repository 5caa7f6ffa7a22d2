//! A gel that gives way slowly: one term of a Prony series.

use libm::expm1;

/// The pressure of a gel of which a share of the stiffness relaxes, from the pressures of the
/// elastic one.
///
/// `p(t) = (1 - share) e(t) + share * integral of exp(-(t - s) / time) de(s)`, with the elastic
/// pressure `e` linear between two steps (Fung 1981, "Biomechanics", section 7.6: quasi-linear
/// viscoelasticity). Where this is negative the indenter has left the gel, and the pressure is 0.
/// What relaxes slowly makes loading and unloading differ.
#[derive(Clone, Debug)]
pub struct Relaxation {
    share: f64,
    time_s: f64,
    /// The elastic pressure at the last step.
    elastic: Vec<f64>,
    /// The integral at the last step.
    memory: Vec<f64>,
}

impl Relaxation {
    /// A gel at rest of `pixels` pixels, of which `share` (0 to 1) relaxes with the time constant
    /// `time_s` in seconds, above 0.
    pub fn new(pixels: usize, share: f64, time_s: f64) -> Self {
        Self { share, time_s, elastic: vec![0.0; pixels], memory: vec![0.0; pixels] }
    }

    /// The pressure `seconds` after the last step, when the elastic one is `elastic`. O(pixels).
    ///
    /// # Panics
    /// Where `elastic` has another number of pixels.
    pub fn step(&mut self, seconds: f64, elastic: &[f64]) -> Vec<f64> {
        assert_eq!(elastic.len(), self.elastic.len(), "a pressure for each pixel");
        let steps = seconds / self.time_s;
        let lost = -expm1(-steps);
        let kept = if steps > 0.0 { lost / steps } else { 1.0 };
        let memory = self.memory.iter_mut().zip(&mut self.elastic);
        let pressure = memory.zip(elastic).map(|((memory, before), &now)| {
            *memory += kept * (now - *before) - lost * *memory;
            *before = now;
            ((1.0 - self.share) * now + self.share * *memory).max(0.0)
        });
        pressure.collect()
    }
}
