//! A tetrahedral mesh cut into pieces: the part of a tetrahedron inside a cell.

use crate::clip::{Tet, area_in_cell, section, split};
use crate::grid::{Grid, too_many};
use crate::moments::Moments;
use crate::{MAX_CELLS, Result};
use glam::DVec3;
use rayon::prelude::*;
use trocar_geometry::TetMesh;

/// Sections and faces with less area (cells) do not connect what lies on their two sides. It is
/// above the rounding of an area and below the square of the distance at which nodes are moved to
/// the grid's planes.
const MIN_AREA: f64 = 1e-15;

/// The part of one tetrahedron inside one cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Number of the cell.
    pub cell: usize,
    /// The tetrahedron.
    pub tet: u32,
    pub moments: Moments,
}

/// All pieces of a mesh, sorted by cell, then by tetrahedron.
pub(crate) struct Pieces {
    pub grid: Grid,
    /// Nodes of the mesh in cells.
    pub nodes: Vec<DVec3>,
    pub list: Vec<Piece>,
}

impl Pieces {
    /// Cuts a mesh.
    pub fn new(grid: Grid, mesh: &TetMesh) -> Result<Self> {
        let nodes: Vec<DVec3> = mesh.vertices.par_iter().map(|p| grid.local(*p)).collect();
        let cut = |t: usize| pieces_of(&grid, t as u32, mesh.tets[t].map(|node| nodes[node as usize]));
        let mut list: Vec<Piece> = (0..mesh.tets.len()).into_par_iter().flat_map_iter(cut).collect();
        list.sort_by_key(|piece| (piece.cell, piece.tet));
        let cells = list.chunk_by(|a, b| a.cell == b.cell).count();
        if cells > MAX_CELLS {
            return Err(too_many(grid.cell, cells as f64));
        }
        Ok(Self { grid, nodes, list })
    }

    /// The piece of `tet` in `cell`.
    pub fn find(&self, cell: usize, tet: u32) -> Option<usize> {
        self.list.binary_search_by_key(&(cell, tet), |piece| (piece.cell, piece.tet)).ok()
    }

    /// The cell one farther along `axis`, if the grid has one.
    pub fn next(&self, cell: usize, axis: usize) -> Option<usize> {
        let mut at = self.grid.at(cell);
        at[axis] += 1;
        (at[axis] < self.grid.dims[axis]).then(|| self.grid.index(at))
    }

    fn lowest(&self, cell: usize) -> DVec3 {
        DVec3::from_array(self.grid.at(cell).map(|n| n as f64))
    }

    /// Whether a face has a part in the closed cell.
    pub fn face_reaches(&self, face: [u32; 3], cell: usize) -> bool {
        area_in_cell(&face.map(|node| self.nodes[node as usize]), self.lowest(cell)) > MIN_AREA
    }

    /// Whether a tetrahedron crosses the upper side of a cell across `axis`.
    pub fn crosses(&self, tet: [u32; 4], cell: usize, axis: usize) -> bool {
        let lowest = self.lowest(cell);
        let polygon = section(&tet.map(|node| self.nodes[node as usize]), axis, lowest[axis] + 1.0);
        area_in_cell(&polygon, lowest) > MIN_AREA
    }

    /// The axis across which a face lies exactly in a plane of the grid, and the plane.
    pub fn plane_of(&self, face: [u32; 3]) -> Option<(usize, usize)> {
        let [a, b, c] = face.map(|node| self.nodes[node as usize]);
        let flat = |axis: &usize| a[*axis] == b[*axis] && a[*axis] == c[*axis] && a[*axis].fract() == 0.0;
        (0..3).find(flat).map(|axis| (axis, a[axis] as usize))
    }
}

fn pieces_of(grid: &Grid, tet: u32, corners: Tet) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (i, slab) in slabs(vec![corners], 0, grid.dims[0]) {
        for (j, bar) in slabs(slab, 1, grid.dims[1]) {
            for (k, parts) in slabs(bar, 2, grid.dims[2]) {
                let lowest = DVec3::new(i as f64, j as f64, k as f64);
                let mut moments = Moments::default();
                parts.iter().for_each(|part| moments.add_tet(part, lowest));
                if moments.volume > 0.0 {
                    pieces.push(Piece { cell: grid.index([i, j, k]), tet, moments });
                }
            }
        }
    }
    pieces
}

/// The parts of tetrahedra in each layer of cells across `axis`, of `count` layers.
fn slabs(tets: Vec<Tet>, axis: usize, count: usize) -> Vec<(usize, Vec<Tet>)> {
    let range = tets.iter().flatten().map(|p| p[axis]);
    let (low, high) = range.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if tets.is_empty() || !low.is_finite() || !high.is_finite() {
        return Vec::new();
    }
    let first = (low as usize).min(count - 1);
    let last = (high.ceil() as usize).clamp(first + 1, count);
    let mut left = tets;
    let mut layers = Vec::with_capacity(last - first);
    for layer in first..last {
        if layer + 1 == last {
            layers.push((layer, std::mem::take(&mut left)));
            break;
        }
        let (mut below, mut above) = (Vec::new(), Vec::new());
        left.iter().for_each(|tet| split(tet, axis, (layer + 1) as f64, &mut below, &mut above));
        layers.push((layer, below));
        left = above;
    }
    layers
}
