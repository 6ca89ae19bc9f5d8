//! The tree of a packed factor's supernodes: the parent of a supernode has its first row below.

use super::supernode::Supernode;
use std::ops::Range;

/// Parent of a root.
const NONE: u32 = u32::MAX;

/// The tree of supernodes. They are in the order of elimination, children before their parent.
#[derive(Default)]
pub(super) struct Tree {
    /// First number of each supernode; one more at the end.
    numbers: Vec<u32>,
    parents: Vec<u32>,
    pub children: Vec<Vec<usize>>,
    pub roots: Vec<usize>,
    /// The first supernode of each subtree: the subtree is all from it on.
    pub first: Vec<usize>,
    /// Tiles of each supernode, and of its subtree.
    pub own: Vec<usize>,
    pub all: Vec<usize>,
}

impl Tree {
    /// The tree of `supernodes`, whose rows below the diagonal are the numbers `rows`, first of
    /// three each, and which have `tiles` in all.
    pub fn new(supernodes: &[Supernode], rows: &[u32], tiles: usize) -> Self {
        let count = supernodes.len();
        let ends = supernodes.iter().skip(1).map(|s| s.tiles).chain([tiles]);
        let own: Vec<usize> = supernodes.iter().zip(ends).map(|(s, end)| end - s.tiles).collect();
        let mut numbers: Vec<u32> = supernodes.iter().map(|s| s.first as u32).collect();
        numbers.extend(supernodes.last().map(|s| (s.first + s.width) as u32));
        let mut tree = Self {
            numbers,
            parents: vec![NONE; count],
            children: vec![Vec::new(); count],
            roots: Vec::new(),
            first: (0..count).collect(),
            all: own.clone(),
            own,
        };
        for (k, s) in supernodes.iter().enumerate() {
            let Some(row) = rows[s.rows.clone()].first() else {
                tree.roots.push(k);
                continue;
            };
            let parent = tree.supernode_of(*row as usize);
            tree.parents[k] = parent as u32;
            tree.children[parent].push(k);
            tree.first[parent] = tree.first[parent].min(tree.first[k]);
            tree.all[parent] += tree.all[k];
        }
        tree
    }

    /// The supernode of a number of the vector.
    pub fn supernode_of(&self, number: usize) -> usize {
        self.numbers.partition_point(|first| *first as usize <= number) - 1
    }

    /// The numbers of a supernode.
    pub fn numbers(&self, supernode: usize) -> Range<usize> {
        self.numbers[supernode] as usize..self.numbers[supernode + 1] as usize
    }

    /// The parent of a supernode; None of a root.
    pub fn parent(&self, supernode: usize) -> Option<usize> {
        Some(self.parents[supernode]).filter(|parent| *parent != NONE).map(|parent| parent as usize)
    }
}
