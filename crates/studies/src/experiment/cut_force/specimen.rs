//! The tissue that is cut: a slab whose edge is between the blades, and a tube across them.

use crate::Result;
use glam::DVec3;
use trocar_geometry::{LatticeMesher, SignedDistance, TetMesh, TetQuality};
use trocar_specimen::{Material, Organ, OrganFacts, Pins, Provenance, Specimen};

/// Thickness of the slab (m).
pub(super) const THICKNESS: f64 = 3e-3;

/// Distance of its edge from the jaw's pivot (m).
const EDGE: f64 = 4.5e-3;

/// Cubes of the slab along the blades, across the cut, and through its thickness, and their edges
/// (m).
const CUBES: ([u32; 3], [f64; 3]) = ([24, 12, 3], [1.0625e-3, 1.2e-3, 1e-3]);

/// Distance of the tissue's middle from the plane of the cut (m). With it no element has equal
/// parts on both sides of the plane, as in an ordinary mesh.
const ASIDE: f64 = 0.3e-3;

/// Radius and half the length of the tube (m), the distance of its axis from the pivot, and the
/// edge of its elements.
const RADIUS: f64 = 4.5e-3;
const HALF_LENGTH: f64 = 0.03;
const AXIS: f64 = 0.012;
const ELEMENT: f64 = 1.6e-3;

/// Modulus (Pa): tissue that keeps its shape on its bed. The force of a cut does not depend on it.
const MODULUS: f64 = 100e3;

/// What is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// A slab in the plane of the shaft, at right angles to the one in which the blades move.
    Slab,
    /// A round tube across the blades.
    Tube,
}

/// A tube along y.
struct Tube;

impl SignedDistance for Tube {
    fn distance(&self, p: DVec3) -> f64 {
        (p - DVec3::Y * p.y.clamp(RADIUS - HALF_LENGTH, HALF_LENGTH - RADIUS)).length() - RADIUS
    }
}

impl Shape {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Slab => "slab",
            Self::Tube => "tube",
        }
    }

    /// Its thickness between the blades (m), where it is the same everywhere.
    pub fn thickness(self) -> Option<f64> {
        (self == Self::Slab).then_some(THICKNESS)
    }

    /// Distance of its nearest edge from the pivot (m).
    pub fn edge(self) -> f64 {
        match self {
            Self::Slab => EDGE,
            Self::Tube => AXIS - RADIUS,
        }
    }

    /// The specimen in a cell whose jaw's pivot is at `height` (m) above the origin.
    pub fn specimen(self, height: f64) -> Result<Specimen> {
        let mut body = match self {
            Self::Slab => slab(),
            Self::Tube => {
                let half = DVec3::new(RADIUS, HALF_LENGTH, RADIUS);
                LatticeMesher::uniform(ELEMENT).mesh_shape(&Tube, (-half, half))?
            }
        };
        let middle = match self {
            Self::Slab => DVec3::new(EDGE, 0.0, 0.0),
            Self::Tube => DVec3::new(AXIS, 0.0, 0.0),
        };
        let middle = middle + ASIDE * DVec3::Y;
        body.vertices.iter_mut().for_each(|p| *p += middle + height * DVec3::Z);
        let base = match self {
            Self::Slab => middle,
            Self::Tube => middle - HALF_LENGTH * DVec3::Y,
        };
        let quality = TetQuality::of(&body);
        let organ = Organ {
            name: "tissue".into(),
            surface: body.boundary().0,
            material: Material { young_modulus_pa: MODULUS, ..Material::default() },
            pins: Pins::None,
            base: base + height * DVec3::Z,
            threads: None,
            posterior: None,
            facts: OrganFacts { nodes: body.vertices.len(), inverted: quality.inverted, ..OrganFacts::default() },
            body,
        };
        Ok(Specimen {
            name: self.name().into(),
            up: DVec3::Z,
            placement: trocar_core::Pose::IDENTITY,
            camera: None,
            organs: vec![organ],
            background: None,
            provenance: Provenance::default(),
        })
    }
}

/// Cubes of six elements each, from x = 0 on, about y = 0 and z = 0.
fn slab() -> TetMesh {
    let ([nx, ny, nz], edges) = CUBES;
    let half = 0.5 * DVec3::new(0.0, f64::from(ny), f64::from(nz));
    let node = |x: u32, y: u32, z: u32| x + (nx + 1) * (y + (ny + 1) * z);
    let mut mesh = TetMesh::default();
    for z in 0..=nz {
        for y in 0..=ny {
            for x in 0..=nx {
                mesh.vertices.push((DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - half) * DVec3::from(edges));
            }
        }
    }
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let corner = |c: u32| node(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
                for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    mesh
}
