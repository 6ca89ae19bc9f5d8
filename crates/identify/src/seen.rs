//! A measured lift in the frame of the specimen.

use crate::alignment::Alignment;
use crate::lone_organ::{Grip, Lifted, LoneOrgan, Pull};
use crate::observation::{Landmark, Observation};
use glam::{DMat3, DVec3};
use trocar_measure::{MeasuredLift, SPACING, chamfer};

/// A measured lift, aligned with the organ of a specimen.
#[derive(Clone, Debug)]
pub struct SeenLift {
    /// The lift, in the frame of the recording.
    pub lift: MeasuredLift,
    /// Organ coordinate of the grasp.
    pub grasp_s: f64,
    /// Displacement of the apex (m).
    pub displacement: DVec3,
    /// Landmarks at rest (m).
    pub landmarks: Vec<DVec3>,
    /// Points of the surface around the apex at rest (m).
    points: Vec<DVec3>,
    /// Turns motions of the specimen into those of the recording.
    back: DMat3,
    /// Median distance between the aligned centrelines (m).
    pub left: f64,
}

impl SeenLift {
    /// Aligns the centreline of a lift at rest with that of the organ (paper section VII-F:
    /// rigidly, places of the same arc length). `None` if too little of the lift is seen.
    pub fn of(lift: MeasuredLift, organ: &LoneOrgan) -> Option<Self> {
        let (profile, apex) = (lift.profile.as_ref()?, lift.apex?);
        // The visible line ends half a width before each end of the organ.
        let spare = 0.5 * (organ.length() - lift.centreline.length()).max(0.0);
        let place = |along: f64| ((along + spare) / organ.length()).clamp(0.0, 1.0);
        let points: Vec<DVec3> = lift.centreline.stations.iter().map(|s| s.point).collect();
        let fronts: Vec<DVec3> = (0..points.len()).map(|i| organ.front_at(place(i as f64 * SPACING))).collect();
        let alignment = Alignment::of(&points, &fronts);
        let (rest, _): (Vec<DVec3>, Vec<DVec3>) = lift.surface(lift.peak).into_iter().unzip();
        Some(Self {
            grasp_s: place(profile.apex_at),
            displacement: alignment.rotation * apex.displacement,
            landmarks: lift.landmarks.iter().map(|l| alignment.apply(l.rest)).collect(),
            points: rest.into_iter().map(|p| alignment.apply(p)).collect(),
            back: alignment.rotation.transpose(),
            left: alignment.left,
            lift,
        })
    }

    /// The lift as an observation: `number` is its number in the recording.
    pub fn observation(&self, number: usize) -> Observation {
        let landmark = |(seen, rest): (&trocar_measure::Landmark, &DVec3)| {
            let moved = self.back.transpose() * seen.moved?;
            Some(Landmark { along: seen.along, rest: *rest, moved })
        };
        Observation {
            number,
            pull: self.pull(Grip::Place),
            landmarks: self.lift.landmarks.iter().zip(&self.landmarks).filter_map(landmark).collect(),
            force: self.lift.info.force_n.map(|f| self.back.transpose() * DVec3::from(f)),
        }
    }

    /// The simulated lift that reproduces it.
    pub fn pull(&self, grip: Grip) -> Pull {
        Pull { s: self.grasp_s, displacement: self.displacement, grip }
    }

    /// Motions of points of the specimen in a simulated lift, in the frame of the recording (m).
    pub fn motions(&self, organ: &LoneOrgan, lifted: &Lifted, points: &[DVec3]) -> Vec<DVec3> {
        organ.motions(lifted, points.to_vec()).into_iter().map(|d| self.back * d).collect()
    }

    /// Landmark error and local Chamfer distance of a simulated lift (m).
    pub fn compared(&self, organ: &LoneOrgan, lifted: &Lifted) -> [Option<f64>; 2] {
        let landmarks: Vec<Option<DVec3>> =
            self.motions(organ, lifted, &self.landmarks).into_iter().map(Some).collect();
        let surface = self.lift.surface(self.lift.peak);
        let (rest, now): (Vec<DVec3>, Vec<DVec3>) = surface.into_iter().unzip();
        let predicted: Vec<DVec3> =
            rest.iter().zip(self.motions(organ, lifted, &self.points)).map(|(p, d)| *p + d).collect();
        [self.lift.landmark_rmse(&landmarks), chamfer(&predicted, &now)]
    }
}
