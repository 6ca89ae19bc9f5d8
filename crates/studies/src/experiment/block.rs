//! Boxes of tetrahedra for bodies that were measured.

use glam::DVec3;
use trocar_geometry::TetMesh;

/// A box from its lowest `corner` (m) with sides of `size` (m): so many cells along each axis, six
/// tetrahedra a cell. Neighbours are mirrored, so that no diagonal is preferred.
pub(super) fn block(corner: DVec3, size: DVec3, cells: [usize; 3]) -> TetMesh {
    let counts = cells.map(|n| n + 1);
    let edge = size / DVec3::from(cells.map(|n| n as f64));
    let all = |counts: [usize; 3]| {
        (0..counts[2]).flat_map(move |k| (0..counts[1]).flat_map(move |j| (0..counts[0]).map(move |i| [i, j, k])))
    };
    let vertices = all(counts).map(|at| corner + DVec3::from(at.map(|n| n as f64)) * edge).collect();
    let mut tets = Vec::with_capacity(6 * cells.iter().product::<usize>());
    for at in all(cells) {
        let mirror = at.map(|n| n % 2);
        let node = |c: usize| {
            let offset = [c & 1, c >> 1 & 1, c >> 2];
            let [i, j, k]: [usize; 3] = std::array::from_fn(|axis| at[axis] + (offset[axis] ^ mirror[axis]));
            ((k * counts[1] + j) * counts[0] + i) as u32
        };
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            let mut tet = [node(0), node(a), node(b), node(7)];
            if mirror.iter().sum::<usize>() % 2 == 1 {
                tet.swap(2, 3);
            }
            tets.push(tet);
        }
    }
    TetMesh { vertices, tets }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_filled_and_nothing_is_inverted() {
        let mesh = block(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.3, 0.2, 0.1), [3, 2, 2]);
        assert!((0..mesh.tets.len()).all(|t| mesh.tet_volume(t) > 1e-6));
        assert!((mesh.volume() - 0.006).abs() < 1e-12);
        let (surface, _) = mesh.boundary();
        assert_eq!(surface.triangles.len(), 2 * 2 * (3 * 2 + 3 * 2 + 2 * 2));
    }
}
