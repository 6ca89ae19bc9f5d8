//! One lift of the reconstructed appendix: the cluster at a place is moved by a displacement.

use crate::{Error, Result};
use glam::{DMat3, DVec3};
use trocar_cell::{Cluster, Surroundings, World, clusters};
use trocar_core::interpolate::smoothstep;
use trocar_core::{Pose, Progress};
use trocar_geometry::symmetric::nearest_rotation;
use trocar_geometry::{OrganAxis, Skin, TriMesh};
use trocar_measure::{LiftProfile, SPACING};
use trocar_specimen::{End, Pins, Specimen};
use trocar_tissue::{Grasp, SolverSettings, ToolMotion};
use trocar_workflow::check_interrupted;

/// Frames of 1/60 s in which the appendix comes to rest, is lifted, and is held.
const SETTLE: usize = 60;
const RISE: usize = 100;
const HOLD: usize = 60;

/// What holds the simulated appendix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Support {
    /// The reconstruction's pins: an end and most of the 30% next to it.
    Specimen,
    /// The lowest 42% of all nodes beyond the end.
    Band,
    /// An end of 8% alone.
    Base,
}

impl Support {
    pub const ALL: [Self; 3] = [Self::Specimen, Self::Band, Self::Base];

    /// The name in tables and keys.
    pub fn name(self) -> &'static str {
        match self {
            Self::Specimen => "end + 30% (specimen)",
            Self::Band => "end + lower band",
            Self::Base => "end alone",
        }
    }

    fn pins(self, own: Pins) -> Pins {
        let end = match own {
            Pins::End { end, .. } => end,
            _ => End::Base,
        };
        match self {
            Self::Specimen => own,
            Self::Band => Pins::End { end, length: 0.14, band_length: 0.86, band_share: 0.42 },
            Self::Base => Pins::End { end, length: 0.08, band_length: 0.0, band_share: 0.0 },
        }
    }
}

/// The appendix of a specimen, alone.
pub(super) struct Appendix {
    specimen: Specimen,
    axis: OrganAxis,
}

/// Where an appendix was at rest and where it is lifted (m).
pub(super) struct Lifted {
    rest: Vec<DVec3>,
    top: Vec<DVec3>,
}

impl Appendix {
    /// Of `specimen`.
    pub fn of(specimen: &Specimen) -> Result<Self> {
        let mut specimen = specimen.clone();
        specimen.organs.retain(|o| o.name == "appendix");
        let organ = specimen
            .organs
            .first()
            .ok_or_else(|| Error::Mismatch("the specimen has no organ 'appendix' to lift".to_owned()))?;
        let axis = OrganAxis::of(&organ.body, organ.base)?;
        Ok(Self { specimen, axis })
    }

    /// Unit vector against gravity.
    pub fn up(&self) -> DVec3 {
        self.specimen.up.normalize()
    }

    /// Length of its centreline (m).
    pub fn length(&self) -> f64 {
        self.axis.length
    }

    /// Points of the centreline, [`SPACING`] apart (m).
    pub fn centreline(&self) -> Vec<DVec3> {
        let count = (self.axis.length / SPACING).floor() as usize;
        (0..=count).map(|i| self.axis.point_at(i as f64 * SPACING / self.axis.length)).collect()
    }

    /// Points on the surface nearest above the centreline at these organ coordinates (m).
    pub fn front_at(&self, s: f64) -> DVec3 {
        let middle = self.axis.point_at(s);
        let up = self.up();
        let surface = &self.specimen.organs[0].surface;
        // The vertex that is highest above the centreline's point and at most 2 mm beside it.
        let beside = |p: &DVec3| (*p - middle - up * (*p - middle).dot(up)).length();
        let near = surface.vertices.iter().filter(|p| beside(p) < 2e-3 && p.distance(middle) < 0.02);
        near.copied().max_by(|a, b| a.dot(up).total_cmp(&b.dot(up))).unwrap_or(middle)
    }

