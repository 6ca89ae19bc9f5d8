//! The preconditioner of one body: its stiffness at rest with the masses of a substep, factorised once and packed.

use super::dissection::{Graph, dissect};
use super::tiles::Tiles;
use crate::Body;
use crate::builder::shape_gradients;
use crate::oracle::element::{blocks, tangent};
use crate::stiffness::Stiffness;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::perm::PermRef;
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

/// Neighbouring supernodes of so many columns together are merged while the share of zeros stays below: a tile is 16 x 16.
const RELAX: [(usize, f64); 3] = [(24, 0.6), (48, 0.25), (usize::MAX, 0.05)];

/// Stiffness that holds a node where a tool carries it, over its own.
const HOLDING: f32 = 1e4;

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
    /// What is added to the diagonal [N/m], three a node alike: masses over h^2.
    added: Vec<f32>,
    /// Stiffness by which tools hold nodes or supports carry them [N/m].
    pub holding: Vec<f32>,
    symbolic: SymbolicCholesky<usize>,
    numbers: Vec<f32>,
    memory: MemBuffer,
    tiles: Tiles,
}

impl Factor {
    /// Orders, assembles and analyses for substeps of `h` [s]; pinned nodes have no part in it. None if memory is short or no node is free.
    pub fn new(body: &Body, h: f64) -> Option<Self> {
        let mesh = &body.rest;
        let free: Vec<usize> = (0..body.len()).filter(|i| !body.pinned[*i]).collect();
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
            dissect(&Graph::new(&neighbours), &positions).order.iter().map(|k| free[*k as usize] as u32).collect();
        // Nodes numbered in the order of elimination, pinned ones behind.
        let mut rank = vec![u32::MAX; body.len()];
        order.iter().enumerate().for_each(|(k, i)| rank[*i as usize] = k as u32);
        let mut next = order.len() as u32;
        for r in rank.iter_mut().filter(|r| **r == u32::MAX) {
            *r = next;
            next += 1;
        }
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
        // The order is in the numbering already; faer takes a lower triangle with a permutation only.
        let identity: Vec<usize> = (0..3 * order.len()).collect();
        let as_it_is = SymmetricOrdering::Custom(PermRef::new_checked(&identity, &identity, identity.len()));
        let symbolic = factorize_symbolic_cholesky(rest.pattern(), Side::Lower, as_it_is, parameters).ok()?;
        let request = symbolic.factorize_numeric_llt_scratch::<f32>(Par::Seq, Default::default());
        let memory = MemBuffer::try_new(request).ok()?;
        Some(Self {
            values: vec![0.0; rest.values().len()],
            scale: vec![0.0; 3 * order.len()],
            added: vec![0.0; order.len()],
            holding: vec![0.0; order.len()],
            numbers: vec![0.0; symbolic.len_val()],
            order,
            rest,
            symbolic,
            memory,
            tiles: Tiles::new(),
        })
    }

    /// Sets the masses [kg] and the substep [s].
    pub fn set_step(&mut self, masses: &[f32], h: f64) {
        for (added, mass) in self.added.iter_mut().zip(masses) {
            *added = (f64::from(*mass) / (h * h)) as f32;
        }
    }

    /// Factorises with the `held` nodes held by a large stiffness and the others by `supports` [N/m]. False if the matrix is not positive definite.
    pub fn factorise(&mut self, held: &[bool], supports: &[f32]) -> bool {
        let pattern = self.rest.pattern();
        let columns = pattern.col_ptr();
        for (node, holding) in self.holding.iter_mut().enumerate() {
            let own = self.rest.values()[columns[3 * node]] as f32 + self.added[node];
            *holding = if held[node] { HOLDING * own } else { supports[node] };
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
            let mut inverse = Mat::<f32>::zeros(width, width);
            invert_lower_triangular(inverse.as_mut(), numbers.subrows(0, width), Par::Seq);
            let rows = pattern.iter().step_by(3).map(|row| (*row / 3) as u32);
            self.tiles.push(first, width, rows, |r, c| inverse[(r, c)], |r, c| numbers[(width + r, c)]);
        }
        true
    }

    /// Solves for `x` in place: three numbers a node in the order of elimination. `x` is at least 16 numbers longer, finite.
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

    /// Bytes of the packed factor.
    pub fn bytes(&self) -> usize {
        self.tiles.bytes()
    }
}

