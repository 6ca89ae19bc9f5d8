//! Points that move with a lattice: surface vertices, grasps, pins, supports, measured points.

use crate::{Error, Lattice, Result};
use glam::DVec3;
use rayon::prelude::*;
use trocar_geometry::closest_on_triangle;

/// A point that moves with the eight nodes of a hexahedron, by trilinear weights. The weights sum
/// to 1. They lie in [0, 1] inside the cell, and extrapolate outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmbeddedPoint {
    /// The hexahedron.
    pub hexahedron: u32,
    /// Its nodes.
    pub nodes: [u32; 8],
    /// The weight of each node.
    pub weights: [f64; 8],
}

impl EmbeddedPoint {
    /// The weighted sum of a vector field over the nodes: the point's position from their
    /// positions, its velocity from their velocities.
    #[inline]
    pub fn interpolate(&self, field: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(&self.weights).map(|(node, weight)| *weight * field[*node as usize]).sum()
    }

    /// Adds a force at the point to the forces of the nodes.
    #[inline]
    pub fn spread(&self, force: DVec3, forces: &mut [DVec3]) {
        for (node, weight) in self.nodes.iter().zip(&self.weights) {
            forces[*node as usize] += *weight * force;
        }
    }
}

impl Lattice {
    /// Embeds every node of the mesh that the lattice was cut from. Each node moves with a
    /// hexahedron that one of its elements lies in.
    ///
    /// # Errors
    /// [`Error::Lattice`] for a node that belongs to no element.
    pub fn embed_nodes(&self) -> Result<Vec<EmbeddedPoint>> {
        let mut pieces: Vec<(u32, usize, u32)> = Vec::with_capacity(4 * self.pieces.len());
        for (cell, tet, hex) in &self.pieces {
            pieces.extend(self.mesh.tets[*tet as usize].iter().map(|node| (*node, *cell, *hex)));
        }
        pieces.sort_unstable();
        let mut points = Vec::with_capacity(self.mesh.vertices.len());
        for (v, p) in self.mesh.vertices.iter().enumerate() {
            let first = pieces.partition_point(|(node, ..)| (*node as usize) < v);
            let own = pieces[first..].iter().take_while(|(node, ..)| *node as usize == v);
            let Some(hex) = self.nearest_cell(*p, own.map(|(_, cell, hex)| (*cell, *hex))) else {
                return Err(Error::Lattice(format!("node {v} of the mesh belongs to no element; remove it")));
            };
            points.push(self.at(hex, *p));
        }
        Ok(points)
    }

    /// Embeds any points (m). Each moves with a hexahedron that its nearest tetrahedron lies in, so
    /// a point beside two parts of the body follows the nearer part.
    ///
    /// # Errors
    /// [`Error::Lattice`] for a point that is not finite.
    pub fn embed(&self, points: &[DVec3]) -> Result<Vec<EmbeddedPoint>> {
        if let Some(i) = points.iter().position(|p| !p.is_finite()) {
            return Err(Error::Lattice(format!("point {i} is {}; must be finite", points[i])));
        }
        let search = Search::new(self);
        let embed = |p: &DVec3| {
            let hex = search.nearest_tet(*p).map(|tet| search.hexahedron(tet, *p));
            self.at(hex.unwrap_or(0), *p)
        };
        Ok(points.par_iter().map(embed).collect())
    }

    /// Embeds points (m), each with the element of the mesh that it moves with. A point may lie
    /// outside of its element.
    pub fn embed_in(&self, points: &[(u32, DVec3)]) -> Vec<EmbeddedPoint> {
        let search = Search::new(self);
        let embed = |(tet, p): &(u32, DVec3)| self.at(search.hexahedron(*tet, *p), *p);
        points.par_iter().map(embed).collect()
    }

    /// The point `p` (m) of a hexahedron.
    fn at(&self, hex: u32, p: DVec3) -> EmbeddedPoint {
        let hexahedron = &self.hexahedra()[hex as usize];
        let cell = hexahedron.cell.map(|n| n as usize);
        let u = (p - self.grid.corner(cell)) / self.grid.cell;
        let weights = std::array::from_fn(|c| {
            (0..3).map(|axis| if c >> axis & 1 == 0 { 1.0 - u[axis] } else { u[axis] }).product()
        });
        EmbeddedPoint { hexahedron: hex, nodes: hexahedron.nodes, weights }
    }

