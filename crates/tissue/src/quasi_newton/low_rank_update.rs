//! Contacts that began or ended since the matrix was factorised, and elements that are
//! far stiffer than at rest, as a low-rank update of its inverse.
//!
//! The factor contains the stiffness of the nodes that pressed when it was made. New and lost
//! contacts differ from it by a stiffness on a few nodes: a matrix of low rank. By Woodbury's
//! formula (Hager 1989, "Updating the inverse of a matrix") the inverse of the sum is that of the
//! factor less a product of a few of its columns. A node costs three solves once, and each solve
//! then costs three products with vectors. The stiffness is the same in all directions, so the
//! columns are kept in the tissue's rest frame and stay valid however it turns.
//!
//! A stiffened element has one direction and one column, which is solved for in every substep.

use super::factor::Factor;
use super::stiffened::{MAX_STIFFENED, Stiffened};
use crate::threads::in_parts;
use fearless_simd::{Simd, dispatch};

/// Greatest number of nodes in the update.
const MAX_NODES: usize = 16;

/// Fewest numbers of the solution whose correction is worth a thread of its own.
const MIN_NUMBERS: usize = 7500;

/// Greatest number of directions in the update.
const MAX_DIRECTIONS: usize = 3 * MAX_NODES + MAX_STIFFENED;

/// The difference between the matrix now and the factor. Its directions are three of each node,
/// then one of each stiffened element.
pub(super) struct LowRankUpdate {
    /// Nodes and the stiffness that is added (N/m); those whose stiffness is taken out of the
    /// factor come first.
    nodes: Vec<(u32, f32)>,
    next: Vec<(u32, f32)>,
    /// Index of each node's columns.
    places: Vec<usize>,
    /// Nodes whose columns of the factor's inverse are known, and three columns of each.
    known: Vec<u32>,
    columns: Vec<f32>,
    /// Elements that are stiffened, gradients in the rest frame, and a column of each.
    stiffened: Vec<Stiffened>,
    stiffened_columns: Vec<f32>,
    /// Whether the elements have changed since the matrix was made.
    stale: bool,
    /// Numbers of a column.
    length: usize,
    /// 1 / stiffness + the inverse's block of the directions, as L D L': what is below the diagonal
    /// of L, and D on it.
    matrix: Vec<f64>,
    shares: Vec<f64>,
    /// Whether the matrix is that of a sum that is positive definite.
    usable: bool,
}

impl LowRankUpdate {
    /// For solves with vectors of `length` numbers.
    pub fn new(length: usize) -> Self {
        Self {
            nodes: Vec::with_capacity(MAX_NODES),
            next: Vec::with_capacity(MAX_NODES),
            places: Vec::with_capacity(MAX_NODES),
            known: Vec::with_capacity(MAX_NODES),
            // Zeros take no memory until a column is written.
            columns: vec![0.0; 3 * MAX_NODES * length],
            stiffened: Vec::with_capacity(MAX_STIFFENED),
            stiffened_columns: vec![0.0; MAX_STIFFENED * length],
            stale: false,
            length,
            matrix: vec![0.0; MAX_DIRECTIONS * MAX_DIRECTIONS],
            shares: vec![0.0; MAX_DIRECTIONS],
            usable: false,
        }
    }

    /// Forgets everything: the factor has changed.
    pub fn clear(&mut self) {
        self.known.clear();
        self.reset();
    }

    /// Makes the update empty: the contacts are those in the factor, and no element is stiffened.
    pub fn reset(&mut self) {
        self.nodes.clear();
        self.stiffened.clear();
        (self.usable, self.stale) = (false, false);
    }

    /// Takes the stiffened elements out.
    pub fn forget_stiffened(&mut self) {
        if !self.stiffened.is_empty() {
            self.stiffened.clear();
            self.usable = self.factorise();
        }
    }

    /// Whether [`Self::set`] is to follow, because elements have changed.
    pub fn is_stale(&self) -> bool {
        self.stale
    }

    /// What the update adds to a node's stiffness (N/m).
    pub fn added(&self, node: u32) -> f32 {
        let known = self.nodes.iter().filter(|(i, _)| self.usable && *i == node);
        known.map(|(_, stiffness)| stiffness).sum()
    }

    /// Sets the nodes that differ (N/m): first those whose stiffness is taken out of the factor,
    /// with a negative one, then those that get more; each kind ascending. Nodes beyond the
    /// greatest number are left out.
    #[inline(always)]
    pub fn set<S: Simd>(
        &mut self,
        simd: S,
        factor: &mut Factor,
        scratch: &mut [f32],
        nodes: impl Iterator<Item = (u32, f32)>,
    ) {
        self.next.clear();
        self.next.extend(nodes.take(MAX_NODES));
        if self.next == self.nodes && !self.stale {
            return;
        }
        self.stale = false;
        std::mem::swap(&mut self.nodes, &mut self.next);
        self.solve_columns(simd, factor, scratch);
        self.usable = self.factorise();
    }

    /// Sets the stiffened elements, gradients in the rest frame, at most [`MAX_STIFFENED`]. The
    /// nodes are to be set after it.
    #[inline(always)]
    pub fn set_stiffened<S: Simd>(&mut self, simd: S, factor: &mut Factor, scratch: &mut [f32], found: &[Stiffened]) {
        if self.stiffened == found {
            return;
        }
        self.stiffened.clear();
        self.stiffened.extend_from_slice(found);
        for (element, column) in found.iter().zip(self.stiffened_columns.chunks_exact_mut(self.length)) {
            scratch.fill(0.0);
            for (node, g) in element.nodes.iter().zip(&element.gradient) {
                (0..3).for_each(|c| scratch[3 * *node as usize + c] += g[c]);
            }
            factor.solve(simd, scratch);
            column.copy_from_slice(&scratch[..self.length]);
        }
        self.stale = true;
    }

