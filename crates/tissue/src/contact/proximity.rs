//! Which vertices of a body's surface are near or inside another body, or folded tissue of their
//! own, and how far.
//!
//! A tree of boxes over each surface is fitted to its vertices. For each leaf of one tree that the
//! other tree reaches, the nearest triangle to each vertex is sought, beginning with that of the
//! vertex before. All of it is in single precision, in the other body's frame: off by some 10 nm.

use crate::body::surface::{Foot, foot};
use crate::body::tree::Aabb;
use crate::state::BodyState;
use crate::{Body, Model, State};
use glam::{Vec3, Vec3A};

/// Reach of folded tissue, over the offset.
const CLOSE: f32 = 4.0 / 3.0;

/// Distance at rest beyond which boxes of one body count as folded, over the reach. Nearer boxes
/// belong together.
const FOLDED: f32 = 2.0;

/// Distance at rest beyond which tissue that did not face itself counts as folded, over the reach.
/// Nearer tissue is the other side of it, or beside it, and only squeezed.
const OTHER_SIDE: f32 = 4.0;

/// Sine of the angle above a triangle from which a vertex faces it.
const FACING: f32 = 0.2;

/// The limits of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// Gap at which surfaces begin to press (m), or the gap at rest if that is smaller.
    pub offset: f32,
    /// Vertices deeper inside than this (m), or than this from where they were at rest if they were
    /// inside then, are left out.
    pub depth: f32,
    /// Whether bodies that collide with themselves are searched for folds.
    pub folds: bool,
}

#[cfg(test)]
impl Default for Limits {
    fn default() -> Self {
        Self { offset: 1.5e-3, depth: 5e-3, folds: false }
    }
}

/// A vertex near a triangle. Vertices by internal number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Near {
    /// The vertex's body.
    pub body: u32,
    pub vertex: u32,
    /// The triangle's body.
    pub other: u32,
    /// The triangle of its surface, and its corners.
    pub at: u32,
    pub triangle: [u32; 3],
    /// Weights of the corners at the point nearest to the vertex: 0 or more, together 1.
    pub weights: [f32; 3],
    /// Unit vector out of the other body, along the line from that point to the vertex.
    pub normal: Vec3,
    /// Signed distance along `normal` (m); negative inside.
    pub distance: f32,
    /// Distance without force (m): [`Limits::offset`], or the signed distance at rest if that is
    /// less. There is force where `distance` is below it.
    pub free: f32,
}

/// Scratch memory, and distances at rest.
#[derive(Clone, Debug)]
pub(crate) struct Proximity {
    limits: Limits,
    /// Boxes of each body's tree.
    boxes: Vec<Vec<Aabb>>,
    /// Of each ordered pair, [`Near::free`] by vertex; empty where it is the offset everywhere.
    free: Vec<Vec<f32>>,
    /// Rest positions by internal number and boxes around them, of bodies that are searched for
    /// folds.
    rest: Vec<(Vec<Vec3A>, Vec<Aabb>)>,
    /// Positions of the bodies at the last search, and their numbers of motions by then.
    seen: Vec<Vec<Vec3A>>,
    versions: Vec<u64>,
    /// The result for each ordered pair.
    known: Vec<Known>,
}

/// The result for a pair, and its reach.
#[derive(Clone, Debug, Default)]
struct Known {
    reach: f32,
    versions: [u64; 2],
    near: Vec<Near>,
}

/// A body's surface where it is now.
struct Side<'a> {
    body: &'a Body,
    x: &'a [Vec3A],
    boxes: &'a [Aabb],
}

/// The nearest triangle so far.
#[derive(Clone, Copy)]
struct Best {
    squared: f32,
    triangle: u32,
    foot: Foot,
}

impl Best {
    fn within(squared: f32) -> Self {
        Self { squared, triangle: u32::MAX, foot: Foot { weights: [0.0; 3], off: Vec3A::ZERO } }
    }
}

