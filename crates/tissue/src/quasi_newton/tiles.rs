//! A Cholesky factor packed for speed, and the solve with it.
//!
//! A solve reads the whole factor twice and does one multiplication a number: it is bound by
//! memory. So the factor is kept in 16 bits a number, in tiles of 16 x 16 numbers with one scale
//! each, supernode by supernode. The triangle on a supernode's diagonal is kept as its inverse: a
//! solve consists of products with tiles and waits for no division.
//!
//! The backward half is the exact transpose of the forward half, tile by tile. So rounding the
//! factor to 16 bits leaves the preconditioner symmetric and positive definite.

use super::supernode::{Supernode, TILE_SIZE};
use super::tile_parts::{Part, Parts};
use super::tree::Tree;
use crate::threads::for_each;
use fearless_simd::{Level, Simd, SimdBase, SimdCvtFloat, dispatch, f32x16, i32x16};
use std::ops::Range;

/// Greatest number in 16 bits.
const MAX_INT16: f32 = 32767.0;

/// 16 x 16 numbers. A word has the numbers of two neighbouring columns: its low half is that of the
/// even column; the whole word, over 65536, is that of the odd one (the low half adds less than its
/// rounding, and is taken into account in it).
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Tile {
    words: [[i32; TILE_SIZE]; TILE_SIZE / 2],
}

/// The packed factor.
pub(super) struct Tiles {
    supernodes: Vec<Supernode>,
    /// The first of the three numbers of each node below the supernodes' diagonals.
    rows: Vec<u32>,
    /// The tree of supernodes.
    tree: Tree,
    parts: Parts,
    tiles: Vec<Tile>,
    scales: Vec<f32>,
    /// Room for the longest column of row tiles.
    buffer: Vec<f32>,
}

/// Tiles that cover `n` numbers.
fn covering(n: usize) -> usize {
    n.div_ceil(TILE_SIZE)
}

impl Tiles {
    pub fn new() -> Self {
        Self {
            supernodes: Vec::new(),
            rows: Vec::new(),
            tree: Tree::default(),
            parts: Parts::default(),
            tiles: Vec::new(),
            scales: Vec::new(),
            buffer: Vec::new(),
        }
    }

    /// Forgets all supernodes but keeps the memory.
    pub fn clear(&mut self) {
        self.supernodes.clear();
        self.rows.clear();
        self.tiles.clear();
        self.scales.clear();
    }

    /// Adds the next supernode: the inverse of its diagonal triangle, `inverse(row, column)`, and
    /// the numbers below, `below(row, column)`; `rows` are the nodes below, ascending.
    pub fn push(
        &mut self,
        level: Level,
        first: usize,
        width: usize,
        rows: impl Iterator<Item = u32>,
        inverse: impl Fn(usize, usize) -> f32,
        below: impl Fn(usize, usize) -> f32,
    ) {
        let begin = self.rows.len();
        self.rows.extend(rows.map(|node| 3 * node));
        let height = 3 * (self.rows.len() - begin);
        self.supernodes.push(Supernode { first, width, rows: begin..self.rows.len(), tiles: self.tiles.len() });
        let columns = covering(width);
        for j in 0..columns {
            for i in j..columns {
                self.pack(level, |r, c| {
                    let (r, c) = (TILE_SIZE * i + r, TILE_SIZE * j + c);
                    if r < width && c <= r { inverse(r, c) } else { 0.0 }
                });
            }
        }
        for j in 0..columns {
            for i in 0..covering(height) {
                self.pack(level, |r, c| {
                    let (r, c) = (TILE_SIZE * i + r, TILE_SIZE * j + c);
                    if r < height && c < width { below(r, c) } else { 0.0 }
                });
            }
        }
        self.buffer.resize(self.buffer.len().max(TILE_SIZE * (columns + covering(height)) + TILE_SIZE), 0.0);
    }

    /// Ends the factor after its last supernode.
    pub fn end(&mut self) {
        self.tree = Tree::new(&self.supernodes, &self.rows, self.tiles.len());
        self.parts = Parts::cut(&self.tree, &mut self.supernodes, &mut self.rows, self.buffer.len());
    }

    /// Ends the factor without cutting it.
    #[cfg(test)]
    pub fn end_whole(&mut self) {
        self.parts = Parts::whole(self.supernodes.len());
    }

    /// Parts that threads solve with at once; 0 if the factor is not cut.
    #[cfg(test)]
    pub fn parts(&self) -> usize {
        self.parts.list.len()
    }

