//! The factor: a multifrontal Cholesky factorisation over the tree of supernodes (Duff and Reid,
//! "The multifrontal solution of indefinite sparse symmetric linear equations", 1983).

use crate::dense::{COLUMNS, eliminate, first_of_band, inverse_bands};
use crate::dissection::dissect;
use crate::graph::{Graph, NONE};
use crate::supernodes::{Supernode, elimination_tree, postorder, supernodes};
use crate::{BlockMatrix, Real};
use fearless_simd::Level;
use rayon::prelude::*;
use trocar_core::has_threads;

/// Products of numbers below which the children of a supernode are eliminated on one thread.
const SHARED: u64 = 1 << 20;

/// The factor L of a matrix A = P' L L' P, and its memory. P is a nested dissection.
///
/// ```
/// use glam::DMat3;
/// use trocar_sparse::{BlockMatrix, Cholesky, Level};
///
/// // Two nodes, joined and held by springs of 1 N/m.
/// let mut matrix = BlockMatrix::new(2, [(0, 1)].into_iter());
/// matrix.add(0, 0, DMat3::IDENTITY * 2.0);
/// matrix.add(1, 1, DMat3::IDENTITY * 2.0);
/// matrix.add(1, 0, -DMat3::IDENTITY);
/// let mut factor = Cholesky::<f64>::new(&matrix);
/// assert!(factor.factorise(Level::new(), matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d())));
/// let mut x = [3.0, 0.0, 0.0, 0.0, 0.0, 0.0];
/// factor.solve(Level::new(), &mut x);
/// assert!((x[0] - 2.0).abs() < 1e-12 && (x[3] - 1.0).abs() < 1e-12);
/// ```
pub struct Cholesky<T> {
    order: Vec<u32>,
    supernodes: Vec<Supernode>,
    /// Place of each of the matrix's blocks.
    places: Vec<Place>,
    /// First number of each supernode's panel; one more at the end.
    first: Vec<usize>,
    /// Products of numbers that a supernode and all below it take.
    work: Vec<u64>,
    /// The panels: columns of a supernode, its own rows and those below each filled up to whole
    /// bands.
    numbers: Vec<T>,
}

/// Where a block of the matrix is added.
#[derive(Clone, Copy)]
struct Place {
    supernode: u32,
    /// Row within the supernode: its own columns first.
    row: u32,
    column: u32,
    /// Whether the order of elimination has the block's row before its column.
    transposed: bool,
}

impl<T: Real> Cholesky<T> {
    /// Analyses the pattern of `matrix`, on the threads of the rayon pool that calls; outside of a
    /// pool the caller does all the work. Numbers follow with [`Self::factorise`].
    pub fn new(matrix: &BlockMatrix) -> Self {
        let graph = Graph::new(matrix);
        let dissected = dissect(&graph);
        let parent = elimination_tree(&graph, &dissected, &inverse(&dissected));
        let along_tree = postorder(&parent);
        let order: Vec<u32> = along_tree.iter().map(|i| dissected[*i as usize]).collect();
        let (rank, new_rank) = (inverse(&order), inverse(&along_tree));
        let parent: Vec<u32> =
            along_tree.iter().map(|i| new_rank.get(parent[*i as usize] as usize).copied().unwrap_or(NONE)).collect();
        let neighbours = |i: u32| graph.neighbours(order[i as usize]).map(|j| rank[j as usize]);
        let supernodes = supernodes(&parent, neighbours);
        let (mut first, mut work) = (vec![0], Vec::with_capacity(supernodes.len()));
        for s in &supernodes {
            let shape = Shape::of::<T>(s);
            first.push(first[first.len() - 1] + shape.len());
            let (own, below) = (shape.width as u64, 3 * s.rows.len() as u64);
            let children: u64 = s.children.iter().map(|child| work[*child as usize]).sum();
            work.push(children + own * own * own / 6 + own * own * below / 2 + own * below * below / 2);
        }
        let numbers = vec![T::default(); first[first.len() - 1]];
        let places = places(matrix, &supernodes, &rank);
        Self { order, supernodes, places, first, work, numbers }
    }

