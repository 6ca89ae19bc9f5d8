//! Isosurface stuffing on a body-centred cubic lattice.
//!
//! Labelle and Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good dihedral angles", SIGGRAPH 2007.

use super::Mesher;
use super::bcc::{Lattice, Point};
use super::body::largest_body;
use super::cuts::Cuts;
use super::stencil::{Corner, Side, fill};
use crate::{Error, MeshDistance, Result, SignedDistance, TetMesh, TriMesh};
use glam::DVec3;
use rayon::prelude::*;

/// The default mesher: no slivers by construction. Every dihedral angle lies between 10.78 and 164.74 degrees.
#[derive(Clone, Copy, Debug)]
pub struct LatticeMesher {
    /// Edge of the lattice's cubic cell [m]; the tets' edges are this long and 0.87 times this long.
    pub cell: f64,
}

impl LatticeMesher {
    /// Chooses the cell for a body of `volume` [m3]: `finest` [m], or larger so that about `max_tets` elements fill it.
    ///
    /// A cubic cell holds 12 tets. Those at the surface are split further, so a small or thin body gets more.
    pub fn for_volume(volume: f64, finest: f64, max_tets: usize) -> Self {
        Self { cell: finest.max((12.0 * volume / max_tets.max(1) as f64).cbrt()) }
    }

    /// Fills `shape`, which lies within `bounds` [m], with tets of about `cell`, nodes on its surface.
    ///
    /// The field must be continuous and change no faster than 1.25 times the distance moved: its sign is taken as known
    /// where it is that far from 0. Only the largest connected part is kept; where it would touch itself along an edge,
    /// it is parted there.
    ///
    /// # Errors
    /// A field that is not finite, a shape that reaches beyond `bounds`, and a shape too thin for the cell to hold one tet.
    pub fn mesh_shape(&self, shape: &dyn SignedDistance, bounds: (DVec3, DVec3)) -> Result<TetMesh> {
        let mut lattice = Lattice::sample(shape, bounds, self.cell)?;
        let mut cuts = Cuts::find(&lattice, shape)?;
        cuts.warp(&mut lattice);
        let body = largest_body(stuff(&lattice, &cuts));
        if body.tets.is_empty() {
            let size = bounds.1 - bounds.0;
            return Err(Error::Mesh(format!(
                "no tetrahedron of a lattice with {} m cells fits into the shape ({:.4} x {:.4} x {:.4} m); \
                 it is empty, or needs a finer cell",
                self.cell, size.x, size.y, size.z
            )));
        }
        Ok(body)
    }
}

impl Mesher for LatticeMesher {
    /// As [`LatticeMesher::mesh_shape`], of the surface's signed distance: cracks and stray triangles do no harm.
    fn mesh(&self, surface: &TriMesh) -> Result<TetMesh> {
        let shape = MeshDistance::new(surface)?;
        let bounds = surface.bounds().ok_or_else(|| Error::Mesh("the surface has no vertices".into()))?;
        self.mesh_shape(&shape, bounds)
    }

    fn describe(&self) -> String {
        format!("isosurface stuffing, lattice cells of {:.3} mm", 1e3 * self.cell)
    }
}

/// The filling of every lattice tet, nodes numbered in the order of their first use.
fn stuff(lattice: &Lattice, cuts: &Cuts) -> TetMesh {
    // Lattice points are named by slot, cut points by their number after the last slot.
    let slots = lattice.values.len();
    let filled: Vec<Vec<[u32; 4]>> = lattice
        .stored_blocks()
        .map(|block| {
            let mut tets = Vec::new();
            for centre in block.map(|slot| lattice.point(slot)).filter(|p| p[0] % 2 != 0) {
                for axis in 0..3 {
                    stuff_face(lattice, cuts, centre, axis, &mut tets);
                }
            }
            tets
        })
        .collect();
    let mut mesh = TetMesh { vertices: Vec::new(), tets: filled.into_iter().flatten().collect() };
    let mut number = vec![u32::MAX; slots + cuts.len()];
    for node in mesh.tets.iter_mut().flatten() {
        let name = *node as usize;
        if number[name] == u32::MAX {
            number[name] = mesh.vertices.len() as u32;
            mesh.vertices.push(if name < slots {
                cuts.position_of_point(lattice, *node)
            } else {
                cuts.position(lattice, name - slots)
            });
        }
        *node = number[name];
    }
    mesh
}

/// Fills the four lattice tets between a cell centre and the next one along `axis`: those over the edges of the face
/// between the two cells.
fn stuff_face(lattice: &Lattice, cuts: &Cuts, centre: Point, axis: usize, tets: &mut Vec<[u32; 4]>) {
    let towards = |along: i32, u: i32, v: i32| {
        let mut p = centre;
        p[axis] += along;
        p[(axis + 1) % 3] += u;
        p[(axis + 2) % 3] += v;
        p
    };
    // Counter-clockwise around the axis, which makes (centre, next, rim[i], rim[i + 1]) positive.
    let points = [centre, towards(2, 0, 0), towards(1, -1, -1), towards(1, 1, -1), towards(1, 1, 1), towards(1, -1, 1)];
    let slots = points.map(|p| lattice.slot(p));
    let sides = slots.map(|slot| match slot.map_or(1.0, |slot| lattice.values[slot as usize]) {
        value if value < 0.0 => Side::Inside,
        value if value > 0.0 => Side::Outside,
        _ => Side::Surface,
    });
    if !sides.contains(&Side::Inside) {
        return;
    }
    for i in 0..4 {
        let of = [0, 1, 2 + i, 2 + (i + 1) % 4];
        let corners = of.map(|k| points[k]);
        fill(&corners, &of.map(|k| sides[k]), |tet| {
            // Inside and surface corners have a slot, and every edge from inside to outside a cut.
            let name = |corner| match corner {
                Corner::Point(k) => slots[of[k]],
                Corner::Cut(k, l) => {
                    cuts.between(lattice, corners[k], corners[l]).map(|cut| (lattice.values.len() + cut) as u32)
                }
            };
            if let [Some(a), Some(b), Some(c), Some(d)] = tet.map(name) {
                tets.push([a, b, c, d]);
            }
        });
    }
}
