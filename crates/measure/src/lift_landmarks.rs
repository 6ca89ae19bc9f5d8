//! The landmarks of a measured lift: every 5 mm along the centreline, means of the points around.

use crate::centreline::SPACING;
use crate::landmarks::Landmark;
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

impl MeasuredLift {
    /// The landmarks, with their motions at the peak and in the frame beside it.
    pub(crate) fn find_landmarks(&self) -> Vec<Landmark> {
        let [peak, beside] = [self.peak, self.beside].map(|frame| self.landmarks_in(frame));
        let landmark = |(station, (moved, beside)): (usize, (Option<DVec3>, Option<DVec3>))| Landmark {
            along: station as f64 * SPACING,
            rest: self.centreline.stations[station].point,
            moved,
            beside,
        };
        self.landmark_stations().zip(peak.into_iter().zip(beside)).map(landmark).collect()
    }

    /// How far each landmark has moved from the frame at rest to another one (m); `None` where it
    /// is hidden.
    pub fn landmarks_in(&self, frame: usize) -> Vec<Option<DVec3>> {
        let motion = self.motion(frame);
        let middle = |station: usize| {
            let near = self.points.iter().zip(&motion);
            let near = near.filter(|(p, _)| p.station.abs_diff(station) <= AROUND && p.across.abs() <= ACROSS);
            let moved: Vec<DVec3> = near.filter_map(|(_, d)| *d).collect();
            let along = |axis: usize| median(moved.iter().map(|d| d[axis]).collect::<Vec<_>>());
            (moved.len() >= LEAST).then(|| Some(DVec3::new(along(0)?, along(1)?, along(2)?)))?
        };
        self.landmark_stations().map(middle).collect()
    }

    /// The places of the landmarks.
    fn landmark_stations(&self) -> impl Iterator<Item = usize> {
        (0..self.centreline.stations.len()).step_by(EVERY)
    }
}
