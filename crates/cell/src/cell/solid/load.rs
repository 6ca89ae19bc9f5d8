//! The force of solids on an instrument, for the force guard and the report.

use glam::DVec3;
use trocar_core::Wrench;

/// The force of solids on an instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::cell) struct SolidLoad {
    /// Mean over the physics steps of the last frame of tissue: force (N) and torque about the tip
    /// (N m), in the cell.
    mean: Wrench,
    /// Sum over the physics steps of the frame that runs.
    sum: Wrench,
    /// Largest magnitude in a physics step of the period (N).
    pub peak: f64,
}

impl SolidLoad {
    /// Begins a control period.
    pub fn begin_period(&mut self) {
        self.peak = 0.0;
    }

    /// Adds a physics step with the force (N) and the torque about the tip (N m) of a `wrench`.
    pub fn add(&mut self, wrench: Wrench) {
        self.sum += wrench;
        self.peak = self.peak.max(wrench.force.length());
    }

    /// Ends a frame of tissue with `steps` physics steps.
    pub fn end_frame(&mut self, steps: u32) {
        let share = 1.0 / f64::from(steps);
        self.mean = Wrench { force: share * self.sum.force, torque: share * self.sum.torque };
        self.sum = Wrench::default();
    }

    /// Mean force over the last frame of tissue (N), in the cell.
    pub fn force(&self) -> DVec3 {
        self.mean.force
    }

    /// The same with the mean torque about the tip (N m).
    pub fn wrench(&self) -> Wrench {
        self.mean
    }

    /// All its numbers; none if there is no force. So hashes of states without touching solids
    /// equal those of earlier versions.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { mean, sum, peak } = *self;
        let any = mean != Wrench::default() || sum != Wrench::default() || peak != 0.0;
        let vectors = [mean.force, mean.torque, sum.force, sum.torque].map(|v| v.to_array());
        let all = vectors.into_iter().flatten().chain([peak]);
        all.take(if any { 13 } else { 0 })
    }
}
