//! The nodes, tetrahedra and groups of a Gmsh file, and the mesh they form.

use super::super::file::Parsed;
use crate::TetMesh;
use glam::DVec3;

/// Smallest volume of an element, relative to the cube of its longest edge.
const MIN_RELATIVE_VOLUME: f64 = 1e-12;

/// The content of a file, with the file's own tags.
#[derive(Default)]
pub(super) struct Content {
    pub(super) nodes: Vec<(u64, DVec3)>,
    pub(super) tets: Vec<(u64, [u64; 4])>,
    /// The physical group of each of `tets`; 0 for none.
    pub(super) group_of: Vec<i64>,
    /// Physical groups of volumes: number and name.
    pub(super) groups: Vec<(i64, String)>,
    /// Version 4.1: volumes and their first physical group.
    pub(super) volumes: Vec<(i64, i64)>,
}

/// Converts tags to indices and checks the mesh.
pub(super) fn assemble(content: &Content) -> Parsed<TetMesh> {
    if content.tets.is_empty() {
        return Err("the file has no tetrahedra".into());
    }
    if let Some((tag, p)) = content.nodes.iter().find(|(_, p)| !p.is_finite()) {
        return Err(format!("node {tag} is {p}; coordinates must be finite"));
    }
    let mut by_tag: Vec<(u64, usize)> = content.nodes.iter().enumerate().map(|(i, n)| (n.0, i)).collect();
    by_tag.sort_unstable();
    if let Some(pair) = by_tag.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(format!("node {} appears twice", pair[0].0));
    }
    let mut tets = Vec::with_capacity(content.tets.len());
    let mut used = vec![false; content.nodes.len()];
    for &(tag, nodes) in &content.tets {
        let mut tet = [0; 4];
        for (slot, node) in tet.iter_mut().zip(nodes) {
            let found = by_tag.binary_search_by_key(&node, |entry| entry.0);
            *slot = by_tag[found.map_err(|_| format!("element {tag} uses node {node}, which is not in the file"))?].1;
            used[*slot] = true;
        }
        let [a, b, c, d] = tet.map(|i| content.nodes[i].1);
        let volume = (b - a).cross(c - a).dot(d - a) / 6.0;
        let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
        let longest = edges.iter().map(|e| e.length_squared()).fold(0.0, f64::max).sqrt();
        if volume.abs() <= MIN_RELATIVE_VOLUME * longest.powi(3) {
            return Err(format!("element {tag} (nodes {nodes:?}) has no volume"));
        }
        if volume < 0.0 {
            tet.swap(2, 3);
        }
        tets.push(tet);
    }
    let mut mesh = TetMesh::default();
    let mut renumbered = vec![0; used.len()];
    for i in 0..used.len() {
        if used[i] {
            renumbered[i] = u32::try_from(mesh.vertices.len()).map_err(|_| "too many nodes".to_string())?;
            mesh.vertices.push(content.nodes[i].1);
        }
    }
    mesh.tets = tets.into_iter().map(|tet| tet.map(|i| renumbered[i])).collect();
    Ok(mesh)
}
