//! A curved, tapered, elliptical tube with rounded ends, defined by a signed distance.

use crate::noise::{self, SmoothLine};
use glam::DVec3;
use trocar_geometry::SignedDistance;

/// Number of points of a centreline.
const POINTS: usize = 97;

/// Shape of a tube, independent of its position. Lengths in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    /// Length of the centreline.
    pub length: f64,
    /// Semi-axis of the cross-section along the bed.
    pub across: f64,
    /// Semi-axis of the cross-section away from the bed.
    pub high: f64,
    /// Radius at the tip relative to the base.
    pub taper: f64,
    /// Relative widening of the middle.
    pub bulge: f64,
    /// Depth of the constrictions relative to the radius, and the distance between them.
    pub folds: (f64, f64),
    /// Curvature at the base and at the tip: change of heading per unit of the organ coordinate
    /// (rad).
    pub bends: [f64; 2],
}

impl Shape {
    /// Upper bound of the radius (m).
    fn max_radius(&self) -> f64 {
        1.3 * (1.0 + self.bulge) * self.across.max(self.high) * self.taper.max(1.0)
    }
}

/// A placed [`Shape`]. Noise makes its wall uneven.
#[derive(Clone, Debug)]
pub(crate) struct Tube {
    shape: Shape,
    seed: u64,
    line: Vec<DVec3>,
    tangents: Vec<DVec3>,
    centre: DVec3,
    /// Radius of a bounding ball around `centre`.
    reach: f64,
    /// Steps of the search for the nearest point of the centreline.
    rounds: usize,
    /// Unevenness of the wall along the centreline, and displacement of its constrictions.
    uneven: SmoothLine,
    displaced: SmoothLine,
}

/// Width of the features of [`Tube::uneven`] and [`Tube::displaced`] (m).
const UNEVEN: f64 = 0.012;
const DISPLACED: f64 = 0.02;

/// A point in local coordinates of an organ.
pub(crate) struct LocalPoint {
    /// Organ coordinate: 0 at the base, 1 at the tip.
    pub s: f64,
    /// Angle around the centreline (rad): 0 to the side along the bed, pi/2 away from the bed.
    pub angle: f64,
}

impl Tube {
    /// Places `shape` from `base` towards `heading` (rad) in the plane of x and y. `height` gives
    /// the centreline's z.
    pub fn lay(shape: Shape, seed: u64, base: (f64, f64), heading: f64, height: impl Fn(f64, f64) -> f64) -> Self {
        let [k0, k1] = shape.bends;
        let heading = |s: f64| heading + k0 * s + 0.5 * (k1 - k0) * s * s;
        Self { rounds: 3, ..Self::wind(shape, seed, base, heading, |_, x, y| height(x, y)) }
    }

    /// Places `shape` from `base` with a heading (rad) in the plane of x and y that depends on the
    /// organ coordinate; `shape.bends` has no effect. `height` gives the centreline's z for organ
    /// coordinate, x and y.
    pub fn wind(
        shape: Shape,
        seed: u64,
        base: (f64, f64),
        heading: impl Fn(f64) -> f64,
        height: impl Fn(f64, f64, f64) -> f64,
    ) -> Self {
        let step = 1.0 / (POINTS - 1) as f64;
        let direction = |s: f64| {
            let (sin, cos) = libm::sincos(heading(s));
            DVec3::new(cos, sin, 0.0)
        };
        let mut p = DVec3::new(base.0, base.1, 0.0);
        let mut line = Vec::with_capacity(POINTS);
        for i in 0..POINTS {
            line.push(p.with_z(height(i as f64 * step, p.x, p.y)));
            p += direction((i as f64 + 0.5) * step) * (step * shape.length);
        }
        let tangents = (0..POINTS)
            .map(|i| (line[(i + 1).min(POINTS - 1)] - line[i.saturating_sub(1)]).normalize_or(DVec3::X))
            .collect();
        let centre = line.iter().sum::<DVec3>() / POINTS as f64;
        let max_radius = shape.max_radius();
        let reach = line.iter().map(|p| (p - centre).length()).fold(0.0, f64::max) + max_radius;
        // Each step leaves the product of curvature and radius of the error: 0.7 in a tight turn.
        let along = |seed, width| SmoothLine::new(seed, -0.1 * shape.length / width, 1.1 * shape.length / width);
        let (uneven, displaced) = (along(seed, UNEVEN), along(seed + 1, DISPLACED));
        Self { shape, seed, line, tangents, centre, reach, rounds: 16, uneven, displaced }
    }

    /// Point of the centreline at the base (s = 0).
    pub fn base(&self) -> DVec3 {
        self.line[0]
    }

    /// Point of the centreline at the tip (s = 1).
    pub fn tip(&self) -> DVec3 {
        self.line[POINTS - 1]
    }

    /// Length of the centreline (m).
    pub fn length(&self) -> f64 {
        self.shape.length
    }

