//! A tree of boxes, eight children a node, over eight triangles a leaf: built by obvhs, refitted when the triangles move, walked
//! by one ray against eight boxes or eight triangles at a time.
//!
//! Nothing is fused and lanes never meet, so every instruction set gives the same bits.

mod beam;
mod block;
mod build;

pub(crate) use beam::Beam;
pub(crate) use block::Hit;

use block::{Block, bounds_of, corners_of};
use build::{build, fit, whole};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};
use glam::Vec3A;

/// Children of a node, triangles of a leaf.
const WIDE: usize = 8;
/// No child.
const NONE: u32 = u32::MAX;
/// A child with this bit is a leaf.
const LEAF: u32 = 1 << 31;
/// Room for what is still to be visited: a walk leaves at most seven siblings behind on each level.
const STACK: usize = 128;
/// The entry to a whole tree.
pub(crate) const ROOT: u32 = 0;

/// What is still to be visited in a walk. Kept between rays, for to clear it would cost as much as a quarter of a walk.
pub(crate) type Stack = [u64; STACK];

/// Stacks for a tree of bodies and the trees below it.
#[derive(Clone)]
pub(crate) struct Stacks {
    pub top: Stack,
    pub below: Stack,
}

impl Stacks {
    #[inline]
    pub fn new() -> Self {
        Self { top: [0; STACK], below: [0; STACK] }
    }
}
/// Deeper trees, which only hostile meshes give, are built anew without looking at the boxes.
const DEEPEST: usize = STACK / (WIDE - 1) - 1;
/// Growth of the far end of boxes: covers the rounding of three operations.
const FAR: f32 = 1.000_000_5;

/// A ray, prepared for the walk. The direction needs no unit length; distances are in its units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub origin: Vec3A,
    pub direction: Vec3A,
    inverse: [f32; 3],
    /// Which of a node's six bounds is met first on each axis, and which last.
    near: [usize; 3],
    far: [usize; 3],
    /// The axis along which the ray runs most, and the two others.
    axes: [usize; 3],
    /// The shear that makes that axis the ray's own.
    shear: [f32; 3],
}

/// Boxes of the children, by bound (low x y z, high x y z).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Node {
    bounds: [[f32; WIDE]; 6],
    child: [u32; WIDE],
}

/// The tree of boxes alone; leaves are numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Boxes {
    nodes: Vec<Node>,
}

/// The tree over triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    boxes: Boxes,
    blocks: Vec<Block>,
}

/// What is done at the leaves that a ray comes to. A trait and no closure: only what is inlined for certain is compiled with the
/// machine's instructions.
pub(crate) trait Visitor<S: Simd> {
    /// Sees a leaf; gives the new reach, negative to end the walk.
    fn leaf(&mut self, simd: S, ray: &Ray, leaf: u32, reach: f32) -> f32;
}

/// Looks for the first triangle.
struct Nearest<'a> {
    blocks: &'a [Block],
    best: Option<Hit>,
}

/// Looks for any triangle.
struct Any<'a> {
    blocks: &'a [Block],
    found: bool,
}

/// An axis-aligned box; empty where low is above high.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub low: Vec3A,
    pub high: Vec3A,
}

impl Bounds {
    pub const EMPTY: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    /// Half the surface [m2].
    #[inline]
    pub fn half_area(&self) -> f32 {
        let d = self.high - self.low;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Grown by a point; one that is no number changes nothing.
    #[inline]
    pub fn with(self, p: Vec3A) -> Self {
        if p.is_finite() { Self { low: self.low.min(p), high: self.high.max(p) } } else { self }
    }
}

impl Ray {
    pub fn new(origin: Vec3A, direction: Vec3A) -> Self {
        let d = direction.to_array();
        let inverse = d.map(|c| 1.0 / if c.abs() < 1e-30 { 1e-30_f32.copysign(c) } else { c });
        let near = [0, 1, 2].map(|k| if inverse[k] < 0.0 { k + 3 } else { k });
        let far = [0, 1, 2].map(|k| if inverse[k] < 0.0 { k } else { k + 3 });
        let z = (0..3).fold(0, |best, k| if d[k].abs() > d[best].abs() { k } else { best });
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let shear = [d[x] * inverse[z], d[y] * inverse[z], inverse[z]];
        Self { origin, direction, inverse, near, far, axes: [x, y, z], shear }
    }
}

impl Boxes {
    /// A tree over boxes with one of them a leaf.
    pub fn over(bounds: &[Bounds]) -> Self {
        let mut order = Vec::new();
        let mut nodes = build(bounds, 1, &mut order);
        let of = |leaf: u32| bounds[order[leaf as usize][0] as usize];
        fit(&mut nodes, of);
        for child in nodes.iter_mut().flat_map(|n| &mut n.child).filter(|c| **c != NONE && **c & LEAF != 0) {
            *child = LEAF | order[(*child & !LEAF) as usize][0];
        }
        Self { nodes }
    }

