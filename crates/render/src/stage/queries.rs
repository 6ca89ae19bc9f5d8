//! Ray queries on a stage: first hit or any hit, of a single ray or of a bundle from one origin.

use super::model::{BodyId, Stage, StageHit};
use crate::bvh::{Beam, ROOT, Ray, Stack, Stacks, Visitor};
use fearless_simd::{Simd, dispatch};
use glam::{Vec3, Vec3A};

/// Result of [`Stage::cast`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Ray parameter, in units of the ray's direction.
    pub t: f32,
    /// The body that was hit.
    pub body: BodyId,
    /// Index among the triangles of its shape.
    pub triangle: u32,
}

/// Candidates for a bundle of rays from one origin.
#[derive(Debug, Default)]
pub(crate) struct BundleCandidates {
    leaves: Vec<(f32, u32)>,
    /// The bundle in the frames of bodies whose pose is not the identity.
    beams: Vec<(u32, Beam)>,
    /// Minimum distance, body, and entry node of its shape's tree; nearest first.
    parts: Vec<(f32, u32, u32)>,
}

impl Stage {
    /// First surface along a ray; `None` if there is none. `direction` can have any length.
    pub fn cast(&mut self, origin: Vec3, direction: Vec3) -> Option<RayHit> {
        self.update_acceleration();
        let hit = self.first(origin.into(), direction.into(), f32::INFINITY, &mut Stacks::new())?;
        Some(RayHit { t: hit.t, body: BodyId(hit.body as usize), triangle: hit.triangle })
    }

    /// First surface along a ray.
    pub(crate) fn first(&self, origin: Vec3A, direction: Vec3A, reach: f32, stacks: &mut Stacks) -> Option<StageHit> {
        dispatch!(self.level, simd => self.first_in(simd, origin, direction, reach, stacks))
    }

    /// Collects the candidates for rays from `origin` in any of `directions`, for
    /// [`Self::first_of_bundle`] and [`Self::bundle_blocked`].
    pub(crate) fn collect_bundle(&self, origin: Vec3A, directions: &[Vec3A], candidates: &mut BundleCandidates) {
        let BundleCandidates { leaves, beams, parts } = candidates;
        parts.clear();
        beams.clear();
        if directions.is_empty() {
            leaves.clear();
            return;
        }
        let world = Beam::new(origin, directions.iter().copied());
        self.top.beam(&world, leaves);
        for (near, leaf) in leaves.iter() {
            let (index, entry) = self.entries[*leaf as usize];
            let body = &self.bodies[index as usize];
            let found = |near: f32, entry: u32| parts.push((near, index, entry));
            let tree = &self.shapes[body.shape].tree;
            if body.is_identity {
                tree.narrow(&world, entry, *near, found);
                continue;
            }
            let at = beams.iter().position(|(b, _)| *b == index).unwrap_or_else(|| {
                let local = directions.iter().map(|d| body.inverse_rotation * *d);
                beams.push((index, Beam::new(body.inverse_rotation * (origin - body.translation), local)));
                beams.len() - 1
            });
            tree.narrow(&beams[at].1, entry, *near, found);
        }
        parts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    }

    /// Keeps only the candidates whose body `counts`.
    pub(crate) fn retain(candidates: &mut BundleCandidates, counts: impl Fn(usize) -> bool) {
        candidates.parts.retain(|(_, body, _)| counts(*body as usize));
    }

    /// Whether the shadows in a box may have changed: a body that `moves` may lie between a lamp
    /// and the box.
    pub(crate) fn shaded_anew(
        &self,
        shown: Option<[Vec3A; 2]>,
        moves: impl Fn(usize) -> bool,
        candidates: &mut BundleCandidates,
    ) -> bool {
        let Some([low, high]) = shown else { return false };
        let leaves = &mut candidates.leaves;
        self.lamps().iter().any(|lamp| {
            let origin = lamp.centre();
            self.top.beam(&Beam::new(origin, [low - origin, high - origin].into_iter()), leaves);
            // A distance that is not a number may be any.
            let before = |near: f32| near.is_nan() || near <= 1.0;
            leaves.iter().any(|(near, leaf)| before(*near) && moves(self.entries[*leaf as usize].0 as usize))
        })
    }

    /// First surface along one ray of a bundle for which [`Self::collect_bundle`] was called.
    pub(crate) fn first_of_bundle(
        &self,
        candidates: &BundleCandidates,
        origin: Vec3A,
        direction: Vec3A,
        stacks: &mut Stacks,
    ) -> Option<StageHit> {
        dispatch!(self.level, simd => self.first_of_bundle_in(simd, candidates, origin, direction, stacks))
    }

