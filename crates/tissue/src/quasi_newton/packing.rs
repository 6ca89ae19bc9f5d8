//! Packing: a supernode of a factor becomes tiles of 8 bits a number, and scales.
//!
//! Numbers are divided by the greatest of their column, then by the greatest of their row.

use super::supernode::{TILE_SIZE, covering};
use super::tile::{Tile, per_unit};
use fearless_simd::{Level, Simd, SimdBase, dispatch, f32x16};
use trocar_sparse::{Panel, Real};

// A band of a panel is a row of tiles.
const _: () = assert!(<f32 as Real>::LANES == TILE_SIZE);

/// 16 x 16 numbers, column by column.
type Unpacked = [f32; TILE_SIZE * TILE_SIZE];

/// Where a supernode's part of the packed factor is written.
pub(super) struct Packing<'a> {
    pub tiles: &'a mut [Tile],
    pub remainders: &'a mut [Tile],
    pub scales: &'a mut [f32],
}

/// Numbers of tiles and of scales of a supernode that is `width` wide, with `height` numbers below
/// its diagonal.
pub(super) fn sizes(width: usize, height: usize) -> [usize; 2] {
    let (columns, tall) = (covering(width), covering(height));
    [columns * (columns + 1) / 2 + columns * tall, TILE_SIZE * (3 * columns + tall)]
}

impl Packing<'_> {
    /// Packs the inverse of the panel's triangle, then the numbers below it.
    pub fn pack(&mut self, level: Level, panel: &Panel<'_, f32>) {
        let (width, height) = (panel.width(), 3 * panel.rows().len());
        let (columns, tall) = (covering(width), covering(height));
        let Self { tiles, remainders, scales } = self;
        let triangle = columns * (columns + 1) / 2;
        let (tiles, tiles_below) = tiles.split_at_mut(triangle);
        let (remainders, remainders_below) = remainders.split_at_mut(triangle);
        let (scales, scales_below) = scales.split_at_mut(2 * TILE_SIZE * columns);

        let mut inverse = Vec::new();
        panel.inverse(level, &mut inverse);
        let mut unpacked = vec![[0.0; TILE_SIZE * TILE_SIZE]; triangle.max(columns * tall)];
        let mut at = unpacked.iter_mut();
        for (j, i) in (0..columns).flat_map(|j| (j..columns).map(move |i| (j, i))) {
            let Some(tile) = at.next() else { break };
            let rows = TILE_SIZE * i..width.min(TILE_SIZE * (i + 1));
            for c in TILE_SIZE * j..width.min(TILE_SIZE * (j + 1)) {
                let (from, to) = (&inverse[width * c..][rows.clone()], TILE_SIZE * (c - TILE_SIZE * j));
                tile[to..to + from.len()].copy_from_slice(from);
            }
        }
        let block = Block { rows: columns, columns, triangle: true };
        block.pack(level, &mut unpacked, Packing { tiles, remainders, scales });

        let mut at = unpacked.iter_mut();
        for (j, i) in (0..columns).flat_map(|j| (0..tall).map(move |i| (j, i))) {
            let Some(tile) = at.next() else { break };
            let inside = TILE_SIZE * (width - TILE_SIZE * j).min(TILE_SIZE);
            tile[..inside].copy_from_slice(&panel.band_below(i)[TILE_SIZE * TILE_SIZE * j..][..inside]);
            tile[inside..].fill(0.0);
            let rows = (height - TILE_SIZE * i).min(TILE_SIZE);
            tile.chunks_exact_mut(TILE_SIZE).for_each(|column| column[rows..].fill(0.0));
        }
        let block = Block { rows: tall, columns, triangle: false };
        let below = Packing { tiles: tiles_below, remainders: remainders_below, scales: scales_below };
        block.pack(level, &mut unpacked, below);
    }
}

/// The shape of a block of tiles. They lie column by column.
struct Block {
    rows: usize,
    columns: usize,
    /// Whether it has only the tiles from the diagonal down.
    triangle: bool,
}

impl Block {
    /// Rounds the `unpacked` tiles. Writes the scales of the columns, then those of the rows.
    fn pack(&self, level: Level, unpacked: &mut [Unpacked], out: Packing<'_>) {
        let (of_columns, of_rows) = out.scales.split_at_mut(TILE_SIZE * self.columns);
        of_rows.fill(0.0);
        dispatch!(level, simd => {
            self.divide_columns(simd, unpacked, of_columns, of_rows);
            let mut rest = unpacked.iter().zip(out.tiles).zip(out.remainders);
            for j in 0..self.columns {
                for row in of_rows[TILE_SIZE * self.first_row(j)..].chunks_exact(TILE_SIZE) {
                    let Some(((unpacked, tile), remainder)) = rest.next() else { break };
                    let per_unit: [f32; TILE_SIZE] = std::array::from_fn(|r| per_unit(row[r], 1.0));
                    let per_unit = f32x16::from_slice(simd, &per_unit);
                    [*tile, *remainder] = Tile::pack(simd, |column| {
                        f32x16::from_slice(simd, &unpacked[TILE_SIZE * column..TILE_SIZE * (column + 1)]) * per_unit
                    });
                }
            }
        });
        of_rows.iter_mut().for_each(|scale| *scale /= Tile::UNIT);
    }

    /// First row of tiles in a column of tiles.
    fn first_row(&self, column: usize) -> usize {
        if self.triangle { column } else { 0 }
    }

    /// Divides each column by its greatest number; finds what is then the greatest of each row.
    #[inline(always)]
    fn divide_columns<S: Simd>(&self, simd: S, unpacked: &mut [Unpacked], of_columns: &mut [f32], of_rows: &mut [f32]) {
        let mut rest = unpacked;
        for j in 0..self.columns {
            let first = self.first_row(j);
            let (tiles, others) = std::mem::take(&mut rest).split_at_mut(self.rows - first);
            rest = others;
            for c in 0..TILE_SIZE {
                let column = TILE_SIZE * c..TILE_SIZE * (c + 1);
                let mut most = f32x16::splat(simd, 0.0);
                for tile in tiles.iter() {
                    most = most.max(f32x16::from_slice(simd, &tile[column.clone()]).abs());
                }
                let scale = &mut of_columns[TILE_SIZE * j + c];
                *scale = most.reduce_max();
                let per_unit = per_unit(*scale, 1.0);
                for (tile, row) in tiles.iter_mut().zip(of_rows[TILE_SIZE * first..].chunks_exact_mut(TILE_SIZE)) {
                    let numbers = &mut tile[column.clone()];
                    let divided = f32x16::from_slice(simd, numbers) * per_unit;
                    divided.store_slice(numbers);
                    f32x16::from_slice(simd, row).max(divided.abs()).store_slice(row);
                }
            }
        }
    }
}