    /// Of some cells and hexahedra, the hexahedron of the cell nearest to `p`; the first of equals.
    fn nearest_cell(&self, p: DVec3, cells: impl Iterator<Item = (usize, u32)>) -> Option<u32> {
        let q = self.grid.local(p);
        let mut best: Option<(f64, u32)> = None;
        for (cell, hex) in cells {
            let distance = self.distance_to_cell(q, cell);
            if best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, hex));
            }
        }
        best.map(|(_, hex)| hex)
    }

    /// Squared distance (cells) of a point in cells from a closed cell.
    fn distance_to_cell(&self, q: DVec3, cell: usize) -> f64 {
        let low = DVec3::from_array(self.grid.at(cell).map(|n| n as f64));
        (q - q.clamp(low, low + DVec3::ONE)).length_squared()
    }
}

/// Finds the tetrahedron nearest to a point.
struct Search<'a> {
    lattice: &'a Lattice,
    /// Each cell with material, its first piece, and the number of its pieces.
    cells: Vec<(usize, usize, usize)>,
    /// Tetrahedron, cell and hexahedron of each piece, sorted.
    by_tet: Vec<(u32, usize, u32)>,
}

impl<'a> Search<'a> {
    fn new(lattice: &'a Lattice) -> Self {
        let mut first = 0;
        let groups = lattice.pieces.chunk_by(|a, b| a.0 == b.0).map(|group| {
            first += group.len();
            (group[0].0, first - group.len(), group.len())
        });
        let cells = groups.collect();
        let mut by_tet: Vec<_> = lattice.pieces.iter().map(|(cell, tet, hex)| (*tet, *cell, *hex)).collect();
        by_tet.sort_unstable();
        Self { lattice, cells, by_tet }
    }

    /// Of the hexahedra that a tetrahedron lies in, the one nearest to `p`.
    fn hexahedron(&self, tet: u32, p: DVec3) -> u32 {
        let own = self.cells_of(tet).iter().map(|(_, cell, hex)| (*cell, *hex));
        self.lattice.nearest_cell(p, own).unwrap_or(0)
    }

    /// The pieces of a tetrahedron.
    fn cells_of(&self, tet: u32) -> &[(u32, usize, u32)] {
        let first = self.by_tet.partition_point(|piece| piece.0 < tet);
        let count = self.by_tet[first..].partition_point(|piece| piece.0 == tet);
        &self.by_tet[first..first + count]
    }

    /// The tetrahedron nearest to `p`; the first of equals.
    fn nearest_tet(&self, p: DVec3) -> Option<u32> {
        let Self { lattice, .. } = self;
        let q = lattice.grid.local(p);
        let nearest = self.cells.iter().map(|group| (lattice.distance_to_cell(q, group.0), group));
        let (_, start) = nearest.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut best = (f64::INFINITY, u32::MAX);
        let visit = |(_, first, count): &(usize, usize, usize), best: &mut (f64, u32)| {
            for (_, tet, _) in &lattice.pieces[*first..first + count] {
                let distance = distance_squared(p, &lattice.mesh.corners(*tet as usize));
                if (distance, *tet) < *best {
                    *best = (distance, *tet);
                }
            }
        };
        visit(start, &mut best);
        // `q` is clamped to the grid, which brings it no farther from any cell.
        let scale = lattice.grid.cell * lattice.grid.cell;
        for group in &self.cells {
            if scale * lattice.distance_to_cell(q, group.0) <= best.0 {
                visit(group, &mut best);
            }
        }
        Some(best.1)
    }
}

/// Squared distance (m2) from a tetrahedron; 0 inside.
fn distance_squared(p: DVec3, corners: &[DVec3; 4]) -> f64 {
    let [a, b, c, d] = *corners;
    let six = (b - a).cross(c - a).dot(d - a);
    let weight = |b: DVec3, c: DVec3, d: DVec3| (b - p).cross(c - p).dot(d - p) / six;
    if [weight(b, c, d), weight(a, d, c), weight(a, b, d), weight(a, c, b)].iter().all(|w| *w >= 0.0) {
        return 0.0;
    }
    let faces = [[b, c, d], [a, c, d], [a, b, d], [a, b, c]];
    faces.iter().map(|face| p.distance_squared(closest_on_triangle(face, p))).fold(f64::INFINITY, f64::min)
}