    #[inline(always)]
    fn first_of_bundle_in<S: Simd>(
        &self,
        simd: S,
        candidates: &BundleCandidates,
        origin: Vec3A,
        direction: Vec3A,
        stacks: &mut Stacks,
    ) -> Option<StageHit> {
        let ray = Ray::new(origin, direction);
        let mut reach = f32::INFINITY;
        let mut best = None;
        let (mut last, mut local) = (u32::MAX, ray);
        for (near, index, entry) in &candidates.parts {
            if *near > reach {
                break;
            }
            let body = &self.bodies[*index as usize];
            if *index != last {
                (last, local) = (*index, body.local(&ray));
            }
            if let Some(hit) = self.shapes[body.shape].tree.first(simd, &local, *entry, reach, &mut stacks.below) {
                reach = hit.t;
                best = Some(StageHit { t: hit.t, body: *index, triangle: hit.triangle, u: hit.u, v: hit.v });
            }
        }
        best
    }

    /// Whether a surface lies before `reach` on one ray of a bundle for which
    /// [`Self::collect_bundle`] was called.
    pub(crate) fn bundle_blocked(
        &self,
        candidates: &BundleCandidates,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> bool {
        dispatch!(self.level, simd => self.bundle_blocked_in(simd, candidates, origin, direction, reach, stacks))
    }

    #[inline(always)]
    fn bundle_blocked_in<S: Simd>(
        &self,
        simd: S,
        candidates: &BundleCandidates,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> bool {
        let ray = Ray::new(origin, direction);
        let (mut last, mut local) = (u32::MAX, ray);
        for (near, index, entry) in &candidates.parts {
            if *near > reach {
                break;
            }
            let body = &self.bodies[*index as usize];
            if *index != last {
                (last, local) = (*index, body.local(&ray));
            }
            if self.shapes[body.shape].tree.any(simd, &local, *entry, reach, &mut stacks.below) {
                return true;
            }
        }
        false
    }

    /// Whether a surface lies on the ray before `reach`.
    pub(crate) fn blocked(&self, origin: Vec3A, direction: Vec3A, reach: f32, stacks: &mut Stacks) -> bool {
        dispatch!(self.level, simd => self.blocked_in(simd, origin, direction, reach, stacks))
    }

    /// First surface of one body along a ray.
    pub(crate) fn first_of(
        &self,
        body: u32,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> Option<StageHit> {
        let held = &self.bodies[body as usize];
        let ray = held.local(&Ray::new(origin, direction));
        let tree = &self.shapes[held.shape].tree;
        let hit = dispatch!(self.level, simd => tree.first(simd, &ray, ROOT, reach, &mut stacks.below))?;
        Some(StageHit { t: hit.t, body, triangle: hit.triangle, u: hit.u, v: hit.v })
    }

    #[inline(always)]
    fn first_in<S: Simd>(
        &self,
        simd: S,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> Option<StageHit> {
        let Stacks { top, below } = stacks;
        let mut nearest = Nearest { stage: self, stack: below, best: None };
        self.top.walk(simd, &Ray::new(origin, direction), ROOT, reach, top, &mut nearest);
        nearest.best
    }

    #[inline(always)]
    fn blocked_in<S: Simd>(&self, simd: S, origin: Vec3A, direction: Vec3A, reach: f32, stacks: &mut Stacks) -> bool {
        let Stacks { top, below } = stacks;
        let mut any = Any { stage: self, stack: below, found: false };
        self.top.walk(simd, &Ray::new(origin, direction), ROOT, reach, top, &mut any);
        any.found
    }
}

/// Searches the first surface of all bodies.
struct Nearest<'a> {
    stage: &'a Stage,
    stack: &'a mut Stack,
    best: Option<StageHit>,
}

/// Searches any surface.
struct Any<'a> {
    stage: &'a Stage,
    stack: &'a mut Stack,
    found: bool,
}

impl<S: Simd> Visitor<S> for Nearest<'_> {
    #[inline(always)]
    fn leaf(&mut self, simd: S, ray: &Ray, leaf: u32, reach: f32) -> f32 {
        let (index, entry) = self.stage.entries[leaf as usize];
        let body = &self.stage.bodies[index as usize];
        let tree = &self.stage.shapes[body.shape].tree;
        let hit = if body.is_identity {
            tree.first(simd, ray, entry, reach, self.stack)
        } else {
            tree.first(simd, &body.local(ray), entry, reach, self.stack)
        };
        match hit {
            Some(hit) => {
                self.best = Some(StageHit { t: hit.t, body: index, triangle: hit.triangle, u: hit.u, v: hit.v });
                hit.t
            }
            None => reach,
        }
    }
}

impl<S: Simd> Visitor<S> for Any<'_> {
    #[inline(always)]
    fn leaf(&mut self, simd: S, ray: &Ray, leaf: u32, reach: f32) -> f32 {
        let (index, entry) = self.stage.entries[leaf as usize];
        let body = &self.stage.bodies[index as usize];
        let tree = &self.stage.shapes[body.shape].tree;
        self.found = tree.any(simd, &body.local(ray), entry, reach, self.stack);
        if self.found { -1.0 } else { reach }
    }
}
