//! A tree over triangles.

use super::beam::Beam;
use super::block::{Block, Hit, bounds_of, corners_of};
use super::boxes::{BoxTree, Stack, Visitor};
use super::build::{bounds_of_node, build, fit};
use super::node::{Bounds, LEAF_BIT, NO_CHILD, ROOT, WIDTH};
use super::ray::Ray;
use fearless_simd::Simd;
use glam::Vec3A;

/// A tree over triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct TriangleTree {
    boxes: BoxTree,
    blocks: Vec<Block>,
}

/// Searches the first triangle.
struct Nearest<'a> {
    blocks: &'a [Block],
    best: Option<Hit>,
}

/// Searches any triangle.
struct Any<'a> {
    blocks: &'a [Block],
    found: bool,
}

impl TriangleTree {
    /// Builds a tree over the triangles with finite corners. For a mesh that deforms, `positions`
    /// should be its rest shape.
    pub fn new(positions: &[Vec3A], triangles: &[[u32; 3]]) -> Self {
        let bounds: Vec<Bounds> = triangles.iter().map(|t| bounds_of(positions, t).unwrap_or(Bounds::EMPTY)).collect();
        let mut order = Vec::new();
        let nodes = build(&bounds, WIDTH, &mut order);
        let blocks = order.iter().map(|leaf| {
            let triangle = std::array::from_fn(|lane| leaf.get(lane).copied().unwrap_or(NO_CHILD));
            Block { corners: [[[f32::NAN; WIDTH]; 3]; 3], triangle }
        });
        let mut tree = Self { blocks: blocks.collect(), boxes: BoxTree { nodes } };
        tree.refit(positions, triangles);
        tree
    }

    /// Moves the triangles to new positions. The topology of the tree stays; it remains efficient
    /// as long as neighbours remain neighbours.
    pub fn refit(&mut self, positions: &[Vec3A], triangles: &[[u32; 3]]) {
        let Self { boxes, blocks } = self;
        fit(&mut boxes.nodes, |leaf| {
            let block = &mut blocks[leaf as usize];
            let mut bounds = Bounds::EMPTY;
            for lane in 0..WIDTH {
                let corners = triangles.get(block.triangle[lane] as usize).and_then(|t| corners_of(positions, t));
                for (c, p) in corners.unwrap_or([Vec3A::NAN; 3]).into_iter().enumerate() {
                    bounds = bounds.with(p);
                    for k in 0..3 {
                        block.corners[c][k][lane] = p[k];
                    }
                }
            }
            bounds
        });
    }

    /// All triangles, neighbours after each other.
    pub fn order(&self) -> impl Iterator<Item = u32> + '_ {
        self.blocks.iter().flat_map(|b| b.triangle).filter(|t| *t != NO_CHILD)
    }

    /// The box of all triangles.
    pub fn bounds(&self) -> Bounds {
        self.boxes.nodes.first().map_or(Bounds::EMPTY, bounds_of_node)
    }

    /// At most `most` entry nodes (the children of one node stay together) that together contain
    /// all triangles, with their boxes. The largest boxes are opened first.
    pub fn entries(&self, most: usize) -> Vec<(u32, Bounds)> {
        let mut open = vec![(ROOT, self.bounds())];
        loop {
            let inner = (0..open.len()).filter(|i| open[*i].0 & LEAF_BIT == 0);
            let Some(widest) = inner.max_by(|a, b| open[*a].1.half_area().total_cmp(&open[*b].1.half_area())) else {
                return open;
            };
            let Some(node) = self.boxes.nodes.get(open[widest].0 as usize) else { return Vec::new() };
            let children = || (0..WIDTH).filter(|lane| node.child[*lane] != NO_CHILD);
            if open.len() + children().count() > most + 1 {
                return open;
            }
            open.swap_remove(widest);
            open.extend(children().map(|lane| {
                let bound = |k: usize| node.bounds[k][lane];
                let low = Vec3A::new(bound(0), bound(1), bound(2));
                (node.child[lane], Bounds { low, high: Vec3A::new(bound(3), bound(4), bound(5)) })
            }));
        }
    }

    /// See [`BoxTree::narrow`].
    pub fn narrow(&self, beam: &Beam, entry: u32, near: f32, found: impl FnMut(f32, u32)) {
        self.boxes.narrow(beam, entry, near, found);
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        self.blocks.len()
    }

    /// First triangle below `entry` that the ray meets before `reach`.
    #[inline(always)]
    pub fn first<S: Simd>(&self, simd: S, ray: &Ray, entry: u32, reach: f32, stack: &mut Stack) -> Option<Hit> {
        let mut nearest = Nearest { blocks: &self.blocks, best: None };
        self.boxes.walk(simd, ray, entry, reach, stack, &mut nearest);
        nearest.best
    }

    /// Whether the ray meets any triangle below `entry` before `reach`.
    #[inline(always)]
    pub fn any<S: Simd>(&self, simd: S, ray: &Ray, entry: u32, reach: f32, stack: &mut Stack) -> bool {
        let mut any = Any { blocks: &self.blocks, found: false };
        self.boxes.walk(simd, ray, entry, reach, stack, &mut any);
        any.found
    }
}

impl<S: Simd> Visitor<S> for Nearest<'_> {
    #[inline(always)]
    fn leaf(&mut self, simd: S, ray: &Ray, leaf: u32, reach: f32) -> f32 {
        match self.blocks[leaf as usize].meet(simd, ray, reach) {
            Some(hit) => {
                self.best = Some(hit);
                hit.t
            }
            None => reach,
        }
    }
}

impl<S: Simd> Visitor<S> for Any<'_> {
    #[inline(always)]
    fn leaf(&mut self, simd: S, ray: &Ray, leaf: u32, reach: f32) -> f32 {
        self.found = self.blocks[leaf as usize].meet(simd, ray, reach).is_some();
        if self.found { -1.0 } else { reach }
    }
}
