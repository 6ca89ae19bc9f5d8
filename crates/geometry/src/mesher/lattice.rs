//! Isosurface stuffing on a body-centred cubic lattice.
//!
//! Labelle and Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good dihedral angles", SIGGRAPH 2007. The lattice has points at the
//! corners (kind A) and the middles (kind B) of cubic cells. Two neighbouring middles and one edge of the face between them make an element: twelve a cell, all alike, with
//! dihedral angles of 60 and 90 degrees. Edges that cross the surface are cut; a lattice point with a cut too near to it is moved onto the surface instead, and
//! what remains of the elements inside is filled by stencils. The worst dihedral angle is then bounded: at least 10.7 degrees.

use super::Mesher;
use super::stencil::{self, Lattice, Side};
use crate::{Error, Grid, Result, SignedDistance, TetMesh, sample_distance};
use glam::DVec3;
use rayon::prelude::*;

/// A cut nearer to a lattice point than this share of the edge moves the point (long and short edges; the paper's safe values).
const TOO_NEAR_LONG: f64 = 0.249_99;
const TOO_NEAR_SHORT: f64 = 0.411_89;

/// Cut points are found to this share of their edge.
const CUT_TOLERANCE: f64 = 1e-5;

/// Elements a cubic cell.
const TETS_A_CELL: f64 = 12.0;

/// The default mesher: no slivers by construction.
#[derive(Clone, Copy, Debug)]
pub struct LatticeMesher {
    /// Edge of the lattice's cubic cell [m]; the tets' edges are this long and 0.87 times this long.
    pub cell: f64,
}

impl LatticeMesher {
    /// Chooses the cell for a body of `volume` [m3]: `finest` [m], or larger so that about `max_tets` elements fill it.
    pub fn for_volume(volume: f64, finest: f64, max_tets: usize) -> Self {
        let fitting = (TETS_A_CELL * volume.max(0.0) / max_tets.max(1) as f64).cbrt();
        Self { cell: fitting.max(finest) }
    }
}

impl Mesher for LatticeMesher {
    fn mesh(&self, shape: &dyn SignedDistance, bounds: (DVec3, DVec3)) -> Result<TetMesh> {
        if !(self.cell > 0.0 && self.cell.is_finite()) {
            return Err(Error::Mesh(format!("the lattice cell is {} m; a positive length", self.cell)));
        }
        let mut lattice = Bcc::new(shape, bounds, self.cell);
        lattice.cut_edges(shape);
        lattice.move_points();
        let mut tets = Vec::new();
        for tet in lattice.inner_tets() {
            stencil::fill(&mut lattice, tet, &mut tets);
        }
        let mesh = TetMesh { vertices: lattice.nodes, tets }.largest_component();
        if mesh.tets.is_empty() {
            return Err(Error::Mesh(format!(
                "nothing of the shape is as large as an element of {:.2} mm; a smaller cell is needed",
                self.cell * 1e3
            )));
        }
        Ok(mesh)
    }
}

/// The lattice with its values. Points are numbered: all of kind A (x fastest), then all of kind B.
struct Bcc {
    corners: Grid,
    middles: Grid,
    /// Edges that cross the surface: (inside, outside) point, where along it, still cut. Sorted.
    cuts: Vec<Cut>,
    /// Lattice points moved onto the surface: (point, where). Sorted.
    moved: Vec<(usize, DVec3)>,
    nodes: Vec<DVec3>,
    node_of_point: Vec<u32>,
}

struct Cut {
    inside: usize,
    outside: usize,
    at: DVec3,
    /// Distance of the cut from the inside end, as a share of the edge.
    share: f64,
    node: u32,
}

const NONE: u32 = u32::MAX;

/// A field seen from a point that is `offset` away.
struct Shifted<'a> {
    shape: &'a dyn SignedDistance,
    offset: DVec3,
}

impl SignedDistance for Shifted<'_> {
    fn distance(&self, p: DVec3) -> f64 {
        self.shape.distance(p + self.offset)
    }
}

