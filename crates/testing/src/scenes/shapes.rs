//! Shapes of organs by their signed distance, for scenes and benchmarks that need no file.

use glam::DVec3;
use trocar_geometry::{SignedDistance, TriMesh, isosurface, sample_everywhere};

/// An ellipsoid around the origin by its half axes [m]; the value is a distance near its surface.
pub struct Ellipsoid(pub DVec3);

impl SignedDistance for Ellipsoid {
    fn distance(&self, p: DVec3) -> f64 {
        let (k, g) = ((p / self.0).length(), (p / (self.0 * self.0)).length());
        if g > 0.0 { k * (k - 1.0) / g } else { -self.0.min_element() }
    }
}

/// Points along a tube's centreline.
const POINTS: usize = 49;

/// A round tube along a curve in the plane z = 0, S-shaped as an appendix lies, with hemispheres at its ends.
pub struct BentTube {
    /// Points of the centreline and the radius there [m].
    points: Vec<(DVec3, f64)>,
}

impl BentTube {
    /// A tube of this length and radius at its base [m], thinner towards its tip by the factor `taper`; its heading turns by `bend` [rad] per
    /// length over its first two thirds and back at 0.6 of that over the last.
    pub fn new(length: f64, radius: f64, taper: f64, bend: f64) -> Self {
        let ds = 1.0 / (POINTS - 1) as f64;
        let (mut at, mut heading) = (DVec3::ZERO, 0.0_f64);
        let mut points = Vec::with_capacity(POINTS);
        for k in 0..POINTS {
            let s = k as f64 * ds;
            points.push((at, radius * (1.0 + (taper - 1.0) * s)));
            heading += ds * bend * if s < 0.66 { 1.0 } else { -0.6 };
            at += length * ds * DVec3::new(heading.cos(), heading.sin(), 0.0);
        }
        Self { points }
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.points.iter().fold(start, |(low, high), (p, r)| (low.min(p - *r), high.max(p + *r)))
    }
}

impl SignedDistance for BentTube {
    fn distance(&self, p: DVec3) -> f64 {
        let to_segment = |pair: &[(DVec3, f64)]| {
            let ((a, ra), (b, rb)) = (pair[0], pair[1]);
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            p.distance(a.lerp(b, t)) - (ra + t * (rb - ra))
        };
        self.points.windows(2).map(to_segment).fold(f64::INFINITY, f64::min)
    }
}

/// The ellipsoid's surface, by triangles of about `spacing` [m].
pub fn ellipsoid(half: DVec3, spacing: f64) -> TriMesh {
    isosurface(&sample_everywhere(&Ellipsoid(half), (-half, half), spacing), 0.0)
}

/// The tube's surface, by triangles of about `spacing` [m].
pub fn tube(tube: &BentTube, spacing: f64) -> TriMesh {
    isosurface(&sample_everywhere(tube, tube.bounds(), spacing), 0.0)
}
