//! What a lift tells: how landmarks moved, and the force where it is known.

use crate::lone_organ::{Lifted, LoneOrgan, Pull};
use glam::DVec3;
use trocar_geometry::Skin;

/// A landmark of a lift that is seen at rest and at the peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// Its place along the organ (m).
    pub along: f64,
    /// Where it is at rest, in the frame of the specimen (m).
    pub rest: DVec3,
    /// How far it has moved (m).
    pub moved: DVec3,
}

/// A lift in the frame of the specimen.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// Its number in the recording.
    pub number: usize,
    /// Where and how far the organ is lifted.
    pub pull: Pull,
    /// Its landmarks, from base to tip.
    pub landmarks: Vec<Landmark>,
    /// Force of the instrument on the tissue at the peak (N), if it was measured.
    pub force: Option<DVec3>,
}

/// Length that stands for a newton (m), so that forces and motions are of one size.
pub(crate) const PER_NEWTON: f64 = 0.05;

impl Observation {
    /// Its landmarks bound to an organ.
    pub(crate) fn bound(&self, organ: &LoneOrgan) -> Skin {
        organ.bind(self.landmarks.iter().map(|l| l.rest).collect())
    }

    /// Numbers of a prediction: three a landmark (m), then three of the force if it was measured.
    pub(crate) fn predicted(&self, organ: &LoneOrgan, lifted: &Lifted, bound: &Skin) -> Vec<f64> {
        let motions = organ.motions_of(lifted, bound).into_iter();
        let force = self.force.map(|_| PER_NEWTON * lifted.force);
        motions.chain(force).flat_map(|d| d.to_array()).collect()
    }

    /// The same numbers as measured.
    pub(crate) fn measured(&self) -> Vec<f64> {
        let force = self.force.map(|f| PER_NEWTON * f);
        self.landmarks.iter().map(|l| l.moved).chain(force).flat_map(|d| d.to_array()).collect()
    }

    /// Root mean square error of the landmarks of a simulated lift (m).
    pub fn error(&self, organ: &LoneOrgan, lifted: &Lifted) -> f64 {
        self.rmse(&self.predicted(organ, lifted, &self.bound(organ)))
    }

    /// Root mean square error of the landmarks of a prediction (m).
    pub(crate) fn rmse(&self, predicted: &[f64]) -> f64 {
        let count = self.landmarks.len();
        let squares: f64 = self.measured()[..3 * count].iter().zip(predicted).map(|(m, p)| (m - p) * (m - p)).sum();
        (squares / count.max(1) as f64).sqrt()
    }
}
