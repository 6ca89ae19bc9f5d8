//! Cleanup of conforming tets: one connected body with a manifold surface.

use crate::TetMesh;
use crate::tet_mesh::adjacency::{EDGES, FACES, NO_TET, face_neighbours};

/// The largest part of `mesh` (by volume) that is connected through faces. Every edge of its
/// surface has exactly two triangles.
///
/// - Parts that only touch at a node or an edge are separated: each gets its own copy of the nodes.
/// - Where a part touches itself along an edge, all but the largest fan of elements around that
///   edge are removed.
///
/// Nodes are numbered in the order of their first use. Unused nodes are removed.
pub(super) fn largest_body(mut mesh: TetMesh) -> TetMesh {
    loop {
        let neighbours = face_neighbours(&mesh.tets);
        let keep = largest_part(&mesh, &neighbours);
        mesh.tets = filtered(&mesh.tets, &keep);
        // Removing whole parts does not change the neighbours of the others, but renumbers them.
        let neighbours = if keep.contains(&false) { face_neighbours(&mesh.tets) } else { neighbours };
        mesh = separate_nodes(&mesh, &neighbours);
        let pinched = pinched_edges(&mesh, &neighbours);
        if pinched.is_empty() {
            return mesh;
        }
        let keep = keep_largest_fans(&mesh, &neighbours, &pinched);
        mesh.tets = filtered(&mesh.tets, &keep);
    }
}

fn filtered(tets: &[[u32; 4]], keep: &[bool]) -> Vec<[u32; 4]> {
    tets.iter().zip(keep).filter(|&(_, &keep)| keep).map(|(&tet, _)| tet).collect()
}

/// Whether each element is in the part with the largest volume.
fn largest_part(mesh: &TetMesh, neighbours: &[[u32; 4]]) -> Vec<bool> {
    let mut part = vec![u32::MAX; mesh.tets.len()];
    let mut volumes: Vec<f64> = Vec::new();
    let mut open = Vec::new();
    for seed in 0..mesh.tets.len() {
        if part[seed] != u32::MAX {
            continue;
        }
        let number = volumes.len() as u32;
        let mut volume = 0.0;
        part[seed] = number;
        open.push(seed);
        while let Some(t) = open.pop() {
            volume += mesh.tet_volume(t);
            for &across in neighbours[t].iter().filter(|&&across| across != NO_TET) {
                if part[across as usize] == u32::MAX {
                    part[across as usize] = number;
                    open.push(across as usize);
                }
            }
        }
        volumes.push(volume);
    }
    let mut largest = 0;
    for (number, &volume) in volumes.iter().enumerate() {
        if volume > volumes[largest] {
            largest = number;
        }
    }
    part.iter().map(|&number| number as usize == largest).collect()
}

/// Gives each face-connected group of elements around a node its own copy of the node.
fn separate_nodes(mesh: &TetMesh, neighbours: &[[u32; 4]]) -> TetMesh {
    // Union-find over the corners of the elements: corner c of element t is item 4 t + c.
    let mut groups = Groups::new(4 * mesh.tets.len());
    for (t, across) in neighbours.iter().enumerate() {
        for (f, &other) in across.iter().enumerate() {
            if other == NO_TET || (other as usize) < t {
                continue;
            }
            for &corner in &FACES[f] {
                let node = mesh.tets[t][corner];
                if let Some(theirs) = mesh.tets[other as usize].iter().position(|&n| n == node) {
                    groups.join(4 * t + corner, 4 * other as usize + theirs);
                }
            }
        }
    }
    let mut number = vec![u32::MAX; 4 * mesh.tets.len()];
    let mut separated = TetMesh { vertices: Vec::with_capacity(mesh.vertices.len()), tets: mesh.tets.clone() };
    for (t, tet) in separated.tets.iter_mut().enumerate() {
        for (corner, node) in tet.iter_mut().enumerate() {
            let group = groups.root(4 * t + corner);
            if number[group] == u32::MAX {
                number[group] = separated.vertices.len() as u32;
                separated.vertices.push(mesh.vertices[*node as usize]);
            }
            *node = number[group];
        }
    }
    separated
}