    /// The nodes in the order of elimination.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Factorises the matrix whose blocks of the lower triangle are `blocks`, column by column, in
    /// the order of [`BlockMatrix::blocks`]. Vectors of `level` are used, and the threads of the
    /// rayon pool that calls; outside of a pool the caller does all the work. The bits depend on
    /// neither. False if the matrix is not positive definite: the factor is then of no use.
    pub fn factorise(&mut self, level: Level, blocks: impl ExactSizeIterator<Item = [[T; 3]; 3]>) -> bool {
        assert_eq!(blocks.len(), self.places.len(), "the matrix has another pattern than the one analysed");
        self.numbers.fill(T::default());
        for (block, place) in blocks.zip(&self.places) {
            let supernode = place.supernode as usize;
            let shape = Shape::of::<T>(&self.supernodes[supernode]);
            let panel = &mut self.numbers[self.first[supernode]..self.first[supernode + 1]];
            let (row, column) = (shape.row(place.row as usize), 3 * place.column as usize);
            for (c, numbers) in block.iter().enumerate() {
                for (r, number) in numbers.iter().enumerate() {
                    let (r, c) = if place.transposed { (c, r) } else { (r, c) };
                    panel[shape.index::<T>(row + r, column + c)] = *number;
                }
            }
        }
        let mut numbers = std::mem::take(&mut self.numbers);
        let mut rest = &mut numbers[..];
        let mut done = true;
        for (s, supernode) in self.supernodes.iter().enumerate().filter(|(_, s)| s.rows.is_empty()) {
            let len = self.first[s + 1] - self.first[supernode.first_descendant as usize];
            let (tree, after) = std::mem::take(&mut rest).split_at_mut(len);
            done = done && self.subtree(level, s, tree).is_some();
            rest = after;
        }
        self.numbers = numbers;
        done
    }

    /// Eliminates a supernode and all below it, whose panels are given. Returns what it adds to the
    /// rows below it, by bands.
    fn subtree(&self, level: Level, s: usize, panels: &mut [T]) -> Option<Vec<T>> {
        let supernode = &self.supernodes[s];
        let shape = Shape::of::<T>(supernode);
        let (mut below, panel) = panels.split_at_mut(panels.len() - shape.len());
        let mut update = vec![T::default(); first_of_band::<T>(shape.bands_below)];
        let tasks = supernode.children.iter().map(|child| {
            let child = *child as usize;
            let first = self.supernodes[child].first_descendant as usize;
            let (own, others) = std::mem::take(&mut below).split_at_mut(self.first[child + 1] - self.first[first]);
            below = others;
            (child, own)
        });
        if supernode.children.len() > 1 && self.work[s] > SHARED && has_threads() {
            let tasks: Vec<_> = tasks.collect();
            let parts: Vec<_> =
                tasks.into_par_iter().map(|(child, own)| (child, self.subtree(level, child, own))).collect();
            for (child, part) in parts {
                self.extend_add(child, &part?, supernode, panel, &mut update);
            }
        } else {
            for (child, own) in tasks {
                let part = self.subtree(level, child, own)?;
                self.extend_add(child, &part, supernode, panel, &mut update);
            }
        }
        eliminate(level, shape.width, panel, &mut update)?;
        Some(update)
    }

    /// Adds a child's `part` to its parent's panel and update.
    fn extend_add(&self, child: usize, part: &[T], parent: &Supernode, panel: &mut [T], update: &mut [T]) {
        let shape = Shape::of::<T>(parent);
        let rows = &self.supernodes[child].rows;
        // Rows of the child's part within the parent's front: its own columns, then the rows below.
        let mut next = 0;
        let places: Vec<usize> = rows
            .iter()
            .flat_map(|row| {
                let place = if *row < parent.columns.end {
                    3 * (row - parent.columns.start) as usize
                } else {
                    next += parent.rows[next..].partition_point(|r| r < row);
                    shape.offset + 3 * next
                };
                place..place + 3
            })
            .collect();
        for (r, row) in places.iter().enumerate() {
            let from = &part[first_of_band::<T>(r / T::LANES) + r % T::LANES..];
            let own = places[..=r].partition_point(|column| *column < shape.offset);
            for (c, column) in places[..own].iter().enumerate() {
                let to = &mut panel[shape.index::<T>(*row, *column)];
                *to = *to + from[T::LANES * c];
            }
            if *row >= shape.offset {
                let row = row - shape.offset;
                let to = &mut update[first_of_band::<T>(row / T::LANES) + row % T::LANES..];
                for (c, column) in places[own..=r].iter().enumerate() {
                    let to = &mut to[T::LANES * (column - shape.offset)];
                    *to = *to + from[T::LANES * (own + c)];
                }
            }
        }
    }

    /// The panels of the factor, in the order of elimination.
    pub fn panels(&self) -> impl DoubleEndedIterator<Item = Panel<'_, T>> {
        self.supernodes.iter().zip(self.first.windows(2)).map(|(supernode, range)| Panel {
            supernode,
            shape: Shape::of::<T>(supernode),
            numbers: &self.numbers[range[0]..range[1]],
        })
    }
}

