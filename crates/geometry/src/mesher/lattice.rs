//! Isosurface stuffing on a body-centred cubic lattice, with larger elements inside the body.
//!
//! F. Labelle, J. R. Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good dihedral
//! angles", SIGGRAPH 2007.

use super::bcc::Lattice;
use super::body::largest_body;
use super::cuts::Cuts;
use super::fill::Filling;
use super::interface::Mesher;
use crate::{Error, MeshDistance, Result, SignedDistance, TetMesh, TriMesh};
use glam::DVec3;

/// Largest automatically chosen cell, in units of volume over area. Volume over area is half the
/// radius of a long tube, so this is the radius.
const MAX_CELL: f64 = 2.0;

/// The default mesher. It produces no slivers by construction: every dihedral angle is between 10.7
/// and 165 degrees.
///
/// Elements at the surface have the finest size, `cell`. Away from the surface they grow by factors
/// of two, up to `coarsest` times that size. These inner elements have angles between 45 and 120
/// degrees. The surface does not depend on `coarsest`.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::{LatticeMesher, SignedDistance};
///
/// struct Ball;
/// impl SignedDistance for Ball {
///     fn distance(&self, p: DVec3) -> f64 {
///         p.length() - 0.02
///     }
/// }
///
/// let bounds = (DVec3::splat(-0.02), DVec3::splat(0.02));
/// let body = LatticeMesher::graded(0.002).mesh_shape(&Ball, bounds)?;
/// assert!((body.volume() / 3.351e-5 - 1.0).abs() < 0.01);
/// # Ok::<(), trocar_geometry::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeMesher {
    /// Edge of the finest cubic cell of the lattice (m). Regular tets there have edges of 1 and
    /// 0.87 times this length.
    pub cell: f64,
    /// Edge of the largest inner cube in cells, rounded down to a power of two. 1 gives a uniform
    /// lattice.
    pub coarsest: u32,
}

impl LatticeMesher {
    /// The value of `coarsest` in [`LatticeMesher::graded`].
    pub const COARSEST: u32 = 8;

    /// Cells of `cell` (m) at the surface, up to [`LatticeMesher::COARSEST`] times larger inside.
    pub fn graded(cell: f64) -> Self {
        Self { cell, coarsest: Self::COARSEST }
    }

    /// Cells of `cell` (m) everywhere.
    pub fn uniform(cell: f64) -> Self {
        Self { cell, coarsest: 1 }
    }

    /// A graded lattice for the body inside `surface`. The cells are `finest` (m), or larger if
    /// more than about `max_tets` elements are expected. The estimate is within about 5% for an
    /// organ; thin bodies get up to 15% fewer elements. The cells never exceed the size at which a
    /// body of this thickness would fall apart, even if the budget is exceeded. See also
    /// [`LatticeMesher::fit`].
    pub fn for_body(surface: &TriMesh, finest: f64, max_tets: usize) -> Self {
        let (area, volume) = (surface.area(), surface.volume().abs());
        if !(area > 0.0 && volume > 0.0 && area.is_finite() && volume.is_finite()) {
            return Self::graded(finest);
        }
        // The count decreases with the cell size: bisection in the logarithm of the size.
        let budget = max_tets.max(1) as f64;
        let (mut low, mut high) = (1e-9 * volume / area, MAX_CELL * volume / area);
        for _ in 0..100 {
            let middle = (low * high).sqrt();
            *(if expected_tets(area, volume, middle) > budget { &mut low } else { &mut high }) = middle;
        }
        Self::graded(finest.max(high))
    }

    /// Meshes `surface` with cells of `finest` (m), or larger for at most 1.1 `max_tets` elements.
    /// Starts with [`LatticeMesher::for_body`] and repeats with larger cells, at most twice, while
    /// there are more elements. Returns the mesher used and the mesh.
    ///
    /// # Errors
    /// As [`LatticeMesher::mesh`](Mesher::mesh).
    pub fn fit(surface: &TriMesh, finest: f64, max_tets: usize) -> Result<(Self, TetMesh)> {
        let shape = MeshDistance::new(surface)?;
        let bounds = bounds(surface)?;
        let mut mesher = Self::for_body(surface, finest, max_tets);
        let mut body = mesher.mesh_shape(&shape, bounds)?;
        for _ in 0..2 {
            let excess = body.tets.len() as f64 / max_tets.max(1) as f64;
            if excess <= 1.1 {
                break;
            }
            // The count is proportional to the cell size to the power of -2 to -3.
            let cell = (mesher.cell * excess.sqrt()).min(MAX_CELL * surface.volume().abs() / surface.area());
            if cell <= mesher.cell {
                break;
            }
            mesher.cell = cell;
            body = mesher.mesh_shape(&shape, bounds)?;
        }
        Ok((mesher, body))
    }

    /// Meshes `shape`, which lies within `bounds` (m), with boundary nodes on its surface.
    ///
    /// The field must be continuous with a slope of at most 1.25, because the sign is assumed to be
    /// known at that distance from the surface. Only the largest connected part is kept. Where it
    /// touches itself along an edge, it is separated.
    ///
    /// # Errors
    /// A field that is not finite, a shape that extends beyond `bounds`, a shape too thin to
    /// contain one tet of this cell size, and a cell so small that there would be more than 30
    /// million tets.
    pub fn mesh_shape(&self, shape: &dyn SignedDistance, bounds: (DVec3, DVec3)) -> Result<TetMesh> {
        let mut lattice = Lattice::sample(shape, bounds, self.cell)?;
        let mut cuts = Cuts::find(&lattice, shape)?;
        cuts.warp(&mut lattice);
        let body = largest_body(Filling::new(&lattice, &cuts, self.coarsest)?.tets()?);
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
    /// [`LatticeMesher::mesh_shape`] of the signed distance to the surface. Cracks and stray
    /// triangles are tolerated.
    fn mesh(&self, surface: &TriMesh) -> Result<TetMesh> {
        let shape = MeshDistance::new(surface)?;
        self.mesh_shape(&shape, bounds(surface)?)
    }

    fn describe(&self) -> String {
        let mm = 1e3 * self.cell;
        match self.coarsest {
            0 | 1 => format!("lattice {mm:.2} mm, uniform"),
            coarsest => format!("lattice {mm:.2} mm, {} times as coarse inside", 1u32 << coarsest.ilog2()),
        }
    }
}

/// Expected number of elements of a graded lattice with cells of `cell` (m) in a body of `area`
/// (m2) and `volume` (m3).
///
/// With the relative thickness t = volume / (area cell), there are 37.5 t / (t + 1.6) elements per
/// cell^2 of surface: proportional to t in a thin body, constant in a thick one. Fitted to seven
/// organs (liver, stomach, spleen, kidney, duodenum, bladder, gallbladder) for t from 0.8 to 12.
/// For t above 1.5 it is within 5%.
fn expected_tets(area: f64, volume: f64, cell: f64) -> f64 {
    37.5 * area / (cell * cell) * volume / (volume + 1.6 * area * cell)
}

fn bounds(surface: &TriMesh) -> Result<(DVec3, DVec3)> {
    surface.bounds().ok_or_else(|| Error::Mesh("the surface has no vertices".into()))
}
