//! A Cholesky factor packed for speed, and the solve with it.
//!
//! A solve reads the whole factor twice and does one multiplication a number: it is bound by
//! memory. So the factor is kept in 8 bits a number, in tiles of 16 x 16 numbers, supernode by
//! supernode. What that rounding leaves is kept in 8 bits more, apart, for precise solves. A number
//! has two scales: its row's and its column's in the supernode. The triangle on a supernode's
//! diagonal is kept as its inverse: a solve consists of products with tiles and waits for no
//! division. Vectors are rounded to 16 bits before they are multiplied, because processors multiply
//! whole numbers faster.
//!
//! The backward half is the transpose of the forward half, tile by tile. So rounding the factor
//! leaves the preconditioner symmetric and positive definite, up to the rounding of vectors.

use super::packing::{Packing, sizes};
use super::supernode::{Supernode, TILE_SIZE, covering};
use super::tile::{Tile, pairs, round, transpose_sum};
use super::tile_parts::{Part, Parts};
use super::tree::Tree;
use crate::threads::for_each;
use fearless_simd::{Level, Simd, SimdBase, SimdCvtFloat, dispatch, f32x16, i32x16};
use std::ops::Range;
use trocar_sparse::Panel;

/// The packed factor.
pub(super) struct Tiles {
    supernodes: Vec<Supernode>,
    /// The first of the three numbers of each node below the supernodes' diagonals.
    rows: Vec<u32>,
    /// The tree of supernodes.
    tree: Tree,
    parts: Parts,
    tiles: Vec<Tile>,
    /// What rounding leaves of the tiles.
    remainders: Vec<Tile>,
    scales: Vec<f32>,
    /// Room for the longest column of row tiles.
    buffer: Vec<f32>,
}

impl Tiles {
    pub fn new() -> Self {
        Self {
            supernodes: Vec::new(),
            rows: Vec::new(),
            tree: Tree::default(),
            parts: Parts::default(),
            tiles: Vec::new(),
            remainders: Vec::new(),
            scales: Vec::new(),
            buffer: Vec::new(),
        }
    }

