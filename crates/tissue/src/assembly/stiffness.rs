//! A body's stiffness over its free nodes, as a sparse symmetric matrix of 3x3 blocks.
//!
//! The pattern depends only on the mesh and on which nodes are fixed, and is kept. Numbers are
//! added element by element in the mesh's order, on one thread.

use faer::sparse::SymbolicSparseColMatRef;
use glam::DMat3;

/// Number of a fixed node among the free ones.
const FIXED: usize = usize::MAX;

/// The lower triangle of a symmetric matrix of 3x3 blocks, compressed by scalar columns.
pub struct Stiffness {
    /// Number of each node among the free ones.
    number: Vec<usize>,
    free: Vec<usize>,
    /// Per free node, its neighbours with higher numbers, ascending.
    below: Vec<Vec<usize>>,
    columns: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
}

impl Stiffness {
    /// An empty matrix over the nodes that are not fixed.
    pub fn new(tets: &[[u32; 4]], fixed: &[bool]) -> Self {
        let mut number = vec![FIXED; fixed.len()];
        let free: Vec<usize> = (0..fixed.len()).filter(|i| !fixed[*i]).collect();
        for (k, i) in free.iter().enumerate() {
            number[*i] = k;
        }
        let mut below = vec![Vec::new(); free.len()];
        for tet in tets {
            for a in tet.map(|i| number[i as usize]) {
                for b in tet.map(|i| number[i as usize]) {
                    if a != FIXED && b != FIXED && b > a {
                        below[a].push(b);
                    }
                }
            }
        }
        for list in &mut below {
            list.sort_unstable();
            list.dedup();
        }
        let (mut columns, mut rows) = (vec![0], Vec::new());
        for (j, list) in below.iter().enumerate() {
            for c in 0..3 {
                rows.extend(3 * j + c..3 * j + 3);
                list.iter().for_each(|i| rows.extend(3 * i..3 * i + 3));
                columns.push(rows.len());
            }
        }
        let values = vec![0.0; rows.len()];
        Self { number, free, below, columns, rows, values }
    }

    /// The free nodes, in the order of the matrix's rows.
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Sets all numbers to 0.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds a block at nodes (i, j). Fixed nodes have none. Of (i, j) and (j, i) one is kept, so
    /// both must be added.
    pub fn add(&mut self, i: usize, j: usize, block: DMat3) {
        let (row, column) = (self.number[i], self.number[j]);
        if row == FIXED || column == FIXED || row < column {
            return;
        }
        if row == column {
            for c in 0..3 {
                let first = self.columns[3 * column + c];
                for r in c..3 {
                    self.values[first + r - c] += 0.5 * (block.col(c)[r] + block.col(r)[c]);
                }
            }
        } else if let Ok(k) = self.below[column].binary_search(&row) {
            for c in 0..3 {
                let first = self.columns[3 * column + c] + 3 - c + 3 * k;
                for r in 0..3 {
                    self.values[first + r] += block.col(c)[r];
                }
            }
        }
    }

    /// The numbers, by the pattern.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Adds the same number to the whole diagonal.
    pub fn shift(&mut self, by: f64) {
        for first in &self.columns[..self.columns.len() - 1] {
            self.values[*first] += by;
        }
    }

    /// Mean of the diagonal's absolute values (N/m).
    pub fn mean_diagonal(&self) -> f64 {
        let diagonal = self.columns[..self.columns.len() - 1].iter().map(|first| self.values[*first].abs());
        diagonal.sum::<f64>() / (3 * self.free.len()).max(1) as f64
    }

    /// Pattern of the lower triangle for faer.
    pub fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        let n = 3 * self.free.len();
        SymbolicSparseColMatRef::new_checked(n, n, &self.columns, None, &self.rows)
    }
}
