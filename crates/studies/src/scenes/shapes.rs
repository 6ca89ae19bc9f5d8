//! Shapes of procedural organs by signed distance.

use glam::DVec3;
use trocar_geometry::{SignedDistance, TriMesh, isosurface, sample_everywhere};

/// An ellipsoid around the origin by its half axes (m). Its value is a distance only near the
/// surface.
pub struct Ellipsoid(pub DVec3);

impl SignedDistance for Ellipsoid {
    fn distance(&self, p: DVec3) -> f64 {
        let (k, g) = ((p / self.0).length(), (p / (self.0 * self.0)).length());
        if g > 0.0 { k * (k - 1.0) / g } else { -self.0.min_element() }
    }
}

/// Number of points along a tube's centreline.
const POINTS: usize = 49;

/// A round tube along an S-shaped curve in the plane z = 0, with hemispheres at its ends, like an
/// appendix.
pub struct BentTube {
    /// Points of the centreline with the radius there (m).
    points: Vec<(DVec3, f64)>,
}

impl BentTube {
    /// A tube of this length (m) and radius at its base (m). The radius at the tip is smaller by
    /// the factor `taper`. The heading turns by `bend` (rad) per length over the first two thirds,
    /// and back at 0.6 of that rate over the last.
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

/// The ellipsoid's surface, with triangles of about `spacing` (m).
pub fn ellipsoid(half: DVec3, spacing: f64) -> TriMesh {
    isosurface(&sample_everywhere(&Ellipsoid(half), (-half, half), spacing), 0.0)
}

/// The tube's surface, with triangles of about `spacing` (m).
pub fn tube(tube: &BentTube, spacing: f64) -> TriMesh {
    isosurface(&sample_everywhere(tube, tube.bounds(), spacing), 0.0)
}
