//! The columns of the nodes of a low-rank update, and the products of each with all, which are kept
//! until the factor changes.
//!
//! Nodes in the jaws have a hundred columns or more, of a thousand numbers each: several threads
//! solve for them and multiply with them. The bits do not depend on how the work is divided.

use super::factor::Factor;
use super::half_columns::HalfColumns;
use super::tiles::ChainRoom;
use crate::threads::{for_each, for_each_with, in_parts};
use fearless_simd::{Level, dispatch};

/// Greatest number of nodes in use.
pub(super) const MAX_NODES: usize = 128;

/// Greatest number of nodes whose columns are kept: jaws that hold 270 nodes use other ones in each
/// frame. And of columns.
const MAX_PLACES: usize = 320;
pub(super) const MAX_COLUMNS: usize = 3 * MAX_PLACES;

/// Fewest nodes that are worth a thread of their own: to solve for their columns, and to multiply
/// with them.
const MIN_SOLVED: usize = 2;
const MIN_NODES: usize = 8;

/// Most parts of columns that are solved for, and of a vector that columns are subtracted from; and
/// the numbers of a block that belongs to one part.
const MAX_PARTS: usize = 4;
const BLOCK: usize = 64;

/// Products of three columns with three others.
type Products = [[f64; 3]; 3];

/// Columns by place: a place belongs to one node until the node is not used and the place is needed
/// for another.
pub(super) struct ColumnCache {
    /// The node of each place.
    known: Vec<u32>,
    columns: Vec<HalfColumns>,
    /// Products of each column with all, three columns a place, row by row. Memory is allocated for
    /// all, and touched as places are used.
    products: Vec<f64>,
    /// The places in use.
    used: Vec<usize>,
    /// Where the vector is cut so that subtracting the columns in use is as much work in each part.
    cuts: Vec<usize>,
    /// Scratch: products of a vector with the columns in use, the work by block, and the columns
    /// that are being solved for.
    of_used: Vec<[f64; 3]>,
    work: Vec<usize>,
    fresh: Vec<Fresh>,
    rooms: Vec<ChainRoom>,
}

/// Columns of a node that are being solved for.
#[derive(Default)]
struct Fresh {
    place: usize,
    columns: HalfColumns,
    /// Products with those of places that come before.
    products: Vec<(usize, Products)>,
}

impl ColumnCache {
    /// An empty one.
    pub fn new() -> Self {
        Self {
            known: Vec::with_capacity(MAX_PLACES),
            columns: vec![HalfColumns::default(); MAX_PLACES],
            products: vec![0.0; MAX_COLUMNS * MAX_COLUMNS],
            used: Vec::with_capacity(MAX_NODES),
            cuts: Vec::with_capacity(MAX_PARTS),
            of_used: Vec::with_capacity(MAX_NODES),
            work: Vec::new(),
            fresh: Vec::new(),
            rooms: Vec::new(),
        }
    }

    /// Forgets all columns: the factor has changed.
    pub fn clear(&mut self) {
        self.known.clear();
    }

    /// The number of columns in use or kept.
    pub fn len(&self) -> usize {
        3 * self.known.len()
    }

    /// Uses the columns of these `nodes`, at most [`MAX_NODES`], and solves for those that are not
    /// known.
    pub fn use_nodes(&mut self, level: Level, factor: &Factor, nodes: &[u32]) {
        let Self { known, columns, used, fresh, .. } = self;
        let (mut unused, mut count) = (0, 0);
        used.clear();
        for node in nodes {
            let place = known.iter().position(|other| other == node).unwrap_or_else(|| {
                let place = if known.len() < MAX_PLACES {
                    known.push(*node);
                    known.len() - 1
                } else {
                    while nodes.contains(&known[unused]) {
                        unused += 1;
                    }
                    known[unused] = *node;
                    unused
                };
                if fresh.len() == count {
                    fresh.push(Fresh::default());
                }
                fresh[count].place = place;
                std::mem::swap(&mut fresh[count].columns, &mut columns[place]);
                count += 1;
                place
            });
            used.push(place);
        }
        self.solve(level, factor, count);
        self.cut(factor.scale.len());
    }

