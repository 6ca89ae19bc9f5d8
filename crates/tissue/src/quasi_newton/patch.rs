//! What the factor does not know of what presses, made good at each solve.
//!
//! The factor holds the nodes that pressed when it was made. Those that press since, and those that let go, differ from it by a stiffness on a few nodes: a matrix of low rank. By Woodbury's
//! formula (Hager 1989, Updating the inverse of a matrix) the inverse of the sum is that of the factor less a product of a few columns of it: three solves a node once, and afterwards three products
//! with vectors a solve. The stiffness is the same in all directions, so that columns are kept in the tissue's rest frame and stay right however it turns.

use super::factor::Factor;
use super::part::{QuasiNewtonSolver, position};
use crate::contact::Source;
use fearless_simd::{Simd, dispatch};

/// Most nodes that are made good.
const MOST: usize = 16;

/// The difference between what presses and what the factor knows.
pub(super) struct Patch {
    /// Nodes, those whose stiffness is taken out of the factor first, and the stiffness that is added [N/m].
    nodes: Vec<(u32, f32)>,
    next: Vec<(u32, f32)>,
    /// Which of the columns are each node's.
    places: Vec<usize>,
    /// Nodes whose columns of the factor's inverse are known, and three columns of each.
    known: Vec<u32>,
    columns: Vec<f32>,
    /// Numbers of a column.
    length: usize,
    /// 1 / stiffness + the inverse's block of the nodes, as L D L': what is below the diagonal of L, and D on it.
    matrix: Vec<f64>,
    shares: Vec<f64>,
    /// Whether the matrix is that of a sum that is positive definite.
    usable: bool,
}

impl Patch {
    /// For solves with vectors of `length` numbers.
    pub fn new(length: usize) -> Self {
        Self {
            nodes: Vec::with_capacity(MOST),
            next: Vec::with_capacity(MOST),
            places: Vec::with_capacity(MOST),
            known: Vec::with_capacity(MOST),
            // Zeros take no memory until a column is written.
            columns: vec![0.0; 3 * MOST * length],
            length,
            matrix: vec![0.0; 9 * MOST * MOST],
            shares: vec![0.0; 3 * MOST],
            usable: false,
        }
    }

    /// The factor is another one.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.known.clear();
        self.usable = false;
    }

    /// What presses is as the factor knows it.
    pub fn rest(&mut self) {
        self.nodes.clear();
        self.usable = false;
    }

    /// Takes over which nodes differ: first those whose stiffness is to be taken out of the factor, with a negative one, then those that are to get more; each kind ascending [N/m]. Beyond
    /// a number nodes are left out.
    #[inline(always)]
    pub fn set<S: Simd>(
        &mut self,
        simd: S,
        factor: &mut Factor,
        scratch: &mut [f32],
        nodes: impl Iterator<Item = (u32, f32)>,
    ) {
        self.next.clear();
        self.next.extend(nodes.take(MOST));
        if self.next == self.nodes {
            return;
        }
        std::mem::swap(&mut self.nodes, &mut self.next);
        self.learn(simd, factor, scratch);
        self.usable = self.factorise();
    }

    /// Solves for the columns that are not known.
    #[inline(always)]
    fn learn<S: Simd>(&mut self, simd: S, factor: &mut Factor, scratch: &mut [f32]) {
        let size = 3 * self.length;
        self.places.clear();
        for (node, _) in &self.nodes {
            let place = self.known.iter().position(|known| known == node).unwrap_or_else(|| {
                let unused = |known: &u32| self.nodes.iter().all(|(node, _)| node != known);
                let free = if self.known.len() < MOST { None } else { self.known.iter().position(unused) };
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
                place
            });
            self.places.push(place);
        }
    }

    /// Makes the matrix of the nodes and its L D L'; false if the sum is not positive definite.
    fn factorise(&mut self) -> bool {
        let n = 3 * self.nodes.len();
        for j in 0..n {
            let column = &self.columns[(3 * self.places[j / 3] + j % 3) * self.length..][..self.length];
            for i in j..n {
                let node = self.nodes[i / 3].0 as usize;
                self.matrix[i * n + j] = f64::from(column[3 * node + i % 3]);
            }
            self.matrix[j * n + j] += 1.0 / f64::from(self.nodes[j / 3].1);
        }
        for j in 0..n {
            for i in j..n {
                let known: f64 =
                    (0..j).map(|k| self.matrix[i * n + k] * self.matrix[j * n + k] * self.matrix[k * n + k]).sum();
                let rest = self.matrix[i * n + j] - known;
                self.matrix[i * n + j] = if i == j { rest } else { rest / self.matrix[j * n + j] };
            }
            // What is taken out makes the matrix negative there, and what is added positive: it is quasi-definite.
            let d = self.matrix[j * n + j] * f64::from(self.nodes[j / 3].1);
            if d.is_nan() || d <= 0.0 {
                return false;
            }
        }
        n > 0
    }

    /// Goes from the factor's solution `x` to that of the sum.
    #[inline(always)]
    pub fn apply<S: Simd>(&mut self, _simd: S, x: &mut [f32]) {
        if !self.usable {
            return;
        }
        let n = 3 * self.nodes.len();
        let (matrix, shares) = (&self.matrix, &mut self.shares[..n]);
        for i in 0..n {
            let known: f64 = (0..i).map(|k| matrix[i * n + k] * shares[k]).sum();
            shares[i] = f64::from(x[3 * self.nodes[i / 3].0 as usize + i % 3]) - known;
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| matrix[k * n + i] * shares[k]).sum();
            shares[i] = shares[i] / matrix[i * n + i] - known;
        }
        let x = &mut x[..self.length];
        for (place, shares) in self.places.iter().zip(shares.chunks_exact(3)) {
            let columns = &self.columns[3 * place * self.length..3 * (place + 1) * self.length];
            let (a, rest) = columns.split_at(self.length);
            let (b, c) = rest.split_at(self.length);
            let [s, t, u] = [shares[0] as f32, shares[1] as f32, shares[2] as f32];
            for (((x, a), b), c) in x.iter_mut().zip(a).zip(b).zip(c) {
                *x -= s * a + t * b + u * c;
            }
        }
    }
}

impl QuasiNewtonSolver {
    /// Lets the preconditioner know of what presses where the nodes are.
    pub(super) fn patch(&mut self) {
        let Self { level, factor: Some(factor), patch, contacts, layout, pressing, known, x, held, right, .. } = self
        else {
            return;
        };
        if contacts.touches().is_empty() && known.is_empty() {
            return;
        }
        pressing.fill(0.0);
        for touch in contacts.touches().iter().filter(|touch| !matches!(touch.source, Source::Grasp(..))) {
            let i = layout.number[touch.vertex as usize] as usize;
            if i < layout.free && !held[i] && touch.height(position(&x[i])) < 0.0 {
                pressing[i] = touch.stiffness;
            }
        }
        // What is left is new.
        for (i, stiffness) in known.iter_mut() {
            *stiffness = -stiffness.abs();
            if std::mem::take(&mut pressing[*i as usize]) > 0.0 {
                *stiffness = -*stiffness;
            }
        }
        let gone = known.iter().filter(|(i, stiffness)| *stiffness < 0.0 && !held[*i as usize]).copied();
        let new = pressing.iter().enumerate().filter(|(_, k)| **k > 0.0).map(|(i, k)| (i as u32, *k));
        dispatch!(*level, simd => patch.set(simd, factor, right, gone.chain(new)));
    }
}
