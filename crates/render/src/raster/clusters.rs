//! Clusters of neighbouring triangles of a shape, with their vertices in order.

use crate::bvh::Bounds;
use crate::lanes::LANES;
use glam::{DVec3, Vec3A};
use std::sync::Arc;
use trocar_geometry::TriMesh;

/// Maximum number of triangles, and of vertices, of a cluster.
pub(super) const MAX_CLUSTER: usize = 96;

/// The clusters of a shape.
#[derive(Clone, Debug)]
pub(crate) struct Clusters {
    pub(crate) fixed: Arc<Fixed>,
    /// Vertices of the clusters in order, by axis. A vertex on the border of clusters is in each.
    pub(crate) vertices: Arc<[Vec<f32>; 3]>,
    /// Bounding spheres of the clusters: centre and radius. The radius of unused lanes is negative
    /// infinity.
    pub(crate) spheres: Arc<[Vec<f32>; 4]>,
    /// The box of all finite vertices.
    bounds: Bounds,
}

/// The part that stays the same when the shape deforms.
#[derive(Debug)]
pub(crate) struct Fixed {
    pub clusters: Vec<Cluster>,
    /// Vertex of the shape for each vertex of a cluster.
    source: Vec<u32>,
    /// Corners of triangles among the vertices of their cluster, by corner.
    pub corners: [Vec<u8>; 3],
    /// Triangle of the shape for each triangle of a cluster.
    pub triangle: Vec<u32>,
    /// Whether the surface is closed and faces outward: from outside, its back is never visible.
    pub closed: bool,
}

/// Ranges of a cluster. Both start at a multiple of [`LANES`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cluster {
    pub first_vertex: u32,
    pub vertices: u32,
    pub first_triangle: u32,
    pub triangles: u32,
}

impl Clusters {
    /// Divides `mesh` into clusters of triangles that follow each other in `order`.
    pub fn new(mesh: &TriMesh, positions: &[Vec3A], order: impl Iterator<Item = u32>) -> Self {
        let mut fixed = Fixed {
            clusters: Vec::new(),
            source: Vec::new(),
            corners: Default::default(),
            triangle: Vec::new(),
            closed: is_closed(mesh),
        };
        // The cluster that a vertex was last in, and its place there.
        let mut place = vec![(u32::MAX, 0_u8); positions.len()];
        let mut open = Cluster { first_vertex: 0, vertices: 0, first_triangle: 0, triangles: 0 };
        for triangle in order {
            let corners = mesh.triangles[triangle as usize];
            if corners.iter().any(|v| *v as usize >= positions.len()) {
                continue;
            }
            let number = fixed.clusters.len() as u32;
            let fresh = corners.iter().filter(|v| place[**v as usize].0 != number).count();
            if open.triangles as usize == MAX_CLUSTER || open.vertices as usize + fresh > MAX_CLUSTER {
                open = fixed.close(open);
            }
            let number = fixed.clusters.len() as u32;
            for (k, vertex) in corners.into_iter().enumerate() {
                let (cluster, at) = &mut place[vertex as usize];
                if *cluster != number {
                    (*cluster, *at) = (number, open.vertices as u8);
                    fixed.source.push(vertex);
                    open.vertices += 1;
                }
                fixed.corners[k].push(*at);
            }
            fixed.triangle.push(triangle);
            open.triangles += 1;
        }
        if open.triangles > 0 {
            fixed.close(open);
        }
        let count = fixed.clusters.len().next_multiple_of(LANES);
        let [x, y, z, mut radius] = [0, 1, 2, 3].map(|_| vec![0.0; count]);
        radius.fill(f32::NEG_INFINITY);
        let vertices = [0, 1, 2].map(|_| vec![0.0; fixed.source.len()]);
        let mut clusters = Self {
            fixed: Arc::new(fixed),
            vertices: Arc::new(vertices),
            spheres: Arc::new([x, y, z, radius]),
            bounds: Bounds::EMPTY,
        };
        clusters.follow(positions);
        clusters
    }

    /// The box of all finite vertices.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Moves the vertices to new positions.
    pub fn follow(&mut self, positions: &[Vec3A]) {
        let Self { fixed, vertices, spheres, bounds } = self;
        let [x, y, z] = Arc::make_mut(vertices);
        let spheres = Arc::make_mut(spheres);
        *bounds = Bounds::EMPTY;
        for (number, cluster) in fixed.clusters.iter().enumerate() {
            let range = cluster.first_vertex as usize..(cluster.first_vertex + cluster.vertices) as usize;
            let mut held = Bounds::EMPTY;
            for at in range.clone() {
                let p = positions[fixed.source[at] as usize];
                [x[at], y[at], z[at]] = p.to_array();
                held = held.with(p);
            }
            let centre = 0.5 * (held.low + held.high);
            let far = |at: usize| centre.distance_squared(Vec3A::new(x[at], y[at], z[at]));
            let most = range.map(far).fold(0.0, f32::max);
            let usable = centre.is_finite();
            *bounds = bounds.with(held.low).with(held.high);
            let radius = if usable { most.sqrt() * (1.0 + 1e-5) } else { f32::NEG_INFINITY };
            let [cx, cy, cz] = if usable { centre.to_array() } else { [0.0; 3] };
            [spheres[0][number], spheres[1][number], spheres[2][number], spheres[3][number]] = [cx, cy, cz, radius];
        }
    }
}

impl Fixed {
    /// Completes a cluster, fills its last registers, and returns the next, which is empty.
    fn close(&mut self, open: Cluster) -> Cluster {
        self.clusters.push(open);
        let last = *self.source.last().unwrap_or(&0);
        self.source.resize(self.source.len().next_multiple_of(LANES), last);
        let triangles = self.triangle.len().next_multiple_of(LANES);
        self.triangle.resize(triangles, 0);
        self.corners.iter_mut().for_each(|corners| corners.resize(triangles, 0));
        Cluster { first_vertex: self.source.len() as u32, vertices: 0, first_triangle: triangles as u32, triangles: 0 }
    }
}

/// Whether every part of the mesh is closed and encloses a positive volume.
fn is_closed(mesh: &TriMesh) -> bool {
    let known = |t: &[u32; 3]| t.iter().all(|v| (*v as usize) < mesh.vertices.len());
    let usable = mesh.triangles.iter().all(known) && mesh.vertices.iter().all(|p| p.is_finite());
    if !usable || !mesh.is_watertight() {
        return false;
    }
    let mut part: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    fn root(part: &mut [u32], mut v: u32) -> u32 {
        while part[v as usize] != v {
            part[v as usize] = part[part[v as usize] as usize];
            v = part[v as usize];
        }
        v
    }
    for [a, b, c] in &mesh.triangles {
        for other in [b, c] {
            let (x, y) = (root(&mut part, *a), root(&mut part, *other));
            part[x.max(y) as usize] = x.min(y);
        }
    }
    let mut volume = vec![0.0; part.len()];
    let centre = mesh.bounds().map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high));
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize] - centre);
        volume[root(&mut part, triangle[0]) as usize] += a.dot(b.cross(c));
    }
    mesh.triangles.iter().all(|t| volume[root(&mut part, t[0]) as usize] > 0.0)
}
