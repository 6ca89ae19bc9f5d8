//! The Hessian's Cholesky factor. The symbolic factorisation (approximate minimum degree, faer)
//! depends only on the mesh and on which nodes are fixed, and is kept.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::{Conj, MatMut, Par, Side};
use glam::DVec3;
use trocar_tissue::assembly::Stiffness;

/// A Cholesky factor and its memory.
pub(super) struct Factor {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    memory: MemBuffer,
    right: Vec<f64>,
}

impl Factor {
    /// Orders and analyses; None if memory is short.
    pub fn new(matrix: &Stiffness) -> Option<Self> {
        let parameters = CholeskySymbolicParams::default();
        let symbolic =
            factorize_symbolic_cholesky(matrix.pattern(), Side::Lower, SymmetricOrdering::Amd, parameters).ok()?;
        let factorise = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let solve = symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        let memory = MemBuffer::try_new(factorise.or(solve)).ok()?;
        Some(Self {
            values: vec![0.0; symbolic.len_val()],
            memory,
            right: vec![0.0; 3 * matrix.free().len()],
            symbolic,
        })
    }

    /// Factorises; false if the matrix is not positive definite.
    pub fn factorise(&mut self, matrix: &Stiffness) -> bool {
        if matrix.values().iter().any(|v| !v.is_finite()) {
            return false;
        }
        let sparse = SparseColMatRef::new(matrix.pattern(), matrix.values());
        let stack = MemStack::new(&mut self.memory);
        let regularization = LltRegularization::default();
        let done = self.symbolic.factorize_numeric_llt(
            &mut self.values,
            sparse,
            Side::Lower,
            regularization,
            Par::Seq,
            stack,
            Default::default(),
        );
        done.is_ok()
    }

    /// Writes the Newton step -H^-1 g over all nodes, 0 at fixed ones.
    pub fn newton_step(&mut self, matrix: &Stiffness, gradient: &[DVec3], step: &mut [DVec3]) {
        for (k, i) in matrix.free().iter().enumerate() {
            let g = gradient[*i].to_array();
            (0..3).for_each(|c| self.right[3 * k + c] = -g[c]);
        }
        let n = self.right.len();
        let right = MatMut::from_column_major_slice_mut(&mut self.right, n, 1);
        let stack = MemStack::new(&mut self.memory);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, right, Par::Seq, stack);
        step.fill(DVec3::ZERO);
        for (k, i) in matrix.free().iter().enumerate() {
            step[*i] = DVec3::from_slice(&self.right[3 * k..3 * k + 3]);
        }
    }
}