    /// Solves for the columns that are not known.
    #[inline(always)]
    fn solve_columns<S: Simd>(&mut self, simd: S, factor: &mut Factor, scratch: &mut [f32]) {
        let size = 3 * self.length;
        self.places.clear();
        for (node, _) in &self.nodes {
            // Solves in a closure that is not inlined would be compiled without the instruction set
            // of `S`, and each of their operations would be a call.
            if let Some(place) = self.known.iter().position(|known| known == node) {
                self.places.push(place);
                continue;
            }
            let unused = |known: &u32| self.nodes.iter().all(|(node, _)| node != known);
            let free = if self.known.len() < MAX_NODES { None } else { self.known.iter().position(unused) };
            let place = free.unwrap_or(self.known.len());
            if place < self.known.len() {
                self.known[place] = *node;
            } else {
                self.known.push(*node);
            }
            for c in 0..3 {
                scratch.fill(0.0);
                scratch[3 * *node as usize + c] = 1.0;
                factor.solve(simd, scratch);
                let column = &mut self.columns[place * size + c * self.length..][..self.length];
                column.copy_from_slice(&scratch[..self.length]);
            }
            self.places.push(place);
        }
    }

    /// Product of a direction and a vector.
    #[inline(always)]
    fn product(&self, i: usize, x: &[f32]) -> f64 {
        match i.checked_sub(3 * self.nodes.len()) {
            None => f64::from(x[3 * self.nodes[i / 3].0 as usize + i % 3]),
            Some(e) => self.stiffened[e].product(x),
        }
    }

    /// Stiffness of a direction.
    fn stiffness(&self, i: usize) -> f64 {
        f64::from(match i.checked_sub(3 * self.nodes.len()) {
            None => self.nodes[i / 3].1,
            Some(e) => self.stiffened[e].stiffness,
        })
    }

    /// The factor's inverse times a direction.
    fn column(&self, i: usize) -> &[f32] {
        match i.checked_sub(3 * self.nodes.len()) {
            None => &self.columns[(3 * self.places[i / 3] + i % 3) * self.length..][..self.length],
            Some(e) => &self.stiffened_columns[e * self.length..][..self.length],
        }
    }

    /// Builds the matrix of the directions and its L D L'. False if the sum is not positive
    /// definite.
    fn factorise(&mut self) -> bool {
        let n = 3 * self.nodes.len() + self.stiffened.len();
        for j in 0..n {
            for i in j..n {
                self.matrix[i * n + j] = self.product(i, self.column(j));
            }
            self.matrix[j * n + j] += 1.0 / self.stiffness(j);
        }
        for j in 0..n {
            for i in j..n {
                let known: f64 =
                    (0..j).map(|k| self.matrix[i * n + k] * self.matrix[j * n + k] * self.matrix[k * n + k]).sum();
                let rest = self.matrix[i * n + j] - known;
                self.matrix[i * n + j] = if i == j { rest } else { rest / self.matrix[j * n + j] };
            }
            // Removed contacts make the matrix negative there, added ones positive: it is
            // quasi-definite.
            let d = self.matrix[j * n + j] * self.stiffness(j);
            if d.is_nan() || d <= 0.0 {
                return false;
            }
        }
        n > 0
    }

    /// Turns the factor's solution `x` into that of the sum.
    #[inline(always)]
    pub fn apply<S: Simd>(&mut self, simd: S, x: &mut [f32]) {
        if !self.usable {
            return;
        }
        let of_nodes = 3 * self.nodes.len();
        let n = of_nodes + self.stiffened.len();
        for i in 0..n {
            let known: f64 = (0..i).map(|k| self.matrix[i * n + k] * self.shares[k]).sum();
            self.shares[i] = self.product(i, x) - known;
        }
        let (matrix, shares) = (&self.matrix, &mut self.shares[..n]);
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| matrix[k * n + i] * shares[k]).sum();
            shares[i] = shares[i] / matrix[i * n + i] - known;
        }
        let (shares, of_stiffened) = shares.split_at(of_nodes);
        let (level, length) = (simd.level(), self.length);
        in_parts(&mut x[..length], MIN_NUMBERS, |first, x| {
            let count = x.len();
            let part = |column: usize| column * length + first..column * length + first + count;
            dispatch!(level, _simd => {
                for (place, shares) in self.places.iter().zip(shares.chunks_exact(3)) {
                    let [a, b, c] = [0, 1, 2].map(|c| &self.columns[part(3 * place + c)]);
                    let [s, t, u] = [shares[0] as f32, shares[1] as f32, shares[2] as f32];
                    for (((x, a), b), c) in x.iter_mut().zip(a).zip(b).zip(c) {
                        *x -= s * a + t * b + u * c;
                    }
                }
                for (k, share) in of_stiffened.iter().enumerate() {
                    let (share, column) = (*share as f32, &self.stiffened_columns[part(k)]);
                    x.iter_mut().zip(column).for_each(|(x, c)| *x -= share * c);
                }
            });
        });
    }
}
