//! What rays meet on the stage: the first surface or any, of one ray or of a bundle from one place.

use super::{BodyId, RayHit, Stage, Touch};
use crate::tree::{Beam, ROOT, Ray, Stack, Stacks, Visitor};
use fearless_simd::{Simd, dispatch};
use glam::{Vec3, Vec3A};

/// What a bundle of rays from one place may meet.
#[derive(Debug, Default)]
pub(crate) struct Ahead {
    leaves: Vec<(f32, u32)>,
    /// The bundle in the frames of bodies that are not still.
    beams: Vec<(u32, Beam)>,
    /// Least distance, body, and entry to its shape's tree; the nearest first.
    parts: Vec<(f32, u32, u32)>,
}

impl Stage {
    /// The first surface along a ray, `direction` of any length; `None` where it meets nothing.
    pub fn cast(&mut self, origin: Vec3, direction: Vec3) -> Option<RayHit> {
        self.settle();
        let touch = self.first(origin.into(), direction.into(), f32::INFINITY, &mut Stacks::new())?;
        Some(RayHit { t: touch.t, body: BodyId(touch.body as usize), triangle: touch.triangle })
    }

    /// The first surface along a ray.
    pub(crate) fn first(&self, origin: Vec3A, direction: Vec3A, reach: f32, stacks: &mut Stacks) -> Option<Touch> {
        dispatch!(self.level, simd => self.first_in(simd, origin, direction, reach, stacks))
    }

    /// What rays from `origin` in any of `directions` may meet; for [`Self::first_ahead`] and [`Self::blocked_ahead`].
    pub(crate) fn ahead(&self, origin: Vec3A, directions: &[Vec3A], found: &mut Ahead) {
        let Ahead { leaves, beams, parts } = found;
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
            if body.still {
                tree.narrow(&world, entry, *near, found);
                continue;
            }
            let at = beams.iter().position(|(b, _)| *b == index).unwrap_or_else(|| {
                let local = directions.iter().map(|d| body.back * *d);
                beams.push((index, Beam::new(body.back * (origin - body.translation), local)));
                beams.len() - 1
            });
            tree.narrow(&beams[at].1, entry, *near, found);
        }
        parts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    }

    /// The first surface along one of the rays of which [`Self::ahead`] knows.
    pub(crate) fn first_ahead(
        &self,
        ahead: &Ahead,
        origin: Vec3A,
        direction: Vec3A,
        stacks: &mut Stacks,
    ) -> Option<Touch> {
        dispatch!(self.level, simd => self.first_ahead_in(simd, ahead, origin, direction, stacks))
    }

    #[inline(always)]
    fn first_ahead_in<S: Simd>(
        &self,
        simd: S,
        ahead: &Ahead,
        origin: Vec3A,
        direction: Vec3A,
        stacks: &mut Stacks,
    ) -> Option<Touch> {
        let ray = Ray::new(origin, direction);
        let mut reach = f32::INFINITY;
        let mut best = None;
        let (mut last, mut local) = (u32::MAX, ray);
        for (near, index, entry) in &ahead.parts {
            if *near > reach {
                break;
            }
            let body = &self.bodies[*index as usize];
            if *index != last {
                (last, local) = (*index, body.local(&ray));
            }
            if let Some(hit) = self.shapes[body.shape].tree.first(simd, &local, *entry, reach, &mut stacks.below) {
                reach = hit.t;
                best = Some(Touch { t: hit.t, body: *index, triangle: hit.triangle, u: hit.u, v: hit.v });
            }
        }
        best
    }

    /// Whether anything lies before `reach` on one of the rays of which [`Self::ahead`] knows.
    pub(crate) fn blocked_ahead(
        &self,
        ahead: &Ahead,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> bool {
        dispatch!(self.level, simd => self.blocked_ahead_in(simd, ahead, origin, direction, reach, stacks))
    }

    #[inline(always)]
    fn blocked_ahead_in<S: Simd>(
        &self,
        simd: S,
        ahead: &Ahead,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> bool {
        let ray = Ray::new(origin, direction);
        let (mut last, mut local) = (u32::MAX, ray);
        for (near, index, entry) in &ahead.parts {
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

    /// Whether anything lies on the ray before `reach`.
    pub(crate) fn blocked(&self, origin: Vec3A, direction: Vec3A, reach: f32, stacks: &mut Stacks) -> bool {
        dispatch!(self.level, simd => self.blocked_in(simd, origin, direction, reach, stacks))
    }

    /// The first surface of one body along a ray.
    pub(crate) fn first_of(
        &self,
        body: u32,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> Option<Touch> {
        let held = &self.bodies[body as usize];
        let ray = held.local(&Ray::new(origin, direction));
        let tree = &self.shapes[held.shape].tree;
        let hit = dispatch!(self.level, simd => tree.first(simd, &ray, ROOT, reach, &mut stacks.below))?;
        Some(Touch { t: hit.t, body, triangle: hit.triangle, u: hit.u, v: hit.v })
    }

    #[inline(always)]
    fn first_in<S: Simd>(
        &self,
        simd: S,
        origin: Vec3A,
        direction: Vec3A,
        reach: f32,
        stacks: &mut Stacks,
    ) -> Option<Touch> {
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

/// Looks for the first surface of all bodies.
struct Nearest<'a> {
    stage: &'a Stage,
    stack: &'a mut Stack,
    best: Option<Touch>,
}

/// Looks for any surface.
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
        let hit = if body.still {
            tree.first(simd, ray, entry, reach, self.stack)
        } else {
            tree.first(simd, &body.local(ray), entry, reach, self.stack)
        };
        match hit {
            Some(hit) => {
                self.best = Some(Touch { t: hit.t, body: index, triangle: hit.triangle, u: hit.u, v: hit.v });
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
