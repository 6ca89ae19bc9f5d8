//! A tree of boxes over the triangles of a surface. Its shape is fixed at rest; its boxes follow
//! the vertices.
//!
//! Nodes are in preorder. Each has the node at which a walk continues if its box is missed, so that
//! a walk needs no stack.

use glam::{DVec3, Vec3A};
use std::ops::Range;

/// Greatest number of triangles of a leaf.
const MAX_LEAF_TRIANGLES: usize = 4;

/// An axis-aligned box (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Aabb {
    pub low: Vec3A,
    pub high: Vec3A,
}

/// The shape of the tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub nodes: Vec<Node>,
    /// Corners of the leaves' triangles, each once a leaf: first those that the leaf owns.
    corners: Vec<u32>,
}

/// A node. Its left child is the next one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// The node after its last descendant.
    pub end: u32,
    /// Its triangles, for a leaf; none otherwise.
    pub triangles: [u32; 2],
    /// Its range of `corners`, and the end of those that it owns. Each vertex is owned by one leaf.
    corners: [u32; 3],
}

impl Node {
    /// Whether it has triangles instead of children.
    pub fn is_leaf(&self) -> bool {
        self.triangles[0] < self.triangles[1]
    }

    /// A leaf's triangles.
    pub fn triangles(&self) -> Range<u32> {
        self.triangles[0]..self.triangles[1]
    }
}

impl Aabb {
    /// The empty box.
    pub const NOTHING: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The box moved by `shift`, and larger by `margin` on every side.
    pub fn moved(self, shift: Vec3A, margin: f32) -> Self {
        Self { low: self.low + shift - margin, high: self.high + shift + margin }
    }

    /// Whether the boxes share a point.
    #[inline]
    pub fn meets(&self, other: &Self) -> bool {
        (self.low.cmple(other.high) & other.low.cmple(self.high)).all()
    }

    /// Squared distance of a point (m2); 0 inside.
    #[inline]
    pub fn distance_squared(&self, p: Vec3A) -> f32 {
        (self.low - p).max(p - self.high).max(Vec3A::ZERO).length_squared()
    }
}

impl Tree {
    /// A tree over triangles with these middles and corners. Returns the order of the triangles,
    /// and the tree over them in that order.
    pub fn over(middles: &[DVec3], corners: &[[u32; 3]]) -> (Vec<u32>, Self) {
        let mut order: Vec<u32> = (0..middles.len() as u32).collect();
        let mut tree = Self::default();
        let vertices = corners.iter().flatten().max().map_or(0, |i| *i as usize + 1);
        if !order.is_empty() {
            tree.split(&mut order, 0, middles, corners, &mut vec![false; vertices]);
        }
        (order, tree)
    }

    /// Adds the node over `part` of the triangles, the first of which has index `first`, and its
    /// descendants. The halves have equal counts, so the depth is logarithmic.
    fn split(&mut self, part: &mut [u32], first: u32, middles: &[DVec3], corners: &[[u32; 3]], owned: &mut [bool]) {
        let at = self.nodes.len();
        self.nodes.push(Node { end: 0, triangles: [0; 2], corners: [0; 3] });
        if part.len() <= MAX_LEAF_TRIANGLES {
            // Ordered by vertex numbers, not by the split.
            part.sort_unstable();
            let mut all: Vec<u32> = part.iter().flat_map(|t| corners[*t as usize]).collect();
            all.sort_unstable();
            all.dedup();
            let start = self.corners.len() as u32;
            self.corners.extend(all.iter().filter(|i| !owned[**i as usize]));
            let own_end = self.corners.len() as u32;
            self.corners.extend(all.iter().filter(|i| owned[**i as usize]));
            all.iter().for_each(|i| owned[*i as usize] = true);
            self.nodes[at].triangles = [first, first + part.len() as u32];
            self.nodes[at].corners = [start, own_end, self.corners.len() as u32];
        } else {
            let (low, high) = part
                .iter()
                .map(|t| middles[*t as usize])
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
            let axis = (high - low).max_position();
            let half = part.len() / 2;
            part.select_nth_unstable_by(half, |a, b| {
                middles[*a as usize][axis].total_cmp(&middles[*b as usize][axis]).then(a.cmp(b))
            });
            let (left, right) = part.split_at_mut(half);
            self.split(left, first, middles, corners, owned);
            self.split(right, first + half as u32, middles, corners, owned);
        }
        self.nodes[at].end = self.nodes.len() as u32;
    }

    /// Fits the boxes to the vertices at `x`; `boxes` is as long as `nodes`.
    pub fn refit(&self, x: &[Vec3A], boxes: &mut [Aabb]) {
        for at in (0..self.nodes.len()).rev() {
            let node = &self.nodes[at];
            boxes[at] = if node.is_leaf() {
                let corners = &self.corners[node.corners[0] as usize..node.corners[2] as usize];
                corners.iter().fold(Aabb::NOTHING, |b, i| b.with(Aabb { low: x[*i as usize], high: x[*i as usize] }))
            } else {
                boxes[at + 1].with(boxes[self.nodes[at + 1].end as usize])
            };
        }
    }

    /// The vertices that a leaf owns.
    pub fn owned(&self, leaf: &Node) -> &[u32] {
        &self.corners[leaf.corners[0] as usize..leaf.corners[1] as usize]
    }

    /// Whether `meets` holds for the box of a leaf and of all nodes above it.
    #[inline]
    pub fn any(&self, boxes: &[Aabb], meets: impl Fn(&Aabb) -> bool) -> bool {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at as usize) {
            if !meets(&boxes[at as usize]) {
                at = node.end;
            } else if node.is_leaf() {
                return true;
            } else {
                at += 1;
            }
        }
        false
    }

    /// Calls `visit` for every leaf whose box meets `place`, in order.
    #[inline]
    pub fn walk(&self, boxes: &[Aabb], place: &Aabb, mut visit: impl FnMut(u32)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at as usize) {
            if !boxes[at as usize].meets(place) {
                at = node.end;
                continue;
            }
            if node.is_leaf() {
                visit(at);
            }
            at += 1;
        }
    }
}