impl Bcc {
    fn new(shape: &dyn SignedDistance, bounds: (DVec3, DVec3), cell: f64) -> Self {
        let corners = sample_distance(shape, bounds, cell);
        let middles = sample_distance(&Shifted { shape, offset: DVec3::splat(0.5 * cell) }, bounds, cell);
        let points = 2 * corners.values.len();
        Self {
            corners,
            middles,
            cuts: Vec::new(),
            moved: Vec::new(),
            nodes: Vec::new(),
            node_of_point: vec![NONE; points],
        }
    }

    fn len_of_kind(&self) -> usize {
        self.corners.values.len()
    }

    fn value(&self, point: usize) -> f32 {
        let n = self.len_of_kind();
        if point < n { self.corners.values[point] } else { self.middles.values[point - n] }
    }

    /// Position of a lattice point before any is moved.
    fn position(&self, point: usize) -> DVec3 {
        let n = self.len_of_kind();
        let [i, j, k] = self.coordinates(point).map(|c| c as f64);
        let half = if point < n { 0.0 } else { 0.5 };
        self.corners.origin + self.corners.spacing * (DVec3::new(i, j, k) + half)
    }

    fn coordinates(&self, point: usize) -> [usize; 3] {
        let [nx, ny, _] = self.corners.dims;
        let p = point % self.len_of_kind();
        [p % nx, p / nx % ny, p / (nx * ny)]
    }

    /// Steps from a point to the next along x, y, z.
    fn strides(&self) -> [usize; 3] {
        let [nx, ny, _] = self.corners.dims;
        [1, nx, nx * ny]
    }

    fn is_long(&self, p: usize, q: usize) -> bool {
        let n = self.len_of_kind();
        (p < n) == (q < n)
    }

    /// Finds the cut point of every edge whose ends lie on different sides. The outermost layer of points is outside everywhere: the
    /// sampled region has cells to spare.
    fn cut_edges(&mut self, shape: &dyn SignedDistance) {
        let n = self.len_of_kind();
        let [sx, sy, sz] = self.strides();
        let mut edges = Vec::new();
        for p in 0..n {
            let [i, j, k] = self.coordinates(p);
            let [nx, ny, nz] = self.corners.dims;
            if i + 1 >= nx || j + 1 >= ny || k + 1 >= nz {
                continue;
            }
            let here = [p, n + p];
            let long = here.into_iter().flat_map(|p| [sx, sy, sz].map(|s| (p, p + s)));
            let cube = [0, sx, sy, sx + sy, sz, sx + sz, sy + sz, sx + sy + sz];
            let short = cube.into_iter().map(|c| (n + p, p + c));
            for (a, b) in long.chain(short) {
                let (va, vb) = (self.value(a), self.value(b));
                if va < 0.0 && vb > 0.0 {
                    edges.push((a, b));
                } else if va > 0.0 && vb < 0.0 {
                    edges.push((b, a));
                }
            }
        }
        edges.sort_unstable();
        self.cuts = edges
            .into_par_iter()
            .map(|(inside, outside)| {
                let (a, b) = (self.position(inside), self.position(outside));
                let ends = (f64::from(self.value(inside)), f64::from(self.value(outside)));
                let share = root(ends, |t| shape.distance(a.lerp(b, t)));
                Cut { inside, outside, at: a.lerp(b, share), share, node: NONE }
            })
            .collect();
    }

