//! The shapes organs come in, seen as one.

use crate::blend::Blend;
use crate::tube::Tube;
use glam::DVec3;
use trocar_geometry::{SignedDistance, isosurface, sample_distance};

/// The shape of an organ in its place, in the camera's frame.
#[derive(Clone, Debug)]
pub(crate) enum Body {
    Tube(Tube),
    Blend(Blend),
}

/// A point in a body's own terms.
pub(crate) struct Local {
    /// Organ coordinate, 0 at the base, 1 at the tip.
    pub s: f64,
    /// Angle around the centreline [rad], 0 to the side along the bed, pi/2 away from the bed.
    pub angle: f64,
}

impl Body {
    /// Where the organ begins.
    pub fn base(&self) -> DVec3 {
        match self {
            Self::Tube(tube) => tube.base(),
            Self::Blend(blend) => blend.base(),
        }
    }

    /// Where it ends.
    pub fn tip(&self) -> DVec3 {
        match self {
            Self::Tube(tube) => tube.tip(),
            Self::Blend(blend) => blend.tip(),
        }
    }

    /// Length from base to tip along the centreline [m].
    pub fn length(&self) -> f64 {
        match self {
            Self::Tube(tube) => tube.length(),
            Self::Blend(blend) => blend.length(),
        }
    }

    /// A box that holds it.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        match self {
            Self::Tube(tube) => tube.bounds(),
            Self::Blend(blend) => blend.bounds(),
        }
    }

    /// Points all over the surface.
    pub fn samples(&self) -> Vec<DVec3> {
        match self {
            Self::Tube(tube) => tube.samples(),
            Self::Blend(blend) => blend.samples().to_vec(),
        }
    }

    /// Where `p` is in the body's own terms.
    pub fn local(&self, p: DVec3) -> Local {
        match self {
            Self::Tube(tube) => {
                let local = tube.local(p);
                Local { s: local.s, angle: local.angle }
            }
            Self::Blend(blend) => blend.local(p),
        }
    }

    /// Volume, measured on a grid of `spacing` [m3].
    pub fn volume(&self, spacing: f64) -> f64 {
        isosurface(&sample_distance(self, self.bounds(), spacing), 0.0).volume()
    }
}

impl SignedDistance for Body {
    fn distance(&self, p: DVec3) -> f64 {
        match self {
            Self::Tube(tube) => tube.distance(p),
            Self::Blend(blend) => blend.distance(p),
        }
    }
}

/// Distance between `body`'s surface and the nearest of `others` [m], negative where they overlap. Sampled on both.
pub(crate) fn gap<'a>(body: &Body, others: impl Iterator<Item = &'a Body>) -> f64 {
    let least = |of: &Body, to: &Body| of.samples().into_iter().map(|p| to.distance(p)).fold(f64::INFINITY, f64::min);
    others.map(|o| least(body, o).min(least(o, body))).fold(f64::INFINITY, f64::min)
}
