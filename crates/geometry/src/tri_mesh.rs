//! Triangle surfaces.

use glam::DVec3;

/// A triangle surface with optional vertex colours. Outward normals follow the right-hand rule.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::TriMesh;
///
/// let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let mut mesh = TriMesh { vertices, triangles, colors: Vec::new() };
/// assert!(mesh.is_watertight() && (mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
/// mesh.triangles.pop();
/// assert_eq!(mesh.open_edges(), 3);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions (m).
    pub vertices: Vec<DVec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// sRGB colour per vertex; empty, or as long as `vertices`.
    pub colors: Vec<[u8; 3]>,
}

/// One side of a triangle, keyed by its undirected edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct HalfEdge {
    /// Smaller and larger vertex index of the edge.
    pub edge: (u32, u32),
    /// The triangle.
    pub triangle: u32,
    /// Whether the triangle traverses the edge from the smaller to the larger index.
    pub forward: bool,
}

impl TriMesh {
    /// Whether every edge has exactly two triangles that traverse it in opposite directions. False
    /// for a mesh without triangles.
    pub fn is_watertight(&self) -> bool {
        let sides = self.half_edges();
        !sides.is_empty() && edge_groups(&sides).all(|group| group.len() == 2 && group[0].forward != group[1].forward)
    }

    /// Number of edges that do not have exactly two triangles.
    pub fn open_edges(&self) -> usize {
        edge_groups(&self.half_edges()).filter(|group| group.len() != 2).count()
    }

    /// Number of distinct edges.
    pub fn edge_count(&self) -> usize {
        edge_groups(&self.half_edges()).count()
    }

    /// Enclosed volume (m3), negative if the triangles face inward. By the divergence theorem about
    /// the centre of the bounding box. For a surface with holes it is the volume with the holes
    /// closed by cones from there.
    pub fn volume(&self) -> f64 {
        let centre = self.bounds().map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high));
        (0..self.triangles.len()).map(|t| self.cone_volume(t, centre)).sum()
    }

    /// Surface area (m2).
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| self.area_vector(t).length()).sum()
    }

    /// Normal of triangle `t` whose length is the area (m2).
    pub fn area_vector(&self, t: usize) -> DVec3 {
        let [a, b, c] = self.corners(t);
        0.5 * (b - a).cross(c - a)
    }

    /// Smallest and largest coordinates (m); `None` without vertices.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds(&self.vertices)
    }

    /// Positions of the three corners of triangle `t` (m).
    pub fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| self.vertices[v as usize])
    }

    /// The component of each triangle and the number of components. Triangles that share an edge
    /// are in one component. Components are numbered in the order of their first triangle.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut parent: Vec<u32> = (0..self.triangles.len() as u32).collect();
        for group in edge_groups(&self.half_edges()) {
            for pair in group.windows(2) {
                let (a, b) = (find(&mut parent, pair[0].triangle), find(&mut parent, pair[1].triangle));
                // The smaller root wins, so a root is the first triangle of its component.
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut label = vec![0; parent.len()];
        let mut count = 0;
        for t in 0..parent.len() as u32 {
            let root = find(&mut parent, t);
            if root == t {
                label[t as usize] = count;
                count += 1;
            } else {
                label[t as usize] = label[root as usize];
            }
        }
        (label, count as usize)
    }

    /// The component with the largest absolute volume, with its vertices renumbered in order. Empty
    /// for an empty mesh.
    pub fn largest_component(&self) -> Self {
        let (label, count) = self.components();
        if count <= 1 {
            return self.submesh(|_| true);
        }
        let volumes = self.component_volumes(&label, count);
        let largest = (1..count).fold(0, |best, c| if volumes[c].abs() > volumes[best].abs() { c } else { best });
        self.submesh(|t| label[t] as usize == largest)
    }

    /// Signed volume of each component (m3), about the component's own first vertex.
    pub(crate) fn component_volumes(&self, label: &[u32], count: usize) -> Vec<f64> {
        let mut volumes = vec![0.0; count];
        let mut origin = vec![None; count];
        for (t, &c) in label.iter().enumerate() {
            let o = *origin[c as usize].get_or_insert(self.corners(t)[0]);
            volumes[c as usize] += self.cone_volume(t, o);
        }
        volumes
    }

    /// The triangles for which `keep` holds and their vertices, both in their original order.
    pub(crate) fn submesh(&self, keep: impl Fn(usize) -> bool) -> Self {
        let mut used = vec![false; self.vertices.len()];
        let kept: Vec<[u32; 3]> =
            self.triangles.iter().enumerate().filter(|&(t, _)| keep(t)).map(|(_, &triangle)| triangle).collect();
        for &v in kept.iter().flatten() {
            used[v as usize] = true;
        }
        let mut renumbered = vec![0; self.vertices.len()];
        let mut result = Self::default();
        for v in 0..self.vertices.len() {
            if used[v] {
                renumbered[v] = result.vertices.len() as u32;
                result.vertices.push(self.vertices[v]);
                if let Some(&color) = self.colors.get(v) {
                    result.colors.push(color);
                }
            }
        }
        result.triangles = kept.into_iter().map(|t| t.map(|v| renumbered[v as usize])).collect();
        result
    }

    /// Flips the orientation of every triangle.
    pub fn flip(&mut self) {
        for triangle in &mut self.triangles {
            triangle.swap(1, 2);
        }
    }

    /// All triangle sides, sorted by edge, then by triangle.
    pub(crate) fn half_edges(&self) -> Vec<HalfEdge> {
        let mut sides = Vec::with_capacity(3 * self.triangles.len());
        for (t, &[a, b, c]) in self.triangles.iter().enumerate() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let edge = (from.min(to), from.max(to));
                sides.push(HalfEdge { edge, triangle: t as u32, forward: from < to });
            }
        }
        sides.sort_unstable();
        sides
    }

    fn cone_volume(&self, t: usize, apex: DVec3) -> f64 {
        let [a, b, c] = self.corners(t).map(|v| v - apex);
        a.dot(b.cross(c)) / 6.0
    }
}

