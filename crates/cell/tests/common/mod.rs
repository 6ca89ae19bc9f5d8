//! How tests of instruments at the tube move them.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_cell::{Action, Cell, CellReport, Setpoint};
use trocar_core::Pose;

/// Steps for `periods` with all jaws commanded to close.
pub fn close(cell: &mut Cell, periods: usize) {
    let targets: Vec<Setpoint> = cell.observe().iter().map(|a| a.commanded.with_jaw(0.0)).collect();
    (0..periods).for_each(|_| drop(cell.step(&Action::targets(&targets)).unwrap()));
}

/// Steps for `periods` with the tip of `arm` commanded to move by `way` (m) in all.
pub fn shift(cell: &mut Cell, arm: &str, way: DVec3, periods: usize) -> Vec<CellReport> {
    let k = cell.arm_index(arm).unwrap();
    let tip = cell.measured_cp(arm).unwrap();
    let from: Vec<Setpoint> = cell.observe().iter().map(|a| a.commanded).collect();
    let step = |n: usize| {
        let translation = tip.translation + way * (n as f64 / periods as f64).min(1.0);
        let mut all = from.clone();
        all[k] = cell.solve(arm, &Pose { translation, ..tip }, &from[k]).unwrap().setpoint;
        Action::targets(&all)
    };
    let actions: Vec<Action> = (1..=periods).map(step).collect();
    actions.iter().map(|action| cell.step(action).unwrap()).collect()
}