impl Proximity {
    /// For the bodies of `model` in their rest shapes. A body with other elements needs another
    /// one.
    pub fn new(model: &Model, limits: Limits) -> Self {
        let n = model.bodies.len();
        let rest = State::new(model).bodies;
        let mut boxes: Vec<Vec<Aabb>> =
            model.bodies.iter().map(|b| vec![Aabb::NOTHING; b.surface.tree.nodes.len()]).collect();
        for (a, body) in model.bodies.iter().enumerate() {
            body.surface.tree.refit(&rest[a].x, &mut boxes[a]);
        }
        let mut free = vec![Vec::new(); n * n];
        for a in 0..n {
            for b in (0..n).filter(|b| *b != a && model.collides(a, *b)) {
                let side = |k: usize| Side { body: &model.bodies[k], x: &rest[k].x, boxes: &boxes[k] };
                free[a * n + b] = free_at_rest(&side(a), &side(b), limits.offset);
            }
        }
        let folds = |a: usize| limits.folds && model.collides(a, a);
        let kept = |(a, s): (usize, BodyState)| if folds(a) { (s.x, boxes[a].clone()) } else { Default::default() };
        let rest = rest.into_iter().enumerate().map(kept).collect();
        let (seen, known) = (vec![Vec::new(); n], vec![Known::default(); n * n]);
        Self { limits, boxes, free, rest, seen, versions: vec![0; n], known }
    }

    /// Fits the boxes to bodies that moved.
    pub fn refit(&mut self, model: &Model, state: &[BodyState]) {
        for (a, body) in model.bodies.iter().enumerate() {
            if self.seen[a] != state[a].x {
                self.seen[a].clone_from(&state[a].x);
                self.versions[a] += 1;
                body.surface.tree.refit(&state[a].x, &mut self.boxes[a]);
            }
        }
    }

    /// Whether `reaches` holds for the middle and half the diagonal of the box around some
    /// triangles of a body and of all boxes around that.
    pub fn meets(&self, body: &Body, index: usize, reaches: &dyn Fn(Vec3A, f32) -> bool) -> bool {
        let meets = |b: &Aabb| reaches(0.5 * (b.low + b.high), 0.5 * (b.high - b.low).length());
        body.surface.tree.any(&self.boxes[index], meets)
    }

    /// Writes into `found` every vertex whose distance from another body that it may touch is
    /// between [`Limits::depth`] deeper than where it presses and `reach` of both bodies (m), with
    /// the nearest triangle; ordered by body, vertex and other body. Pairs of bodies that did not
    /// move since the last call are not examined again. It allocates only to make lists longer than
    /// before.
    pub fn find(
        &mut self,
        model: &Model,
        state: &[BodyState],
        reach: impl Fn(usize, usize) -> f32,
        found: &mut Vec<Near>,
    ) {
        found.clear();
        self.refit(model, state);
        let n = model.bodies.len();
        for a in 0..n {
            let first = found.len();
            for b in (0..n).filter(|b| model.collides(a, *b)) {
                if a == b && !self.limits.folds {
                    continue;
                }
                let reach = reach(a, b);
                let mut known = std::mem::take(&mut self.known[a * n + b]);
                let versions = [self.versions[a], self.versions[b]];
                if known.versions != versions || known.reach != reach {
                    (known.reach, known.versions) = (reach, versions);
                    known.near.clear();
                    self.find_pair(model, state, [a, b], reach, &mut known.near);
                }
                found.extend_from_slice(&known.near);
                self.known[a * n + b] = known;
            }
            found[first..].sort_unstable_by_key(|near| (near.vertex, near.other));
        }
    }

    fn find_pair(&mut self, model: &Model, state: &[BodyState], [a, b]: [usize; 2], reach: f32, found: &mut Vec<Near>) {
        let n = model.bodies.len();
        let Limits { offset, depth, .. } = self.limits;
        // Folds are not searched for deep inside, where the tissue's own surface is.
        let depth = if a == b { depth.min(reach) } else { depth };
        // Neighbouring tissue stays neighbouring at any speed.
        let close = CLOSE * offset;
        let least = self.free[a * n + b].iter().copied().fold(0.0, f32::min);
        let search = reach.max(depth - least);
        let side = |k: usize| Side { body: &model.bodies[k], x: &state[k].x, boxes: &self.boxes[k] };
        let (from, to) = (side(a), side(b));
        // From a's frame to b's.
        let shift = (from.body.origin - to.body.origin).as_vec3a();
        let Some(whole) = to.boxes.first().map(|b| b.moved(-shift, search)) else {
            return;
        };
        let free = &self.free[a * n + b];
        let (rest, rest_boxes) = &self.rest[a];
        let mut last = 0;
        from.body.surface.tree.walk(from.boxes, &whole, |leaf| {
            let owned = from.body.surface.tree.owned(&from.body.surface.tree.nodes[leaf as usize]);
            if owned.is_empty() {
                return;
            }
            let place = from.boxes[leaf as usize].moved(shift, search);
            if !to.body.surface.tree.any(to.boxes, |b| b.meets(&place)) {
                return;
            }
            let around = rest_boxes.get(leaf as usize).map(|b| b.moved(Vec3A::ZERO, FOLDED * close));
            let apart = |near: u32| around.is_none_or(|around| !rest_boxes[near as usize].meets(&around));
            for vertex in owned {
                let p = from.x[*vertex as usize] + shift;
                let mut best = Best::within(search * search);
                if a == b {
                    let skip = |t: u32| is_squeezed(from.body, rest, *vertex, t, OTHER_SIDE * close);
                    to.nearest(p, &mut best, apart, skip);
                } else {
                    // The vertices before are mostly neighbours: where they ended bounds the
                    // search.
                    to.try_triangle(last, p, &mut best);
                    to.nearest(p, &mut best, |_| true, |_| false);
                    if best.triangle != u32::MAX {
                        last = best.triangle;
                    }
                }
                let Some((normal, distance)) = to.signed(&best) else {
                    continue;
                };
                let free = free.get(*vertex as usize).copied().unwrap_or(offset);
                if distance <= reach && distance >= free.min(0.0) - depth {
                    found.push(Near {
                        body: a as u32,
                        vertex: *vertex,
                        other: b as u32,
                        at: best.triangle,
                        triangle: to.body.surface.triangles[best.triangle as usize],
                        weights: best.foot.weights,
                        normal,
                        distance,
                        free,
                    });
                }
            }
        });
    }
}

