//! Conjugate gradients, preconditioned by a Cholesky factor of a nearby matrix.

use glam::DVec3;
use trocar_sparse::{BlockMatrix, Cholesky, Level};

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// The residual is small enough.
    Solved,
    /// The greatest number of iterations.
    Slow,
    /// A direction along which the matrix is not positive.
    NegativeCurvature,
}

/// The preconditioner: a factor of one matrix, kept for others like it.
pub(crate) struct Preconditioner {
    cholesky: Cholesky<f64>,
    numbers: Vec<f64>,
}

impl Preconditioner {
    /// Analyses the pattern of `matrix`.
    pub fn new(matrix: &BlockMatrix) -> Self {
        Self { cholesky: Cholesky::new(matrix), numbers: vec![0.0; 3 * matrix.len()] }
    }

    /// Factorises; false if the matrix is not positive definite.
    pub fn factorise(&mut self, matrix: &BlockMatrix) -> bool {
        self.cholesky.factorise(Level::new(), matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d()))
    }

    fn apply(&mut self, from: &[DVec3], to: &mut [DVec3]) {
        for (numbers, p) in self.numbers.chunks_exact_mut(3).zip(from) {
            p.write_to_slice(numbers);
        }
        self.cholesky.solve(Level::new(), &mut self.numbers);
        for (numbers, p) in self.numbers.chunks_exact(3).zip(to) {
            *p = DVec3::from_slice(numbers);
        }
    }
}

/// Solves A x = b for x, until the residual's norm is at most `tolerance` times that of b. Returns
/// how it ended and the number of iterations.
pub(crate) fn solve(
    matrix: &BlockMatrix,
    preconditioner: &mut Preconditioner,
    b: &[DVec3],
    tolerance: f64,
    most: usize,
    x: &mut [DVec3],
) -> (Ended, usize) {
    x.fill(DVec3::ZERO);
    let mut residual = b.to_vec();
    let mut z = vec![DVec3::ZERO; b.len()];
    preconditioner.apply(&residual, &mut z);
    let mut direction = z.clone();
    let mut product = z.clone();
    let mut size = dot(&residual, &z);
    let wanted = tolerance * tolerance * dot(b, b);
    for iteration in 1..=most {
        multiply(matrix, &direction, &mut product);
        let curvature = dot(&direction, &product);
        if curvature.is_nan() || curvature <= 0.0 {
            return (Ended::NegativeCurvature, iteration);
        }
        let step = size / curvature;
        for i in 0..x.len() {
            x[i] += step * direction[i];
            residual[i] -= step * product[i];
        }
        if dot(&residual, &residual) <= wanted {
            return (Ended::Solved, iteration);
        }
        preconditioner.apply(&residual, &mut z);
        let next = dot(&residual, &z);
        let keep = next / size;
        size = next;
        for (d, z) in direction.iter_mut().zip(&z) {
            *d = *z + keep * *d;
        }
    }
    (Ended::Slow, most)
}

/// A times x.
fn multiply(matrix: &BlockMatrix, x: &[DVec3], out: &mut [DVec3]) {
    out.fill(DVec3::ZERO);
    for (row, column, block) in matrix.blocks() {
        let (i, j) = (row as usize, column as usize);
        out[i] += *block * x[j];
        if i != j {
            out[j] += block.transpose() * x[i];
        }
    }
}

pub(crate) fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
