//! A sparse symmetric matrix of 3x3 blocks.

use glam::DMat3;

/// The lower triangle of a symmetric matrix of 3x3 blocks, one row and column of blocks a node.
///
/// Column j holds its diagonal block first, then the blocks of its neighbours with higher numbers,
/// ascending.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    /// First block of each column; one more at the end.
    first: Vec<usize>,
    /// Row of each block.
    rows: Vec<u32>,
    /// Column of each block.
    columns: Vec<u32>,
    blocks: Vec<DMat3>,
}

impl BlockMatrix {
    /// A zero matrix over `n` nodes with a block for each pair of `neighbours` (in any order and
    /// number) and each node.
    pub fn new(n: usize, neighbours: impl Iterator<Item = (u32, u32)>) -> Self {
        let mut below = vec![Vec::new(); n];
        for (a, b) in neighbours.filter(|(a, b)| a != b) {
            below[a.min(b) as usize].push(a.max(b));
        }
        let mut matrix = Self { first: vec![0], rows: Vec::new(), columns: Vec::new(), blocks: Vec::new() };
        for (column, list) in below.iter_mut().enumerate() {
            list.sort_unstable();
            list.dedup();
            matrix.rows.push(column as u32);
            matrix.rows.extend_from_slice(list);
            matrix.columns.resize(matrix.rows.len(), column as u32);
            matrix.first.push(matrix.rows.len());
        }
        matrix.blocks = vec![DMat3::ZERO; matrix.rows.len()];
        matrix
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sets all numbers to 0.
    pub fn clear(&mut self) {
        self.blocks.fill(DMat3::ZERO);
    }

    /// Adds a block at nodes (i, j). Of (i, j) and (j, i) one is kept, so both must be added.
    /// Blocks on the diagonal are made symmetric; blocks outside the pattern are dropped.
    pub fn add(&mut self, i: u32, j: u32, block: DMat3) {
        if i < j {
            return;
        }
        let first = self.first[j as usize];
        if i == j {
            self.blocks[first] += (block + block.transpose()) * 0.5;
        } else if let Ok(k) = self.rows[first + 1..self.first[j as usize + 1]].binary_search(&i) {
            self.blocks[first + 1 + k] += block;
        }
    }

    /// Adds the same number to the whole diagonal.
    pub fn shift(&mut self, by: f64) {
        for first in &self.first[..self.first.len() - 1] {
            self.blocks[*first] += DMat3::from_diagonal(glam::DVec3::splat(by));
        }
    }

    /// The diagonal block of node i.
    pub fn diagonal(&self, i: usize) -> DMat3 {
        self.blocks[self.first[i]]
    }

    /// The blocks of the lower triangle: row, column and numbers.
    pub fn blocks(&self) -> impl ExactSizeIterator<Item = (u32, u32, &DMat3)> {
        self.rows.iter().zip(&self.columns).zip(&self.blocks).map(|((row, column), block)| (*row, *column, block))
    }
}
