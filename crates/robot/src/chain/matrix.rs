//! Small symmetric matrices over an arm's joints, and their Cholesky factors.

use super::joints::{Joints, MAX_JOINTS};

/// A symmetric matrix with a row and a column for each joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMatrix {
    n: usize,
    rows: [[f64; MAX_JOINTS]; MAX_JOINTS],
}

impl JointMatrix {
    /// Zeros for `n` joints, at most [`MAX_JOINTS`].
    pub const fn zeros(n: usize) -> Self {
        Self { n: if n < MAX_JOINTS { n } else { MAX_JOINTS }, rows: [[0.0; MAX_JOINTS]; MAX_JOINTS] }
    }

    /// Number of rows and columns.
    pub const fn size(&self) -> usize {
        self.n
    }

    /// Row `i`; empty beyond the last.
    pub fn row(&self, i: usize) -> &[f64] {
        if i < self.n { &self.rows[i][..self.n] } else { &[] }
    }

    pub(crate) const fn at(&self, i: usize, j: usize) -> f64 {
        self.rows[i][j]
    }

    pub(crate) const fn set(&mut self, i: usize, j: usize, value: f64) {
        self.rows[i][j] = value;
        self.rows[j][i] = value;
    }

    pub(crate) fn add_diagonal(&mut self, i: usize, value: f64) {
        self.rows[i][i] += value;
    }

    /// Adds `s` r r^T.
    pub(crate) fn add_outer(&mut self, s: f64, r: &Joints) {
        for i in 0..self.n {
            let t = s * r.at(i);
            for j in 0..self.n {
                self.rows[i][j] += t * r.at(j);
            }
        }
    }

    /// The matrix times a vector.
    pub fn times(&self, v: &Joints) -> Joints {
        Joints::from_fn(self.n, |i| (0..self.n).map(|j| self.rows[i][j] * v.at(j)).sum())
    }

    /// The Cholesky factor L with L L^T = self; `None` if the matrix is not positive definite or
    /// not finite.
    pub fn factor(&self) -> Option<JointFactor> {
        let n = self.n;
        let mut l = JointFactor { n, rows: [[0.0; MAX_JOINTS]; MAX_JOINTS], inverse: [0.0; MAX_JOINTS] };
        for i in 0..n {
            for j in 0..=i {
                let mut s = self.rows[i][j];
                for k in 0..j {
                    s -= l.rows[i][k] * l.rows[j][k];
                }
                if j < i {
                    l.rows[i][j] = s * l.inverse[j];
                } else {
                    // A smaller pivot is only rounding.
                    if !(s > 1e-14 * self.rows[i][i].abs() && s.is_finite()) {
                        return None;
                    }
                    let root = s.sqrt();
                    l.rows[i][i] = root;
                    l.inverse[i] = 1.0 / root;
                }
            }
        }
        Some(l)
    }
}

/// The Cholesky factor of a [`JointMatrix`].
#[derive(Clone, Copy, Debug)]
pub struct JointFactor {
    n: usize,
    rows: [[f64; MAX_JOINTS]; MAX_JOINTS],
    inverse: [f64; MAX_JOINTS],
}

impl JointFactor {
    /// Solves A x = b.
    pub fn solve(&self, b: &Joints) -> Joints {
        let n = self.n;
        let mut x = Joints::from_fn(n, |i| b.at(i));
        for i in 0..n {
            let mut s = x[i];
            for k in 0..i {
                s -= self.rows[i][k] * x[k];
            }
            x[i] = s * self.inverse[i];
        }
        for i in (0..n).rev() {
            let mut s = x[i];
            for k in i + 1..n {
                s -= self.rows[k][i] * x[k];
            }
            x[i] = s * self.inverse[i];
        }
        x
    }
}
