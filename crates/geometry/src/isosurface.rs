//! The surface where a grid's values cross a level.
//!
//! Marching tetrahedra: every cube of the grid is cut into the six tetrahedra around its main diagonal (Kuhn's subdivision), the same way in every
//! cube, so that neighbours share their faces. A tetrahedron has no ambiguous case: the surface is a manifold by construction.

use crate::{Grid, TriMesh};
use glam::DVec3;
use std::collections::HashMap;

/// Corners of a cube as offsets along x, y, z; bit 0 is x, bit 1 is y, bit 2 is z.
const MAIN: [u8; 2] = [0, 7];

/// The six paths from corner 0 to corner 7 along cube edges: with both ends each is a tetrahedron.
const PATHS: [[u8; 2]; 6] = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];

/// Values nearer to the level than this many spacings are moved this far off it: no triangle then has a vanishing edge.
const CLEARANCE: f32 = 0.01;

/// Extracts the surface `value = level`; values below are inside. Watertight and manifold by construction wherever the
/// surface stays inside the grid.
pub fn isosurface(grid: &Grid, level: f32) -> TriMesh {
    let [nx, ny, nz] = grid.dims;
    let clearance = CLEARANCE * grid.spacing as f32;
    let value = |i: usize| {
        let v = grid.values[i] - level;
        if v.abs() >= clearance { v } else { clearance.copysign(v) }
    };
    let offset = |corner: u8| {
        let [x, y, z] = [corner & 1, corner >> 1 & 1, corner >> 2 & 1].map(usize::from);
        (z * ny + y) * nx + x
    };
    let position = |i: usize| {
        let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
        grid.origin + grid.spacing * DVec3::new(x as f64, y as f64, z as f64)
    };
    let mut mesh = TriMesh::default();
    let mut on_edge: HashMap<(usize, usize), u32> = HashMap::new();
    for z in 0..nz.saturating_sub(1) {
        for y in 0..ny.saturating_sub(1) {
            for x in 0..nx.saturating_sub(1) {
                let first = (z * ny + y) * nx + x;
                let corners: [usize; 8] = std::array::from_fn(|c| first + offset(c as u8));
                let inside = corners.iter().filter(|c| value(**c) < 0.0).count();
                if inside == 0 || inside == 8 {
                    continue;
                }
                for path in PATHS {
                    let tet = [MAIN[0], path[0], path[1], MAIN[1]].map(|c| corners[c as usize]);
                    let mut cut = |a: usize, b: usize| {
                        let (a, b) = (a.min(b), a.max(b));
                        *on_edge.entry((a, b)).or_insert_with(|| {
                            let (va, vb) = (f64::from(value(a)), f64::from(value(b)));
                            mesh.vertices.push(position(a).lerp(position(b), va / (va - vb)));
                            mesh.vertices.len() as u32 - 1
                        })
                    };
                    let triangles = cut_tet(tet, &value, &mut cut);
                    mesh.triangles.extend(triangles.into_iter().flatten());
                }
            }
        }
    }
    mesh
}

/// The triangles in which the level cuts a positively oriented tetrahedron, outward (towards positive values).
fn cut_tet(
    tet: [usize; 4],
    value: &impl Fn(usize) -> f32,
    cut: &mut impl FnMut(usize, usize) -> u32,
) -> [Option<[u32; 3]>; 2] {
    // Even permutations that bring corner k to the front keep the orientation.
    const FRONT: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]];
    let negative = tet.map(|i| value(i) < 0.0);
    match negative.iter().filter(|n| **n).count() {
        lone @ (1 | 3) => {
            let k = negative.iter().position(|n| *n == (lone == 1)).unwrap_or(0);
            let [a, b, c, d] = FRONT[k].map(|k| tet[k]);
            let [p, q, r] = [cut(a, b), cut(a, c), cut(a, d)];
            // Seen from outside the tet's corner a, (b, c, d) runs clockwise about a's side of the cut.
            [Some(if lone == 1 { [p, q, r] } else { [p, r, q] }), None]
        }
        2 => {
            let k = negative.iter().position(|n| *n).unwrap_or(0);
            let mut front = FRONT[k].map(|k| tet[k]);
            // Turn the other three until the second negative corner comes second.
            while value(front[1]) >= 0.0 {
                front = [front[0], front[2], front[3], front[1]];
            }
            let [a, b, c, d] = front;
            let [ac, ad, bc, bd] = [cut(a, c), cut(a, d), cut(b, c), cut(b, d)];
            [Some([ac, ad, bd]), Some([ac, bd, bc])]
        }
        _ => [None, None],
    }
}
