//! Eigenvalues and singular values of 3x3 matrices, by Jacobi's rotations; their nearest rotations.
//! Only sums, products, quotients and roots are used: the bits are the same on every machine.

use glam::{DMat3, DVec3};

/// Greatest number of sweeps; seven suffice for double precision.
const MAX_SWEEPS: usize = 30;

/// Pairs of axes that a sweep rotates.
const PAIRS: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// Cosine and sine of the rotation that makes the symmetric matrix (a, c; c, b) diagonal, by at
/// most 45 degrees.
fn rotation(a: f64, b: f64, c: f64) -> (f64, f64) {
    let ratio = (b - a) / (2.0 * c);
    let tangent = ratio.signum() / (ratio.abs() + (1.0 + ratio * ratio).sqrt());
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    (cosine, tangent * cosine)
}

/// Columns i and j of `m` turned into each other.
fn turn(m: &mut DMat3, [i, j]: [usize; 2], (cosine, sine): (f64, f64)) {
    let (a, b) = (m.col(i), m.col(j));
    *m.col_mut(i) = cosine * a - sine * b;
    *m.col_mut(j) = sine * a + cosine * b;
}

/// Eigenvalues and the rotation whose columns are the eigenvectors of a symmetric matrix, in no
/// particular order.
pub fn eigen(matrix: DMat3) -> (DVec3, DMat3) {
    let (mut m, mut axes) = (matrix, DMat3::IDENTITY);
    // Rounding leaves about this much beside the diagonal.
    let rounding = f64::EPSILON * matrix.to_cols_array().iter().map(|x| x.abs()).fold(0.0, f64::max);
    for _ in 0..MAX_SWEEPS {
        let mut turned = false;
        for [i, j] in PAIRS {
            let (a, b, c) = (m.col(i)[i], m.col(j)[j], m.col(j)[i]);
            if c.abs() > rounding {
                let by = rotation(a, b, c);
                turn(&mut m, [i, j], by);
                m = m.transpose();
                turn(&mut m, [i, j], by);
                turn(&mut axes, [i, j], by);
                turned = true;
            }
        }
        if !turned {
            break;
        }
    }
    (DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z), axes)
}

/// F = U diag(s) V^T with rotations U and V. The values descend; only the last may be negative, and
/// is if F inverts (Irving, Teran and Fedkiw, "Invertible finite elements", 2004).
#[derive(Clone, Copy, Debug)]
pub struct Svd {
    /// The left rotation U.
    pub u: DMat3,
    /// The singular values s.
    pub s: DVec3,
    /// The right rotation V.
    pub v: DMat3,
}

impl Svd {
    /// By Hestenes' one-sided rotations.
    pub fn of(f: DMat3) -> Self {
        let (mut b, mut v) = (f, DMat3::IDENTITY);
        for _ in 0..MAX_SWEEPS {
            let mut turned = false;
            for [i, j] in PAIRS {
                let (a, d, c) = (b.col(i).length_squared(), b.col(j).length_squared(), b.col(i).dot(b.col(j)));
                if c.abs() > f64::EPSILON * (a * d).sqrt() {
                    let by = rotation(a, d, c);
                    turn(&mut b, [i, j], by);
                    turn(&mut v, [i, j], by);
                    turned = true;
                }
            }
            if !turned {
                break;
            }
        }
        for [i, j] in PAIRS {
            if b.col(i).length_squared() < b.col(j).length_squared() {
                // A quarter turn swaps the columns and keeps the determinant.
                turn(&mut b, [i, j], (0.0, -1.0));
                turn(&mut v, [i, j], (0.0, -1.0));
            }
        }
        let first = b.x_axis.try_normalize().unwrap_or(DVec3::X);
        let across = b.y_axis - first * first.dot(b.y_axis);
        let second = across.try_normalize().unwrap_or_else(|| first.any_orthonormal_vector());
        let third = first.cross(second);
        let s = DVec3::new(first.dot(b.x_axis), second.dot(b.y_axis), third.dot(b.z_axis));
        Self { u: DMat3::from_cols(first, second, third), s, v }
    }
}

/// Greatest number of Newton steps to a rotation; they converge quadratically.
const MAX_POLAR_STEPS: usize = 12;

/// A step that changes so little (squared) is followed by rounding only.
const POLAR_TOLERANCE: f64 = 1e-14;

/// Determinant, over the cube of the norm, below which singular values are taken.
const POLAR_MIN_VOLUME: f64 = 1e-3;

/// The rotation nearest to F: Newton's iteration of Higham, "Computing the polar decomposition -
/// with applications", 1986.
pub fn nearest_rotation(f: DMat3) -> DMat3 {
    let norm = f.to_cols_array().iter().map(|e| e * e).sum::<f64>().sqrt();
    let volume = f.determinant();
    if volume > POLAR_MIN_VOLUME * norm.powi(3) {
        let mut x = f;
        for _ in 0..MAX_POLAR_STEPS {
            let next = (x + cofactor(x) * (1.0 / x.determinant())) * 0.5;
            let change: f64 = (next - x).to_cols_array().iter().map(|e| e * e).sum();
            x = next;
            if change < POLAR_TOLERANCE {
                return x;
            }
        }
    }
    let svd = Svd::of(f);
    svd.u * svd.v.transpose()
}

/// The cofactor matrix, det(F) F^-T.
pub fn cofactor(f: DMat3) -> DMat3 {
    let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn size(m: DMat3) -> f64 {
        m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
    }

    #[test]
    fn matrices_are_taken_apart_and_put_together() {
        let turn = |a, b, c| DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, a, b, c));
        let (q, r) = (turn(0.3, -1.2, 2.0), turn(-2.9, 0.4, 1.1));
        for s in [[1.0, 1.0, 1.0], [3.0, 2.0, 0.1], [1.0, 1.0, -0.5], [2.0, 1e-9, -1e-12], [1.0, 0.0, 0.0], [0.0; 3]] {
            let f = q * DMat3::from_diagonal(s.into()) * r.transpose();
            let svd = Svd::of(f);
            assert!(size(svd.u * DMat3::from_diagonal(svd.s) * svd.v.transpose() - f) < 1e-14 * (1.0 + s[0]));
            for rotation in [svd.u, svd.v] {
                assert!(size(rotation * rotation.transpose() - DMat3::IDENTITY) < 1e-14, "{s:?}");
                assert!((rotation.determinant() - 1.0).abs() < 1e-14);
            }
            assert!((svd.s - DVec3::from_array(s)).length() < 1e-14 * (1.0 + s[0]), "{s:?}: {}", svd.s);

            let symmetric = q * DMat3::from_diagonal(s.into()) * q.transpose();
            let (values, axes) = eigen(symmetric);
            assert!(size(axes * DMat3::from_diagonal(values) * axes.transpose() - symmetric) < 1e-14 * (1.0 + s[0]));
        }
    }
}
