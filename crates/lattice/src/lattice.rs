//! A lattice: hexahedra around a body, and how much of each is material.

use crate::grid::Grid;
use crate::moments::Moments;
use crate::pieces::Pieces;
use crate::ramify::Ramified;
use crate::{BoundaryRule, Error, LatticeOptions, Result};
use glam::{DMat3, DVec3};
use trocar_geometry::{LatticeMesher, MeshDistance, TetMesh, TriMesh};

/// Cells with more than this share of material count as full.
const FULL: f64 = 1.0 - 1e-9;

/// Edge of the tetrahedra that fill a surface, over the edge of a cell.
const FILLING: f64 = 0.5;

/// Offset of Gauss's two points from the middle of a side, over the side.
const GAUSS: f64 = 0.288_675_134_594_812_9;

/// One hexahedron: a connected part of the material in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hexahedron {
    /// Its nodes. Node c is the cell's corner (c & 1, c >> 1 & 1, c >> 2).
    pub nodes: [u32; 8],
    /// Its place in the grid.
    pub cell: [u32; 3],
    /// Volume of its material over the volume of the cell, in (0, 1].
    pub fraction: f64,
    /// Where the volumetric part is evaluated: the material's centroid. In the cell's own
    /// coordinates from 0 to 1, as is `spread`.
    pub centre: DVec3,
    /// The points of the deviatoric part are `centre + spread * (+-1, +-1, +-1)`, with equal
    /// weights.
    pub spread: DMat3,
}

/// A regular lattice of hexahedra around a body.
///
/// It is cut from a tetrahedral mesh of the body. Volume, mean and covariance of the material in
/// each cell are exact integrals over the parts of tetrahedra inside it.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::TetMesh;
/// use trocar_lattice::{Lattice, LatticeOptions};
///
/// let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let mesh = TetMesh { vertices: corners.map(|p| 0.01 * p).to_vec(), tets: vec![[0, 1, 2, 3]] };
/// let lattice = Lattice::of_mesh(&mesh, &LatticeOptions::new(0.004))?;
/// assert!((lattice.volume() / mesh.volume() - 1.0).abs() < 1e-6);
/// # Ok::<(), trocar_lattice::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Lattice {
    pub(crate) grid: Grid,
    pub(crate) options: LatticeOptions,
    pub(crate) mesh: TetMesh,
    hexahedra: Vec<Hexahedron>,
    nodes: Vec<DVec3>,
    shares: Vec<f64>,
    /// Cell, tetrahedron and hexahedron of each piece, sorted by cell and tetrahedron.
    pub(crate) pieces: Vec<(usize, u32, u32)>,
}

impl Lattice {
    /// A lattice around a tetrahedral mesh.
    ///
    /// # Errors
    /// [`Error::Lattice`] for an empty mesh, coordinates that are not finite, node indices out of
    /// range, elements without a positive volume, options out of range and more than
    /// [`MAX_CELLS`](crate::MAX_CELLS) cells.
    pub fn of_mesh(mesh: &TetMesh, options: &LatticeOptions) -> Result<Self> {
        let bounds = check(mesh)?;
        let grid = Grid::new(options, bounds, mesh.volume())?;
        let pieces = Pieces::new(grid, mesh)?;
        let ramified = Ramified::new(&pieces, mesh);
        let mut moments = vec![Moments::default(); ramified.cells.len()];
        for (piece, hex) in pieces.list.iter().zip(&ramified.hex_of_piece) {
            moments[*hex as usize].add(&piece.moments);
        }
        let mut shares = vec![0.0; ramified.corners.len()];
        let mut hexahedra = Vec::with_capacity(moments.len());
        for ((nodes, cell), moments) in ramified.nodes.iter().zip(&ramified.cells).zip(&moments) {
            let moments = if moments.volume > FULL { &Moments::FULL } else { moments };
            for (node, share) in nodes.iter().zip(moments.shares()) {
                shares[*node as usize] += share * grid.cell.powi(3);
            }
            hexahedra.push(hexahedron(*nodes, grid.at(*cell), moments, options.rule));
        }
        let tagged = pieces.list.iter().zip(&ramified.hex_of_piece);
        Ok(Self {
            grid,
            options: *options,
            mesh: mesh.clone(),
            hexahedra,
            nodes: ramified.corners.iter().map(|at| grid.corner(*at)).collect(),
            shares,
            pieces: tagged.map(|(piece, hex)| (piece.cell, piece.tet, *hex)).collect(),
        })
    }

