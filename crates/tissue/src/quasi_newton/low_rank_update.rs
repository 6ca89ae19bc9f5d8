//! Contacts that differ from those in the factor, and elements that are far stiffer than at rest,
//! as a low-rank update of the inverse.
//!
//! The factor contains the stiffness of the nodes that pressed when it was made. New, harder and
//! lost contacts differ from it by a stiffness on a few nodes: a matrix U K U' of low rank. With
//! A = L L' Woodbury's formula (Hager 1989, "Updating the inverse of a matrix") becomes
//! (A + U K U')^-1 = L'^-1 (1 - V (K^-1 + V'V)^-1 V') L^-1 with V = L^-1 U: a correction between
//! the two halves of a solve. The columns of V are short ([`HalfColumn`]). A node has three, which
//! are solved for once: the stiffness is the same in all directions, so they are kept in the
//! tissue's rest frame and stay valid however it turns.
//!
//! A stiffened element has one direction and one column, which is solved for in every substep.

use super::factor::Factor;
use super::half_column::HalfColumn;
use super::stiffened::{MAX_STIFFENED, Stiffened};
use fearless_simd::Simd;

/// Greatest number of nodes in the update.
const MAX_NODES: usize = 48;

/// Greatest number of directions in the update, and of columns.
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
    /// Nodes whose columns are known: the first three columns are those of the first.
    known: Vec<u32>,
    /// Elements that are stiffened, gradients in the rest frame.
    stiffened: Vec<Stiffened>,
    /// Columns: three of each place, then one of each stiffened element.
    columns: Vec<HalfColumn>,
    /// V'V of all columns.
    products: Vec<f64>,
    /// Whether the elements have changed since the matrix was made.
    stale: bool,
    /// K^-1 + V'V of the directions as L D L', by columns: what is below the diagonal of L, and D
    /// on it.
    matrix: Vec<f64>,
    shares: Vec<f64>,
    /// Whether the matrix is that of a sum that is positive definite.
    usable: bool,
}