    fn pack(&mut self, level: Level, at: impl Fn(usize, usize) -> f32) {
        let mut numbers = [[0.0f32; TILE_SIZE]; TILE_SIZE];
        let mut most = 0.0f32;
        for c in 0..TILE_SIZE {
            for r in 0..TILE_SIZE {
                numbers[c][r] = at(r, c);
                most = most.max(numbers[c][r].abs());
            }
        }
        let scale = if most > 0.0 { most / MAX_INT16 } else { 1.0 };
        let mut tile = Tile { words: [[0; TILE_SIZE]; TILE_SIZE / 2] };
        // With the CPU's instructions for rounding.
        dispatch!(level, _simd => {
            for (pair, words) in tile.words.iter_mut().enumerate() {
                for (r, word) in words.iter_mut().enumerate() {
                    let even = (numbers[2 * pair][r] / scale).round();
                    let odd = (numbers[2 * pair + 1][r] / scale - even / 65536.0).round().clamp(-MAX_INT16, MAX_INT16);
                    *word = (odd as i32) * 65536 + i32::from(even as i16);
                }
            }
        });
        self.tiles.push(tile);
        // Both halves come out 65536 times too large.
        self.scales.push(scale / 65536.0);
    }

    /// Solves L y = x in place: `x` is three numbers a node in the order of elimination, padded by
    /// at least 16.
    #[inline(always)]
    pub fn forward<S: Simd>(&mut self, simd: S, x: &mut [f32]) {
        let (mut buffer, mut parts) = (std::mem::take(&mut self.buffer), std::mem::take(&mut self.parts));
        let (whole, level) = (&*x, simd.level());
        for_each(&mut parts.list, |part| {
            part.begin(whole);
            let Part { supernodes, vector, buffer, .. } = part;
            // Another thread has to ask for its instruction set itself.
            dispatch!(level, simd => for s in &self.supernodes[supernodes.clone()] {
                self.eliminate(simd, s, vector, buffer);
            });
        });
        for part in &parts.list {
            part.take_from(&parts.numbers, x);
            part.end(x);
        }
        for s in &parts.above {
            self.eliminate(simd, &self.supernodes[*s], x, &mut buffer);
        }
        (self.buffer, self.parts) = (buffer, parts);
    }

    /// Solves L' x = y in place.
    #[inline(always)]
    pub fn backward<S: Simd>(&mut self, simd: S, x: &mut [f32]) {
        let (mut buffer, mut parts) = (std::mem::take(&mut self.buffer), std::mem::take(&mut self.parts));
        for s in parts.above.iter().rev() {
            self.substitute(simd, &self.supernodes[*s], x, &mut buffer);
        }
        let (whole, level) = (&*x, simd.level());
        for_each(&mut parts.list, |part| {
            part.read(&parts.numbers, whole);
            let Part { supernodes, vector, buffer, .. } = part;
            dispatch!(level, simd => for s in self.supernodes[supernodes.clone()].iter().rev() {
                self.substitute(simd, s, vector, buffer);
            });
        });
        for part in &parts.list {
            part.end(x);
        }
        (self.buffer, self.parts) = (buffer, parts);
    }

    /// Solves L y = x in place for an `x` that has numbers only in the chain of supernodes from
    /// that of `number` up to the root, and is 0 elsewhere. Writes the numbers of these supernodes
    /// to `ranges`.
    #[inline(always)]
    pub fn forward_chain<S: Simd>(&mut self, simd: S, number: usize, x: &mut [f32], ranges: &mut Vec<Range<usize>>) {
        let (mut buffer, mut parts) = (std::mem::take(&mut self.buffer), std::mem::take(&mut self.parts));
        ranges.clear();
        let mut next = Some(self.tree.supernode_of(number));
        if let Some(part) = parts.list.iter_mut().find(|part| part.numbers.contains(&number)) {
            part.begin(x);
            while let Some(s) = next.filter(|s| part.supernodes.contains(s)) {
                self.eliminate(simd, &self.supernodes[s], &mut part.vector, &mut part.buffer);
                ranges.push(self.tree.numbers(s));
                next = self.tree.parent(s);
            }
            part.take_from(&parts.numbers, x);
            part.end(x);
        }
        while let Some(s) = next {
            self.eliminate(simd, &self.supernodes[s], x, &mut buffer);
            ranges.push(self.tree.numbers(s));
            next = self.tree.parent(s);
        }
        (self.buffer, self.parts) = (buffer, parts);
    }

