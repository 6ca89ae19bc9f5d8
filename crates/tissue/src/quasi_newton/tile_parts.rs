//! Parts of a packed factor that several threads solve with at once.
//!
//! The supernodes of a factor are a tree. The tree of a large body is cut near its root: into
//! subtrees, the parts, and the supernodes above them. Parts share no numbers of the vector. In the
//! forward half each part sums up what it takes from the numbers above, and the sums are taken
//! there in the order of the parts. In the backward half the parts only read the numbers above. How
//! a tree is cut depends on the factor alone, so the bits do not depend on the threads.

use super::supernode::{Supernode, TILE_SIZE};
use super::tree::Tree;
use std::ops::Range;

/// Tiles of the smallest factor that is cut: below, the threads cost more than they save.
const MIN_TILES: usize = 6000;

/// Parts are cut until there are so many, or the largest has less than a share of all tiles.
const MAX_PARTS: usize = 8;
const MIN_SHARE: f64 = 0.25;

/// The supernodes above the parts have at most this share of all tiles.
const MAX_SHARE_ABOVE: f64 = 0.4;

/// A subtree of the factor with its part of the vector.
pub(super) struct Part {
    /// Its supernodes.
    pub supernodes: Range<usize>,
    /// Its numbers of the vector.
    pub numbers: Range<usize>,
    /// A copy of them, room for a tile, and from `above` on what it takes from the numbers above.
    pub vector: Vec<f32>,
    /// Place in `vector` of the first number above.
    pub above: usize,
    /// Room for the longest column of row tiles.
    pub buffer: Vec<f32>,
}

/// The parts of a factor.
#[derive(Default)]
pub(super) struct Parts {
    /// The subtrees; none of a factor that is not cut.
    pub list: Vec<Part>,
    /// The supernodes above them, in the order of elimination: all of a factor that is not cut.
    pub above: Vec<usize>,
    /// The numbers of these supernodes, ascending.
    pub numbers: Vec<Range<usize>>,
}

impl Parts {
    /// A factor of so many supernodes that is not cut.
    pub fn whole(supernodes: usize) -> Self {
        Self { above: (0..supernodes).collect(), ..Self::default() }
    }

    /// Cuts the `tree` of `supernodes`, whose rows below the diagonal are the numbers `rows`, first
    /// of three each. Numbers of the parts' supernodes then refer to the parts' vectors. `buffer`
    /// is room for the longest column of row tiles.
    pub fn cut(tree: &Tree, supernodes: &mut [Supernode], rows: &mut [u32], buffer: usize) -> Self {
        let tiles: usize = tree.own.iter().sum();
        let (roots, above) = if tiles < MIN_TILES { Default::default() } else { roots_of_parts(tree, tiles as f64) };
        if roots.len() < 2 {
            return Self::whole(supernodes.len());
        }
        let numbers: Vec<Range<usize>> =
            above.iter().map(|s| supernodes[*s].first..supernodes[*s].first + supernodes[*s].width).collect();
        // Place of a number above the parts in the row of all of them.
        let place = |number: usize| {
            let k = numbers.partition_point(|range| range.end <= number);
            numbers[..k].iter().map(Range::len).sum::<usize>() + number - numbers[k].start
        };
        let count: usize = numbers.iter().map(Range::len).sum();
        let mut list = Vec::with_capacity(roots.len());
        for root in roots {
            let own = tree.first[root]..root + 1;
            let of = supernodes[own.start].first..supernodes[root].first + supernodes[root].width;
            let offset = of.len() + TILE_SIZE;
            for s in &mut supernodes[own.clone()] {
                s.first -= of.start;
                for row in &mut rows[s.rows.clone()] {
                    let number = *row as usize;
                    *row = if number < of.end { number - of.start } else { offset + place(number) } as u32;
                }
            }
            list.push(Part {
                supernodes: own,
                numbers: of,
                vector: vec![0.0; offset + count + TILE_SIZE],
                above: offset,
                buffer: vec![0.0; buffer],
            });
        }
        Self { list, above, numbers }
    }
}

impl Part {
    /// Begins the forward half with the vector `x`.
    pub fn begin(&mut self, x: &[f32]) {
        self.vector[..self.numbers.len()].copy_from_slice(&x[self.numbers.clone()]);
        self.vector[self.numbers.len()..].fill(0.0);
    }

    /// Takes the sums of one of the part's vectors from the numbers above, `ranges` of `x`.
    pub fn take(&self, vector: &[f32], ranges: &[Range<usize>], x: &mut [f32]) {
        let mut sums = vector[self.above..].iter();
        for range in ranges {
            x[range.clone()].iter_mut().zip(&mut sums).for_each(|(x, sum)| *x += sum);
        }
    }

    /// Begins the backward half: reads the part's numbers and those above, `ranges` of `x`.
    pub fn read(&mut self, ranges: &[Range<usize>], x: &[f32]) {
        self.vector[..self.numbers.len()].copy_from_slice(&x[self.numbers.clone()]);
        let mut at = self.above;
        for range in ranges {
            self.vector[at..at + range.len()].copy_from_slice(&x[range.clone()]);
            at += range.len();
        }
    }