    /// Packs the panels of a factor, each on any thread of the pool that calls.
    pub fn pack(&mut self, level: Level, panels: &[Panel<'_, f32>]) {
        self.supernodes.clear();
        self.rows.clear();
        let (mut tiles, mut scales, mut buffer) = (0, 0, 0);
        for panel in panels {
            let begin = self.rows.len();
            self.rows.extend(panel.rows().iter().map(|node| 3 * node));
            let (first, width, rows) = (panel.first(), panel.width(), begin..self.rows.len());
            let height = 3 * rows.len();
            self.supernodes.push(Supernode { first, width, rows, tiles, scales });
            let [more_tiles, more_scales] = sizes(width, height);
            (tiles, scales) = (tiles + more_tiles, scales + more_scales);
            buffer = buffer.max(TILE_SIZE * (covering(width) + covering(height) + 1));
        }
        self.tiles.resize(tiles, Tile::ZERO);
        self.remainders.resize(tiles, Tile::ZERO);
        self.scales.resize(scales, 0.0);
        self.buffer.resize(buffer, 0.0);

        let (mut tiles, mut remainders) = (&mut self.tiles[..], &mut self.remainders[..]);
        let mut scales = &mut self.scales[..];
        let pack = |panel| {
            let [count, scale_count] = sizes(Panel::width(panel), 3 * panel.rows().len());
            let packing = Packing {
                tiles: tiles.split_off_mut(..count)?,
                remainders: remainders.split_off_mut(..count)?,
                scales: scales.split_off_mut(..scale_count)?,
            };
            Some((panel, packing))
        };
        let mut tasks: Vec<_> = panels.iter().filter_map(pack).collect();
        for_each(&mut tasks, |(panel, packing)| packing.pack(level, panel));
    }

    /// Ends the factor after it is packed.
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

    /// Solves L y = x in place: `x` is three numbers a node in the order of elimination, padded by
    /// at least 16. A `precise` solve has 16 bits of each number of the factor, another may have 8.
    #[inline(always)]
    pub fn forward<S: Simd>(&mut self, simd: S, x: &mut [f32], precise: bool) {
        let (mut buffer, mut parts) = (std::mem::take(&mut self.buffer), std::mem::take(&mut self.parts));
        let (whole, level) = (&*x, simd.level());
        for_each(&mut parts.list, |part| {
            part.begin(whole);
            let Part { supernodes, vector, buffer, .. } = part;
            // Another thread has to ask for its instruction set itself.
            dispatch!(level, simd => for s in &self.supernodes[supernodes.clone()] {
                self.eliminate(simd, s, vector, buffer, precise);
            });
        });
        for part in &parts.list {
            part.take(&part.vector, &parts.numbers, x);
            part.end(x);
        }
        for s in &parts.above {
            self.eliminate(simd, &self.supernodes[*s], x, &mut buffer, precise);
        }
        (self.buffer, self.parts) = (buffer, parts);
    }

    /// Solves L' x = y in place; as precise as the forward half.
    #[inline(always)]
    pub fn backward<S: Simd>(&mut self, simd: S, x: &mut [f32], precise: bool) {
        let (mut buffer, mut parts) = (std::mem::take(&mut self.buffer), std::mem::take(&mut self.parts));
        for s in parts.above.iter().rev() {
            self.substitute(simd, &self.supernodes[*s], x, &mut buffer, precise);
        }
        let (whole, level) = (&*x, simd.level());
        for_each(&mut parts.list, |part| {
            part.read(&parts.numbers, whole);
            let Part { supernodes, vector, buffer, .. } = part;
            dispatch!(level, simd => for s in self.supernodes[supernodes.clone()].iter().rev() {
                self.substitute(simd, s, vector, buffer, precise);
            });
        });
        for part in &parts.list {
            part.end(x);
        }
        (self.buffer, self.parts) = (buffer, parts);
    }

    /// Solves L y = x, precisely, for an `x` that is 0 but for one `value`. The solution has
    /// numbers only in the chain of supernodes from that of its `number` up to the root: writes
    /// those to `column`, and the ranges of these supernodes' numbers to `ranges`.
    #[inline(always)]
    pub fn forward_chain<S: Simd>(
        &self,
        simd: S,
        (number, value): (usize, f32),
        room: &mut ChainRoom,
        column: &mut Vec<f32>,
        ranges: &mut Vec<Range<usize>>,
    ) {
        let ChainRoom { x, part: of_part, buffer } = room;
        ranges.clear();
        x[number] = value;
        let mut next = Some(self.tree.supernode_of(number));
        if let Some(part) = self.parts.list.iter().find(|part| part.numbers.contains(&number)) {
            of_part.clear();
            of_part.resize(part.vector.len(), 0.0);
            of_part[number - part.numbers.start] = value;
            while let Some(s) = next.filter(|s| part.supernodes.contains(s)) {
                self.eliminate(simd, &self.supernodes[s], of_part, buffer, true);
                ranges.push(self.tree.numbers(s));
                next = self.tree.parent(s);
            }
            part.take(of_part, &self.parts.numbers, x);
            x[part.numbers.clone()].copy_from_slice(&of_part[..part.numbers.len()]);
        }
        while let Some(s) = next {
            self.eliminate(simd, &self.supernodes[s], x, buffer, true);
            ranges.push(self.tree.numbers(s));
            next = self.tree.parent(s);
        }
        column.clear();
        for range in ranges.iter() {
            column.extend_from_slice(&x[range.clone()]);
            x[range.clone()].fill(0.0);
        }
    }

    /// Room for [`Self::forward_chain`] with a vector of so many `numbers`.
    pub fn chain_room(&self, numbers: usize) -> ChainRoom {
        ChainRoom { x: vec![0.0; numbers + TILE_SIZE], part: Vec::new(), buffer: vec![0.0; self.buffer.len()] }
    }

    /// y = inverse b, and the rows below lose their product with y.
    #[inline(always)]
    fn eliminate<S: Simd>(&self, simd: S, s: &Supernode, x: &mut [f32], buffer: &mut [f32], precise: bool) {
        let rows = &self.rows[s.rows.clone()];
        let (y, below) = buffer.split_at_mut(TILE_SIZE * covering(s.width));
        let below = &mut below[..TILE_SIZE * covering(3 * rows.len())];
        let [inverse, under] = self.scales_of(s, y.len(), below.len());
        y.fill(0.0);
        below.fill(0.0);
        let mut at = s.tiles;
        for (j, scales) in inverse.columns.chunks_exact(TILE_SIZE).enumerate() {
            // Beyond the width other supernodes' numbers are read: their scales are 0 there.
            let b = &x[s.first + TILE_SIZE * j..s.first + TILE_SIZE * (j + 1)];
            self.add_product(simd, &mut at, b, scales, &mut y[TILE_SIZE * j..], precise);
        }
        multiply(simd, y, inverse.rows);
        x[s.first..s.first + s.width].copy_from_slice(&y[..s.width]);
        for (y, scales) in y.chunks_exact(TILE_SIZE).zip(under.columns.chunks_exact(TILE_SIZE)) {
            self.add_product(simd, &mut at, y, scales, below, precise);
        }
        multiply(simd, below, under.rows);
        for (row, by) in rows.iter().zip(below.chunks_exact(3)) {
            let to = &mut x[*row as usize..*row as usize + 3];
            for c in 0..3 {
                to[c] -= by[c];
            }
        }
    }

    /// x = inverse' (y - below' x_below).
    #[inline(always)]
    fn substitute<S: Simd>(&self, simd: S, s: &Supernode, x: &mut [f32], buffer: &mut [f32], precise: bool) {
        let rows = &self.rows[s.rows.clone()];
        let (z, below) = buffer.split_at_mut(TILE_SIZE * covering(s.width));
        let below = &mut below[..TILE_SIZE * covering(3 * rows.len())];
        let [inverse, under] = self.scales_of(s, z.len(), below.len());
        for (row, to) in rows.iter().zip(below.chunks_exact_mut(3)) {
            to.copy_from_slice(&x[*row as usize..*row as usize + 3]);
        }
        below[3 * rows.len()..].fill(0.0);
        z[..s.width].copy_from_slice(&x[s.first..s.first + s.width]);
        z[s.width..].fill(0.0);
        let columns = z.len() / TILE_SIZE;
        let mut at = s.tiles + columns * (columns + 1) / 2;
        let unit = round(simd, below, under.rows);
        for (z, scales) in z.chunks_exact_mut(TILE_SIZE).zip(under.columns.chunks_exact(TILE_SIZE)) {
            let sum = self.transposed(simd, at, below, precise) * f32x16::from_slice(simd, scales) * unit;
            (f32x16::from_slice(simd, z) - sum).store_slice(z);
            at += below.len() / TILE_SIZE;
        }
        let mut at = s.tiles;
        let unit = round(simd, z, inverse.rows);
        for (j, scales) in inverse.columns.chunks_exact(TILE_SIZE).enumerate() {
            // Only columns after j are read of z from here on.
            let out = self.transposed(simd, at, &z[TILE_SIZE * j..], precise) * f32x16::from_slice(simd, scales) * unit;
            out.store_slice(&mut z[TILE_SIZE * j..TILE_SIZE * (j + 1)]);
            at += columns - j;
        }
        x[s.first..s.first + s.width].copy_from_slice(&z[..s.width]);
    }

    /// The scales of the inverse and of the numbers below, which are `width` and `height` tall.
    #[inline(always)]
    fn scales_of(&self, s: &Supernode, width: usize, height: usize) -> [Scales<'_>; 2] {
        let (columns, rest) = self.scales[s.scales..s.scales + 3 * width + height].split_at(width);
        let (rows, rest) = rest.split_at(width);
        let (under, below) = rest.split_at(width);
        [Scales { columns, rows }, Scales { columns: under, rows: below }]
    }

    /// Adds to `sums` the products of a column of tiles, the first of them at `at`, with `y` times
    /// the columns' `scales`; without the rows' scales.
    #[inline(always)]
    fn add_product<S: Simd>(
        &self,
        simd: S,
        at: &mut usize,
        y: &[f32],
        scales: &[f32],
        sums: &mut [f32],
        precise: bool,
    ) {
        let (y, unit) = pairs(f32x16::from_slice(simd, y) * f32x16::from_slice(simd, scales));
        let tiles = *at..*at + sums.len() / TILE_SIZE;
        for (at, sum) in tiles.clone().zip(sums.chunks_exact_mut(TILE_SIZE)) {
            let mut product: f32x16<S> = f32x16::float_from(self.tiles[at].product(simd, &y));
            if precise {
                let rest: f32x16<S> = f32x16::float_from(self.remainders[at].product(simd, &y));
                product += rest * (1.0 / Tile::REMAINDER_UNIT);
            }
            (f32x16::from_slice(simd, sum) + product * unit).store_slice(sum);
        }
        *at = tiles.end;
    }

    /// Sum over a column of tiles, the first of them at `at`, of tile' times its part of `x`, as
    /// [`round`] left it; without the columns' scales.
    #[inline(always)]
    fn transposed<S: Simd>(&self, simd: S, at: usize, x: &[f32], precise: bool) -> f32x16<S> {
        let mut sum = sum_transposed(simd, &self.tiles[at..], x);
        if precise {
            sum += sum_transposed(simd, &self.remainders[at..], x) * (1.0 / Tile::REMAINDER_UNIT);
        }
        sum
    }
}

/// Sum of tile' times its part of `x`, as [`round`] left it, over as many `tiles` as `x` has parts.
#[inline(always)]
fn sum_transposed<S: Simd>(simd: S, tiles: &[Tile], x: &[f32]) -> f32x16<S> {
    let mut sums = [i32x16::splat(simd, 0); TILE_SIZE];
    for (tile, x) in tiles.iter().zip(x.chunks_exact(TILE_SIZE)) {
        tile.add_transposed(simd, x, &mut sums);
    }
    transpose_sum(simd, &sums)
}

/// Scratch memory of a solve along a chain.
pub(super) struct ChainRoom {
    /// A vector of a solve, all zero before and after.
    x: Vec<f32>,
    /// The part's vector.
    part: Vec<f32>,
    /// Room for the longest column of row tiles.
    buffer: Vec<f32>,
}

/// The scales of a block's columns and rows.
struct Scales<'a> {
    columns: &'a [f32],
    rows: &'a [f32],
}

/// Multiplies number by number.
#[inline(always)]
fn multiply<S: Simd>(simd: S, x: &mut [f32], by: &[f32]) {
    for (x, by) in x.chunks_exact_mut(TILE_SIZE).zip(by.chunks_exact(TILE_SIZE)) {
        (f32x16::from_slice(simd, x) * f32x16::from_slice(simd, by)).store_slice(x);
    }
}