    /// Has `visitor` see the leaves below `entry` (a child of some node; [`ROOT`] for all) whose boxes the ray meets before
    /// `reach`, the nearer first.
    #[inline(always)]
    pub fn walk<S: Simd, V: Visitor<S>>(
        &self,
        simd: S,
        ray: &Ray,
        entry: u32,
        mut reach: f32,
        stack: &mut Stack,
        visitor: &mut V,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let [ox, oy, oz] = ray.origin.to_array();
        let origin = [f32x8::splat(simd, ox), f32x8::splat(simd, oy), f32x8::splat(simd, oz)];
        let [ix, iy, iz] = ray.inverse;
        let inverse = [f32x8::splat(simd, ix), f32x8::splat(simd, iy), f32x8::splat(simd, iz)];
        let mut top = 0;
        let mut at = entry;
        loop {
            if at & LEAF != 0 {
                reach = visitor.leaf(simd, ray, at & !LEAF, reach);
                if reach < 0.0 {
                    return;
                }
            } else {
                let node = &self.nodes[at as usize];
                let mut near = f32x8::splat(simd, 0.0);
                let mut far = f32x8::splat(simd, reach);
                for k in 0..3 {
                    let enter = f32x8::from_slice(simd, &node.bounds[ray.near[k]]);
                    let leave = f32x8::from_slice(simd, &node.bounds[ray.far[k]]);
                    near = near.max((enter - origin[k]) * inverse[k]);
                    far = far.min((leave - origin[k]) * inverse[k] * FAR);
                }
                let mut met = near.simd_le(far).to_bitmask();
                if met != 0 {
                    let distances: [f32; WIDE] = near.into();
                    let lane = met.trailing_zeros() as usize & (WIDE - 1);
                    met &= met - 1;
                    let mut nearest = waiting(node.child[lane], distances[lane]);
                    let bottom = top;
                    while met != 0 {
                        let lane = met.trailing_zeros() as usize & (WIDE - 1);
                        met &= met - 1;
                        let mut next = waiting(node.child[lane], distances[lane]);
                        if next < nearest {
                            (next, nearest) = (nearest, next);
                        }
                        // The others are sorted as they come, the nearest on top.
                        let mut place = top;
                        while place > bottom && stack[(place - 1) & (STACK - 1)] < next {
                            stack[place & (STACK - 1)] = stack[(place - 1) & (STACK - 1)];
                            place -= 1;
                        }
                        stack[place & (STACK - 1)] = next;
                        top += 1;
                    }
                    at = nearest as u32;
                    continue;
                }
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let next = stack[top & (STACK - 1)];
                if f32::from_bits((next >> 32) as u32) <= reach {
                    at = next as u32;
                    break;
                }
            }
        }
    }
}

/// A child to be visited, and where the ray enters it; as whole numbers they sort by distance, for it is not negative.
#[inline(always)]
fn waiting(child: u32, distance: f32) -> u64 {
    u64::from(distance.to_bits()) << 32 | u64::from(child)
}

impl Tree {
    /// A tree over the triangles whose corners are all there and finite; `corners` of a mesh that will move should be its rest
    /// shape.
    pub fn new(positions: &[Vec3A], triangles: &[[u32; 3]]) -> Self {
        let bounds: Vec<Bounds> = triangles.iter().map(|t| bounds_of(positions, t).unwrap_or(Bounds::EMPTY)).collect();
        let mut order = Vec::new();
        let nodes = build(&bounds, WIDE, &mut order);
        let blocks = order.iter().map(|leaf| {
            let triangle = std::array::from_fn(|lane| leaf.get(lane).copied().unwrap_or(NONE));
            Block { corners: [[[f32::NAN; WIDE]; 3]; 3], triangle }
        });
        let mut tree = Self { blocks: blocks.collect(), boxes: Boxes { nodes } };
        tree.refit(positions, triangles);
        tree
    }

    /// Follows the corners to where they are now. The tree's shape stays: it serves as long as neighbours stay neighbours.
    pub fn refit(&mut self, positions: &[Vec3A], triangles: &[[u32; 3]]) {
        let Self { boxes, blocks } = self;
        fit(&mut boxes.nodes, |leaf| {
            let block = &mut blocks[leaf as usize];
            let mut bounds = Bounds::EMPTY;
            for lane in 0..WIDE {
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

    /// The box of all triangles.
    pub fn bounds(&self) -> Bounds {
        self.boxes.nodes.first().map_or(Bounds::EMPTY, whole)
    }

    /// Entries that together hold all triangles, at most `most` (but a node's children stay together), with their boxes: the
    /// largest boxes are opened first.
    pub fn entries(&self, most: usize) -> Vec<(u32, Bounds)> {
        let mut open = vec![(ROOT, self.bounds())];
        loop {
            let inner = (0..open.len()).filter(|i| open[*i].0 & LEAF == 0);
            let Some(widest) = inner.max_by(|a, b| open[*a].1.half_area().total_cmp(&open[*b].1.half_area())) else {
                return open;
            };
            let Some(node) = self.boxes.nodes.get(open[widest].0 as usize) else { return Vec::new() };
            let children = || (0..WIDE).filter(|lane| node.child[*lane] != NONE);
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

    /// See [`Boxes::narrow`].
    pub fn narrow(&self, beam: &Beam, entry: u32, near: f32, found: impl FnMut(f32, u32)) {
        self.boxes.narrow(beam, entry, near, found);
    }

    /// Leaves of the tree.
    pub fn leaves(&self) -> usize {
        self.blocks.len()
    }

    /// The first triangle below `entry` that the ray meets before `reach`.
    #[inline(always)]
    pub fn first<S: Simd>(&self, simd: S, ray: &Ray, entry: u32, reach: f32, stack: &mut Stack) -> Option<Hit> {
        let mut nearest = Nearest { blocks: &self.blocks, best: None };
        self.boxes.walk(simd, ray, entry, reach, stack, &mut nearest);
        nearest.best
    }

    /// Whether the ray meets anything below `entry` before `reach`.
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

#[cfg(test)]
mod tests;