    /// Lifts the cluster nearest to organ coordinate `s` by `displacement` (m). `None` if the
    /// simulation diverges.
    pub fn lift(
        &self,
        support: Support,
        modulus: f64,
        s: f64,
        displacement: DVec3,
        progress: &dyn Progress,
    ) -> Result<Option<Lifted>> {
        let mut specimen = self.specimen.clone();
        let organ = &mut specimen.organs[0];
        organ.material.young_modulus_pa = modulus;
        organ.pins = support.pins(organ.pins);
        let surroundings = Surroundings { body_contact: None, ..Surroundings::default() };
        let schedule = SolverSettings::FAST;
        let mut world = World::surrounded(&specimen, &surroundings, Vec::new(), schedule, 1)?;
        for _ in 0..SETTLE {
            world.step(&[]);
        }
        let rest = world.state.positions(&world.model, 0);
        let all = clusters(&world, 0);
        let near = |c: &&Cluster| (c.s - s).abs();
        let cluster = all
            .iter()
            .min_by(|a, b| near(a).total_cmp(&near(b)))
            .ok_or_else(|| Error::Mismatch("the appendix has no free part to grasp".to_owned()))?;
        let grasp = Grasp::capture(&world.model, &world.state, 0, &cluster.nodes, 0, &Pose::IDENTITY);
        world.state.grasps.push(grasp);
        let at = |frame: usize| {
            let share = smoothstep((frame as f64 / RISE as f64).min(1.0));
            Pose { translation: share * displacement, ..Pose::IDENTITY }
        };
        for frame in 0..RISE + HOLD {
            check_interrupted(progress)?;
            let report = world.step(&[ToolMotion { from: at(frame), to: at(frame + 1) }]);
            if report.divergence.is_some() {
                return Ok(None);
            }
        }
        let top = world.state.positions(&world.model, 0);
        Ok(top.iter().all(|p| p.is_finite()).then_some(Lifted { rest, top }))
    }

    /// Motions of points of the recorded pose (m).
    pub fn motions(&self, lifted: &Lifted, points: Vec<DVec3>) -> Vec<DVec3> {
        let body = &self.specimen.organs[0].body;
        let points = TriMesh { vertices: points, ..TriMesh::default() };
        let skin = Skin::bind(&points, body);
        let mut places = [vec![DVec3::ZERO; points.vertices.len()], vec![DVec3::ZERO; points.vertices.len()]];
        skin.deform(body, &lifted.rest, &mut places[0]);
        skin.deform(body, &lifted.top, &mut places[1]);
        places[1].iter().zip(&places[0]).map(|(top, rest)| *top - *rest).collect()
    }

    /// The profile of its centreline.
    pub fn profile(&self, lifted: &Lifted) -> Option<LiftProfile> {
        let up = self.up();
        let rises: Vec<Option<f64>> =
            self.motions(lifted, self.centreline()).into_iter().map(|d| Some(d.dot(up))).collect();
        LiftProfile::of(&rises, SPACING)
    }
}

/// The rigid motion that brings points nearest to others in the least-squares sense (Kabsch 1976):
/// rotation, middle of the first, middle of the second. The second value is the median distance
/// that is left (m).
pub(super) fn aligned(points: &[DVec3], others: &[DVec3]) -> ((DMat3, DVec3, DVec3), f64) {
    let middle = |of: &[DVec3]| of.iter().sum::<DVec3>() / of.len().max(1) as f64;
    let (a, b) = (middle(points), middle(others));
    let mut spread = DMat3::ZERO;
    for (p, q) in points.iter().zip(others) {
        let (p, q) = (*p - a, *q - b);
        spread += DMat3::from_cols(q * p.x, q * p.y, q * p.z);
    }
    let rotation = nearest_rotation(spread);
    let left = points.iter().zip(others).map(|(p, q)| (rotation * (*p - a) + b).distance(*q));
    let left = trocar_core::median(left.collect::<Vec<_>>()).unwrap_or(f64::NAN);
    ((rotation, a, b), left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn a_turned_and_moved_curve_is_brought_back() {
        let curve: Vec<DVec3> = (0..40)
            .map(|i| {
                let t = f64::from(i) / 39.0;
                DVec3::new(0.08 * t, 0.03 * (2.0 * t).sin(), 0.01 * t * t)
            })
            .collect();
        let turn = DMat3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_z(-1.2));
        let moved: Vec<DVec3> = curve.iter().map(|p| turn * *p + DVec3::new(0.1, -0.2, 0.3)).collect();
        let ((rotation, a, b), left) = aligned(&curve, &moved);
        assert!(left < 1e-12, "{left}");
        assert!((rotation * (curve[7] - a) + b).distance(moved[7]) < 1e-12);
    }
}
