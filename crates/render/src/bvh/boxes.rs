//! A tree of boxes and its traversal.

use super::build::{build, fit};
use super::node::{Bounds, LEAF_BIT, NO_CHILD, Node, STACK_SIZE, WIDTH};
use super::ray::Ray;
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};

/// Factor on the far distance of a box. It covers the rounding error of three operations.
const FAR_FACTOR: f32 = 1.000_000_5;

/// Nodes that remain to be visited. Reused between rays: clearing it would cost up to a quarter of
/// a traversal.
pub(crate) type Stack = [u64; STACK_SIZE];

/// Stacks for the tree over bodies and for the trees below it.
#[derive(Clone)]
pub(crate) struct Stacks {
    pub top: Stack,
    pub below: Stack,
}

impl Stacks {
    #[inline]
    pub fn new() -> Self {
        Self { top: [0; STACK_SIZE], below: [0; STACK_SIZE] }
    }
}

/// A tree of boxes. Its leaves are numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoxTree {
    pub(super) nodes: Vec<Node>,
}

/// Processes the leaves that a ray reaches. It is a trait, not a closure, because only guaranteed
/// inlining compiles the code with the machine's instruction set.
pub(crate) trait Visitor<S: Simd> {
    /// Processes a leaf. Returns the new reach; a negative reach ends the traversal.
    fn leaf(&mut self, simd: S, ray: &Ray, leaf: u32, reach: f32) -> f32;
}

impl BoxTree {
    /// Builds a tree in which each leaf is one box.
    pub fn over(bounds: &[Bounds]) -> Self {
        let mut order = Vec::new();
        let mut nodes = build(bounds, 1, &mut order);
        let of = |leaf: u32| bounds[order[leaf as usize][0] as usize];
        fit(&mut nodes, of);
        for child in nodes.iter_mut().flat_map(|n| &mut n.child).filter(|c| **c != NO_CHILD && **c & LEAF_BIT != 0) {
            *child = LEAF_BIT | order[(*child & !LEAF_BIT) as usize][0];
        }
        Self { nodes }
    }

    /// Visits the leaves below `entry` (a child of a node; `ROOT` for all) whose boxes the ray
    /// meets before `reach`, nearest first.
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
            if at & LEAF_BIT != 0 {
                reach = visitor.leaf(simd, ray, at & !LEAF_BIT, reach);
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
                    far = far.min((leave - origin[k]) * inverse[k] * FAR_FACTOR);
                }
                let mut met = near.simd_le(far).to_bitmask();
                if met != 0 {
                    let distances: [f32; WIDTH] = near.into();
                    let lane = met.trailing_zeros() as usize & (WIDTH - 1);
                    met &= met - 1;
                    let mut nearest = waiting(node.child[lane], distances[lane]);
                    let bottom = top;
                    while met != 0 {
                        let lane = met.trailing_zeros() as usize & (WIDTH - 1);
                        met &= met - 1;
                        let mut next = waiting(node.child[lane], distances[lane]);
                        if next < nearest {
                            (next, nearest) = (nearest, next);
                        }
                        // The other children are sorted as they are pushed, nearest on top.
                        let mut place = top;
                        while place > bottom && stack[(place - 1) & (STACK_SIZE - 1)] < next {
                            stack[place & (STACK_SIZE - 1)] = stack[(place - 1) & (STACK_SIZE - 1)];
                            place -= 1;
                        }
                        stack[place & (STACK_SIZE - 1)] = next;
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
                let next = stack[top & (STACK_SIZE - 1)];
                if f32::from_bits((next >> 32) as u32) <= reach {
                    at = next as u32;
                    break;
                }
            }
        }
    }
}

/// A child to be visited with the distance at which the ray enters it, packed into an integer that
/// sorts by distance. Distances are not negative.
#[inline(always)]
fn waiting(child: u32, distance: f32) -> u64 {
    u64::from(distance.to_bits()) << 32 | u64::from(child)
}
