//! The shared Cholesky factor, and solves with a right side in each lane.
//!
//! Every number of the factor is read once for all lanes of a register. It lies in tiles of 6 x 6
//! numbers, two nodes by two nodes, column by column. The triangle on a supernode's diagonal is
//! kept as its inverse, so that no number waits for a division.

use crate::registers::{Block, Reg, load, splat, store};
use fearless_simd::Simd;
use std::ops::Range;
use trocar_sparse::{Cholesky, Level};

/// Rows and columns of a tile.
const TILE: usize = 6;

/// One supernode.
#[derive(Clone, Debug)]
struct Supernode {
    /// Its nodes.
    nodes: Range<usize>,
    /// Pairs of the nodes below, in `Factor::rows`.
    rows: Range<usize>,
    /// First tile: the inverse triangle by rows of tiles, then what is below by rows of tiles.
    tiles: usize,
}

/// A factor.
#[derive(Clone, Debug)]
pub(super) struct Factor {
    supernodes: Vec<Supernode>,
    /// Nodes below, in pairs; the number of nodes where the second of a pair is none.
    rows: Vec<[u32; 2]>,
    tiles: Vec<[f32; TILE * TILE]>,
}

/// A vector over the nodes in each lane. Solves need one more node, which they set to 0.
pub(super) type Field = Vec<[Block<f32>; 3]>;

impl Factor {
    /// Packs a factor of `count` nodes.
    pub fn new(level: Level, cholesky: &Cholesky<f64>, count: usize) -> Self {
        let mut factor = Self { supernodes: Vec::new(), rows: Vec::new(), tiles: Vec::new() };
        let mut inverse = Vec::new();
        for panel in cholesky.panels() {
            let width = panel.width();
            let (begin, tiles) = (factor.rows.len(), factor.tiles.len());
            let below = panel.rows();
            factor.rows.extend(below.chunks(2).map(|pair| [pair[0], *pair.get(1).unwrap_or(&(count as u32))]));
            panel.inverse(level, &mut inverse);
            let pairs = width.div_ceil(TILE);
            for i in 0..pairs {
                for j in 0..=i {
                    factor.push(|r, c| {
                        let (r, c) = (TILE * i + r, TILE * j + c);
                        if r < width && c <= r { inverse[width * c + r] } else { 0.0 }
                    });
                }
            }
            for i in 0..below.len().div_ceil(2) {
                for j in 0..pairs {
                    factor.push(|r, c| {
                        let (r, c) = (TILE * i + r, TILE * j + c);
                        if r < 3 * below.len() && c < width { panel.below(r, c) } else { 0.0 }
                    });
                }
            }
            let first = panel.first() / 3;
            let nodes = first..first + width / 3;
            factor.supernodes.push(Supernode { nodes, rows: begin..factor.rows.len(), tiles });
        }
        factor
    }

    fn push(&mut self, at: impl Fn(usize, usize) -> f64) {
        self.tiles.push(std::array::from_fn(|k| at(k % TILE, k / TILE) as f32));
    }

