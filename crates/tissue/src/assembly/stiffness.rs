//! A body's stiffness over its free nodes, as a sparse symmetric matrix of 3x3 blocks.
//!
//! The pattern depends only on the mesh and on which nodes are fixed, and is kept. Numbers are
//! added element by element in the mesh's order, on one thread.

use glam::DMat3;
use trocar_sparse::BlockMatrix;

/// Number of a fixed node among the free ones.
const FIXED: u32 = u32::MAX;

/// The stiffness of a mesh over its free nodes (N/m).
pub struct Stiffness {
    /// Number of each node among the free ones.
    number: Vec<u32>,
    free: Vec<usize>,
    matrix: BlockMatrix,
}

impl Stiffness {
    /// An empty matrix over the nodes that are not fixed.
    pub fn new(tets: &[[u32; 4]], fixed: &[bool]) -> Self {
        Self::with_pairs(tets, &[], fixed)
    }

    /// [`Self::new`], and also with a block for each of these `pairs` of nodes.
    pub fn with_pairs(tets: &[[u32; 4]], pairs: &[[u32; 2]], fixed: &[bool]) -> Self {
        let mut number = vec![FIXED; fixed.len()];
        let free: Vec<usize> = (0..fixed.len()).filter(|i| !fixed[*i]).collect();
        for (k, i) in free.iter().enumerate() {
            number[*i] = k as u32;
        }
        let corners = tets.iter().map(|tet| tet.map(|i| number[i as usize]));
        let inner = corners.flat_map(|tet| (0..4).flat_map(move |a| (0..a).map(move |b| (tet[a], tet[b]))));
        let others = pairs.iter().map(|pair| pair.map(|i| number[i as usize])).map(|[a, b]| (a, b));
        let matrix = BlockMatrix::new(free.len(), inner.chain(others).filter(|(a, b)| *a != FIXED && *b != FIXED));
        Self { number, free, matrix }
    }

    /// The free nodes, in the order of the matrix's rows.
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Sets all numbers to 0.
    pub fn clear(&mut self) {
        self.matrix.clear();
    }

    /// Adds a block at nodes (i, j). Fixed nodes have none. Of (i, j) and (j, i) one is kept, so
    /// both must be added.
    pub fn add(&mut self, i: usize, j: usize, block: DMat3) {
        let (row, column) = (self.number[i], self.number[j]);
        if row != FIXED && column != FIXED {
            self.matrix.add(row, column, block);
        }
    }

    /// The numbers.
    pub fn matrix(&self) -> &BlockMatrix {
        &self.matrix
    }

    /// Adds the same number to the whole diagonal.
    pub fn shift(&mut self, by: f64) {
        self.matrix.shift(by);
    }

    /// Mean of the diagonal's absolute values (N/m).
    pub fn mean_diagonal(&self) -> f64 {
        let sum: f64 = (0..self.free.len())
            .map(|i| self.matrix.diagonal(i))
            .map(|block| (0..3).map(|c| block.col(c)[c].abs()).sum::<f64>())
            .sum();
        sum / (3 * self.free.len()).max(1) as f64
    }
}
