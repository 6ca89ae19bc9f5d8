//! One element: the gradients of its shape functions, its tangent and its stiffness.

use crate::Hyperelastic;
use glam::{DMat3, DVec3};
use trocar_geometry::TetMesh;

/// dP/dF as a matrix over the entries of F, column by column (Pa).
pub type Tangent = [[f64; 9]; 9];

/// The other corners of an element seen from corner k, in the order that makes
/// (b-a)x(c-a).(x-a) positive.
pub(crate) const SEEN_FROM: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// Gradients of the four shape functions of element `t` at rest (1/m).
pub fn shape_gradients(mesh: &TetMesh, t: usize) -> [DVec3; 4] {
    let x = mesh.corners(t);
    let six_v = 6.0 * mesh.tet_volume(t);
    [0, 1, 2, 3].map(|k: usize| {
        let [a, b, c] = SEEN_FROM[k].map(|c| x[c]);
        (b - a).cross(c - a) / six_v
    })
}

/// dP/dF of the material `psi` at F.
pub fn tangent(psi: &dyn Hyperelastic, f: DMat3) -> Tangent {
    std::array::from_fn(|k| {
        let mut change = [0.0; 9];
        change[k] = 1.0;
        psi.stress_change(f, DMat3::from_cols_array(&change)).to_cols_array()
    })
}

/// The 3x3 blocks of an element's stiffness over its volume: block (a, b) is at index `[a][b]`.
pub fn blocks(tangent: &Tangent, m: &[DVec3; 4]) -> [[DMat3; 4]; 4] {
    let mut out = [[DMat3::ZERO; 4]; 4];
    for b in 0..4 {
        for s in 0..3 {
            // Stress when corner b moves along axis s: F changes by e_s m'.
            let mut stress = [0.0; 9];
            for (k, along) in m[b].to_array().into_iter().enumerate() {
                for (sum, value) in stress.iter_mut().zip(&tangent[3 * k + s]) {
                    *sum += along * value;
                }
            }
            let stress = DMat3::from_cols_array(&stress);
            for (a, row) in out.iter_mut().enumerate() {
                *row[b].col_mut(s) = stress * m[a];
            }
        }
    }
    out
}