    /// Bytes of its numbers.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.tiles[..]) + size_of_val(&self.rows[..])
    }

    /// Solves in place in the lanes of a part.
    #[inline(always)]
    pub fn solve<S: Simd>(&self, simd: S, x: &mut [[Block<f32>; 3]], part: usize) {
        let last = x.len() - 1;
        // What fills odd rows and columns up is multiplied by 0, and must be a number.
        set(simd, &mut x[last], part);
        for supernode in &self.supernodes {
            self.forward(simd, supernode, x, part);
        }
        for supernode in self.supernodes.iter().rev() {
            self.backward(simd, supernode, x, part);
        }
    }

    /// x = inverse x on the diagonal, and the rows below lose their product with it.
    #[inline(always)]
    fn forward<S: Simd>(&self, simd: S, s: &Supernode, x: &mut [[Block<f32>; 3]], part: usize) {
        let (first, count) = (s.nodes.start, s.nodes.len());
        let pairs = count.div_ceil(2);
        // From the last row upwards, so that a row reads what is not yet written.
        for i in (0..pairs).rev() {
            let mut sums = [splat(simd, 0.0); TILE];
            let at = s.tiles + i * (i + 1) / 2;
            for (j, tile) in self.tiles[at..=at + i].iter().enumerate() {
                multiply(simd, tile, &x[first + 2 * j..], part, &mut sums);
            }
            put(simd, sums, &mut x[first + 2 * i..], part, 2 * i + 1 < count);
        }
        let mut at = s.tiles + pairs * (pairs + 1) / 2;
        for rows in &self.rows[s.rows.clone()] {
            let mut sums = [splat(simd, 0.0); TILE];
            for (j, tile) in self.tiles[at..at + pairs].iter().enumerate() {
                multiply(simd, tile, &x[first + 2 * j..], part, &mut sums);
            }
            at += pairs;
            let [a, b] = *rows;
            subtract(simd, [sums[0], sums[1], sums[2]], &mut x[a as usize], part);
            subtract(simd, [sums[3], sums[4], sums[5]], &mut x[b as usize], part);
        }
    }

    /// x = inverse' (x - below' x_below).
    #[inline(always)]
    fn backward<S: Simd>(&self, simd: S, s: &Supernode, x: &mut [[Block<f32>; 3]], part: usize) {
        let (first, count) = (s.nodes.start, s.nodes.len());
        let pairs = count.div_ceil(2);
        let below = s.tiles + pairs * (pairs + 1) / 2;
        for j in 0..pairs {
            let mut sums = [splat(simd, 0.0); TILE];
            let mut at = below + j;
            for rows in &self.rows[s.rows.clone()] {
                let [a, b] = *rows;
                multiply_transposed(simd, &self.tiles[at], &x[a as usize], &x[b as usize], part, &mut sums);
                at += pairs;
            }
            subtract(simd, [sums[0], sums[1], sums[2]], &mut x[first + 2 * j], part);
            if 2 * j + 1 < count {
                subtract(simd, [sums[3], sums[4], sums[5]], &mut x[first + 2 * j + 1], part);
            }
        }
        for j in 0..pairs {
            let mut sums = [splat(simd, 0.0); TILE];
            for i in j..pairs {
                let tile = &self.tiles[s.tiles + i * (i + 1) / 2 + j];
                multiply_transposed(simd, tile, &x[first + 2 * i], &x[first + 2 * i + 1], part, &mut sums);
            }
            put(simd, sums, &mut x[first + 2 * j..], part, 2 * j + 1 < count);
        }
    }
}

#[inline(always)]
fn set<S: Simd>(simd: S, to: &mut [Block<f32>; 3], part: usize) {
    for k in 0..3 {
        store::<S>(splat(simd, 0.0), &mut to[k], part);
    }
}

/// sums += tile x, x being two nodes.
#[inline(always)]
fn multiply<S: Simd>(
    simd: S,
    tile: &[f32; TILE * TILE],
    x: &[[Block<f32>; 3]],
    part: usize,
    sums: &mut [Reg<S>; TILE],
) {
    let x = &x[..2];
    for c in 0..TILE {
        let y = load(simd, &x[c / 3][c % 3], part);
        for r in 0..TILE {
            sums[r] += y * tile[TILE * c + r];
        }
    }
}

/// sums += tile' x, x being two nodes.
#[inline(always)]
fn multiply_transposed<S: Simd>(
    simd: S,
    tile: &[f32; TILE * TILE],
    a: &[Block<f32>; 3],
    b: &[Block<f32>; 3],
    part: usize,
    sums: &mut [Reg<S>; TILE],
) {
    for r in 0..TILE {
        let y = load(simd, if r < 3 { &a[r] } else { &b[r - 3] }, part);
        for c in 0..TILE {
            sums[c] += y * tile[TILE * c + r];
        }
    }
}

#[inline(always)]
fn subtract<S: Simd>(simd: S, sums: [Reg<S>; 3], to: &mut [Block<f32>; 3], part: usize) {
    for k in 0..3 {
        store::<S>(load(simd, &to[k], part) - sums[k], &mut to[k], part);
    }
}