/// Boundary edges shared by more than two boundary triangles, sorted.
fn pinched_edges(mesh: &TetMesh, neighbours: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for (tet, across) in mesh.tets.iter().zip(neighbours) {
        for (face, _) in FACES.iter().zip(across).filter(|&(_, &other)| other == NO_TET) {
            let [a, b, c] = face.map(|corner| tet[corner]);
            edges.extend([[a, b], [b, c], [c, a]].map(|[i, j]| [i.min(j), i.max(j)]));
        }
    }
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() > 2).map(|same| same[0]).collect()
}

/// Whether to keep each element: false around a pinched edge for elements outside the fan of the
/// largest volume.
fn keep_largest_fans(mesh: &TetMesh, neighbours: &[[u32; 4]], pinched: &[[u32; 2]]) -> Vec<bool> {
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); pinched.len()];
    for (t, tet) in mesh.tets.iter().enumerate() {
        for [a, b] in EDGES {
            if let Ok(found) = pinched.binary_search(&[tet[a].min(tet[b]), tet[a].max(tet[b])]) {
                around[found].push(t as u32);
            }
        }
    }
    let mut keep = vec![true; mesh.tets.len()];
    for tets in around {
        let mut groups = Groups::new(tets.len());
        for (i, &t) in tets.iter().enumerate() {
            // Two elements at the edge that share a face differ in one node, so the face contains
            // the edge.
            for across in neighbours[t as usize] {
                if let Ok(j) = tets.binary_search(&across) {
                    groups.join(i, j);
                }
            }
        }
        let mut volumes = vec![0.0; tets.len()];
        for (i, &t) in tets.iter().enumerate() {
            volumes[groups.root(i)] += mesh.tet_volume(t as usize);
        }
        let mut largest = 0;
        for i in 0..volumes.len() {
            if volumes[i] > volumes[largest] {
                largest = i;
            }
        }
        for (i, &t) in tets.iter().enumerate() {
            keep[t as usize] &= groups.root(i) == largest;
        }
    }
    keep
}

/// Union-find with path halving; the root of a group is its smallest item.
struct Groups(Vec<u32>);

impl Groups {
    fn new(items: usize) -> Self {
        Self((0..items as u32).collect())
    }

    fn root(&mut self, mut item: usize) -> usize {
        while self.0[item] as usize != item {
            self.0[item] = self.0[self.0[item] as usize];
            item = self.0[item] as usize;
        }
        item
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn parts_that_touch_at_a_node_are_separated_and_the_larger_is_kept() {
        let vertices = vec![
            DVec3::ZERO,
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            -2.0 * DVec3::X,
            -2.0 * DVec3::Y,
            -2.0 * DVec3::Z,
            DVec3::splat(9.0),
        ];
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3], [0, 5, 4, 6]] };
        let body = largest_body(mesh);
        assert_eq!(body.tets, vec![[0, 1, 2, 3]]);
        assert_eq!(body.vertices.len(), 4);
        assert!((body.volume() - 8.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn a_ring_that_touches_itself_is_separated() {
        // A chain of cubes (6 tets each) around a hole. Its last cube (-1, 1) touches the first
        // cube (0, 0) only along the edge x = 0, y = 1.
        let cells = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (-1, 2), (-1, 1)];
        let node = |x: i32, y: i32, z: i32| (((x + 1) * 5 + y) * 2 + z) as u32;
        let vertices =
            (0..5 * 5 * 2).map(|i| DVec3::new(f64::from(i / 10 - 1), f64::from(i / 2 % 5), f64::from(i % 2))).collect();
        let mut tets = Vec::new();
        for (x, y) in cells {
            let c: Vec<u32> = (0..8).map(|i| node(x + (i & 1), y + (i >> 1 & 1), i >> 2)).collect();
            for t in [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]] {
                tets.push(t.map(|i: usize| c[i]));
            }
        }
        let mesh = TetMesh { vertices, tets };
        assert_eq!(pinched_edges(&mesh, &face_neighbours(&mesh.tets)).len(), 1);
        let nodes = mesh.tets.iter().flatten().copied().collect::<std::collections::BTreeSet<_>>().len();
        let body = largest_body(mesh);
        // Both nodes of the shared edge are duplicated. No element is removed.
        assert_eq!(body.tets.len(), 6 * cells.len());
        assert_eq!(body.vertices.len(), nodes + 2);
        assert!(pinched_edges(&body, &face_neighbours(&body.tets)).is_empty());
    }
}
