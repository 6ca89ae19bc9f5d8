//! Marching cubes with polygons traced face by face: the surface where the values of a grid cross a
//! level.
//!
//! The result is watertight and manifold for these reasons. The signs of the four corners of a cube
//! face alone decide which of its crossed edges are joined. So the two cubes that share a face join
//! the same pairs, in opposite directions. Each crossed edge of a cube lies in two of its faces;
//! the path enters it in one and leaves it in the other. So the joins close to polygons, and the
//! polygons around a grid edge form one ring. A polygon is split into triangles only along
//! diagonals that do not lie in a cube face, because the neighbour could have the same diagonal
//! there. If no such split exists, the polygon gets a vertex in its middle. Three vertices that are
//! not all in one face cannot be collinear, so every triangle has an area.

use crate::{Grid, TriMesh};
use glam::DVec3;

/// Minimum distance of a vertex from the ends of its grid edge, as a fraction of the edge. It keeps
/// the vertices around a grid point distinct.
const EDGE_MARGIN: f64 = 0.02;
/// Marks a grid edge that the surface does not cross.
const NO_VERTEX: u32 = u32::MAX;

/// Extracts the surface `value = level`. Lower values are inside, NaN is outside.
///
/// The surface is watertight and manifold by construction where it stays inside the grid. Triangles
/// face outward and have a positive area. Vertices lie on grid edges by linear interpolation, at
/// least 2% of the edge away from its ends.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::{SignedDistance, isosurface, sample_distance};
///
/// struct Ball;
/// impl SignedDistance for Ball {
///     fn distance(&self, p: DVec3) -> f64 {
///         p.length() - 0.5
///     }
/// }
///
/// let grid = sample_distance(&Ball, (DVec3::splat(-0.5), DVec3::splat(0.5)), 0.05);
/// let surface = isosurface(&grid, 0.0);
/// assert!(surface.is_watertight() && (surface.volume() - 0.524).abs() < 0.01);
/// ```
pub fn isosurface(grid: &Grid, level: f32) -> TriMesh {
    let [nx, ny, nz] = grid.dims;
    let mut mesh = TriMesh::default();
    if nx < 2 || ny < 2 || nz < 2 || grid.values.len() != nx * ny * nz {
        return mesh;
    }
    let cases: Vec<Vec<Polygon>> = (0..=255).map(polygons).collect();
    let mut lower = Layer::new(nx * ny);
    let mut upper = Layer::new(nx * ny);
    lower.cut(grid, level, 0, &mut mesh.vertices);
    for k in 0..nz - 1 {
        upper.cut(grid, level, k + 1, &mut mesh.vertices);
        lower.cut_up(grid, level, k, &mut mesh.vertices);
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                let mut case = 0;
                for c in 0..8 {
                    let value = grid.values[grid.index([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)])];
                    case |= usize::from(value < level) << c;
                }
                for polygon in &cases[case] {
                    let corner = |edge: u8| {
                        let base = edge_base(edge);
                        let layer = if base >> 2 == 0 { &lower } else { &upper };
                        layer.crossing[usize::from(edge / 4)][(j + (base >> 1 & 1)) * nx + i + (base & 1)]
                    };
                    polygon.emit(corner, &mut mesh);
                }
            }
        }
        std::mem::swap(&mut lower, &mut upper);
    }
    mesh
}

/// Vertices on the grid edges that start at the points of one plane of constant z, for each axis.
struct Layer {
    crossing: [Vec<u32>; 3],
}

impl Layer {
    fn new(points: usize) -> Self {
        Self { crossing: [0, 1, 2].map(|_| vec![NO_VERTEX; points]) }
    }

    /// Creates the vertices on the edges within plane `k`.
    fn cut(&mut self, grid: &Grid, level: f32, k: usize, vertices: &mut Vec<DVec3>) {
        self.crossing[2].fill(NO_VERTEX);
        for axis in 0..2 {
            self.cut_along(axis, grid, level, k, vertices);
        }
    }

    /// Creates the vertices on the edges from plane `k` to the next.
    fn cut_up(&mut self, grid: &Grid, level: f32, k: usize, vertices: &mut Vec<DVec3>) {
        self.cut_along(2, grid, level, k, vertices);
    }

    fn cut_along(&mut self, axis: usize, grid: &Grid, level: f32, k: usize, vertices: &mut Vec<DVec3>) {
        let [nx, ny, _] = grid.dims;
        for j in 0..ny {
            for i in 0..nx {
                let from = [i, j, k];
                let mut to = from;
                to[axis] += 1;
                let slot = &mut self.crossing[axis][j * nx + i];
                *slot = NO_VERTEX;
                if to[axis] >= grid.dims[axis] {
                    continue;
                }
                let (a, b) = (grid.values[grid.index(from)], grid.values[grid.index(to)]);
                if (a < level) != (b < level) {
                    let part = f64::from(level - a) / f64::from(b - a);
                    let part = if part.is_finite() { part.clamp(EDGE_MARGIN, 1.0 - EDGE_MARGIN) } else { 0.5 };
                    *slot = vertices.len() as u32;
                    vertices.push(grid.point(from).lerp(grid.point(to), part));
                }
            }
        }
    }
}