    /// Solves for the first `count` fresh columns, and multiplies them with all others.
    fn solve(&mut self, level: Level, factor: &Factor, count: usize) {
        let Self { known, columns, products, fresh, rooms, .. } = self;
        let (nodes, fresh) = (&*known, &mut fresh[..count]);
        let parts = (count / MIN_SOLVED).clamp(1, MAX_PARTS);
        while rooms.len() < parts {
            rooms.push(factor.chain_room());
        }
        let mut rest = &mut *fresh;
        let mut part = |k: usize| {
            let (first, others) = std::mem::take(&mut rest).split_at_mut(count * (k + 1) / parts - count * k / parts);
            rest = others;
            first
        };
        let mut tasks: [_; MAX_PARTS] = std::array::from_fn(|k| if k < parts { part(k) } else { Default::default() });
        for_each_with(&mut tasks[..parts], &mut rooms[..parts], |fresh, room| {
            dispatch!(level, simd => for Fresh { place, columns, .. } in fresh.iter_mut() {
                columns.solve(simd, factor, room, nodes[*place] as usize);
            });
        });
        for fresh in fresh.iter_mut() {
            std::mem::swap(&mut columns[fresh.place], &mut fresh.columns);
        }
        let (columns, count) = (&*columns, known.len());
        // Of two fresh ones, the later one is multiplied with the earlier one.
        let mut order = [0; MAX_PLACES];
        fresh.iter().enumerate().for_each(|(k, fresh)| order[fresh.place] = k + 1);
        for_each(fresh, |Fresh { place, products, .. }| {
            let others = (0..count).filter(|other| order[*other] <= order[*place]);
            products.clear();
            products.extend(others.map(|other| (other, [[0.0; 3]; 3])));
            dispatch!(level, simd => for (other, products) in products.iter_mut() {
                *products = columns[*place].product_with(simd, &columns[*other]);
            });
        });
        for Fresh { place, products: blocks, .. } in fresh.iter() {
            for (other, block) in blocks {
                for (r, row) in block.iter().enumerate() {
                    for (c, product) in row.iter().enumerate() {
                        products[MAX_COLUMNS * (3 * place + r) + 3 * other + c] = *product;
                        products[MAX_COLUMNS * (3 * other + c) + 3 * place + r] = *product;
                    }
                }
            }
        }
    }

    /// Cuts a vector of so many `numbers`.
    fn cut(&mut self, numbers: usize) {
        let Self { columns, used, cuts, work, .. } = self;
        cuts.clear();
        let parts = (used.len() / MIN_NODES).clamp(1, MAX_PARTS);
        if parts == 1 {
            return;
        }
        work.clear();
        work.resize(numbers.div_ceil(BLOCK), 0);
        for range in used.iter().flat_map(|place| columns[*place].ranges()) {
            work[range.start / BLOCK..range.end.div_ceil(BLOCK)].iter_mut().for_each(|work| *work += 1);
        }
        let all: usize = work.iter().sum();
        let mut sum = 0;
        for (block, work) in work.iter().enumerate() {
            sum += work;
            if sum * parts >= all * (cuts.len() + 1) && cuts.len() + 1 < parts {
                cuts.push((BLOCK * (block + 1)).min(numbers));
            }
        }
    }

    /// The place of each node in use, in their order.
    pub fn used(&self) -> &[usize] {
        &self.used
    }

    /// Products of a place's column `c` with the columns of all places.
    pub fn products(&self, place: usize, c: usize) -> &[f64] {
        &self.products[MAX_COLUMNS * (3 * place + c)..][..self.len()]
    }

    /// Products of a vector that is solved by half with the columns in use, each at its place.
    pub fn multiply(&mut self, level: Level, y: &[f32], products: &mut [f64]) {
        let Self { columns, used, of_used, .. } = self;
        of_used.clear();
        of_used.resize(used.len(), [0.0; 3]);
        in_parts(of_used, MIN_NODES, |first, products| {
            dispatch!(level, simd => for (product, place) in products.iter_mut().zip(&used[first..]) {
                *product = columns[*place].product(simd, y);
            });
        });
        for (place, product) in used.iter().zip(of_used) {
            products[3 * *place..3 * *place + 3].copy_from_slice(product);
        }
    }