impl Side<'_> {
    fn corners(&self, t: u32) -> [Vec3A; 3] {
        self.body.surface.triangles[t as usize].map(|i| self.x[i as usize])
    }

    /// Keeps triangle `t` if it is nearer.
    fn try_triangle(&self, t: u32, p: Vec3A, best: &mut Best) {
        let foot = foot(p, self.corners(t));
        let squared = foot.off.length_squared();
        if squared < best.squared {
            *best = Best { squared, triangle: t, foot };
        }
    }

    /// Seeks the nearest triangle in leaves that `open` admits, except those to `skip`.
    #[inline]
    fn nearest(&self, p: Vec3A, best: &mut Best, open: impl Fn(u32) -> bool, skip: impl Fn(u32) -> bool) {
        let nodes = &self.body.surface.tree.nodes;
        let mut at = 0;
        while let Some(node) = nodes.get(at as usize) {
            if self.boxes[at as usize].distance_squared(p) >= best.squared {
                at = node.end;
                continue;
            }
            if node.is_leaf() && open(at) {
                for t in node.triangles() {
                    let foot = foot(p, self.corners(t));
                    let squared = foot.off.length_squared();
                    if squared < best.squared && !skip(t) {
                        *best = Best { squared, triangle: t, foot };
                    }
                }
            }
            at += 1;
        }
    }

    /// Outward normal and signed distance at the nearest triangle, if there is one.
    fn signed(&self, best: &Best) -> Option<(Vec3, f32)> {
        if best.triangle == u32::MAX {
            return None;
        }
        let (normal, distance) = self.body.surface.signed(self.x, best.triangle, &best.foot)?;
        Some((normal.into(), distance))
    }
}

/// For each vertex of `from` the signed distance from `to` at rest where it is below `offset`, and
/// `offset` elsewhere; empty if it is `offset` everywhere.
fn free_at_rest(from: &Side<'_>, to: &Side<'_>, offset: f32) -> Vec<f32> {
    let shift = (from.body.origin - to.body.origin).as_vec3a();
    let Some(whole) = to.boxes.first().map(|b| b.moved(Vec3A::ZERO, offset)) else {
        return Vec::new();
    };
    let mut free = vec![offset; from.x.len()];
    for vertex in from.body.surface.tree.nodes.iter().flat_map(|node| from.body.surface.tree.owned(node)) {
        let p = from.x[*vertex as usize] + shift;
        if whole.distance_squared(p) > 0.0 {
            continue;
        }
        let mut best = Best::within(f32::INFINITY);
        to.nearest(p, &mut best, |_| true, |_| false);
        if let Some((_, distance)) = to.signed(&best) {
            free[*vertex as usize] = distance.min(offset);
        }
    }
    if free.iter().all(|f| *f == offset) { Vec::new() } else { free }
}

/// Whether triangle `t` of a vertex's own body was within `thickness` of it at rest and did not
/// face it.
fn is_squeezed(body: &Body, rest: &[Vec3A], vertex: u32, t: u32, thickness: f32) -> bool {
    let [a, b, c] = body.surface.triangles[t as usize].map(|i| rest[i as usize]);
    let off = foot(rest[vertex as usize], [a, b, c]).off;
    let at_rest = off.length();
    at_rest < thickness && off.dot((b - a).cross(c - a).normalize_or_zero()) < FACING * at_rest
}
