//! The preconditioner of one body: its stiffness at rest with the masses of a substep, factorised
//! once and packed.

use super::tiles::{ChainRoom, Tiles};
use crate::Body;
use crate::assembly::{Stiffness, blocks, shape_gradients, tangent};
use crate::lanes::Row;
use fearless_simd::{Level, Simd};
use glam::{DMat3, Vec3A};
use std::ops::Range;
use trocar_sparse::Cholesky;

/// Stiffness that holds a node where a tool carries it, over the node's own.
const HOLDING_FACTOR: f32 = 1e4;

/// The factor of a body's matrix over its free nodes.
pub(super) struct Factor {
    /// Free nodes of the body (original numbers) in the order of elimination.
    pub order: Vec<u32>,
    /// Place of each free node in that order.
    rank: Vec<u32>,
    /// Stiffness at rest, without masses.
    rest: Stiffness,
    /// 1 / sqrt of the diagonal, three a node: the matrix that is factorised has a diagonal of 1.
    pub scale: Vec<f32>,
    /// Masses over h^2, which are added to the diagonal (N/m), three a node alike.
    added: Vec<f32>,
    /// Stiffness by which tools hold nodes or supports carry them (N/m).
    pub holding: Vec<f32>,
    /// 1 over the diagonal without `holding` (m/N), by node; 0 where tools hold one.
    pub compliance: Vec<Row>,
    cholesky: Cholesky<f32>,
    tiles: Tiles,
}

impl Factor {
    /// Orders, assembles and analyses for substeps of `h` (s), without pinned nodes. None if no
    /// node is free.
    pub fn new(body: &Body, h: f64) -> Option<Self> {
        let mesh = &body.rest;
        let mut rest = Stiffness::new(&mesh.tets, &body.pinned);
        if rest.free().is_empty() {
            return None;
        }
        let psi = body.material.hyperelastic();
        let at_rest = tangent(psi.as_ref(), DMat3::IDENTITY);
        for (t, tet) in mesh.tets.iter().enumerate() {
            let blocks = blocks(&at_rest, &shape_gradients(mesh, t));
            for a in 0..4 {
                for b in 0..4 {
                    rest.add(tet[a] as usize, tet[b] as usize, blocks[a][b] * body.volumes[t]);
                }
            }
        }
        add_dashpots(body, h, &mut rest);
        let cholesky = Cholesky::new(rest.matrix());
        let mut rank = vec![0; rest.free().len()];
        cholesky.order().iter().enumerate().for_each(|(k, i)| rank[*i as usize] = k as u32);
        Some(Self {
            scale: vec![0.0; 3 * rank.len()],
            added: vec![0.0; rank.len()],
            holding: vec![0.0; rank.len()],
            compliance: vec![[0.0; 4]; rank.len()],
            order: cholesky.order().iter().map(|i| rest.free()[*i as usize] as u32).collect(),
            rank,
            rest,
            cholesky,
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
    pub fn factorise(&mut self, level: Level, held: &[bool], supports: &[f32]) -> bool {
        let Self { rank, rest, scale, added, holding, compliance, cholesky, .. } = self;
        for (i, rank) in rank.iter().enumerate() {
            let node = *rank as usize;
            let own = rest.matrix().diagonal(i);
            let first = own.x_axis.x as f32 + added[node];
            holding[node] = if held[node] { HOLDING_FACTOR * first } else { supports[node] };
            for c in 0..3 {
                let diagonal = own.col(c)[c] as f32 + added[node];
                scale[3 * node + c] = 1.0 / (diagonal + holding[node]).sqrt();
                compliance[node][c] = if held[node] { 0.0 } else { 1.0 / diagonal };
            }
        }
        let scaled = rest.matrix().blocks().map(|(row, column, block)| {
            let [rows, columns] = [row, column].map(|i| 3 * rank[i as usize] as usize);
            let number = |r: usize, c: usize| match row == column && r == c {
                true => 1.0,
                false => block.col(c)[r] as f32 * scale[rows + r] * scale[columns + c],
            };
            [0, 1, 2].map(|c| [0, 1, 2].map(|r| number(r, c)))
        });
        let done = cholesky.factorise(level, scaled);
        if done {
            self.pack(level);
        }
        done
    }

    fn pack(&mut self, level: Level) {
        let panels: Vec<_> = self.cholesky.panels().collect();
        self.tiles.pack(level, &panels);
        self.tiles.end();
    }

    /// Adds the product of the matrix, without what holds or carries nodes, and `x`; nodes in the
    /// order of elimination.
    pub fn multiply(&self, x: impl Fn(usize) -> Vec3A, product: &mut [Vec3A]) {
        let Self { rank, rest, added, .. } = self;
        for (row, column, block) in rest.matrix().blocks() {
            let [i, j] = [row, column].map(|k| rank[k as usize] as usize);
            product[i] += (*block * x(j).as_dvec3()).as_vec3a();
            if i == j {
                product[i] += added[i] * x(i);
            } else {
                product[j] += (block.transpose() * x(i).as_dvec3()).as_vec3a();
            }
        }
    }

    /// The first half of a solve in place: three numbers a node in the order of elimination. `x` is
    /// at least 16 numbers longer, finite. The factor is rounded to 8 bits unless
    /// the solve is `precise`.
    #[inline(always)]
    pub fn forward<S: Simd>(&mut self, simd: S, x: &mut [f32], precise: bool) {
        self.scale(x);
        self.tiles.forward(simd, x, precise);
    }

    /// The second half.
    #[inline(always)]
    pub fn backward<S: Simd>(&mut self, simd: S, x: &mut [f32], precise: bool) {
        self.tiles.backward(simd, x, precise);
        self.scale(x);
    }

    /// The first half for an `x` that is 1 at `number` and else 0, precisely: the numbers of the
    /// chain of supernodes from that of `number` up to the root, and their ranges.
    #[inline(always)]
    pub fn forward_chain<S: Simd>(
        &self,
        simd: S,
        number: usize,
        room: &mut ChainRoom,
        column: &mut Vec<f32>,
        ranges: &mut Vec<Range<usize>>,
    ) {
        self.tiles.forward_chain(simd, (number, self.scale[number]), room, column, ranges);
    }

    /// Room for it.
    pub fn chain_room(&self) -> ChainRoom {
        self.tiles.chain_room(self.scale.len())
    }

    #[inline(always)]
    fn scale(&self, x: &mut [f32]) {
        x.iter_mut().zip(&self.scale).for_each(|(x, s)| *x *= s);
    }
}

/// Adds the resistance of the dashpots within a substep to the stiffness.
fn add_dashpots(body: &Body, h: f64, stiffness: &mut Stiffness) {
    let node_of = body.nodes_of_vertices();
    for (i, node) in node_of.iter().enumerate() {
        for edge in body.edges_of(i).iter().filter(|edge| edge.damping > 0.0) {
            let to = node_of[edge.to as usize];
            let n = (body.rest.vertices[to] - body.rest.vertices[*node]).normalize_or_zero();
            let block = DMat3::from_cols(n * n.x, n * n.y, n * n.z) * (f64::from(edge.damping) / h);
            // Every edge appears at both its ends.
            stiffness.add(*node, *node, block);
            stiffness.add(*node, to, -block);
        }
    }
}