impl LowRankUpdate {
    /// An empty one.
    pub fn new() -> Self {
        Self {
            nodes: Vec::with_capacity(MAX_NODES),
            next: Vec::with_capacity(MAX_NODES),
            places: Vec::with_capacity(MAX_NODES),
            known: Vec::with_capacity(MAX_NODES),
            stiffened: Vec::with_capacity(MAX_STIFFENED),
            columns: vec![HalfColumn::default(); MAX_DIRECTIONS],
            products: vec![0.0; MAX_DIRECTIONS * MAX_DIRECTIONS],
            stale: false,
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
        self.solve_nodes(simd, factor, scratch);
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
        for (e, element) in found.iter().enumerate() {
            let column = 3 * MAX_NODES + e;
            self.columns[column].solve(simd, factor, scratch, element.numbers());
            self.stiffened.push(*element);
            self.multiply(simd, column);
        }
        self.stale = true;
    }

    /// Solves for the columns of nodes that are not known.
    #[inline(always)]
    fn solve_nodes<S: Simd>(&mut self, simd: S, factor: &mut Factor, scratch: &mut [f32]) {
        self.places.clear();
        for k in 0..self.nodes.len() {
            let node = self.nodes[k].0;
            // Solves in a closure that is not inlined would be compiled without the instruction set
            // of `S`, and each of their operations would be a call.
            if let Some(place) = self.known.iter().position(|known| *known == node) {
                self.places.push(place);
                continue;
            }
            let unused = |known: &u32| self.nodes.iter().all(|(node, _)| node != known);
            let free = if self.known.len() < MAX_NODES { None } else { self.known.iter().position(unused) };
            let place = free.unwrap_or(self.known.len());
            if place < self.known.len() {
                self.known[place] = node;
            } else {
                self.known.push(node);
            }
            for c in 0..3 {
                let unit = std::iter::once((3 * node as usize + c, 1.0));
                self.columns[3 * place + c].solve(simd, factor, scratch, unit);
            }
            for c in 0..3 {
                self.multiply(simd, 3 * place + c);
            }
            self.places.push(place);
        }
    }

    /// Multiplies a column with all that are in use.
    #[inline(always)]
    fn multiply<S: Simd>(&mut self, simd: S, column: usize) {
        let of_elements = 3 * MAX_NODES..3 * MAX_NODES + self.stiffened.len();
        for other in (0..3 * self.known.len()).chain(of_elements) {
            let product = self.columns[column].product_with(simd, &self.columns[other]);
            self.products[column * MAX_DIRECTIONS + other] = product;
            self.products[other * MAX_DIRECTIONS + column] = product;
        }
    }

    /// Number of directions.
    fn directions(&self) -> usize {
        3 * self.nodes.len() + self.stiffened.len()
    }

    /// Stiffness of a direction.
    fn stiffness(&self, i: usize) -> f64 {
        f64::from(match i.checked_sub(3 * self.nodes.len()) {
            None => self.nodes[i / 3].1,
            Some(e) => self.stiffened[e].stiffness,
        })
    }

    /// Index of a direction's column.
    fn column(&self, i: usize) -> usize {
        match i.checked_sub(3 * self.nodes.len()) {
            None => 3 * self.places[i / 3] + i % 3,
            Some(e) => 3 * MAX_NODES + e,
        }
    }

    /// Builds the matrix of the directions and its L D L'. False if the sum is not positive
    /// definite.
    fn factorise(&mut self) -> bool {
        let n = self.directions();
        for j in 0..n {
            let products = MAX_DIRECTIONS * self.column(j);
            for i in j..n {
                self.matrix[j * n + i] = self.products[products + self.column(i)];
            }
            self.matrix[j * n + j] += 1.0 / self.stiffness(j);
        }
        for j in 0..n {
            let (before, column) = self.matrix.split_at_mut(j * n);
            let column = &mut column[j..n];
            for before in before.chunks_exact(n).enumerate().map(|(k, before)| &before[k..]) {
                // D first, then the numbers of L below it.
                let part = &before[before.len() - column.len()..];
                let share = before[0] * part[0];
                column.iter_mut().zip(part).for_each(|(sum, l)| *sum -= share * l);
            }
            // Removed contacts make the matrix negative there, added ones positive: it is
            // quasi-definite.
            let d = column[0];
            column[1..].iter_mut().for_each(|l| *l /= d);
            let signed = d * self.stiffness(j);
            if signed.is_nan() || signed <= 0.0 {
                return false;
            }
        }
        n > 0
    }

    /// Turns `y`, solved by half with the factor, into that of the sum.
    #[inline(always)]
    pub fn apply<S: Simd>(&mut self, simd: S, y: &mut [f32]) {
        if !self.usable {
            return;
        }
        let n = self.directions();
        for i in 0..n {
            self.shares[i] = self.columns[self.column(i)].product(simd, y);
        }
        let shares = &mut self.shares[..n];
        for (k, l) in self.matrix.chunks_exact(n).take(n).enumerate() {
            let (solved, below) = shares.split_at_mut(k + 1);
            below.iter_mut().zip(&l[k + 1..]).for_each(|(sum, l)| *sum -= solved[k] * l);
        }
        for (k, l) in self.matrix.chunks_exact(n).take(n).enumerate().rev() {
            let known: f64 = l[k + 1..].iter().zip(&shares[k + 1..]).map(|(l, share)| l * share).sum();
            shares[k] = shares[k] / l[k] - known;
        }
        for i in 0..n {
            self.columns[self.column(i)].subtract(self.shares[i] as f32, y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::LowRankUpdate;
    use crate::quasi_newton::factor::Factor;
    use crate::quasi_newton::stiffened::Stiffened;
    use crate::{BodyDescription, ConstitutiveModel, Isa, Material, ModelBuilder};
    use fearless_simd::dispatch;
    use trocar_testing::blocks::block;

    /// Nodes that press in the factor and now, softly or hard, a node that no longer does, and
    /// stiffened elements: a solve with the update is that with a factor of all that.
    #[test]
    fn an_updated_solve_is_that_of_the_sum() {
        // The tree of the larger one is cut into parts.
        for cells in [[4, 4, 6], [14, 14, 24]] {
            let mesh = block(cells, 2e-3);
            let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].z < 1e-3).collect();
            let material = Material {
                model: ConstitutiveModel::StableNeoHookean,
                young_modulus: 12e3,
                poisson_ratio: 0.45,
                density: 1200.0,
                viscosity: 0.0,
            };
            let mut builder = ModelBuilder::new();
            let body = BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] };
            builder.body(body).unwrap();
            let model = builder.build().unwrap();
            let level = Isa::detect().level();
            let factors = || {
                let mut factor = Factor::new(&model.bodies[0], 1e-2).unwrap();
                let masses = vec![1e-3; factor.order.len()];
                factor.set_step(&masses, 1e-2);
                factor
            };
            let (mut before, mut after) = (factors(), factors());
            let free = before.order.len();
            let held = vec![false; free];
            let stiffness = 400.0;
            // Nodes in the order of elimination: the first ones, and some that come last.
            let nodes = [1, free / 3, free / 2, free - 40, free - 2];
            let mut supports = vec![0.0; free];
            (supports[nodes[0]], supports[nodes[1]]) = (stiffness, stiffness);
            assert!(before.factorise(level, &held, &supports));
            supports[nodes[0]] = 0.0;
            supports[nodes[1]] = 25.0 * stiffness;
            nodes[2..].iter().for_each(|i| supports[*i] = stiffness);
            // A stiffened element of one node is a spring at it.
            let along = nodes[3];
            assert!(after.factorise(level, &held, &supports));
            let element = |c: usize| {
                let mut gradient = [[0.0; 3]; 4];
                gradient[0][c] = 1.0;
                Stiffened { nodes: [along as u32, 0, 0, 0], gradient, stiffness }
            };
            let differs = [
                (nodes[0] as u32, -stiffness),
                (nodes[1] as u32, 24.0 * stiffness),
                (nodes[2] as u32, stiffness),
                (nodes[4] as u32, stiffness),
            ];
            let right: Vec<f32> = (0..3 * free).map(|i| ((7 * i) % 11) as f32 - 5.0).collect();
            let [mut x, mut y, mut without] = [(); 3].map(|()| [&right[..], &[0.0; 16]].concat());
            let mut scratch = vec![0.0; x.len()];
            let mut update = LowRankUpdate::new();
            dispatch!(level, simd => {
                update.set_stiffened(simd, &mut before, &mut scratch, &[element(0), element(1), element(2)]);
                update.set(simd, &mut before, &mut scratch, differs.into_iter());
                before.forward(simd, &mut x, true);
                update.apply(simd, &mut x);
                before.backward(simd, &mut x, true);
                before.forward(simd, &mut without, true);
                before.backward(simd, &mut without, true);
                after.forward(simd, &mut y, true);
                after.backward(simd, &mut y, true);
            });
            let most = y.iter().fold(0.0f32, |most, y| most.max(y.abs()));
            let off = |x: &[f32]| x.iter().zip(&y).fold(0.0f32, |most, (x, y)| most.max((x - y).abs())) / most;
            let (error, change) = (off(&x), off(&without));
            assert!(error < 2e-3 && change > 10.0 * error, "{cells:?}: off by {error}, by {change} without the update");
        }
    }
}
