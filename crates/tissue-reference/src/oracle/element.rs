//! One element: its deformation gradient, and its tangent made positive.

use faer::{Mat, Side};
use glam::{DMat3, DVec3};
use trocar_tissue::assembly::Tangent;

/// F from the corners' positions and rest gradients, F = sum x m'.
pub(crate) fn deformation(x: [DVec3; 4], m: &[DVec3; 4]) -> DMat3 {
    // Gradients sum to zero: edges instead of positions avoid the rounding of positions far from
    // the origin.
    let mut f = DMat3::ZERO;
    for k in 1..4 {
        let edge = x[k] - x[0];
        f.x_axis += edge * m[k].x;
        f.y_axis += edge * m[k].y;
        f.z_axis += edge * m[k].z;
    }
    f
}

/// The nearest positive semidefinite tangent: negative eigenvalues become 0. None if there is no
/// eigendecomposition (numbers that are not finite).
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