/// A closed ring of crossed cube edges, outward by the right-hand rule.
struct Polygon {
    edges: Vec<u8>,
    /// First vertex of a fan whose diagonals avoid the cube's faces; `None` if the polygon needs a
    /// vertex in its middle.
    apex: Option<usize>,
}

impl Polygon {
    /// Appends the polygon's triangles. `corner` gives the vertex on a cube edge.
    fn emit(&self, corner: impl Fn(u8) -> u32, mesh: &mut TriMesh) {
        let n = self.edges.len();
        let at = |i: usize| corner(self.edges[i % n]);
        if let Some(apex) = self.apex {
            for i in 1..n - 1 {
                mesh.triangles.push([at(apex), at(apex + i), at(apex + i + 1)]);
            }
        } else {
            let middle = (0..n).map(|i| mesh.vertices[at(i) as usize]).sum::<DVec3>() / n as f64;
            let centre = mesh.vertices.len() as u32;
            mesh.vertices.push(middle);
            for i in 0..n {
                mesh.triangles.push([centre, at(i), at(i + 1)]);
            }
        }
    }
}

/// Corner of the cube (bit 0: x, 1: y, 2: z) at which edge `4 * axis + n` starts.
fn edge_base(edge: u8) -> usize {
    let (axis, n) = (usize::from(edge / 4), usize::from(edge % 4));
    let others = [(axis + 1) % 3, (axis + 2) % 3];
    (n & 1) << others[0] | (n >> 1) << others[1]
}

/// The edge between two neighbouring corners.
fn edge_between(a: usize, b: usize) -> u8 {
    let axis = (a ^ b).trailing_zeros() as usize;
    let base = a & b;
    let others = [(axis + 1) % 3, (axis + 2) % 3];
    (4 * axis + (base >> others[0] & 1) + 2 * (base >> others[1] & 1)) as u8
}

/// Faces of the cube that edge `edge` lies in, as bits (2 * axis + side).
fn faces_of(edge: u8) -> u8 {
    let (axis, base) = (usize::from(edge / 4), edge_base(edge));
    (0..3).filter(|&a| a != axis).map(|a| 1 << (2 * a + (base >> a & 1))).sum()
}

/// Corners of a face, counterclockwise seen from outside the cube.
fn face_corners(axis: usize, side: usize) -> [usize; 4] {
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = side << axis;
    if side == 1 { [base, base | u, base | u | v, base | v] } else { [base, base | v, base | u | v, base | u] }
}

/// The polygons of a cube whose corners in the bit set `case` are inside.
fn polygons(case: usize) -> Vec<Polygon> {
    let inside = |corner: usize| case >> corner & 1 == 1;
    // Counterclockwise around each face, every run of inside corners is separated by one segment,
    // from the edge that enters the run to the edge that leaves it.
    let mut next = [None; 12];
    for axis in 0..3 {
        for side in 0..2 {
            let ring = face_corners(axis, side);
            for i in 0..4 {
                if inside(ring[i]) || !inside(ring[(i + 1) % 4]) {
                    continue;
                }
                let entered = edge_between(ring[i], ring[(i + 1) % 4]);
                let mut j = i + 1;
                while inside(ring[(j + 1) % 4]) {
                    j += 1;
                }
                next[usize::from(entered)] = Some(edge_between(ring[j % 4], ring[(j + 1) % 4]));
            }
        }
    }
    let mut result = Vec::new();
    for start in 0..12u8 {
        let mut edges = Vec::new();
        let mut edge = start;
        while let Some(following) = next[usize::from(edge)].take() {
            edges.push(edge);
            edge = following;
        }
        if !edges.is_empty() {
            let apex = (0..edges.len()).find(|&apex| fan_avoids_faces(&edges, apex));
            result.push(Polygon { edges, apex });
        }
    }
    result
}

