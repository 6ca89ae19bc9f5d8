//! The preconditioner of one body: its stiffness at rest with the masses of a substep, factorised
//! once and packed.

use super::dissection::{Graph, dissect};
use super::tiles::Tiles;
use crate::Body;
use crate::assembly::{Stiffness, blocks, shape_gradients, tangent};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::perm::PermRef;
use faer::reborrow::ReborrowMut;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::SymbolicSupernodalParams;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::{Mat, Par, Side};
use fearless_simd::Simd;
use glam::DMat3;

/// Neighbouring supernodes of so many columns together are merged while the share of zeros stays
/// below this: a tile is 16 x 16.
const RELAX: [(usize, f64); 3] = [(24, 0.6), (48, 0.25), (usize::MAX, 0.05)];

/// Stiffness that holds a node where a tool carries it, over the node's own.
const HOLDING_FACTOR: f32 = 1e4;

/// The factor of a body's matrix over its free nodes.
pub(super) struct Factor {
    /// Free nodes of the body (original numbers) in the order of elimination.
    pub order: Vec<u32>,
    /// Stiffness at rest, without masses.
    rest: Stiffness,
    /// The matrix that is factorised, scaled to a diagonal of 1.
    values: Vec<f32>,
    /// 1 / sqrt of the diagonal, three a node.
    pub scale: Vec<f32>,
    /// Masses over h^2, which are added to the diagonal (N/m), three a node alike.
    added: Vec<f32>,
    /// Stiffness by which tools hold nodes or supports carry them (N/m).
    pub holding: Vec<f32>,
    symbolic: SymbolicCholesky<usize>,
    numbers: Vec<f32>,
    memory: MemBuffer,
    /// Room for the inverse of the widest supernode's triangle.
    inverse: Mat<f32>,
    tiles: Tiles,
}