    /// Ends either half: writes the part's numbers into `x`.
    pub fn end(&self, x: &mut [f32]) {
        x[self.numbers.clone()].copy_from_slice(&self.vector[..self.numbers.len()]);
    }
}

/// The roots of the parts, and the supernodes above them, both in the order of elimination.
fn roots_of_parts(tree: &Tree, tiles: f64) -> (Vec<usize>, Vec<usize>) {
    let (mut parts, mut above, mut above_tiles) = (tree.roots.clone(), Vec::new(), 0);
    while parts.len() < MAX_PARTS {
        let Some(largest) = (0..parts.len()).max_by_key(|k| (tree.all[parts[*k]], *k)) else { break };
        let root = parts[largest];
        let more = above_tiles + tree.own[root];
        let small = (tree.all[root] as f64) < MIN_SHARE * tiles;
        if small || tree.children[root].is_empty() || more as f64 > MAX_SHARE_ABOVE * tiles {
            break;
        }
        above_tiles = more;
        above.push(root);
        parts.splice(largest..=largest, tree.children[root].iter().copied());
    }
    parts.sort_unstable();
    above.sort_unstable();
    (parts, above)
}

#[cfg(test)]
mod tests {
    use crate::Isa;
    use crate::quasi_newton::tiles::Tiles;
    use fearless_simd::dispatch;
    use glam::{DMat3, DVec3};
    use trocar_sparse::{BlockMatrix, Cholesky};

    /// A grid of nodes joined by springs.
    fn grid(size: usize) -> BlockMatrix {
        let number = |x: usize, y: usize, z: usize| (x + size * (y + size * z)) as u32;
        let all = move || (0..size).flat_map(move |z| (0..size).flat_map(move |y| (0..size).map(move |x| [x, y, z])));
        let pairs: Vec<(u32, u32)> = all()
            .flat_map(|[x, y, z]| {
                let next = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
                let inside = next.into_iter().filter(|(x, y, z)| [x, y, z].iter().all(|k| **k < size));
                inside.map(move |(a, b, c)| (number(x, y, z), number(a, b, c)))
            })
            .collect();
        let mut matrix = BlockMatrix::new(size * size * size, pairs.iter().copied());
        for i in 0..(size * size * size) as u32 {
            matrix.add(i, i, DMat3::IDENTITY * 0.3);
        }
        for (i, j) in pairs {
            let block = DMat3::from_diagonal(DVec3::new(0.9, 1.0, 1.1));
            matrix.add(i, i, block);
            matrix.add(j, j, block);
            matrix.add(j.max(i), j.min(i), -block);
        }
        matrix
    }

    #[test]
    fn parts_solve_as_the_whole_with_any_number_of_threads() {
        let matrix = grid(18);
        let level = Isa::detect().level();
        let mut factor = Cholesky::<f32>::new(&matrix);
        let blocks = matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d().map(|c| c.map(|x| x as f32)));
        assert!(factor.factorise(level, blocks));
        let panels: Vec<_> = factor.panels().collect();
        let mut tiles = Tiles::new();
        tiles.pack(level, &panels);
        let right: Vec<f32> = (0..3 * matrix.len()).map(|i| ((7 * i) % 11) as f32 - 5.0).collect();
        let solve = |tiles: &mut Tiles, precise: bool| {
            let mut x = right.clone();
            x.resize(right.len() + 16, 0.0);
            dispatch!(level, simd => {
                tiles.forward(simd, &mut x, precise);
                tiles.backward(simd, &mut x, precise);
            });
            x
        };
        let numbers = |k: usize| 3 * factor.order()[k / 3] as usize + k % 3;
        // The factor before it was packed has the nodes as the matrix numbers them.
        let mut unpacked = vec![0.0; right.len()];
        right.iter().enumerate().for_each(|(k, x)| unpacked[numbers(k)] = *x);
        factor.solve(level, &mut unpacked);
        let most = unpacked.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        let squares = |numbers: &[f32]| numbers.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        // The worst of 17,496 numbers depends on the order of elimination and on the right side:
        // with others it is up to 4%. The mean hardly does.
        for (precise, worst, mean) in [(true, 1e-3, 1e-3), (false, 0.03, 0.012)] {
            tiles.end_whole();
            let whole = solve(&mut tiles, precise);
            tiles.end();
            assert!(tiles.parts() >= 2, "the factor is too small to be cut");
            let parts = solve(&mut tiles, precise);
            assert!(whole.iter().zip(&parts).all(|(a, b)| (a - b).abs() < 1e-4 * most));
            let off: Vec<f32> = (0..right.len()).map(|k| parts[k] - unpacked[numbers(k)]).collect();
            let found = off.iter().fold(0.0f32, |most, x| most.max(x.abs())) / most;
            assert!(found < worst, "the packed factor's solution is off by {found}");
            let found = (squares(&off) / squares(&unpacked)).sqrt();
            assert!(found < mean, "the packed factor's solution is off by {found} in the root mean square");
            for threads in [1, 2, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                assert!(pool.install(|| solve(&mut tiles, precise)) == parts, "{threads} threads");
            }
            // Numbers of parts refer to the parts: the next round packs anew.
            tiles.pack(level, &panels);
        }
    }
}
