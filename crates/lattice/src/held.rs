//! Points that fill the part of a body which pinned or grasped nodes hold.
//!
//! In a finite element mesh nodes that are held also hold the edges, faces and elements between
//! them. In a lattice with cells smaller than those elements the tissue between single points would
//! yield, and the more the smaller the cells. So the whole edges, faces and elements are sampled.

use crate::{EmbeddedPoint, Error, Lattice, Result};
use glam::DVec3;

/// Greatest distance between neighbouring points along an edge, over the edge of a cell.
const SPACING: f64 = 0.5;

impl Lattice {
    /// Embeds points of everything that nodes of the mesh hold: the nodes, and the insides of
    /// edges, faces and elements whose nodes are all among them, at most half a cell apart along
    /// edges.
    ///
    /// # Errors
    /// [`Error::Lattice`] for a node that does not exist.
    pub fn embed_held(&self, nodes: &[u32]) -> Result<Vec<EmbeddedPoint>> {
        let mesh = self.mesh();
        let mut held = vec![false; mesh.vertices.len()];
        for node in nodes {
            let Some(held) = held.get_mut(*node as usize) else {
                let count = mesh.vertices.len();
                return Err(Error::Lattice(format!("held node {node} does not exist; the mesh has {count} nodes")));
            };
            *held = true;
        }
        // Each with an element that has it; the first is kept.
        let mut simplices: Vec<(Vec<u32>, u32)> = Vec::new();
        for (t, tet) in mesh.tets.iter().enumerate() {
            let mut own: Vec<u32> = tet.iter().copied().filter(|node| held[*node as usize]).collect();
            own.sort_unstable();
            let subsets = (1..1u32 << own.len()).map(|set| (0..own.len()).filter(move |i| set >> i & 1 == 1));
            simplices.extend(subsets.map(|subset| (subset.map(|i| own[i]).collect(), t as u32)));
        }
        simplices.sort_unstable();
        simplices.dedup_by(|later, first| later.0 == first.0);
        let mut points = Vec::new();
        for (simplex, tet) in &simplices {
            let corners: Vec<DVec3> = simplex.iter().map(|node| mesh.vertices[*node as usize]).collect();
            let mut own = Vec::new();
            inside(&corners, SPACING * self.cell(), &mut own);
            points.extend(own.into_iter().map(|p| (*tet, p)));
        }
        Ok(self.embed_in(&points))
    }
}

/// Appends points strictly inside a simplex, on a regular grid of its barycentric coordinates; of a
/// single corner the corner itself.
fn inside(corners: &[DVec3], spacing: f64, out: &mut Vec<DVec3>) {
    let pairs = corners.iter().flat_map(|a| corners.iter().map(move |b| a.distance(*b)));
    let parts = (pairs.fold(0.0, f64::max) / spacing).ceil().max(1.0) as usize;
    let mut shares = vec![1; corners.len()];
    let last = corners.len() - 1;
    // The last share is what the others leave of `parts`.
    loop {
        let sum: usize = shares[..last].iter().sum();
        if sum < parts {
            shares[last] = parts - sum;
            let weighted = corners.iter().zip(&shares).map(|(corner, share)| *share as f64 * *corner);
            out.push(weighted.sum::<DVec3>() / parts as f64);
        }
        let Some(next) = (0..last).find(|i| shares[*i] + 1 < parts) else { return };
        shares[..next].fill(1);
        shares[next] += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of inner points of a simplex of n parts is the binomial of n - 1 over its
    /// dimension, and their mean is the centroid.
    #[test]
    fn insides_are_sampled_evenly() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y * 0.9, DVec3::Z * 0.8];
        for (count, expected) in [(1, 1), (2, 4), (3, 6), (4, 4)] {
            // The longest edges are 1, 1.35 and 1.35: five parts each.
            let spacing = [1.0, 0.2, 0.28, 0.28][count - 1];
            let mut points = Vec::new();
            inside(&corners[..count], spacing, &mut points);
            assert_eq!(points.len(), expected, "{count}");
            let mean = points.iter().sum::<DVec3>() / expected as f64;
            let centroid = corners[..count].iter().sum::<DVec3>() / count as f64;
            assert!((mean - centroid).length() < 1e-12);
        }
    }
}