impl Factor {
    /// Orders, assembles and analyses for substeps of `h` (s), without pinned nodes. None if memory
    /// is short or no node is free.
    pub fn new(body: &Body, h: f64) -> Option<Self> {
        let mesh = &body.rest;
        let free: Vec<usize> = (0..body.len()).filter(|i| !body.pinned[*i]).collect();
        if free.is_empty() {
            return None;
        }
        let mut number = vec![u32::MAX; body.len()];
        for (k, i) in free.iter().enumerate() {
            number[*i] = k as u32;
        }
        let mut neighbours = vec![Vec::new(); free.len()];
        for [a, b] in mesh.edges() {
            let (a, b) = (number[a as usize], number[b as usize]);
            if a != u32::MAX && b != u32::MAX {
                neighbours[a as usize].push(b);
                neighbours[b as usize].push(a);
            }
        }
        let positions: Vec<glam::DVec3> = free.iter().map(|i| mesh.vertices[*i]).collect();
        let order: Vec<u32> =
            dissect(&Graph::new(&neighbours), &positions).iter().map(|k| free[*k as usize] as u32).collect();
        // Nodes numbered in the order of elimination, pinned ones behind.
        let mut rank = vec![u32::MAX; body.len()];
        order.iter().enumerate().for_each(|(k, i)| rank[*i as usize] = k as u32);
        let behind = rank.iter_mut().filter(|r| **r == u32::MAX);
        behind.zip(order.len() as u32..).for_each(|(r, next)| *r = next);
        let tets: Vec<[u32; 4]> = mesh.tets.iter().map(|t| t.map(|i| rank[i as usize])).collect();
        let fixed: Vec<bool> = (0..body.len()).map(|k| k >= order.len()).collect();
        let mut rest = Stiffness::new(&tets, &fixed);
        let psi = body.material.hyperelastic();
        let at_rest = tangent(psi.as_ref(), DMat3::IDENTITY);
        for (t, tet) in tets.iter().enumerate() {
            let blocks = blocks(&at_rest, &shape_gradients(mesh, t));
            for a in 0..4 {
                for b in 0..4 {
                    rest.add(tet[a] as usize, tet[b] as usize, blocks[a][b] * body.volumes[t]);
                }
            }
        }
        add_dashpots(body, &rank, h, &mut rest);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            supernodal_params: SymbolicSupernodalParams { relax: Some(&RELAX) },
            ..Default::default()
        };
        // The numbering is the order already; faer takes a lower triangle with a permutation only.
        let identity: Vec<usize> = (0..3 * order.len()).collect();
        let natural_order = SymmetricOrdering::Custom(PermRef::new_checked(&identity, &identity, identity.len()));
        let symbolic = factorize_symbolic_cholesky(rest.pattern(), Side::Lower, natural_order, parameters).ok()?;
        let request = symbolic.factorize_numeric_llt_scratch::<f32>(Par::Seq, Default::default());
        let memory = MemBuffer::try_new(request).ok()?;
        let SymbolicCholeskyRaw::Supernodal(supernodes) = symbolic.raw() else { return None };
        let ends = supernodes.supernode_begin().iter().zip(supernodes.supernode_end());
        let widest = ends.map(|(begin, end)| end - begin).max().unwrap_or(0);
        Some(Self {
            values: vec![0.0; rest.values().len()],
            scale: vec![0.0; 3 * order.len()],
            added: vec![0.0; order.len()],
            holding: vec![0.0; order.len()],
            numbers: vec![0.0; symbolic.len_val()],
            order,
            rest,
            symbolic,
            inverse: Mat::zeros(widest, widest),
            memory,
            tiles: Tiles::new(),
        })
    }

    /// Sets the masses (kg) and the substep (s).
    pub fn set_step(&mut self, masses: &[f32], h: f64) {
        for (added, mass) in self.added.iter_mut().zip(masses) {
            *added = (f64::from(*mass) / (h * h)) as f32;
        }
    }

    /// Factorises with the `held` nodes held by a large stiffness and the others by `supports`
    /// (N/m). False if the matrix is not positive definite.
    pub fn factorise(&mut self, held: &[bool], supports: &[f32]) -> bool {
        let pattern = self.rest.pattern();
        let columns = pattern.col_ptr();
        for (node, holding) in self.holding.iter_mut().enumerate() {
            let own = self.rest.values()[columns[3 * node]] as f32 + self.added[node];
            *holding = if held[node] { HOLDING_FACTOR * own } else { supports[node] };
        }
        for (column, first) in columns[..columns.len() - 1].iter().enumerate() {
            let diagonal = self.rest.values()[*first] as f32 + self.added[column / 3] + self.holding[column / 3];
            self.scale[column] = 1.0 / diagonal.sqrt();
        }
        for column in 0..columns.len() - 1 {
            for k in columns[column]..columns[column + 1] {
                let row = pattern.row_idx()[k];
                self.values[k] = if row == column {
                    1.0
                } else {
                    self.rest.values()[k] as f32 * self.scale[row] * self.scale[column]
                };
            }
        }
        let matrix = SparseColMatRef::new(pattern, self.values.as_slice());
        let stack = MemStack::new(&mut self.memory);
        let done = self.symbolic.factorize_numeric_llt(
            &mut self.numbers,
            matrix,
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            stack,
            Default::default(),
        );
        done.is_ok() && self.pack()
    }

    fn pack(&mut self) -> bool {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = self.symbolic.raw() else { return false };
        let factor = SupernodalLltRef::new(symbolic, &self.numbers);
        self.tiles.clear();
        for s in 0..symbolic.n_supernodes() {
            let node = factor.supernode(s);
            let (first, pattern, numbers) = (node.start(), node.pattern(), node.val());
            let width = numbers.ncols();
            if first % 3 != 0 || width % 3 != 0 || pattern.len() % 3 != 0 {
                return false;
            }
            let mut inverse = self.inverse.as_mut().submatrix_mut(0, 0, width, width);
            invert_lower_triangular(inverse.rb_mut(), numbers.subrows(0, width), Par::Seq);
            let rows = pattern.iter().step_by(3).map(|row| (*row / 3) as u32);
            self.tiles.push(first, width, rows, |r, c| inverse[(r, c)], |r, c| numbers[(width + r, c)]);
        }
        true
    }

    /// Solves for `x` in place: three numbers a node in the order of elimination. `x` is at least
    /// 16 numbers longer, finite.
    #[inline(always)]
    pub fn solve<S: Simd>(&mut self, simd: S, x: &mut [f32]) {
        for (x, s) in x.iter_mut().zip(&self.scale) {
            *x *= s;
        }
        self.tiles.solve(simd, x);
        for (x, s) in x.iter_mut().zip(&self.scale) {
            *x *= s;
        }
    }
}

/// Adds the resistance of the dashpots within a substep to the stiffness, nodes numbered by `rank`.
fn add_dashpots(body: &Body, rank: &[u32], h: f64, stiffness: &mut Stiffness) {
    let node_of = body.nodes_of_vertices();
    for (i, node) in node_of.iter().enumerate() {
        for edge in body.edges_of(i).iter().filter(|edge| edge.damping > 0.0) {
            let to = node_of[edge.to as usize];
            let n = (body.rest.vertices[to] - body.rest.vertices[*node]).normalize_or_zero();
            let block = DMat3::from_cols(n * n.x, n * n.y, n * n.z) * (f64::from(edge.damping) / h);
            // Every edge appears at both its ends.
            let (i, j) = (rank[*node] as usize, rank[to] as usize);
            stiffness.add(i, i, block);
            stiffness.add(i, j, -block);
        }
    }
}
