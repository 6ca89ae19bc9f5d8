//! One element: deformation gradient, nodal forces and stiffness.

use crate::Hyperelastic;
use faer::{Mat, Side};
use glam::{DMat3, DVec3};

/// dP/dF as a matrix over the entries of F, column by column [Pa].
pub(crate) type Tangent = [[f64; 9]; 9];

/// F from the corners' positions and rest gradients, F = sum x m'.
pub(crate) fn deformation(x: [DVec3; 4], m: &[DVec3; 4]) -> DMat3 {
    // Gradients sum to zero: edges instead of positions keep the rounding of positions far from the origin out.
    let mut f = DMat3::ZERO;
    for k in 1..4 {
        let edge = x[k] - x[0];
        f.x_axis += edge * m[k].x;
        f.y_axis += edge * m[k].y;
        f.z_axis += edge * m[k].z;
    }
    f
}

/// dP/dF at F.
pub(crate) fn tangent(psi: &dyn Hyperelastic, f: DMat3) -> Tangent {
    std::array::from_fn(|k| {
        let mut change = [0.0; 9];
        change[k] = 1.0;
        psi.stress_change(f, DMat3::from_cols_array(&change)).to_cols_array()
    })
}

/// The nearest positive semidefinite tangent: negative eigenvalues become 0. None if there is no eigendecomposition (numbers that are not finite).
pub(crate) fn projected(tangent: &Tangent) -> Option<Tangent> {
    if tangent.iter().flatten().any(|v| !v.is_finite()) {
        return None;
    }
    let matrix = Mat::from_fn(9, 9, |r, c| 0.5 * (tangent[c][r] + tangent[r][c]));
    let eigen = matrix.self_adjoint_eigen(Side::Lower).ok()?;
    let (vectors, values) = (eigen.U(), eigen.S());
    let mut out = [[0.0; 9]; 9];
    for k in 0..9 {
        let value = values[k].max(0.0);
        for c in 0..9 {
            for r in 0..9 {
                out[c][r] += value * vectors[(r, k)] * vectors[(c, k)];
            }
        }
    }
    Some(out)
}

/// The 3x3 blocks of an element's stiffness, over its volume, block (a, b) at [a][b].
pub(crate) fn blocks(tangent: &Tangent, m: &[DVec3; 4]) -> [[DMat3; 4]; 4] {
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