    /// A bounding box.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let margin = DVec3::splat(self.shape.max_radius());
        let low = self.line.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = self.line.iter().copied().fold(DVec3::MIN, DVec3::max);
        (low - margin, high + margin)
    }

    /// Points on the surface, about a tenth of the circumference apart.
    pub fn samples(&self) -> Vec<DVec3> {
        const AROUND: usize = 16;
        let mut points = Vec::new();
        for i in 0..POINTS {
            let (across, up) = self.frame(i as f64 / (POINTS - 1) as f64);
            let rounded = match i {
                0 => [-1.0, -0.7, -0.35, 0.0].as_slice(),
                i if i == POINTS - 1 => [0.0, 0.35, 0.7, 1.0].as_slice(),
                _ => [0.0].as_slice(),
            };
            for &along in rounded {
                let narrow = (1.0_f64 - along * along).sqrt();
                let (a, b) = self.radii(i as f64 / (POINTS - 1) as f64);
                for j in 0..AROUND {
                    let (sin, cos) = libm::sincos(std::f64::consts::TAU * j as f64 / AROUND as f64);
                    let aside = across * (a * cos * narrow) + up * (b * sin * narrow);
                    points.push(self.line[i] + aside + self.tangents[i] * (along * a));
                }
            }
        }
        points
    }

    pub fn local(&self, p: DVec3) -> LocalPoint {
        let (s, offset) = self.project(p);
        LocalPoint { s, angle: libm::atan2(offset.y, offset.x) }
    }

    /// The organ coordinate of the nearest centreline point, and the offset from it in the local
    /// frame (across, up, along).
    fn project(&self, p: DVec3) -> (f64, DVec3) {
        let nearest = (0..POINTS)
            .map(|i| (i, p.distance_squared(self.line[i])))
            .fold((0, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best })
            .0;
        let on_segment = |i: usize| {
            let (a, b) = (self.line[i], self.line[i + 1]);
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (i as f64 + t, a.lerp(b, t))
        };
        let before = on_segment(nearest.saturating_sub(1));
        let after = on_segment(nearest.min(POINTS - 2));
        let (at, foot) = if p.distance_squared(before.1) < p.distance_squared(after.1) { before } else { after };
        // The corners of the polyline would tear the wall, so the foot point moves along smoothed
        // tangents.
        let (mut s, mut foot) = (at / (POINTS - 1) as f64, foot);
        for _ in 0..self.rounds {
            s = (s + (p - foot).dot(self.tangent(s)) / self.shape.length).clamp(0.0, 1.0);
            foot = self.point(s);
        }
        let (across, up) = self.frame(s);
        let d = p - foot;
        let offset = DVec3::new(d.dot(across), d.dot(up), d.dot(self.tangent(s)));
        (s, offset)
    }

    fn point(&self, s: f64) -> DVec3 {
        let at = s * (POINTS - 1) as f64;
        let i = (at as usize).min(POINTS - 2);
        self.line[i].lerp(self.line[i + 1], at - i as f64)
    }

    fn tangent(&self, s: f64) -> DVec3 {
        let at = (s * (POINTS - 1) as f64).clamp(0.0, (POINTS - 1) as f64);
        let i = (at as usize).min(POINTS - 2);
        self.tangents[i].lerp(self.tangents[i + 1], at - i as f64).normalize_or(DVec3::X)
    }

    /// Unit vectors across the tube along the bed, and away from the bed (towards negative z).
    fn frame(&self, s: f64) -> (DVec3, DVec3) {
        let t = self.tangent(s);
        let across = DVec3::Z.cross(t).normalize_or(DVec3::Y);
        (across, across.cross(t))
    }

    /// Semi-axes at organ coordinate s.
    fn radii(&self, s: f64) -> (f64, f64) {
        let Shape { length, across, high, taper, bulge, folds: (depth, distance), .. } = self.shape;
        let uneven = 0.05 * self.uneven.at(s * length / UNEVEN);
        // The cosine to a high power makes constrictions narrow and the parts between them wide.
        let phase = s * length / distance + 0.6 * self.displaced.at(s * length / DISPLACED);
        let fold = libm::cos(std::f64::consts::PI * phase).powi(6);
        let r = (1.0 + (taper - 1.0) * s)
            * (1.0 + bulge * libm::sin(std::f64::consts::PI * s) + uneven)
            * (1.0 + 0.35 * depth - depth * fold);
        (across * r, high * r)
    }
}

impl SignedDistance for Tube {
    /// Implicit function of the ellipse divided by the length of its gradient: exact to first order
    /// at the surface. Far away it is the distance to a bounding sphere, which is a lower bound.
    fn distance(&self, p: DVec3) -> f64 {
        let outside = (p - self.centre).length() - self.reach;
        if outside > 0.01 {
            return outside;
        }
        let (s, offset) = self.project(p);
        let (a, b) = self.radii(s);
        let q = offset / DVec3::new(a, b, a);
        let k0 = q.length();
        let k1 = (q / DVec3::new(a, b, a)).length();
        if k1 < 1e-9 || k0 < 1e-6 {
            return -a.min(b);
        }
        // A wall oblique to the centreline is closer than its radial distance.
        const H: f64 = 2e-3;
        let slope = (self.radii(s + H).0 - self.radii(s - H).0) / (2.0 * H * self.shape.length);
        let bumps = 0.2e-3 * noise::fractal(self.seed + 2, p / 5e-3, 2);
        k0 * (k0 - 1.0) / k1 / (1.0 + slope * slope).sqrt() + bumps
    }
}
