//! Supernodes of a packed factor: columns with the same rows below.

use std::ops::Range;

/// Rows and columns of a tile.
pub(super) const TILE_SIZE: usize = 16;

/// Tiles that cover `n` numbers.
pub(super) fn covering(n: usize) -> usize {
    n.div_ceil(TILE_SIZE)
}

/// One supernode: columns `first..first + width` of the vector, rows below by number.
pub(super) struct Supernode {
    pub first: usize,
    /// A multiple of 3.
    pub width: usize,
    /// Rows below its diagonal, in `Tiles::rows`.
    pub rows: Range<usize>,
    /// Its first tile: by columns of tiles, which both halves of a solve read one after another;
    /// those of the diagonal triangle first.
    pub tiles: usize,
    /// Its first scale: those of the inverse's columns and rows, then those of the numbers below.
    pub scales: usize,
}
