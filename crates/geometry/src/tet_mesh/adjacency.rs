//! Adjacency of the elements of a tetrahedral mesh.

use rayon::prelude::*;

/// Marks a face on the boundary, without an element on the other side.
pub(crate) const NO_TET: u32 = u32::MAX;

/// Corners of the face opposite each corner, counter-clockwise seen from outside a positive
/// element.
pub(crate) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Corner pairs of the six edges.
pub(crate) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// For each element and each of its [`FACES`], the element on the other side or [`NO_TET`]. A face
/// of three or more elements, which no conforming mesh has, counts as boundary of each.
pub(crate) fn face_neighbours(tets: &[[u32; 4]]) -> Vec<[u32; 4]> {
    // The owner is part of the sort key. So the order is unique, and the unstable parallel sort is
    // deterministic.
    let mut faces: Vec<([u32; 3], u32, u8)> = tets
        .par_iter()
        .enumerate()
        .flat_map_iter(|(t, tet)| {
            (0..4u8).map(move |f| {
                let mut key = FACES[usize::from(f)].map(|corner| tet[corner]);
                key.sort_unstable();
                (key, t as u32, f)
            })
        })
        .collect();
    faces.par_sort_unstable();
    let mut neighbours = vec![[NO_TET; 4]; tets.len()];
    for same in faces.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, t0, f0), (_, t1, f1)] = *same {
            neighbours[t0 as usize][usize::from(f0)] = t1;
            neighbours[t1 as usize][usize::from(f1)] = t0;
        }
    }
    neighbours
}
