//! A contact as solvers see it: a vertex at a plane, with Coulomb friction towards a place.
//!
//! Plane and place are held during a substep, so that no vertex gets behind a tool within it. A
//! spring pushes a vertex behind the plane out. A second spring of the same stiffness holds it to
//! its place along the plane, until it would pull harder than Coulomb's law allows: then the place
//! follows ([`Contact::slide`]). A load below the limit is borne at a fixed displacement; nothing
//! creeps.

use super::memory::Source;
use glam::{Mat3A, Vec3A};

/// A vertex at a plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    /// The body's vertex.
    pub vertex: u32,
    /// What it touches.
    pub source: Source,
    /// Unit normal of the plane, towards the free side.
    pub normal: Vec3A,
    /// A point of the plane when the substep ends, in the body's frame (m).
    pub point: Vec3A,
    /// Where friction holds the vertex without force at that time (m); its component along the
    /// normal does not matter.
    pub place: Vec3A,
    /// (N/m)
    pub stiffness: f32,
    /// Limit of friction.
    pub friction: Friction,
}

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

    /// Greatest friction force on a vertex at `x` (N).
    #[inline(always)]
    pub fn limit(&self, x: Vec3A) -> f32 {
        match self.friction {
            Friction::Coulomb(coefficient) => coefficient * self.stiffness * (-self.height(x)).max(0.0),
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
        let (height, along) = if pressed { (height, self.stiffness) } else { (0.0, 0.0) };
        let off = self.off(x);
        let pull = self.stiffness * off.length();
        let across = self.stiffness * if pull > limit { limit / pull } else { 1.0 };
        Some(Push { gradient: along * height * self.normal + across * off, along, across })
    }

    /// Displacement along the plane from the place (m).
    #[inline(always)]
    fn off(&self, x: Vec3A) -> Vec3A {
        let off = x - self.place;
        off - off.dot(self.normal) * self.normal
    }

    /// How far the place follows a vertex at `x` that pulls beyond the limit (m). None if it stays.
    pub fn slide(&self, x: Vec3A) -> Option<Vec3A> {
        let (off, limit) = (self.off(x), self.limit(x));
        let pull = self.stiffness * off.length();
        (pull > limit).then(|| off * (1.0 - limit / pull))
    }
}

impl Push {
    /// The positive definite block of the vertex: friction's secant.
    #[inline(always)]
    pub fn block(&self, normal: Vec3A) -> Mat3A {
        let k = self.along - self.across;
        Mat3A::from_cols(normal * (k * normal.x), normal * (k * normal.y), normal * (k * normal.z))
            + Mat3A::from_diagonal(glam::Vec3::splat(self.across))
    }
}
