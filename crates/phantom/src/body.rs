//! The shape of an organ, either a tube or a blend.

use crate::blend::Blend;
use crate::tube::{LocalPoint, Tube};
use glam::DVec3;
use trocar_geometry::{SignedDistance, isosurface, sample_distance};

/// The shape of a placed organ, in the camera frame.
#[derive(Clone, Debug)]
pub(crate) enum Body {
    Tube(Tube),
    Blend(Blend),
}

impl Body {
    /// Start of the organ.
    pub fn base(&self) -> DVec3 {
        match self {
            Self::Tube(tube) => tube.base(),
            Self::Blend(blend) => blend.base(),
        }
    }

    /// End of the organ.
    pub fn tip(&self) -> DVec3 {
        match self {
            Self::Tube(tube) => tube.tip(),
            Self::Blend(blend) => blend.tip(),
        }
    }

    /// Length from base to tip along the centreline (m).
    pub fn length(&self) -> f64 {
        match self {
            Self::Tube(tube) => tube.length(),
            Self::Blend(blend) => blend.length(),
        }
    }

    /// A bounding box.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        match self {
            Self::Tube(tube) => tube.bounds(),
            Self::Blend(blend) => blend.bounds(),
        }
    }

    /// Points on the whole surface.
    pub fn samples(&self) -> Vec<DVec3> {
        match self {
            Self::Tube(tube) => tube.samples(),
            Self::Blend(blend) => blend.samples().to_vec(),
        }
    }

    pub fn local(&self, p: DVec3) -> LocalPoint {
        match self {
            Self::Tube(tube) => tube.local(p),
            Self::Blend(blend) => blend.local(p),
        }
    }

    /// Volume, measured on a grid of `spacing` (m³).
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

/// Distance between `body` and the nearest of `others` (m), negative if they overlap. Sampled on
/// both surfaces.
pub(crate) fn gap<'a>(body: &Body, others: impl Iterator<Item = &'a Body>) -> f64 {
    let least = |of: &Body, to: &Body| of.samples().into_iter().map(|p| to.distance(p)).fold(f64::INFINITY, f64::min);
    others.map(|o| least(body, o).min(least(o, body))).fold(f64::INFINITY, f64::min)
}
