//! The singular value decomposition of a tall matrix with few columns.

/// A matrix with `N` columns, one array a row.
type Rows<const N: usize> = Vec<[f64; N]>;

/// Most sweeps over all pairs of columns; ten are enough for any well-scaled matrix.
const MAX_SWEEPS: usize = 60;

/// The decomposition A = U S V' of a matrix with `N` columns.
pub(super) struct Svd<const N: usize> {
    /// The left singular vectors times their singular values, U S: as many rows as A has.
    scaled_left: Rows<N>,
    /// The right singular vectors, the columns of V.
    pub right: [[f64; N]; N],
    /// The singular values, in no particular order.
    pub values: [f64; N],
}

impl<const N: usize> Svd<N> {
    /// Decomposes `matrix` by one-sided Jacobi rotations (Hestenes 1958), which find small singular
    /// values to full relative accuracy. `None` if the rotations do not converge, as with numbers
    /// that are not finite.
    pub fn new(mut matrix: Rows<N>) -> Option<Self> {
        // Columns shorter than rounding in the whole matrix are zero: their directions are noise.
        let squares = matrix.iter().flatten().map(|a| a * a).sum::<f64>();
        let zero = f64::EPSILON * f64::EPSILON * squares;
        let mut right = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        for _ in 0..MAX_SWEEPS {
            let mut rotated = false;
            for p in 0..N {
                for q in p + 1..N {
                    rotated |= orthogonalise(&mut matrix, &mut right, [p, q], zero)?;
                }
            }
            if !rotated {
                let norm = |j: usize| matrix.iter().map(|row| row[j] * row[j]).sum::<f64>().sqrt();
                return Some(Self { values: std::array::from_fn(norm), right, scaled_left: matrix });
            }
        }
        None
    }

    /// The least-squares solution x of A x = b.
    pub fn solve(&self, b: &[f64]) -> [f64; N] {
        let projected: [f64; N] = std::array::from_fn(|k| {
            let dot: f64 = self.scaled_left.iter().zip(b).map(|(row, b)| row[k] * b).sum();
            dot / (self.values[k] * self.values[k])
        });
        std::array::from_fn(|i| (0..N).map(|k| self.right[i][k] * projected[k]).sum())
    }

    /// Entry (i, j) of the inverse of A' A.
    pub fn inverse_normal(&self, i: usize, j: usize) -> f64 {
        let term = |k: usize| self.right[i][k] * self.right[j][k] / (self.values[k] * self.values[k]);
        (0..N).map(term).sum()
    }
}

/// Rotates columns `p` and `q` of `matrix` (and of `right`) until they are orthogonal. Returns
/// whether they were not, or `None` for numbers that are not finite. A column whose squared length
/// is at most `zero` is left as it is.
fn orthogonalise<const N: usize>(
    matrix: &mut [[f64; N]],
    right: &mut [[f64; N]; N],
    [p, q]: [usize; 2],
    zero: f64,
) -> Option<bool> {
    let (mut pp, mut qq, mut pq) = (0.0, 0.0, 0.0);
    for row in matrix.iter() {
        pp += row[p] * row[p];
        qq += row[q] * row[q];
        pq += row[p] * row[q];
    }
    if !(pp + qq + pq).is_finite() {
        return None;
    }
    if pq.abs() <= f64::EPSILON * (pp * qq).sqrt() || pp.min(qq) <= zero {
        return Some(false);
    }
    let zeta = (qq - pp) / (2.0 * pq);
    let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sine = cosine * tangent;
    for row in matrix.iter_mut().chain(right.iter_mut()) {
        (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
    }
    Some(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_of_known_singular_values_is_decomposed() {
        // Two columns of lengths 3 and 2 at right angles, mixed by a rotation of 30 degrees.
        let (c, s) = (0.75_f64.sqrt(), 0.5);
        let matrix: Vec<[f64; 2]> = vec![[3.0 * c, -3.0 * s], [2.0 * s, 2.0 * c], [0.0, 0.0]];
        let svd = Svd::new(matrix.clone()).unwrap();
        let mut values = svd.values;
        values.sort_by(f64::total_cmp);
        assert!((values[0] - 2.0).abs() < 1e-14 && (values[1] - 3.0).abs() < 1e-14, "{values:?}");
        let truth = [0.3, -1.7];
        let b: Vec<f64> = matrix.iter().map(|row| row[0] * truth[0] + row[1] * truth[1]).collect();
        let x = svd.solve(&b);
        assert!((x[0] - truth[0]).abs() < 1e-14 && (x[1] - truth[1]).abs() < 1e-14, "{x:?}");
        // A' A times its inverse is the identity.
        for i in 0..2 {
            for j in 0..2 {
                let normal = |k: usize| matrix.iter().map(|row| row[i] * row[k]).sum::<f64>();
                let product: f64 = (0..2).map(|k| normal(k) * svd.inverse_normal(k, j)).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_dependent_column_has_a_singular_value_of_zero() {
        let svd = Svd::new((0..9).map(|k| [f64::from(k), 2.0 * f64::from(k), 1.0]).collect()).unwrap();
        let (least, most) = svd.values.iter().fold((f64::MAX, 0.0_f64), |(l, m), v| (l.min(*v), m.max(*v)));
        assert!(least < 1e-14 * most, "{:?}", svd.values);
    }

    #[test]
    fn numbers_that_are_not_finite_have_no_decomposition() {
        assert!(Svd::new(vec![[1.0, f64::NAN], [0.0, 1.0]]).is_none());
    }
}
