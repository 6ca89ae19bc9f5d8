//! The force of solids on an instrument, for the force guard and the report.

use glam::DVec3;

/// The force of solids on an instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::cell) struct SolidLoad {
    /// Mean over the physics steps of the last frame of tissue (N), in the cell.
    mean: DVec3,
    /// Sum over the physics steps of the frame that runs (N).
    sum: DVec3,
    /// Largest magnitude in a physics step of the period (N).
    pub peak: f64,
}

impl SolidLoad {
    /// Begins a control period.
    pub fn begin_period(&mut self) {
        self.peak = 0.0;
    }

    /// Adds a physics step with `force` (N).
    pub fn add(&mut self, force: DVec3) {
        self.sum += force;
        self.peak = self.peak.max(force.length());
    }

    /// Ends a frame of tissue with `steps` physics steps.
    pub fn end_frame(&mut self, steps: u32) {
        self.mean = self.sum / f64::from(steps);
        self.sum = DVec3::ZERO;
    }

    /// Mean force over the last frame of tissue (N), in the cell.
    pub fn force(&self) -> DVec3 {
        self.mean
    }

    /// All its numbers; none if there is no force. So hashes of states without touching solids
    /// equal those of earlier versions.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { mean, sum, peak } = *self;
        let any = mean != DVec3::ZERO || sum != DVec3::ZERO || peak != 0.0;
        let all = mean.to_array().into_iter().chain(sum.to_array()).chain([peak]);
        all.take(if any { 7 } else { 0 })
    }
}
