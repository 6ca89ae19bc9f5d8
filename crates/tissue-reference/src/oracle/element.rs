//! One element: its deformation gradient, and its tangent made positive.

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
    let mut matrix = [[0.0; N]; N];
    for c in 0..N {
        for r in 0..N {
            matrix[c][r] = 0.5 * (tangent[c][r] + tangent[r][c]);
        }
    }
    let vectors = diagonalise(&mut matrix)?;
    let mut out = [[0.0; N]; N];
    for (k, vector) in vectors.iter().enumerate() {
        let value = matrix[k][k].max(0.0);
        for c in 0..N {
            for r in 0..N {
                out[c][r] += value * vector[r] * vector[c];
            }
        }
    }
    Some(out)
}

/// Rows of a tangent.
const N: usize = 9;

/// Makes a symmetric matrix diagonal by Jacobi's rotations in cyclic order (Golub and Van Loan,
/// "Matrix Computations", section 8.5). Returns its eigenvectors; None if they do not converge.
fn diagonalise(matrix: &mut Tangent) -> Option<Tangent> {
    /// Sweeps over all pairs: convergence is quadratic, some eight are enough.
    const MAX_SWEEPS: usize = 30;
    let mut vectors = [[0.0; N]; N];
    (0..N).for_each(|k| vectors[k][k] = 1.0);
    let size = matrix.iter().flatten().map(|x| x * x).sum::<f64>();
    for _ in 0..MAX_SWEEPS {
        let pairs = (0..N).flat_map(|q| (0..q).map(move |p| (p, q)));
        if pairs.clone().map(|(p, q)| matrix[q][p] * matrix[q][p]).sum::<f64>() <= 1e-32 * size {
            return Some(vectors);
        }
        for (p, q) in pairs {
            let between = matrix[q][p];
            if between == 0.0 {
                continue;
            }
            // The smaller rotation that makes the number between p and q zero.
            let theta = 0.5 * (matrix[q][q] - matrix[p][p]) / between;
            let t = theta.signum() / (theta.abs() + libm::hypot(theta, 1.0));
            let (c, s) = (1.0 / libm::hypot(t, 1.0), t / libm::hypot(t, 1.0));
            let rotate = |a: f64, b: f64| (c * a - s * b, s * a + c * b);
            for column in matrix.iter_mut() {
                (column[p], column[q]) = rotate(column[p], column[q]);
            }
            for r in 0..N {
                (matrix[p][r], matrix[q][r]) = rotate(matrix[p][r], matrix[q][r]);
                (vectors[p][r], vectors[q][r]) = rotate(vectors[p][r], vectors[q][r]);
            }
        }
    }
    None
}
