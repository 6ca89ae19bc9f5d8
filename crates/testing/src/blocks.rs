//! Small bodies of tissue.
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "helpers of tests may panic")]

use glam::DVec3;
use std::collections::BTreeMap;
use trocar_geometry::{LatticeMesher, SignedDistance, TetMesh, TriMesh};
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, Descent, Material, Model, ModelBuilder, SolverSettings, Start, SupportField,
    SupportPlane,
};

/// Length of a frame (s).
pub const FRAME: f64 = 1.0 / 60.0;
/// Gravitational acceleration (m/s2).
pub const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);

/// The appendix's material; `viscosity` 0.
pub fn tissue(young_modulus: f64) -> Material {
    Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus,
        poisson_ratio: 0.45,
        density: 1200.0,
        viscosity: 0.0,
    }
}

/// A schedule to be judged.
#[derive(Clone, Copy, Debug)]
pub struct Judged {
    /// Its name in messages.
    pub name: &'static str,
    /// The schedule.
    pub schedule: SolverSettings,
    /// Whether it minimises: held to the laws that the minimum keeps. Sweeps that stop early are
    /// not at the minimum.
    pub converges: bool,
}

/// Every schedule that solvers are judged by.
pub fn schedules() -> Vec<Judged> {
    vec![
        Judged { name: "paper", schedule: SolverSettings::PAPER, converges: false },
        Judged { name: "adaptive sweeps", schedule: adaptive(), converges: false },
        Judged { name: "fast", schedule: SolverSettings::FAST, converges: true },
        Judged { name: "many sweeps", schedule: many_sweeps(), converges: true },
    ]
}

/// The paper's sweeps from an adaptive start.
pub fn adaptive() -> SolverSettings {
    SolverSettings::Descent(Descent { substeps: 8, iterations: 10, start: Start::Adaptive })
}

/// So many sweeps that little is left to minimise on a small mesh.
pub fn many_sweeps() -> SolverSettings {
    SolverSettings::Descent(Descent { substeps: 8, iterations: 150, start: Start::Adaptive })
}

/// A number in 0..1 for each counter, the same on every machine.
pub fn noise(k: u64) -> f64 {
    trocar_core::unit(trocar_core::mix(k.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

/// A box of `cells` cubes of edge `edge` (m), lower corner at the origin, six tetrahedra a cube
/// around its main diagonal.
pub fn block(cells: [usize; 3], edge: f64) -> TetMesh {
    let [nx, ny, nz] = cells;
    let index = |i: usize, j: usize, k: usize| ((k * (ny + 1) + j) * (nx + 1) + i) as u32;
    let mut mesh = TetMesh::default();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                mesh.vertices.push(edge * DVec3::new(i as f64, j as f64, k as f64));
            }
        }
    }
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let corner = |c: usize| index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1));
                for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    mesh
}

/// Nodes of `mesh` for which `chosen` holds.
pub fn nodes(mesh: &TetMesh, chosen: impl Fn(DVec3) -> bool) -> Vec<u32> {
    (0..mesh.vertices.len() as u32).filter(|i| chosen(mesh.vertices[*i as usize])).collect()
}

/// A model of one body under `gravity`.
pub fn model(mesh: &TetMesh, material: Material, pinned: Vec<u32>, gravity: DVec3) -> Model {
    let mut builder = ModelBuilder::new().gravity(gravity);
    builder.body(BodyDescription { name: "block".into(), mesh, material, pinned, supports: vec![] }).unwrap();
    builder.build().unwrap()
}

/// An organ of an appendix's size, bent in the plane z = 0, by the lattice mesher with cells of
/// `cell` (m). It lies along x from 0 to its length.
pub fn appendix(cell: f64) -> TetMesh {
    struct Tube;
    impl SignedDistance for Tube {
        fn distance(&self, p: DVec3) -> f64 {
            let x = p.x.clamp(RADIUS, LENGTH - RADIUS);
            let middle = DVec3::new(x, 4.0 * x * (LENGTH - x), 0.0);
            // The curve is steep at its ends: 0.9 keeps the value below the distance.
            0.9 * (p.distance(middle) - RADIUS)
        }
    }
    const LENGTH: f64 = 0.085;
    const RADIUS: f64 = 0.0045;
    let bounds = (DVec3::new(0.0, -RADIUS, -RADIUS), DVec3::new(LENGTH, 0.02, RADIUS));
    LatticeMesher::uniform(cell).mesh_shape(&Tube, bounds).unwrap()
}

/// Three small bodies: one to be grasped, one dropped on a plane, one on a field; and the
/// nodes of the first to be grasped.
pub fn three_bodies() -> (Model, Vec<u32>) {
    let (large, small) = (block([2, 2, 4], 2e-3), block([2, 1, 1], 2e-3));
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let material = Material { viscosity: 4.0, ..tissue(12e3) };
    let pinned = nodes(&large, |p| p.z == 0.0);
    builder.body(BodyDescription { name: "held".into(), mesh: &large, material, pinned, supports: vec![] }).unwrap();
    let plane = SupportPlane { point: DVec3::Z * -2e-3, normal: DVec3::Z, friction: 0.6 };
    let field = SupportField::under(&small, DVec3::new(0.1, 0.0, 1.0), 1e-3, 0.4).unwrap();
    for (name, model, support) in [
        ("dropped", ConstitutiveModel::StVenantKirchhoff, plane.into()),
        ("lying", ConstitutiveModel::Corotated, field.into()),
    ] {
        let (material, supports) = (Material { model, ..material }, vec![support]);
        let body = BodyDescription { name: name.into(), mesh: &small, material, pinned: vec![], supports };
        builder.body(body).unwrap();
    }
    (builder.build().unwrap(), nodes(&large, |p| p.z > 7e-3 && p.x < 3e-3))
}

/// The same surface with each triangle in four.
pub fn refined(surface: &TriMesh) -> TriMesh {
    let mut fine = TriMesh { vertices: surface.vertices.clone(), ..TriMesh::default() };
    let mut middles = BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            fine.vertices.push(0.5 * (surface.vertices[a as usize] + surface.vertices[b as usize]));
            fine.vertices.len() as u32 - 1
        })
    };
    for [a, b, c] in &surface.triangles {
        let [ab, bc, ca] = [middle(*a, *b), middle(*b, *c), middle(*c, *a)];
        fine.triangles.extend([[*a, ab, ca], [*b, bc, ab], [*c, ca, bc], [ab, bc, ca]]);
    }
    fine
}