    /// Moves each lattice point with a cut too near to it onto the nearest such cut; its edges are then no longer cut.
    fn move_points(&mut self) {
        // (point, cut, distance as a share of what is too near), by point: a point sees its cuts in a fixed order.
        let mut near: Vec<(usize, usize, f64)> = Vec::new();
        for (c, cut) in self.cuts.iter().enumerate() {
            let limit = if self.is_long(cut.inside, cut.outside) { TOO_NEAR_LONG } else { TOO_NEAR_SHORT };
            for (point, share) in [(cut.inside, cut.share), (cut.outside, 1.0 - cut.share)] {
                if share < limit {
                    near.push((point, c, share / limit));
                }
            }
        }
        near.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.cmp(&b.1)));
        for of_point in near.chunk_by(|a, b| a.0 == b.0) {
            let point = of_point[0].0;
            let live = of_point.iter().filter(|(_, c, _)| {
                let cut = &self.cuts[*c];
                let other = if cut.inside == point { cut.outside } else { cut.inside };
                self.moved.binary_search_by_key(&other, |m| m.0).is_err()
            });
            if let Some((_, c, _)) = live.min_by(|a, b| a.2.total_cmp(&b.2)) {
                // Points come in ascending order, so `moved` stays sorted.
                self.moved.push((point, self.cuts[*c].at));
            }
        }
    }

    /// Elements with at least one corner inside, positively oriented.
    fn inner_tets(&self) -> Vec<[usize; 4]> {
        let n = self.len_of_kind();
        let strides = self.strides();
        let dims = self.corners.dims;
        let mut tets = Vec::new();
        for p in 0..n {
            let c = self.coordinates(p);
            if (0..3).any(|d| c[d] + 2 >= dims[d]) {
                continue;
            }
            for d in 0..3 {
                // The middles of this cell and of the next along d, and the square between them.
                let (u, v) = (strides[(d + 1) % 3], strides[(d + 2) % 3]);
                let (b0, b1) = (n + p, n + p + strides[d]);
                let a = p + strides[d];
                let square = [a, a + u, a + u + v, a + v];
                for k in 0..4 {
                    let tet = [b0, b1, square[k], square[(k + 1) % 4]];
                    if tet.iter().any(|q| self.side(*q) == Side::Inside) {
                        tets.push(tet);
                    }
                }
            }
        }
        tets
    }
}

impl Lattice for Bcc {
    fn side(&self, point: usize) -> Side {
        let value = self.value(point);
        if value == 0.0 || self.moved.binary_search_by_key(&point, |m| m.0).is_ok() {
            Side::Surface
        } else if value < 0.0 {
            Side::Inside
        } else {
            Side::Outside
        }
    }

    fn node(&mut self, point: usize) -> u32 {
        if self.node_of_point[point] == NONE {
            let moved = self.moved.binary_search_by_key(&point, |m| m.0);
            let at = moved.map_or_else(|_| self.position(point), |m| self.moved[m].1);
            self.node_of_point[point] = self.nodes.len() as u32;
            self.nodes.push(at);
        }
        self.node_of_point[point]
    }

    fn cut(&mut self, inside: usize, outside: usize) -> u32 {
        let found = self.cuts.binary_search_by(|c| (c.inside, c.outside).cmp(&(inside, outside)));
        let Ok(c) = found else { return self.node(outside) };
        if self.cuts[c].node == NONE {
            self.cuts[c].node = self.nodes.len() as u32;
            self.nodes.push(self.cuts[c].at);
        }
        self.cuts[c].node
    }

    fn splits_from_first(&self, p: usize, q: usize, outside: usize) -> bool {
        match (self.is_long(p, outside), self.is_long(q, outside)) {
            // A long and a short edge are cut: the diagonal ends at the cut of the long one.
            (false, true) => true,
            (true, false) => false,
            // Two short ones: p and q are neighbours of one kind, one of them even.
            _ => self.coordinates(p).iter().sum::<usize>().is_multiple_of(2),
        }
    }

    fn shorter(&self, (a, b): (u32, u32), (c, d): (u32, u32)) -> bool {
        let length2 = |i: u32, j: u32| (self.nodes[i as usize] - self.nodes[j as usize]).length_squared();
        length2(a, b) <= length2(c, d)
    }
}

/// Where a field that is negative at 0 and positive at 1 vanishes (regula falsi, Illinois variant, with bisection as safety).
fn root((mut fa, mut fb): (f64, f64), field: impl Fn(f64) -> f64) -> f64 {
    const ITERATIONS: usize = 40;
    let (mut a, mut b) = (0.0, 1.0);
    for iteration in 0..ITERATIONS {
        let t = if iteration % 4 == 3 { 0.5 * (a + b) } else { (a * fb - b * fa) / (fb - fa) };
        let f = field(t);
        if f == 0.0 {
            return t;
        }
        let step;
        if f < 0.0 {
            step = t - a;
            (a, fa) = (t, f);
            fb *= 0.5;
        } else {
            step = b - t;
            (b, fb) = (t, f);
            fa *= 0.5;
        }
        if b - a < CUT_TOLERANCE || step < 0.1 * CUT_TOLERANCE {
            break;
        }
    }
    0.5 * (a + b)
}
