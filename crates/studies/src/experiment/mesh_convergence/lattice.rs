//! The body by a lattice of hexahedra.

use super::body::{GRASP_LIFT, GRASP_PARTS, GRAVITY, Hold, LIFT, PULL, Patch, TestBody, WEIGHT_SHARE};
use super::result::{Cases, MeshRow};
use crate::{Error, Result};
use glam::DVec3;
use trocar_lattice::{
    Body, BodyDescription, BodyState, Conditions, EmbeddedPoint, Lattice, LatticeOptions, Law, Material, Newton,
    PointLoad, Precision, Spring,
};

/// Stiffness of the grasp, over Young's modulus times a cell: as the lattice's pins.
const GRASP_STIFFNESS: f64 = 100.0;

/// The row of a lattice with cells of `cell` (m).
pub(super) fn row(body: &TestBody, tissue: trocar_tissue::Material, cell: f64) -> Result<MeshRow> {
    let lattice = Lattice::of_mesh(&body.mesh, &LatticeOptions::new(cell)).map_err(|error| refused(&error))?;
    let material = Material {
        law: Law::StableNeoHookean,
        young_modulus: tissue.young_modulus,
        poisson_ratio: tissue.poisson_ratio,
        density: tissue.density,
    };
    let nodes = lattice.nodes().len();
    let trial = Trial { body, lattice, material };
    Ok(MeshRow {
        method: "lattice".to_owned(),
        edge_mm: 1e3 * cell,
        nodes,
        nu: tissue.poisson_ratio,
        cases: trial.cases()?,
    })
}

struct Trial<'a> {
    body: &'a TestBody,
    lattice: Lattice,
    material: Material,
}

impl Trial<'_> {
    fn cases(&self) -> Result<Cases> {
        let up = self.body.up;
        let sagged = self.settle(Hold::End, |share| (-WEIGHT_SHARE * share * GRAVITY * up, vec![], vec![]))?;
        let masses = sagged.0.masses();
        let rest = self.lattice.nodes();
        let moved = sagged.1.positions.iter().zip(rest).zip(masses).map(|((x, r), m)| m * (*r - *x).dot(up));
        let sag = moved.sum::<f64>() / masses.iter().sum::<f64>();
        let grasped = self.held(|p| self.body.is_grasped(p))?;
        let stiffness = GRASP_STIFFNESS * self.material.young_modulus * self.lattice.cell();
        let springs = |share: f64| -> Vec<Spring> {
            let target = |point: &EmbeddedPoint| point.interpolate(rest) + share * GRASP_LIFT * up;
            grasped.iter().map(|point| Spring { point: *point, target: target(point), stiffness }).collect()
        };
        let (_, lifted) = self.settle(Hold::End, |share| (DVec3::ZERO, springs(share), vec![]))?;
        let force = |spring: &Spring| spring.stiffness * (spring.target - spring.point.interpolate(&lifted.positions));
        let grasp_n = springs(1.0).iter().map(|spring| force(spring).dot(up)).sum();
        let pulls = self.body.pulled.iter().map(|patch| self.pulled(Hold::Band, patch, PULL));
        Ok(Cases {
            sag_mm: 1e3 * sag,
            lift_mm: 1e3 * self.pulled(Hold::End, &self.body.lifted, LIFT)?,
            pull_mm: pulls.map(|u| Ok(1e3 * u?)).collect::<Result<_>>()?,
            grasp_n,
        })
    }

    /// Mean displacement (m) of a patch along a force on it (N).
    fn pulled(&self, hold: Hold, patch: &Patch, force: f64) -> Result<f64> {
        let up = self.body.up;
        let places: Vec<DVec3> = patch.iter().map(|(p, _)| *p).collect();
        let points = self.lattice.embed(&places).map_err(|error| refused(&error))?;
        let loads = |share: f64| {
            let load = |(point, (_, weight)): (&EmbeddedPoint, &(DVec3, f64))| PointLoad {
                point: *point,
                force: share * weight * force * up,
            };
            points.iter().zip(patch).map(load).collect()
        };
        let (_, state) = self.settle(hold, |share| (DVec3::ZERO, vec![], loads(share)))?;
        let moved =
            |point: &EmbeddedPoint| point.interpolate(&state.positions) - point.interpolate(self.lattice.nodes());
        Ok(points.iter().zip(patch).map(|(point, (_, weight))| weight * moved(point).dot(up)).sum())
    }

    fn held(&self, of: impl Fn(DVec3) -> bool) -> Result<Vec<EmbeddedPoint>> {
        let vertices = &self.body.mesh.vertices;
        let nodes: Vec<u32> = (0..vertices.len() as u32).filter(|i| of(vertices[*i as usize])).collect();
        self.lattice.embed_held(&nodes).map_err(|error| refused(&error))
    }

    fn settle(
        &self,
        hold: Hold,
        acting: impl Fn(f64) -> (DVec3, Vec<Spring>, Vec<PointLoad>),
    ) -> Result<(Body, BodyState)> {
        let pins = self.held(|p| self.body.is_held(p, hold))?;
        let description = BodyDescription {
            name: "appendix".to_owned(),
            lattice: self.lattice.clone(),
            material: self.material,
            pins,
            fixed: Vec::new(),
        };
        let body = Body::new(description).map_err(|error| refused(&error))?;
        let mut state = BodyState::new(&body);
        let mut newton = Newton::new(&body, Precision::default()).map_err(|error| refused(&error))?;
        for part in 1..=GRASP_PARTS {
            let (gravity, springs, loads) = acting(part as f64 / GRASP_PARTS as f64);
            newton
                .settle(&body, &Conditions { gravity, springs: &springs, loads: &loads }, &mut state)
                .map_err(|error| refused(&error))?;
        }
        Ok((body, state))
    }
}

fn refused(error: &trocar_lattice::Error) -> Error {
    Error::Mismatch(error.to_string())
}