/// Writes two nodes, or one.
#[inline(always)]
fn put<S: Simd>(_simd: S, sums: [Reg<S>; TILE], to: &mut [[Block<f32>; 3]], part: usize, both: bool) {
    for k in 0..3 {
        store::<S>(sums[k], &mut to[0][k], part);
    }
    if both {
        for k in 0..3 {
            store::<S>(sums[3 + k], &mut to[1][k], part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Isa;
    use crate::registers::{BLOCK, parts};
    use fearless_simd::dispatch;
    use glam::{DMat3, DVec3};
    use trocar_sparse::BlockMatrix;
    use trocar_testing::blocks::{block, noise};

    #[inline(always)]
    fn all<S: Simd>(simd: S, factor: &Factor, x: &mut Field) {
        for part in 0..parts::<S>() {
            factor.solve(simd, x, part);
        }
    }

    /// Every lane is solved as by the factor in double precision, and by every instruction set with
    /// the same bits. Numbers that are none stay in their lane.
    #[test]
    fn lanes_are_solved() {
        let mesh = block([6, 5, 4], 1.0);
        let count = mesh.vertices.len();
        let pairs = mesh.tets.iter().flat_map(|t| (0..4).flat_map(move |a| (0..a).map(move |b| (t[a], t[b]))));
        let mut matrix = BlockMatrix::new(count, pairs);
        let pattern: Vec<(u32, u32)> = matrix.blocks().map(|(i, j, _)| (i, j)).collect();
        for (k, (i, j)) in pattern.into_iter().enumerate() {
            let number = |n: usize| noise((9 * k + n) as u64) - 0.5;
            let off = DMat3::from_cols_array(&[0, 1, 2, 3, 4, 5, 6, 7, 8].map(number));
            matrix.add(i, j, if i == j { DMat3::from_diagonal(DVec3::splat(30.0)) } else { off });
        }
        let mut cholesky = Cholesky::<f64>::new(&matrix);
        let level = Isa::detect().level();
        assert!(cholesky.factorise(level, matrix.blocks().map(|(_, _, b)| b.to_cols_array_2d())));
        let factor = Factor::new(level, &cholesky, count);
        let order = cholesky.order();
        let right = |lane: usize, place: usize, k: usize| noise((lane * 3 * count + 3 * place + k) as u64) - 0.5;
        let mut first: Option<Field> = None;
        for isa in Isa::ALL {
            let mut x: Field = vec![[Block([f32::NAN; BLOCK]); 3]; count + 1];
            for (place, x) in x[..count].iter_mut().enumerate() {
                for k in 0..3 {
                    x[k] = Block(std::array::from_fn(|lane| right(lane, place, k) as f32));
                    x[k].0[7] = f32::NAN;
                }
            }
            dispatch!(isa.level(), simd => all(simd, &factor, &mut x));
            for lane in (0..BLOCK).filter(|lane| *lane != 7) {
                let mut expected = vec![0.0; 3 * count];
                for (place, node) in order.iter().enumerate() {
                    (0..3).for_each(|k| expected[3 * *node as usize + k] = right(lane, place, k));
                }
                cholesky.solve(level, &mut expected);
                for (place, node) in order.iter().enumerate() {
                    for k in 0..3 {
                        let off = f64::from(x[place][k].0[lane]) - expected[3 * *node as usize + k];
                        assert!(off.abs() < 1e-6, "{}, lane {lane}, place {place}: {off}", isa.name());
                    }
                }
            }
            let bits =
                |x: &Field| -> Vec<u32> { x.as_flattened().iter().flat_map(|b| b.0).map(f32::to_bits).collect() };
            let same = first.as_ref().is_none_or(|first| {
                bits(first).iter().zip(bits(&x)).all(|(a, b)| *a == b || f32::from_bits(*a).is_nan())
            });
            assert!(same, "{}", isa.name());
            first = Some(x);
        }
    }
}