/// Groups of sides with the same edge.
pub(crate) fn edge_groups(sorted: &[HalfEdge]) -> impl Iterator<Item = &[HalfEdge]> {
    sorted.chunk_by(|a, b| a.edge == b.edge)
}

/// Root of `i` in a union-find forest, with path halving.
fn find(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Smallest and largest coordinates of some points; `None` without points.
pub(crate) fn bounds(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let first = *points.first()?;
    Some(points.iter().fold((first, first), |(lo, hi), p| (lo.min(*p), hi.max(*p))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cube, icosphere};

    #[test]
    fn a_cube_has_its_volume_area_and_edges() {
        let mut mesh = cube(DVec3::splat(10.0), 2.0);
        assert!(mesh.is_watertight());
        assert!((mesh.volume() - 8.0).abs() < 1e-12);
        assert!((mesh.area() - 24.0).abs() < 1e-12);
        assert_eq!((mesh.edge_count(), mesh.open_edges()), (18, 0));
        assert_eq!(mesh.bounds(), Some((DVec3::splat(9.0), DVec3::splat(11.0))));
        mesh.flip();
        assert!(mesh.is_watertight());
        assert!((mesh.volume() + 8.0).abs() < 1e-12);
        mesh.triangles.swap_remove(3);
        assert!(!mesh.is_watertight());
        assert_eq!(mesh.open_edges(), 3);
    }

    #[test]
    fn one_flipped_triangle_is_not_watertight() {
        let mut mesh = cube(DVec3::ZERO, 1.0);
        mesh.triangles[0].swap(0, 1);
        assert!(!mesh.is_watertight());
        assert_eq!(mesh.open_edges(), 0);
    }

    #[test]
    fn an_empty_mesh_is_not_watertight() {
        let empty = TriMesh::default();
        assert!(!empty.is_watertight());
        assert_eq!(empty.volume(), 0.0);
        assert!(empty.bounds().is_none());
        assert_eq!(empty.largest_component(), empty);
    }

    #[test]
    fn the_largest_component_has_the_largest_volume() {
        let small = icosphere(3, 0.3);
        let large = cube(DVec3::splat(5.0), 2.0);
        let mut both = small;
        let offset = both.vertices.len() as u32;
        both.vertices.extend(&large.vertices);
        both.triangles.extend(large.triangles.iter().map(|t| t.map(|v| v + offset)));
        assert_eq!(both.components().1, 2);
        assert_eq!(both.largest_component(), large);
    }
}