    /// A lattice around a watertight surface. Its inside is first filled with tetrahedra of half a
    /// cell's edge ([`LatticeMesher`]), which round off smaller features. [`Self::volume`] is the
    /// volume that is kept.
    ///
    /// # Errors
    /// As [`Self::of_mesh`], and for a surface that is not watertight, faces inward, or is too thin
    /// for the cell.
    pub fn of_surface(surface: &TriMesh, options: &LatticeOptions) -> Result<Self> {
        let refused = |reason: String| Err(Error::Lattice(format!("the surface {reason}")));
        let Some(bounds) = surface.bounds().filter(|_| !surface.triangles.is_empty()) else {
            return refused("is empty; a lattice needs a closed surface with a volume".to_owned());
        };
        if let Some(v) = surface.vertices.iter().position(|p| !p.is_finite()) {
            return refused(format!("has vertex {v} at {}; coordinates must be finite", surface.vertices[v]));
        }
        if !surface.is_watertight() {
            let open = surface.open_edges();
            return refused(format!("is not watertight ({open} open edges); repair or close it first"));
        }
        let volume = surface.volume();
        if volume.is_nan() || volume <= 0.0 {
            return refused(format!("encloses {volume} m3; triangles must face outward"));
        }
        Grid::new(options, bounds, volume)?;
        let inside = |e: trocar_geometry::Error| Error::Lattice(format!("the surface cannot be filled: {e}"));
        let shape = MeshDistance::new(surface).map_err(inside)?;
        let mesh = LatticeMesher::uniform(FILLING * options.cell).mesh_shape(&shape, bounds).map_err(inside)?;
        Self::of_mesh(&mesh, options)
    }

    /// The hexahedra, ordered by cell.
    pub fn hexahedra(&self) -> &[Hexahedron] {
        &self.hexahedra
    }

    /// Rest positions of the nodes (m).
    pub fn nodes(&self) -> &[DVec3] {
        &self.nodes
    }

    /// Integral of each node's shape function over the material (m3): its share of the volume.
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// Edge of a cell (m).
    pub fn cell(&self) -> f64 {
        self.grid.cell
    }

    /// For each node the node of another lattice that it was before a cut. `whole` is that of the
    /// uncut body, on the same grid; `before` tells which of its elements an element of this
    /// lattice was. None for nodes that the whole did not have.
    pub fn nodes_before(&self, whole: &Self, before: impl Fn(u32) -> Option<u32>) -> Vec<Option<u32>> {
        let offset = ((self.grid.origin - whole.grid.origin) / self.grid.cell).round();
        let mut nodes = vec![None; self.nodes.len()];
        for (cell, tet, hex) in &self.pieces {
            let at = (DVec3::from_array(self.grid.at(*cell).map(|n| n as f64)) + offset).to_array();
            let inside = |axis: usize| at[axis] >= 0.0 && at[axis] < whole.grid.dims[axis] as f64;
            let (true, Some(old)) = ((0..3).all(inside), before(*tet)) else { continue };
            let key = (whole.grid.index(at.map(|n| n as usize)), old);
            if let Ok(found) = whole.pieces.binary_search_by_key(&key, |piece| (piece.0, piece.1)) {
                let from = &whole.hexahedra[whole.pieces[found].2 as usize].nodes;
                for (node, from) in self.hexahedra[*hex as usize].nodes.iter().zip(from) {
                    nodes[*node as usize] = Some(*from);
                }
            }
        }
        nodes
    }

    /// The options that it was made with.
    pub fn options(&self) -> &LatticeOptions {
        &self.options
    }

    /// The tetrahedra that it was cut from.
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// Volume of the material (m3).
    pub fn volume(&self) -> f64 {
        self.hexahedra.iter().map(|hex| hex.fraction).sum::<f64>() * self.grid.cell.powi(3)
    }

    /// Number of cells that hold two or more hexahedra, because parts of the body in them are not
    /// connected.
    pub fn doubled_cells(&self) -> usize {
        self.hexahedra.chunk_by(|a, b| a.cell == b.cell).filter(|cell| cell.len() > 1).count()
    }
}

fn hexahedron(nodes: [u32; 8], cell: [usize; 3], moments: &Moments, rule: BoundaryRule) -> Hexahedron {
    let gauss = DMat3::from_diagonal(DVec3::splat(GAUSS));
    let (centre, spread) = match rule {
        BoundaryRule::Moments if moments.volume < 1.0 => (moments.mean(), moments.spread()),
        BoundaryRule::Moments | BoundaryRule::Fraction => (DVec3::splat(0.5), gauss),
    };
    Hexahedron { nodes, cell: cell.map(|n| n as u32), fraction: moments.volume, centre, spread }
}

/// Refuses meshes that cannot be cut. Returns the bounds (m).
fn check(mesh: &TetMesh) -> Result<(DVec3, DVec3)> {
    let refused = |reason: String| Err(Error::Lattice(format!("the mesh {reason}")));
    let (Some(bounds), false) = (mesh.bounds(), mesh.tets.is_empty()) else {
        return refused("is empty; a lattice needs at least one tetrahedron".to_owned());
    };
    if let Some(v) = mesh.vertices.iter().position(|p| !p.is_finite()) {
        return refused(format!("has node {v} at {}; coordinates must be finite", mesh.vertices[v]));
    }
    let count = mesh.vertices.len();
    if let Some(t) = mesh.tets.iter().position(|tet| tet.iter().any(|node| *node as usize >= count)) {
        return refused(format!("has element {t} with nodes {:?}; there are only {count}", mesh.tets[t]));
    }
    if let Some(t) = (0..mesh.tets.len()).find(|t| !matches!(mesh.tet_volume(*t), v if v > 0.0)) {
        return refused(format!("has element {t} of volume {:.2e} m3; must be positive", mesh.tet_volume(t)));
    }
    Ok(bounds)
}