/// Adds what the dashpots resist within a substep to the stiffness, nodes numbered by `rank`.
fn add_dashpots(body: &Body, rank: &[u32], h: f64, stiffness: &mut Stiffness) {
    let mut node_of = vec![0; body.len()];
    body.internal.iter().enumerate().for_each(|(node, i)| node_of[*i as usize] = node);
    for (i, node) in node_of.iter().enumerate() {
        for edge in body.edges_of(i).iter().filter(|edge| edge.damping > 0.0) {
            let to = node_of[edge.to as usize];
            let n = (body.rest.vertices[to] - body.rest.vertices[*node]).normalize_or_zero();
            let block = DMat3::from_cols(n * n.x, n * n.y, n * n.z) * (f64::from(edge.damping) / h);
            // Every edge is met from both its ends.
            let (i, j) = (rank[*node] as usize, rank[to] as usize);
            stiffness.add(i, i, block);
            stiffness.add(i, j, -block);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::*;
    use fearless_simd::{Level, dispatch};
    use trocar_geometry::TetMesh;

    fn components(mesh: &TetMesh) -> Vec<TetMesh> {
        let mut label: Vec<usize> = (0..mesh.vertices.len()).collect();
        fn find(l: &mut Vec<usize>, mut i: usize) -> usize {
            while l[i] != i {
                l[i] = l[l[i]];
                i = l[i];
            }
            i
        }
        for t in &mesh.tets {
            for k in 1..4 {
                let (a, b) = (find(&mut label, t[0] as usize), find(&mut label, t[k] as usize));
                label[a.max(b)] = a.min(b);
            }
        }
        let mut roots: Vec<usize> = (0..label.len()).map(|i| find(&mut label, i)).collect();
        let all = roots.clone();
        roots.sort_unstable();
        roots.dedup();
        roots
            .iter()
            .map(|r| {
                let nodes: Vec<usize> = (0..all.len()).filter(|i| all[*i] == *r).collect();
                let mut number = vec![0u32; all.len()];
                nodes.iter().enumerate().for_each(|(k, i)| number[*i] = k as u32);
                TetMesh {
                    vertices: nodes.iter().map(|i| mesh.vertices[*i]).collect(),
                    tets: mesh
                        .tets
                        .iter()
                        .filter(|t| all[t[0] as usize] == *r)
                        .map(|t| t.map(|i| number[i as usize]))
                        .collect(),
                }
            })
            .collect()
    }

    #[test]
    #[ignore]
    fn dev_solve_speed() {
        let mesh = trocar_geometry::io::read_msh(std::path::Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../../shared/peers/meshes/specimen_a.msh"
        )))
        .unwrap();
        let mut builder = ModelBuilder::new();
        for m in components(&mesh) {
            let pinned = pins::lowest_band(&m.vertices, glam::DVec3::Z, 0.42);
            let material = Material {
                model: ConstitutiveModel::StableNeoHookean,
                young_modulus: 12e3,
                poisson_ratio: 0.45,
                density: 1200.0,
                viscosity: 0.0,
            };
            builder.body(BodyDescription { name: "x".into(), mesh: &m, material, pinned, supports: vec![] }).unwrap();
        }
        let model = builder.build().unwrap();
        let (mut total, mut bytes) = (0.0, 0);
        for body in &model.bodies {
            let t0 = std::time::Instant::now();
            let mut f = Factor::new(body, 1.0 / 120.0).unwrap();
            let t1 = std::time::Instant::now();
            let h = 1.0 / 120.0f64;
            let added: Vec<f32> = f.order.iter().map(|i| (body.mass(*i as usize) / h / h) as f32).collect();
            let held = vec![false; f.order.len()];
            f.added.copy_from_slice(&added);
            assert!(f.factorise(&held, &vec![0.0; held.len()]));
            let t2 = std::time::Instant::now();
            let n = 3 * f.order.len();
            let mut v = vec![0.0f32; n + 16];
            let truth: Vec<f64> = (0..n).map(|k| ((k * 7919 % 1000) as f64 - 500.0) * 1e-6).collect();
            // A x
            let pattern = f.rest.pattern();
            let mut b = vec![0.0f64; n];
            for c in 0..n {
                for k in pattern.col_ptr()[c]..pattern.col_ptr()[c + 1] {
                    let r = pattern.row_idx()[k];
                    let a = f.rest.values()[k] + if r == c { added[c / 3] as f64 } else { 0.0 };
                    b[r] += a * truth[c];
                    if r != c {
                        b[c] += a * truth[r];
                    }
                }
            }
            for k in 0..n {
                v[k] = b[k] as f32;
            }
            let level = Level::new();
            dispatch!(level, simd => f.solve(simd, &mut v));
            let (e, s): (f64, f64) =
                (0..n).fold((0.0, 0.0), |(e, s), k| (e + (v[k] as f64 - truth[k]).powi(2), s + truth[k].powi(2)));
            let mut best = f64::INFINITY;
            for _ in 0..200 {
                let t = std::time::Instant::now();
                dispatch!(level, simd => f.solve(simd, &mut v));
                best = best.min(t.elapsed().as_secs_f64());
            }
            total += best;
            bytes += f.bytes();
            println!(
                "free {} tets {} new {:.1} ms factor {:.1} ms solve {:.3} ms bytes {:.2} MB error {:.2e} supernodes {} nnz {:.2}M",
                f.order.len(),
                body.tets.len(),
                (t1 - t0).as_secs_f64() * 1e3,
                (t2 - t1).as_secs_f64() * 1e3,
                best * 1e3,
                f.bytes() as f64 / 1e6,
                (e / s).sqrt(),
                f.tiles.supernodes_len(),
                f.numbers.len() as f64 / 1e6
            );
        }
        println!("total solve {:.3} ms, {:.2} MB", total * 1e3, bytes as f64 / 1e6);
    }
}