    /// y -= the columns in use times their `shares`, each at its place.
    pub fn subtract(&self, level: Level, shares: &[f64], y: &mut [f32]) {
        let Self { columns, used, cuts, .. } = self;
        let mut parts: [(usize, &mut [f32]); MAX_PARTS] = Default::default();
        let (mut rest, mut first) = (y, 0);
        for (part, cut) in parts.iter_mut().zip(cuts) {
            let (numbers, others) = rest.split_at_mut(cut - first);
            *part = (first, numbers);
            (rest, first) = (others, *cut);
        }
        parts[cuts.len()] = (first, rest);
        for_each(&mut parts[..=cuts.len()], |(first, y)| {
            dispatch!(level, _simd => for place in used {
                columns[*place].subtract(std::array::from_fn(|c| shares[3 * place + c]), *first, y);
            });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::{ColumnCache, MAX_NODES, MAX_PLACES};
    use crate::Isa;
    use crate::quasi_newton::factor::Factor;
    use crate::{BodyDescription, ConstitutiveModel, Material, ModelBuilder};
    use fearless_simd::dispatch;
    use trocar_testing::blocks::block;

    /// A factor whose tree is cut into parts.
    fn factor() -> Factor {
        let mesh = block([10, 10, 24], 2e-3);
        let material = Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: 12e3,
            poisson_ratio: 0.45,
            density: 1200.0,
            viscosity: 0.0,
        };
        let mut builder = ModelBuilder::new();
        let body = BodyDescription { name: "block".into(), mesh: &mesh, material, pinned: vec![], supports: vec![] };
        builder.body(body).unwrap();
        let model = builder.build().unwrap();
        let mut factor = Factor::new(&model.bodies[0], 1e-2).unwrap();
        let free = factor.order.len();
        factor.set_step(&vec![1e-3; free], 1e-2);
        assert!(factor.factorise(Isa::detect().level(), &vec![false; free], &vec![0.0; free]));
        factor
    }

    /// Products with a vector are those of solves for a node, whichever nodes were used before, and
    /// any number of threads has the same bits.
    #[test]
    fn columns_are_those_of_solves() {
        let level = Isa::detect().level();
        let mut factor = factor();
        let free = factor.order.len();
        let y: Vec<f32> = (0..3 * free + 16).map(|i| ((7 * i) % 11) as f32 - 5.0).collect();
        let windows: Vec<Vec<u32>> = [0usize, 300, 700, 1100, 40]
            .into_iter()
            .map(|first| (0..MAX_NODES).map(|k| ((first + 3 * k) % free) as u32).collect())
            .collect();
        assert!(windows.len() * MAX_NODES > MAX_PLACES, "no place is used twice");
        let run = |factor: &Factor| {
            let mut cache = ColumnCache::new();
            let mut results = Vec::new();
            for nodes in &windows {
                cache.use_nodes(level, factor, nodes);
                let mut products = vec![0.0; cache.len()];
                cache.multiply(level, &y, &mut products);
                let own = |place: &usize| [0, 1, 2].map(|c| cache.products(*place, c)[3 * place + c]);
                let of_used = cache.used().iter().map(|place| [0, 1, 2].map(|c| products[3 * place + c]));
                let squares: Vec<_> = cache.used().iter().map(own).collect();
                let mut rest = vec![0.0; y.len()];
                cache.subtract(level, &vec![1e-3; cache.len()], &mut rest);
                results.push((of_used.collect::<Vec<_>>(), squares, rest));
            }
            results
        };
        let results = run(&factor);
        for threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| run(&factor)) == results, "{threads} threads");
        }
        for (nodes, (products, squares, rest)) in windows.iter().zip(&results) {
            let mut sum = vec![0.0f64; 3 * free];
            for (k, node) in nodes.iter().enumerate() {
                for c in 0..3 {
                    let mut column = vec![0.0; 3 * free + 16];
                    column[3 * *node as usize + c] = 1.0;
                    dispatch!(level, simd => factor.forward(simd, &mut column, true));
                    let dot = |with: &[f32]| -> f64 {
                        column[..3 * free].iter().zip(with).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
                    };
                    let square = dot(&column);
                    assert!((square - squares[k][c]).abs() < 1e-3 * square, "node {node}: {square} {:?}", squares[k]);
                    let scale = (square * dot(&y).abs().max(1.0)).sqrt() + dot(&y).abs();
                    assert!((dot(&y) - products[k][c]).abs() < 1e-3 * scale, "node {node}: {}", products[k][c]);
                    sum.iter_mut().zip(&column).for_each(|(sum, x)| *sum += 1e-3 * f64::from(*x));
                }
            }
            let most = sum.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            let off = |k: usize| (f64::from(rest[k]) + sum[k]).abs();
            assert!((0..3 * free).all(|k| off(k) < 1e-3 * most));
        }
    }
}
