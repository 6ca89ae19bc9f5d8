//! Dense symmetric systems: small, and with the same bits on any machine.

/// The lower triangular factor of a positive definite matrix (Cholesky).
#[derive(Clone, Debug)]
pub(crate) struct Factor {
    size: usize,
    /// Row by row, full rows.
    lower: Vec<f64>,
}

impl Factor {
    /// The factor of the matrix with these elements, of which only the lower triangle is read. None
    /// if it is not positive definite.
    pub fn of(size: usize, element: impl Fn(usize, usize) -> f64) -> Option<Self> {
        let mut lower = vec![0.0; size * size];
        for i in 0..size {
            let (above, row) = lower.split_at_mut(i * size);
            let row = &mut row[..size];
            for j in 0..i {
                let other = &above[j * size..j * size + j + 1];
                row[j] = (element(i, j) - dot(&row[..j], &other[..j])) / other[j];
            }
            let left = element(i, i) - dot(&row[..i], &row[..i]);
            if !(left > 0.0 && left.is_finite()) {
                return None;
            }
            row[i] = left.sqrt();
        }
        Some(Self { size, lower })
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.lower[i * self.size..i * self.size + i + 1]
    }

    /// x = L^-1 x.
    pub fn forward(&self, x: &mut [f64]) {
        for i in 0..self.size {
            let row = self.row(i);
            x[i] = (x[i] - dot(&row[..i], &x[..i])) / row[i];
        }
    }

    /// x = A^-1 x.
    pub fn solve(&self, x: &mut [f64]) {
        self.forward(x);
        for i in (0..self.size).rev() {
            let row = self.row(i);
            x[i] /= row[i];
            let known = x[i];
            x[..i].iter_mut().zip(row).for_each(|(x, l)| *x -= l * known);
        }
    }

    /// The logarithm of the determinant of A.
    pub fn log_determinant(&self) -> f64 {
        (0..self.size).map(|i| 2.0 * self.row(i)[i].ln()).sum()
    }

    /// x' A^-1 x; overwrites x.
    pub fn distance(&self, x: &mut [f64]) -> f64 {
        self.forward(x);
        dot(x, x)
    }
}

/// The sum of products.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums, in a fixed order: several times as fast as one.
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_solves_the_matrix() {
        let matrix = [[4.0, 1.0, 0.5], [1.0, 3.0, -0.2], [0.5, -0.2, 2.0]];
        let factor = Factor::of(3, |i, j| matrix[i][j]).unwrap();
        let mut x = vec![1.0, -2.0, 0.7];
        let right = x.clone();
        factor.solve(&mut x);
        for i in 0..3 {
            assert!((dot(&matrix[i], &x) - right[i]).abs() < 1e-12);
        }
        assert!((factor.distance(&mut right.clone()) - dot(&right, &x)).abs() < 1e-12);
        let determinant: f64 = 4.0 * (6.0 - 0.04) - (2.0 + 0.1) + 0.5 * (-0.2 - 1.5);
        assert!((factor.log_determinant() - determinant.ln()).abs() < 1e-12);
        assert!(Factor::of(2, |i, j| if i == j { 1.0 } else { 2.0 }).is_none());
    }
}
