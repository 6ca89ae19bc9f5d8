//! The body of the study: an appendix, what holds it, and what acts on it.

use crate::{Error, Result};
use glam::DVec3;
use trocar_geometry::{OrganAxis, TetMesh};
use trocar_specimen::{Organ, Specimen};

/// The organ.
const ORGAN: &str = "appendix";

/// Length of the held end in the organ coordinate, and share of the lowest nodes where the organ
/// lies (the paper's share of pinned nodes).
const END: f64 = 0.14;
const BAND: f64 = 0.42;

/// Diameter of the patch that is pulled, and of the region that is grasped (m).
const PATCH: f64 = 5e-3;
const GRASP: f64 = 8e-3;

/// Organ coordinates of the patches that are pulled.
const PATCHES: [f64; 3] = [0.35, 0.55, 0.75];

/// Organ coordinate of the lift and of the grasp.
const MIDDLE: f64 = 0.55;

/// Parts of an edge of the surface into which a patch is divided.
const PARTS: usize = 8;

/// Share of its weight under which the organ sags from its base. Under all of it a soft tube hangs
/// straight down, and shows its length instead of its stiffness.
pub(super) const WEIGHT_SHARE: f64 = 0.01;

/// Standard gravity (m/s2).
pub(super) const GRAVITY: f64 = 9.80665;

/// Force that lifts the middle of the organ, and force that pulls a patch of it (N).
pub(super) const LIFT: f64 = 2e-3;
pub(super) const PULL: f64 = 0.1;

/// How far the grasp is lifted (m).
pub(super) const GRASP_LIFT: f64 = 8e-3;

/// Parts of the way of the grasp.
pub(super) const GRASP_PARTS: usize = 4;

/// An appendix with what holds it and what acts on it. Loads and measures are defined on the body:
/// they are the same for every mesh.
pub(super) struct TestBody {
    /// The specimen's organ: mesh, material.
    pub organ: Organ,
    /// Its mesh: the body.
    pub mesh: TetMesh,
    /// Unit vector against gravity.
    pub up: DVec3,
    axis: OrganAxis,
    /// Height below which it lies (m).
    band: f64,
    /// Points of the patches, with weights that sum to 1; and of the patch in the middle.
    pub pulled: Vec<Patch>,
    pub lifted: Patch,
    /// Centre of the grasp (m).
    grasp: DVec3,
}

/// Points with weights that sum to 1.
pub(super) type Patch = Vec<(DVec3, f64)>;

/// How the body is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hold {
    /// By its base.
    End,
    /// By its lowest part.
    Band,
    /// By its base and in a grasp.
    EndAndGrasp,
}

impl TestBody {
    pub fn of(specimen: &Specimen) -> Result<Self> {
        let Some(organ) = specimen.organs.iter().find(|o| o.name == ORGAN).cloned() else {
            let names = specimen.organs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(Error::Mismatch(format!("the specimen has no organ '{ORGAN}'; it has {names}")));
        };
        let (mesh, up) = (organ.body.clone(), specimen.up.normalize());
        let axis = OrganAxis::of(&mesh, organ.base)?;
        let mut heights: Vec<f64> = mesh.vertices.iter().map(|p| p.dot(up)).collect();
        heights.sort_by(f64::total_cmp);
        let band = heights[(BAND * heights.len() as f64) as usize];
        let mut body = Self { organ, mesh, up, axis, band, pulled: vec![], lifted: vec![], grasp: DVec3::ZERO };
        body.pulled = PATCHES.iter().map(|s| body.patch(*s)).collect::<Result<_>>()?;
        body.lifted = body.patch(MIDDLE)?;
        body.grasp = body.centre(MIDDLE);
        Ok(body)
    }

    /// Nodes and elements.
    pub fn size(&self) -> (usize, usize) {
        (self.mesh.vertices.len(), self.mesh.tets.len())
    }

    /// Size of its box (m).
    pub fn extent(&self) -> DVec3 {
        self.mesh.bounds().map_or(DVec3::ZERO, |(low, high)| high - low)
    }

    /// Mean of the nodes about an organ coordinate.
    fn centre(&self, s: f64) -> DVec3 {
        let near = self.mesh.vertices.iter().zip(&self.axis.s).filter(|(_, own)| (**own - s).abs() < 0.04);
        let (sum, count) = near.fold((DVec3::ZERO, 0.0), |(sum, count), (p, _)| (sum + *p, count + 1.0));
        sum / f64::max(count, 1.0)
    }

    /// The patch on the top of the organ at an organ coordinate.
    fn patch(&self, s: f64) -> Result<Patch> {
        let (surface, _) = self.mesh.boundary();
        let centre = self.centre(s);
        let beside = |p: DVec3| (p - centre).reject_from_normalized(self.up).length();
        let above = surface.vertices.iter().filter(|p| (**p - centre).dot(self.up) > 0.0);
        let Some(top) = above.min_by(|a, b| beside(**a).total_cmp(&beside(**b))) else {
            return Err(Error::Mismatch(format!("'{ORGAN}' has no surface above its axis at {s}")));
        };
        let mut points = Vec::new();
        for t in 0..surface.triangles.len() {
            let [a, b, c] = surface.corners(t);
            let area = (b - a).cross(c - a).length();
            for (u, v) in thirds() {
                let p = a + u * (b - a) + v * (c - a);
                if p.distance(*top) < 0.5 * PATCH {
                    points.push((p, area));
                }
            }
        }
        let whole: f64 = points.iter().map(|(_, weight)| weight).sum();
        points.iter_mut().for_each(|(_, weight)| *weight /= whole);
        Ok(points)
    }

    /// Whether a point of the body is held.
    pub fn is_held(&self, p: DVec3, hold: Hold) -> bool {
        match hold {
            Hold::End => self.coordinate(p) < END,
            Hold::Band => p.dot(self.up) < self.band,
            Hold::EndAndGrasp => self.is_grasped(p) || self.is_held(p, Hold::End),
        }
    }

    /// Whether a point of the body is grasped.
    pub fn is_grasped(&self, p: DVec3) -> bool {
        p.distance(self.grasp) < 0.5 * GRASP
    }

    /// Organ coordinate of the nearest node.
    fn coordinate(&self, p: DVec3) -> f64 {
        let nodes = self.mesh.vertices.iter().zip(&self.axis.s);
        let nearest = nodes.min_by(|a, b| a.0.distance_squared(p).total_cmp(&b.0.distance_squared(p)));
        nearest.map_or(1.0, |(_, s)| *s)
    }
}

/// Centres of the small triangles of a triangle that is divided evenly.
fn thirds() -> impl Iterator<Item = (f64, f64)> {
    let cells = (0..PARTS).flat_map(|i| (0..PARTS - i).map(move |j| (i, j)));
    let centre = |(i, j): (usize, usize), by: f64| ((i as f64 + by) / PARTS as f64, (j as f64 + by) / PARTS as f64);
    cells.flat_map(move |cell| {
        let flipped = (cell.0 + cell.1 + 2 <= PARTS).then(|| centre(cell, 2.0 / 3.0));
        std::iter::once(centre(cell, 1.0 / 3.0)).chain(flipped)
    })
}
