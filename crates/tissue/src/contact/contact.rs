//! A contact as solvers see it: a point of the surface at a plane, with Coulomb friction towards a
//! place.
//!
//! Plane and place are held during a substep, so that no point gets behind a tool within it. What
//! pressed before has the plane of where its velocity takes it along the tool. A
//! spring pushes a point behind the plane out. A second spring of the same stiffness holds it to
//! its place along the plane, until it would pull harder than Coulomb's law allows: then the place
//! follows ([`Contact::slide`]). A load below the limit is borne at a fixed displacement; nothing
//! creeps.

use super::site::Site;
use crate::state::Source;
use glam::{Mat3A, Vec3A};

/// A point of the surface at a plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    /// The point of the body's surface.
    pub site: Site,
    /// What it touches.
    pub source: Source,
    /// Unit normal of the plane, towards the free side.
    pub normal: Vec3A,
    /// A point of the plane when the substep ends, in the body's frame (m).
    pub point: Vec3A,
    /// Where friction holds the point without force at that time (m); its component along the
    /// normal does not matter.
    pub place: Vec3A,
    /// (N/m)
    pub stiffness: f32,
    /// Depth from which the spring is harder (m); infinite if it never is.
    pub hard_from: f32,
    /// Limit of friction.
    pub friction: Friction,
}

/// Stiffness of a contact that is deep over that of one that has just begun.
const HARDENING: f32 = 25.0;

/// The limit of friction.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Friction {
    /// A coefficient of the normal force.
    Coulomb(f32),
    /// A force (N); the plane holds on both sides.
    Clamped(f32),
}

/// Force of a contact at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Push {
    /// Derivative of the energy (N): the reaction on the touched surface.
    pub gradient: Vec3A,
    /// Stiffness along the normal and across it (N/m).
    pub along: f32,
    pub across: f32,
}

impl Contact {
    /// Height of a point above the plane (m).
    #[inline(always)]
    pub fn height(&self, x: Vec3A) -> f32 {
        (x - self.point).dot(self.normal)
    }

    /// Force along the normal at a `depth` (m) behind the plane (N).
    #[inline(always)]
    pub fn pressure(&self, depth: f32) -> f32 {
        self.stiffness * self.linear_depth(depth)
    }

    /// The depth at which a spring that never hardens would have the same force (m).
    #[inline(always)]
    fn linear_depth(&self, depth: f32) -> f32 {
        depth.max(0.0) + (HARDENING - 1.0) * (depth - self.hard_from).max(0.0)
    }

    /// Stiffness beyond the depth from which the spring is harder (N/m).
    pub fn hardened(&self) -> f32 {
        HARDENING * self.stiffness
    }

    /// Stiffness along the normal of a point at `x` (N/m).
    #[inline(always)]
    pub fn tangent(&self, x: Vec3A) -> f32 {
        if -self.height(x) > self.hard_from { HARDENING * self.stiffness } else { self.stiffness }
    }

    /// Greatest friction force on a point at `x` (N).
    #[inline(always)]
    pub fn limit(&self, x: Vec3A) -> f32 {
        match self.friction {
            Friction::Coulomb(coefficient) => coefficient * self.stiffness * self.linear_depth(-self.height(x)),
            // NaN is no force.
            Friction::Clamped(force) => force.max(0.0),
        }
    }

    /// Force at `x`, with the limit of friction there.
    #[inline(always)]
    pub fn push(&self, x: Vec3A) -> Option<Push> {
        self.push_within(x, self.limit(x))
    }

    /// Force at `x` with a given `limit` of friction (N), which has a potential. None where no
    /// force acts.
    #[inline(always)]
    pub fn push_within(&self, x: Vec3A, limit: f32) -> Option<Push> {
        let height = self.height(x);
        let pressed = height < 0.0 || matches!(self.friction, Friction::Clamped(_));
        if !pressed && limit <= 0.0 {
            return None;
        }
        let (force, along) = match self.friction {
            Friction::Clamped(_) => (self.stiffness * height, self.stiffness),
            Friction::Coulomb(_) if pressed => (-self.pressure(-height), self.tangent(x)),
            Friction::Coulomb(_) => (0.0, 0.0),
        };
        let off = self.off(x);
        let pull = self.stiffness * off.length();
        let across = self.stiffness * if pull > limit { limit / pull } else { 1.0 };
        Some(Push { gradient: force * self.normal + across * off, along, across })
    }

    /// The same contact as one of a single `vertex` at `here`, while all others stay where they
    /// are. The point of contact is at `at`, and moves by `share` of the vertex's motion: negative
    /// for a corner of the triangle that another body touches.
    pub fn of_vertex(&self, vertex: u32, share: f32, here: Vec3A, at: Vec3A) -> Self {
        Self {
            site: Site::vertex(vertex),
            normal: share.signum() * self.normal,
            point: here - (self.height(at) / share) * self.normal,
            place: here - (at - self.place) / share,
            stiffness: self.stiffness * share * share,
            hard_from: self.hard_from / share.abs(),
            ..*self
        }
    }

    /// Displacement along the plane from the place (m).
    #[inline(always)]
    pub fn off(&self, x: Vec3A) -> Vec3A {
        let off = x - self.place;
        off - off.dot(self.normal) * self.normal
    }

    /// How far the place follows a point at `x` that pulls beyond the limit (m). None if it stays.
    pub fn slide(&self, x: Vec3A) -> Option<Vec3A> {
        let (off, limit) = (self.off(x), self.limit(x));
        let pull = self.stiffness * off.length();
        (pull > limit).then(|| off * (1.0 - limit / pull))
    }
}

impl Push {
    /// The positive definite block of the point: friction's secant.
    #[inline(always)]
    pub fn block(&self, normal: Vec3A) -> Mat3A {
        let k = self.along - self.across;
        Mat3A::from_cols(normal * (k * normal.x), normal * (k * normal.y), normal * (k * normal.z))
            + Mat3A::from_diagonal(glam::Vec3::splat(self.across))
    }
}
