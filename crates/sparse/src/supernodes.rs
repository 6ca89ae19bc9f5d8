//! Supernodes: runs of columns with the same rows below them, which dense kernels treat as one.

use crate::Real;
use crate::graph::{Graph, NONE};
use std::ops::Range;

/// Rows and columns of a tile. Fronts are stored, and a factor in single precision is read, in
/// vectors of so many numbers: those that fill up the last one cost what others cost.
const TILE_SIZE: usize = f32::LANES;

/// A supernode is merged with its parent in the elimination tree if both together have at most this
/// many tiles more than apart. That is what the work on another supernode costs. (Ashcraft and
/// Grimes, "The influence of relaxed supernode partitions on the multifrontal method", 1989.)
const MERGED_TILES: usize = 3;

/// A run of columns of the factor.
#[derive(Clone, Debug)]
pub(crate) struct Supernode {
    /// Its columns, as nodes in the order of elimination.
    pub columns: Range<u32>,
    /// The rows below its columns, as nodes in the order of elimination, ascending.
    pub rows: Vec<u32>,
    /// The supernodes whose parent it is, ascending.
    pub children: Vec<u32>,
    /// The first supernode of its subtree: those from there to itself.
    pub first_descendant: u32,
}

/// Parent of each node in the elimination tree (Liu, "The role of elimination trees in sparse
/// factorisation", 1990). `order` lists nodes as they are eliminated, `rank` is its inverse; nodes
/// of the tree are ranks.
pub(crate) fn elimination_tree(graph: &Graph, order: &[u32], rank: &[u32]) -> Vec<u32> {
    let mut parent = vec![NONE; order.len()];
    let mut ancestor = vec![NONE; order.len()];
    for (i, node) in order.iter().enumerate() {
        for neighbour in graph.neighbours(*node) {
            let mut k = rank[neighbour as usize];
            while k < i as u32 {
                let next = std::mem::replace(&mut ancestor[k as usize], i as u32);
                if next == NONE {
                    parent[k as usize] = i as u32;
                }
                k = next;
            }
        }
    }
    parent
}

/// The nodes of a tree, children before parents, each subtree in one piece.
pub(crate) fn postorder(parent: &[u32]) -> Vec<u32> {
    let mut children = vec![Vec::new(); parent.len()];
    let mut stack = Vec::new();
    for i in (0..parent.len()).rev() {
        match parent[i] {
            NONE => stack.push(i as u32),
            p => children[p as usize].push(i as u32),
        }
    }
    let mut order = Vec::with_capacity(parent.len());
    while let Some(i) = stack.pop() {
        // A node is seen twice: before its children, and, without any, after them.
        let below = std::mem::take(&mut children[i as usize]);
        if below.is_empty() {
            order.push(i);
        } else {
            stack.push(i);
            stack.extend(below);
        }
    }
    order
}

/// The supernodes of a tree whose numbering is a postorder. `neighbours` lists the nodes next to a
/// node, all as ranks.
pub(crate) fn supernodes<'a, I: Iterator<Item = u32> + 'a>(
    parent: &[u32],
    neighbours: impl Fn(u32) -> I,
) -> Vec<Supernode> {
    let counts = column_counts(parent, &neighbours);
    let ends = merge(parent, &counts, &fundamental_ends(parent, &counts));
    let mut of = vec![0; parent.len()];
    let mut list: Vec<Supernode> = Vec::with_capacity(ends.len());
    let mut begin = 0;
    for end in ends {
        of[begin as usize..end as usize].fill(list.len() as u32);
        list.push(Supernode {
            columns: begin..end,
            rows: Vec::new(),
            children: Vec::new(),
            first_descendant: list.len() as u32,
        });
        begin = end;
    }
    let mut seen = vec![NONE; parent.len()];
    for s in 0..list.len() {
        let columns = list[s].columns.clone();
        let mut rows = Vec::new();
        let mut visit = |i: u32| {
            if i >= columns.end && seen[i as usize] != s as u32 {
                seen[i as usize] = s as u32;
                rows.push(i);
            }
        };
        columns.clone().for_each(|column| neighbours(column).for_each(&mut visit));
        list[s].children.iter().for_each(|child| list[*child as usize].rows.iter().copied().for_each(&mut visit));
        rows.sort_unstable();
        if let Some(first) = rows.first() {
            let above = of[*first as usize] as usize;
            let descendant = list[s].first_descendant;
            list[above].children.push(s as u32);
            list[above].first_descendant = list[above].first_descendant.min(descendant);
        }
        list[s].rows = rows;
    }
    list
}

/// Nodes in each column of the factor, the diagonal included: those of row i are on the ways up the
/// tree from its neighbours to i.
pub(crate) fn column_counts<I: Iterator<Item = u32>>(parent: &[u32], neighbours: &impl Fn(u32) -> I) -> Vec<u32> {
    let mut counts = vec![1; parent.len()];
    let mut seen = vec![NONE; parent.len()];
    for i in 0..parent.len() as u32 {
        seen[i as usize] = i;
        for mut k in neighbours(i).filter(|k| *k < i) {
            while seen[k as usize] != i {
                seen[k as usize] = i;
                counts[k as usize] += 1;
                k = parent[k as usize];
            }
        }
    }
    counts
}

/// Ends of the runs of columns whose rows are those of the column before, without its diagonal.
fn fundamental_ends(parent: &[u32], counts: &[u32]) -> Vec<u32> {
    let n = parent.len() as u32;
    let continues = |j: u32| parent[j as usize] == j + 1 && counts[j as usize] == counts[j as usize + 1] + 1;
    (0..n).filter(|j| j + 1 == n || !continues(*j)).map(|j| j + 1).collect()
}

/// Tiles of a run of columns that have `height` rows, the diagonal included; all in nodes.
fn tiles(columns: usize, height: usize) -> usize {
    let [width, below] = [columns, height - columns].map(|nodes| (3 * nodes).div_ceil(TILE_SIZE));
    width * (width + 1) / 2 + width * below
}

/// Merges runs with their parents where that costs few tiles; the ends of all runs.
fn merge(parent: &[u32], counts: &[u32], ends: &[u32]) -> Vec<u32> {
    /// A run of columns that may still grow.
    struct Run {
        begin: u32,
        end: u32,
        /// Rows of its first column.
        height: usize,
    }
    let size = |run: &Run| tiles((run.end - run.begin) as usize, run.height);
    let mut merged: Vec<Run> = Vec::with_capacity(ends.len());
    // From the root down, so that the run after one is its parent as merged, if it is the parent at
    // all. `merged` has the later runs, the next one last.
    for k in (0..ends.len()).rev() {
        let (begin, end) = (if k == 0 { 0 } else { ends[k - 1] }, ends[k]);
        let run = Run { begin, end, height: counts[begin as usize] as usize };
        let up = parent[end as usize - 1];
        if let Some(next) = merged.last_mut().filter(|next| up != NONE && up < next.end) {
            let both = Run { begin, end: next.end, height: next.height + (end - begin) as usize };
            if size(&both) <= size(&run) + size(next) + MERGED_TILES {
                *next = both;
                continue;
            }
        }
        merged.push(run);
    }
    merged.iter().rev().map(|run| run.end).collect()
}
