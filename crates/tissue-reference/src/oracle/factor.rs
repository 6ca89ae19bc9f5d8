//! The Hessian's Cholesky factor. Its analysis depends only on the mesh and on which nodes are
//! fixed, and is kept.

use glam::DVec3;
use trocar_sparse::{Cholesky, Level};
use trocar_tissue::assembly::Stiffness;

/// A Cholesky factor and its memory.
pub(crate) struct Factor {
    cholesky: Cholesky<f64>,
    right: Vec<f64>,
}

impl Factor {
    /// Orders and analyses a matrix.
    pub fn new(matrix: &Stiffness) -> Self {
        Self { cholesky: Cholesky::new(matrix.matrix()), right: vec![0.0; 3 * matrix.free().len()] }
    }

    /// Factorises; false if the matrix is not positive definite.
    pub fn factorise(&mut self, matrix: &Stiffness) -> bool {
        let blocks = matrix.matrix().blocks();
        self.cholesky.factorise(Level::new(), blocks.map(|(_, _, block)| block.to_cols_array_2d()))
    }

    /// Writes the Newton step -H^-1 g over all nodes, 0 at fixed ones.
    pub fn newton_step(&mut self, matrix: &Stiffness, gradient: &[DVec3], step: &mut [DVec3]) {
        for (right, i) in self.right.chunks_exact_mut(3).zip(matrix.free()) {
            (-gradient[*i]).write_to_slice(right);
        }
        self.cholesky.solve(Level::new(), &mut self.right);
        step.fill(DVec3::ZERO);
        for (right, i) in self.right.chunks_exact(3).zip(matrix.free()) {
            step[*i] = DVec3::from_slice(right);
        }
    }
}