/// True when no diagonal of the fan from `apex` lies in a face of the cube.
fn fan_avoids_faces(edges: &[u8], apex: usize) -> bool {
    let n = edges.len();
    (2..n - 1).all(|i| faces_of(edges[apex]) & faces_of(edges[(apex + i) % n]) == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{Ball, Torus, scattered};
    use crate::{sample_distance, sample_everywhere};
    use std::f64::consts::PI;

    fn euler(mesh: &TriMesh) -> i64 {
        mesh.vertices.len() as i64 - mesh.edge_count() as i64 + mesh.triangles.len() as i64
    }

    fn smallest_area(mesh: &TriMesh) -> f64 {
        (0..mesh.triangles.len()).map(|t| mesh.area_vector(t).length()).fold(f64::MAX, f64::min)
    }

    #[test]
    fn a_ball_gives_a_sphere() {
        let h = 0.04;
        let grid = sample_distance(&Ball(0.5), (DVec3::splat(-0.5), DVec3::splat(0.5)), h);
        let mesh = isosurface(&grid, 0.0);
        assert!(mesh.is_watertight());
        assert_eq!((euler(&mesh), mesh.components().1), (2, 1));
        let truth = 4.0 / 3.0 * PI * 0.125;
        assert!((mesh.volume() / truth - 1.0).abs() < 0.01, "{}", mesh.volume() / truth);
        assert!(mesh.vertices.iter().all(|v| (v.length() - 0.5).abs() < 0.03 * h));
        assert!(smallest_area(&mesh) > 1e-5 * h * h);
        let grown = isosurface(&grid, 0.05);
        assert!((grown.volume() / (truth * 1.1f64.powi(3)) - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_torus_has_a_hole() {
        let bounds = (DVec3::new(-0.9, -0.9, -0.3), DVec3::new(0.9, 0.9, 0.3));
        let mesh = isosurface(&sample_distance(&Torus(0.6, 0.3), bounds, 0.05), 0.0);
        assert!(mesh.is_watertight());
        assert_eq!(euler(&mesh), 0);
        let truth = 2.0 * PI * PI * 0.6 * 0.09;
        assert!((mesh.volume() / truth - 1.0).abs() < 0.02);
    }

    /// Every vertex's triangles form one fan.
    fn vertices_are_manifold(mesh: &TriMesh) -> bool {
        let mut around = vec![Vec::new(); mesh.vertices.len()];
        for &[a, b, c] in &mesh.triangles {
            around[a as usize].push((b, c));
            around[b as usize].push((c, a));
            around[c as usize].push((a, b));
        }
        around.iter().all(|spokes| {
            let (mut at, mut steps) = (spokes[0].0, 0);
            while let Some(&(_, to)) = spokes.iter().find(|s| s.0 == at) {
                (at, steps) = (to, steps + 1);
                if at == spokes[0].0 || steps > spokes.len() {
                    break;
                }
            }
            steps == spokes.len()
        })
    }

    #[test]
    fn noise_covers_every_case_and_is_watertight_and_manifold() {
        let n = 24;
        let mut values: Vec<f32> = scattered(n * n * n).iter().map(|p| p.x as f32).collect();
        for (c, value) in values.iter_mut().enumerate() {
            let border = [c % n, c / n % n, c / (n * n)].iter().any(|&i| i == 0 || i == n - 1);
            if border {
                *value = 1.0;
            } else if c % 17 == 0 {
                *value = 0.0;
            } else if c % 19 == 0 {
                *value = f32::NAN;
            }
        }
        let grid = Grid { origin: DVec3::ZERO, spacing: 1.0, dims: [n; 3], values };
        let mesh = isosurface(&grid, 0.0);
        assert!(mesh.triangles.len() > 10_000);
        assert!(mesh.vertices.iter().all(|v| v.is_finite()));
        assert!(mesh.is_watertight());
        assert!(vertices_are_manifold(&mesh));
        assert!(mesh.volume() > 0.0);
        assert!(smallest_area(&mesh) > 1e-6);
    }

    #[test]
    fn a_surface_through_grid_points_has_no_degenerate_triangles() {
        // A cube whose faces, edges and corners all lie on grid points.
        struct Cube;
        impl crate::SignedDistance for Cube {
            fn distance(&self, p: DVec3) -> f64 {
                p.abs().max_element() - 0.5
            }
        }
        let mesh = isosurface(&sample_everywhere(&Cube, (DVec3::splat(-0.5), DVec3::splat(0.5)), 0.125), 0.0);
        assert!(mesh.is_watertight());
        assert_eq!(euler(&mesh), 2);
        assert!(smallest_area(&mesh) > 1e-8);
        // Edges and corners are cut off within a cell.
        assert!(mesh.volume() > 0.85 && mesh.volume() < 1.0);
    }

    #[test]
    fn a_grid_without_inside_gives_an_empty_mesh() {
        let grid = Grid { origin: DVec3::ZERO, spacing: 1.0, dims: [3; 3], values: vec![1.0; 27] };
        assert_eq!(isosurface(&grid, 0.0), TriMesh::default());
        let flat = Grid { dims: [3, 3, 1], values: vec![-1.0; 9], ..grid };
        assert_eq!(isosurface(&flat, 0.0), TriMesh::default());
    }
}
