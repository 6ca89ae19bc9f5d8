//! What an error of a measured pull does to the landmarks.
//!
//! Where a grasp holds the organ, and how far it moves, is measured too. An error there moves all
//! landmarks of its lift alike, and is another in each lift. Were it not told apart, the parameters
//! would make up for it.

use crate::Result;
use crate::lone_organ::{LoneOrgan, Pace, Pull};
use crate::observation::Observation;
use glam::DVec3;
use trocar_core::Progress;
use trocar_geometry::Skin;

/// Deviation of the measured motion of the grasp along an axis (m): the tracker's noise and the
/// grasp's own slip.
const MOTION: f64 = 0.3e-3;

/// Deviation of the measured place of the grasp along the organ (m): half the distance between two
/// points of a measured profile.
const PLACE: f64 = 1e-3;

/// Steps of the differences: of the motion, and of the place along the organ in each direction (m).
const MOTION_STEP: f64 = 1e-3;
const PLACE_STEP: f64 = 2e-3;

/// Errors of a pull: of its place along the organ, and of its motion along each axis.
pub(crate) const PULL_ERRORS: usize = 4;

/// How the numbers of all lifts change with one deviation of the place and of each axis of the
/// motion of each pull: [`PULL_ERRORS`] rows a lift. None if a lift diverges.
pub(crate) fn pull_errors(
    organ: &LoneOrgan,
    lifts: &[Observation],
    bound: &[Skin],
    progress: &dyn Progress,
) -> Result<Option<Vec<Vec<f64>>>> {
    let along = PLACE_STEP / organ.length();
    let moved = |pull: &Pull, by: DVec3| Pull { displacement: pull.displacement + MOTION_STEP * by, ..*pull };
    let shifted = |pull: &Pull, by: f64| Pull { s: (pull.s + by).clamp(0.0, 1.0), ..*pull };
    let around = |lift: &Observation| {
        let axes = DVec3::AXES.map(|axis| moved(&lift.pull, axis));
        [vec![lift.pull, shifted(&lift.pull, -along), shifted(&lift.pull, along)], axes.to_vec()].concat()
    };
    let pulls: Vec<Pull> = lifts.iter().flat_map(around).collect();
    let Some(lifted) = organ.lift(&pulls, Pace::QUICK, progress)?.into_iter().collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    let own: Vec<usize> = lifts.iter().map(|lift| lift.measured().len()).collect();
    let (total, mut first, mut rows) = (own.iter().sum(), 0, Vec::new());
    for (((lift, bound), own), lifted) in lifts.iter().zip(bound).zip(own).zip(lifted.chunks(6)) {
        let numbers: Vec<Vec<f64>> = lifted.iter().map(|l| lift.predicted(organ, l, bound)).collect();
        let mut row = |from: usize, to: usize, factor: f64| {
            let mut row = vec![0.0; total];
            let differences = numbers[to].iter().zip(&numbers[from]).map(|(to, from)| factor * (to - from));
            row[first..first + own].iter_mut().zip(differences).for_each(|(row, difference)| *row = difference);
            rows.push(row);
        };
        row(1, 2, PLACE / (2.0 * PLACE_STEP));
        (3..6).for_each(|axis| row(0, axis, MOTION / MOTION_STEP));
        first += own;
    }
    Ok(Some(rows))
}
