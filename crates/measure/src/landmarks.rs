//! Landmarks every 5 mm along an organ's centreline (paper section VII-F).

use crate::centreline::SPACING;
use crate::lift::MeasuredLift;
use glam::DVec3;
use trocar_core::median;

/// Places from landmark to landmark.
const EVERY: usize = 5;

/// A landmark is the middle of the points this many places around it, and this near to the middle
/// of the organ in half widths.
const AROUND: usize = 1;
const ACROSS: f64 = 0.3;

/// Least number of those points that must be seen.
const LEAST: usize = 3;

/// A landmark of the front above the centreline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// Its place along the organ (m).
    pub along: f64,
    /// Where it is at rest (m).
    pub rest: DVec3,
    /// How far it has moved at the peak (m); `None` where it is hidden.
    pub moved: Option<DVec3>,
    /// The same in the frame beside the peak.
    pub beside: Option<DVec3>,
}

impl Landmark {
    /// The landmarks of a lift.
    pub(crate) fn all(lift: &MeasuredLift) -> Vec<Self> {
        let [peak, beside] = [lift.peak, lift.beside].map(|frame| Self::motions(lift, frame));
        let landmark = |(station, (moved, beside)): (usize, (Option<DVec3>, Option<DVec3>))| Self {
            along: station as f64 * SPACING,
            rest: lift.centreline.stations[station].point,
            moved,
            beside,
        };
        Self::stations(lift).zip(peak.into_iter().zip(beside)).map(landmark).collect()
    }

    /// The motions of the landmarks from the frame at rest to another one (m); `None` where one is
    /// hidden.
    pub(crate) fn motions(lift: &MeasuredLift, frame: usize) -> Vec<Option<DVec3>> {
        let motion = lift.motion(frame);
        let middle = |station: usize| {
            let near = lift.points.iter().zip(&motion);
            let near = near.filter(|(p, _)| p.station.abs_diff(station) <= AROUND && p.across.abs() <= ACROSS);
            let moved: Vec<DVec3> = near.filter_map(|(_, d)| *d).collect();
            let along = |axis: usize| median(moved.iter().map(|d| d[axis]).collect::<Vec<_>>());
            (moved.len() >= LEAST).then(|| Some(DVec3::new(along(0)?, along(1)?, along(2)?)))?
        };
        Self::stations(lift).map(middle).collect()
    }

    /// The places of the landmarks.
    fn stations(lift: &MeasuredLift) -> impl Iterator<Item = usize> {
        (0..lift.centreline.stations.len()).step_by(EVERY)
    }
}

/// The motions of landmarks at the peak (m).
pub fn displacements(landmarks: &[Landmark]) -> Vec<Option<DVec3>> {
    landmarks.iter().map(|l| l.moved).collect()
}

/// Root mean square distance between predicted and measured motions (m), over the pairs that are
/// known; `None` without any.
pub fn rmse(predicted: &[Option<DVec3>], measured: &[Option<DVec3>]) -> Option<f64> {
    let pairs = predicted.iter().zip(measured).filter_map(|(a, b)| Some((*a)?.distance_squared((*b)?)));
    let squares: Vec<f64> = pairs.collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_over_the_pairs_that_are_known() {
        let measured = [Some(DVec3::X * 0.003), None, Some(DVec3::Y * 0.004), Some(DVec3::ZERO)];
        let predicted = [Some(DVec3::ZERO), Some(DVec3::X), Some(DVec3::ZERO), None];
        let error = rmse(&predicted, &measured).unwrap();
        assert!((error - (12.5e-6_f64).sqrt()).abs() < 1e-12, "{error}");
        assert_eq!(rmse(&[None], &[Some(DVec3::ZERO)]), None);
    }
}
