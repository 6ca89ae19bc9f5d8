//! One trial: the body by one kind and size of elements, in every case.

use super::body::{GRASP_LIFT, GRASP_PARTS, GRAVITY, Hold, LIFT, PULL, Patch, TestBody, WEIGHT_SHARE};
use super::lattice;
use super::result::{Cases, MeshRow};
use crate::Result;
use crate::scenes::reference;
use glam::DVec3;
use trocar_geometry::{LatticeMesher, Mesher, TetQuality};
use trocar_tissue::Material;
use trocar_tissue_reference::oracle::Precision;
use trocar_tissue_reference::statics::{Elements, Load, Loading, Place};

/// Parts of a loading.
const PARTS: usize = 2;

/// Elements of a patch, and share of the shear modulus that its mean gradient has.
const PATCH_SIZE: usize = 8;
const PATCH_SHARE: f64 = 0.5;

/// Kind and size of the elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// Quadratic tetrahedra on the organ's mesh: the reference.
    Quadratic,
    /// What the cell steps.
    Default,
    /// Linear tetrahedra of the organ's mesh, softer by what the mesh is too stiff.
    Corrected,
    /// Linear tetrahedra: the organ's mesh.
    Linear,
    /// The same, each divided into eight.
    LinearFiner,
    /// Linear tetrahedra of a mesh with so many times larger cells.
    LinearCoarser { by: f64 },
    /// Linear tetrahedra of the organ's mesh in patches.
    Patches,
    /// A lattice of hexahedra (m).
    Lattice { cell: f64 },
}

/// A method and Poisson's ratio.
pub(super) struct Trial {
    pub method: Method,
    pub nu: f64,
}

impl Trial {
    pub fn key(&self) -> String {
        format!("{:?}, {}", self.method, self.nu)
    }

    pub fn run(&self, body: &TestBody) -> Result<MeshRow> {
        let material = material(body, self.nu);
        let own = &body.mesh;
        let by = |name: &str, elements: Elements| -> Result<MeshRow> {
            let edge_mm = 1e3 * TetQuality::of(elements.mesh()).median_edge;
            let nodes = elements.rest().len();
            let cases = cases(body, &elements, material.density)?;
            Ok(MeshRow { method: name.to_owned(), edge_mm, nodes, nu: self.nu, cases })
        };
        match self.method {
            Method::Quadratic => by("quadratic", Elements::quadratic(own, material)),
            Method::Default => by("default", Elements::linear(own, default_material(body, material))),
            Method::Corrected => by("corrected", Elements::linear(own, trocar_cell::element_material(material, own))),
            Method::Linear => by("linear", Elements::linear(own, material)),
            Method::LinearFiner => by("linear", Elements::divided(own, material)),
            Method::LinearCoarser { by: times } => {
                let (surface, _) = own.boundary();
                let edge = times * TetQuality::of(own).median_edge;
                let mesh = LatticeMesher::graded(CELL_OVER_EDGE * edge).mesh(&surface)?;
                by("linear", Elements::linear(&mesh, material))
            }
            Method::Patches => by("patches", Elements::patches(own, material, PATCH_SIZE, PATCH_SHARE)),
            Method::Lattice { cell } => lattice::row(body, material, cell),
        }
    }
}

/// Cell of the lattice mesher over the median edge of its mesh: most edges of a body-centred cubic
/// lattice are half the diagonal of a cube.
const CELL_OVER_EDGE: f64 = 1.154_700_538_379_251_5;

/// The organ's tissue with another Poisson's ratio.
fn material(body: &TestBody, nu: f64) -> Material {
    let own = trocar_cell::tissue_of(&body.organ);
    Material { poisson_ratio: nu, viscosity: 0.0, ..own }
}

/// The tissue as the cell steps it.
fn default_material(body: &TestBody, material: Material) -> Material {
    if trocar_scene::Tissue::default().mesh_correction {
        trocar_cell::element_material(material, &body.mesh)
    } else {
        material
    }
}

fn cases(body: &TestBody, elements: &Elements, density: f64) -> Result<Cases> {
    let up = body.up;
    let place = |patch: &Patch| -> Vec<(Place, f64)> {
        patch.iter().map(|(p, weight)| (elements.locate(*p), *weight)).collect()
    };
    let settle = |hold: Hold, loading: &Loading| {
        let held = elements.held_by(|p| body.is_held(p, hold));
        let parts = if loading.moved.is_empty() { PARTS } else { GRASP_PARTS };
        elements.settle(&held, loading, parts, Precision::default()).map_err(reference)
    };
    // Mean displacement along the force.
    let pulled = |hold: Hold, patch: &Patch, force: f64| -> Result<f64> {
        let places = place(patch);
        let loads = places.iter().map(|(place, w)| Load { place: place.clone(), force: *w * force * up }).collect();
        let found = settle(hold, &Loading { loads, ..Loading::default() })?;
        Ok(places.iter().map(|(place, w)| w * place.of(&found.displacements).dot(up)).sum())
    };
    let shares = elements.shares();
    let volume: f64 = shares.iter().sum();
    let weight = -WEIGHT_SHARE * density * GRAVITY * up;
    let sagged = settle(Hold::End, &Loading { body_force: weight, ..Loading::default() })?;
    let down = |u: &DVec3| -u.dot(up);
    let sag = sagged.displacements.iter().zip(&shares).map(|(u, share)| share * down(u)).sum::<f64>() / volume;
    let grasped = elements.held_by(|p| body.is_grasped(p));
    let moved = (0..grasped.len()).filter(|i| grasped[*i]).map(|i| (i as u32, GRASP_LIFT * up)).collect();
    let lifted = settle(Hold::EndAndGrasp, &Loading { moved, ..Loading::default() })?;
    let grasp_force = lifted.reactions.iter().zip(&grasped).filter(|(_, g)| **g).map(|(f, _)| f.dot(up)).sum();
    let pulls = body.pulled.iter().map(|patch| pulled(Hold::Band, patch, PULL)).collect::<Result<Vec<_>>>()?;
    Ok(Cases {
        sag_mm: 1e3 * sag,
        lift_mm: 1e3 * pulled(Hold::End, &body.lifted, LIFT)?,
        pull_mm: pulls.iter().map(|u| 1e3 * u).collect(),
        grasp_n: grasp_force,
    })
}