/// The columns of one supernode.
pub struct Panel<'a, T> {
    supernode: &'a Supernode,
    shape: Shape,
    numbers: &'a [T],
}

impl<T: Real> Panel<'_, T> {
    /// Its first column.
    pub fn first(&self) -> usize {
        3 * self.supernode.columns.start as usize
    }

    /// Number of its columns, a multiple of 3.
    pub fn width(&self) -> usize {
        self.shape.width
    }

    /// The rows below its columns, as nodes in the order of elimination, ascending.
    pub fn rows(&self) -> &[u32] {
        &self.supernode.rows
    }

    /// Bands of its triangle, and of the rows below.
    pub(crate) fn bands(&self) -> usize {
        self.shape.bands
    }

    pub(crate) fn bands_below(&self) -> usize {
        self.shape.bands_below
    }

    /// The numbers of a band, column by column. Those below follow those of the triangle.
    pub(crate) fn band(&self, number: usize) -> &[T] {
        &self.numbers[number * self.shape.band..(number + 1) * self.shape.band]
    }

    /// The number at `row` and `column` of its triangle.
    pub fn at(&self, row: usize, column: usize) -> T {
        self.numbers[self.shape.index::<T>(row, column)]
    }

    /// The number at `row` of the rows below, three a node, and `column`.
    pub fn below(&self, row: usize, column: usize) -> T {
        self.numbers[self.shape.index::<T>(self.shape.offset + row, column)]
    }

    /// A band of the rows below: [`Real::LANES`] rows, column by column.
    pub fn band_below(&self, number: usize) -> &[T] {
        self.band(self.bands() + number)
    }

    /// Writes the inverse of its triangle: `width` columns of `width` numbers, those above the
    /// diagonal 0.
    pub fn inverse(&self, level: Level, out: &mut Vec<T>) {
        let width = self.width();
        out.clear();
        out.resize(width * width, T::default());
        inverse_bands(level, width, self.numbers, |number, band| {
            let columns = T::LANES * number..width.min(T::LANES * (number + 1));
            for (lane, column) in columns.enumerate() {
                (column..width).for_each(|row| out[width * column + row] = band[T::LANES * row + lane]);
            }
        });
    }
}

/// Sizes of a panel.
#[derive(Clone, Copy)]
struct Shape {
    width: usize,
    /// Row at which the rows below begin.
    offset: usize,
    /// Bands of its triangle.
    bands: usize,
    bands_below: usize,
    /// Numbers of a band.
    band: usize,
}

impl Shape {
    fn of<T: Real>(supernode: &Supernode) -> Self {
        let width = 3 * supernode.columns.len();
        Self {
            width,
            offset: width.next_multiple_of(T::LANES),
            bands: width.div_ceil(T::LANES),
            bands_below: (3 * supernode.rows.len()).div_ceil(T::LANES),
            band: T::LANES * width.next_multiple_of(COLUMNS),
        }
    }

    /// Numbers of the panel.
    fn len(&self) -> usize {
        (self.bands + self.bands_below) * self.band
    }

    /// First row of a node: the supernode's own columns come first.
    fn row(&self, node: usize) -> usize {
        if 3 * node < self.width { 3 * node } else { self.offset + 3 * node - self.width }
    }

    /// Place of a number in the panel.
    #[inline(always)]
    fn index<T: Real>(&self, row: usize, column: usize) -> usize {
        row / T::LANES * self.band + T::LANES * column + row % T::LANES
    }
}

/// The inverse of a permutation.
fn inverse(order: &[u32]) -> Vec<u32> {
    let mut rank = vec![0; order.len()];
    order.iter().enumerate().for_each(|(k, i)| rank[*i as usize] = k as u32);
    rank
}

fn places(matrix: &BlockMatrix, supernodes: &[Supernode], rank: &[u32]) -> Vec<Place> {
    let place = |(i, j, _): (u32, u32, _)| {
        let (i, j): (u32, u32) = (rank[i as usize], rank[j as usize]);
        let (row, column) = (i.max(j), i.min(j));
        let supernode = supernodes.partition_point(|s| s.columns.end <= column);
        let Supernode { columns, rows, .. } = &supernodes[supernode];
        let row = if row < columns.end {
            row - columns.start
        } else {
            columns.len() as u32 + rows.partition_point(|r| *r < row) as u32
        };
        Place { supernode: supernode as u32, row, column: column - columns.start, transposed: i < j }
    };
    matrix.blocks().map(place).collect()
}
