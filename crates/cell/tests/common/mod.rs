//! How tests of instruments at the tube move them.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(dead_code, reason = "no test needs all of them")]

use glam::{DMat3, DQuat, DVec3};
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

/// The tip's pose with `at` (m) in mid-mouth of an arm, jaws across x.
pub fn over(cell: &Cell, arm: &str, at: DVec3, beyond: f64) -> Pose {
    let x = cell.workspace(arm).unwrap().direction_to(at);
    let z = (DVec3::X - DVec3::X.dot(x) * x).normalize();
    let pose = |z: DVec3| {
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
        Pose { rotation, translation: at - (0.0115 - beyond) * x }
    };
    let near = cell.setpoint(arm).unwrap();
    let turn = |p: &Pose| {
        let s = cell.solve(arm, p, &near).unwrap();
        (s.setpoint.roll() - near.roll()).abs() + 10.0 * s.roll_excess.abs()
    };
    let [one, other] = [pose(z), pose(-z)];
    if turn(&one) <= turn(&other) { one } else { other }
}

/// Goes to a pose in `periods`, starting and stopping gently, and stays for half a second.
pub fn go(cell: &mut Cell, arm: &str, pose: &Pose, periods: usize) -> Vec<CellReport> {
    let from = cell.setpoint(arm).unwrap();
    let start = cell.workspace(arm).unwrap().tip(&from);
    (1..=periods + 15)
        .map(|k| {
            let t = (k as f64 / periods as f64).min(1.0);
            let share = t * t * (3.0 - 2.0 * t);
            let rotation = start.rotation.slerp(pose.rotation, share);
            let translation = start.translation.lerp(pose.translation, share);
            cell.servo_cp(arm, &Pose { rotation, translation }).unwrap();
            cell.step(None).unwrap()
        })
        .collect()
}