    /// y = inverse b, and the rows below lose their product with y.
    #[inline(always)]
    fn eliminate<S: Simd>(&self, simd: S, s: &Supernode, x: &mut [f32], buffer: &mut [f32]) {
        let columns = covering(s.width);
        let rows = &self.rows[s.rows.clone()];
        let tall = covering(3 * rows.len());
        let (y, below) = buffer.split_at_mut(TILE_SIZE * columns);
        y.fill(0.0);
        below[..TILE_SIZE * tall].fill(0.0);
        let mut at = s.tiles;
        for j in 0..columns {
            // Beyond the width other supernodes' numbers are read: their tiles are 0 there.
            let b = &x[s.first + TILE_SIZE * j..s.first + TILE_SIZE * (j + 1)];
            for sum in y[TILE_SIZE * j..].chunks_exact_mut(TILE_SIZE) {
                self.product(simd, at, b, f32x16::from_slice(simd, sum)).store_slice(sum);
                at += 1;
            }
        }
        x[s.first..s.first + s.width].copy_from_slice(&y[..s.width]);
        for y in y.chunks_exact(TILE_SIZE) {
            for sum in below[..TILE_SIZE * tall].chunks_exact_mut(TILE_SIZE) {
                self.product(simd, at, y, f32x16::from_slice(simd, sum)).store_slice(sum);
                at += 1;
            }
        }
        for (k, row) in rows.iter().enumerate() {
            let to = &mut x[*row as usize..*row as usize + 3];
            let by = &below[3 * k..3 * k + 3];
            for c in 0..3 {
                to[c] -= by[c];
            }
        }
    }

    /// x = inverse' (y - below' x_below).
    #[inline(always)]
    fn substitute<S: Simd>(&self, simd: S, s: &Supernode, x: &mut [f32], buffer: &mut [f32]) {
        let columns = covering(s.width);
        let rows = &self.rows[s.rows.clone()];
        let tall = covering(3 * rows.len());
        let (z, below) = buffer.split_at_mut(TILE_SIZE * columns);
        for (k, row) in rows.iter().enumerate() {
            below[3 * k..3 * k + 3].copy_from_slice(&x[*row as usize..*row as usize + 3]);
        }
        below[3 * rows.len()..TILE_SIZE * tall].fill(0.0);
        z[..s.width].copy_from_slice(&x[s.first..s.first + s.width]);
        z[s.width..].fill(0.0);
        let mut at = s.tiles + columns * (columns + 1) / 2;
        for z in z.chunks_exact_mut(TILE_SIZE) {
            let sum = self.transposed(simd, at, &below[..TILE_SIZE * tall]);
            (f32x16::from_slice(simd, z) - sum).store_slice(z);
            at += tall;
        }
        let mut at = s.tiles;
        for j in 0..columns {
            // Only columns after j are read of z from here on.
            let out = self.transposed(simd, at, &z[TILE_SIZE * j..]);
            out.store_slice(&mut z[TILE_SIZE * j..TILE_SIZE * (j + 1)]);
            at += columns - j;
        }
        x[s.first..s.first + s.width].copy_from_slice(&z[..s.width]);
    }

    /// sum + tile y.
    #[inline(always)]
    fn product<S: Simd>(&self, simd: S, at: usize, y: &[f32], sum: f32x16<S>) -> f32x16<S> {
        let tile = &self.tiles[at];
        let mut even = f32x16::splat(simd, 0.0);
        let mut odd = f32x16::splat(simd, 0.0);
        for (pair, words) in tile.words.iter().enumerate() {
            let word = i32x16::from_slice(simd, words);
            let low: f32x16<S> = f32x16::float_from(word << 16);
            let high: f32x16<S> = f32x16::float_from(word);
            even += low * y[2 * pair];
            odd += high * y[2 * pair + 1];
        }
        sum + (even + odd) * self.scales[at]
    }

    /// Sum over a column of tiles, the first of them at `at`, of tile' times its part of `x`.
    #[inline(always)]
    fn transposed<S: Simd>(&self, simd: S, at: usize, x: &[f32]) -> f32x16<S> {
        let mut sums = [f32x16::splat(simd, 0.0); TILE_SIZE];
        for (k, x) in x.chunks_exact(TILE_SIZE).enumerate() {
            self.add_transposed(simd, at + k, x, &mut sums);
        }
        transpose_sum(simd, sums)
    }

    /// Adds the products of a tile's columns with `x`, lane by lane; the caller needs their sums
    /// over lanes.
    #[inline(always)]
    fn add_transposed<S: Simd>(&self, simd: S, at: usize, x: &[f32], sums: &mut [f32x16<S>; TILE_SIZE]) {
        let x = f32x16::from_slice(simd, x) * self.scales[at];
        for (pair, words) in self.tiles[at].words.iter().enumerate() {
            let word = i32x16::from_slice(simd, words);
            let low: f32x16<S> = f32x16::float_from(word << 16);
            let high: f32x16<S> = f32x16::float_from(word);
            sums[2 * pair] += low * x;
            sums[2 * pair + 1] += high * x;
        }
    }
}

/// The sum over lanes of each of 16 vectors.
#[inline(always)]
fn transpose_sum<S: Simd>(simd: S, mut v: [f32x16<S>; TILE_SIZE]) -> f32x16<S> {
    // Each round adds neighbours and halves the number of vectors; unzipping keeps their order.
    for half in [8, 4, 2, 1] {
        for k in 0..half {
            let (a, b) = (v[2 * k], v[2 * k + 1]);
            v[k] = simd.unzip_low_f32x16(a, b) + simd.unzip_high_f32x16(a, b);
        }
    }
    v[0]
}
