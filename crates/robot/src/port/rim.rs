//! The points of the rim nearest to a shaft: exact, from the root of one monotone function.
//!
//! A cylinder of radius r and unit direction u goes through the circle |q| = R in the plane z = 0;
//! its axis crosses the plane at c. It fits if every point q of the circle is at least r from the
//! axis. With x in the direction of the tilt and k = cos(tilt)^2, the squared distance of q = R
//! (cos a, sin a) is
//!
//! ```text
//! f(a) = k (R cos a - cx)^2 + (R sin a - cy)^2
//! f'(a)/2R = (1-k) R sin a cos a + k cx sin a - cy cos a
//! ```
//!
//! By symmetry cx, cy >= 0. In the first quadrant f'(a) = 0 is (1-k) R = cy/sin a - k cx/cos a,
//! whose right side decreases from infinity to minus infinity: it has one root, the nearest point.
//! Of the other quadrants only the second can have another minimum (the shaft may lean on both
//! sides): (1-k) R = cy/sin b + k cx/cos b with b = pi - a has a convex right side with the minimum
//! ((k cx)^(2/3) + cy^(2/3))^(3/2) at tan(b)^3 = cy/(k cx); the root below this b is the minimum of
//! f. Inside the sheet the distance is concave along z, so only the two edges of a thick sheet can
//! be in contact.
//!
//! The two minima of an edge merge when the axis is far enough to one side. Up to tilts of
//! acos(sqrt(r/R)) (24.1 degrees for 5 mm in 6 mm) neither is then in contact. Beyond, both may be,
//! each deeper than r - R cos(tilt)^2, and the force has a step there.

use super::kinematics::MIN_TILT_COS;
use super::port_model::Port;
use super::shaft::Shaft;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Bisections of a quadrant down to double precision.
const BISECTIONS: usize = 60;

/// An edge of the hole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// The outer edge; the only one of a sheet without thickness.
    Outer,
    /// The edge inside the body.
    Inner,
}

/// A point of the rim that is a local minimum of the distance to the shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RimPoint {
    /// The edge.
    pub edge: Edge,
    /// Angle about the port's normal (rad), from the port's x, within +-pi.
    pub angle: f64,
    /// Position (m), in the cell.
    pub point: DVec3,
    /// Unit vector from the rim to the shaft, across the shaft: the direction of the force on the
    /// shaft, in the cell.
    pub normal: DVec3,
    /// Distance between shaft and rim (m); negative in contact.
    pub gap: f64,
}

impl Port {
    /// The points of the rim nearest to a shaft: one or two an edge, none if the shaft does not go
    /// through the port's plane (a tilt over 87 degrees) or ends before it. They are exact: if all
    /// gaps are positive, there is no contact.
    pub fn nearest(&self, shaft: &Shaft) -> [Option<RimPoint>; 4] {
        let mut found = [None; 4];
        let inverse = self.pose.inverse();
        let (base, u) = (inverse.transform(shaft.base), inverse.rotation * shaft.direction);
        // A shaft that is not finite has no contact.
        if u.z.abs() < MIN_TILT_COS || !u.is_finite() || !base.is_finite() {
            return found;
        }
        let half = 0.5 * self.thickness;
        let edges: &[(Edge, f64)] =
            if half > 0.0 { &[(Edge::Outer, -half), (Edge::Inner, half)] } else { &[(Edge::Outer, 0.0)] };
        for (e, &(edge, z)) in edges.iter().enumerate() {
            let crossing = base + (z - base.z) / u.z * u;
            let angles = minima(DVec2::new(crossing.x, crossing.y), DVec2::new(u.x, u.y), 0.5 * self.hole_diameter);
            for (k, angle) in angles.into_iter().enumerate().filter_map(|(k, a)| a.map(|a| (k, a))) {
                let out = DVec2::from_angle(angle);
                let place = (0.5 * self.hole_diameter * out).extend(z);
                // Across the shaft, with its part in the sheet's plane towards the centre: the axis
                // lies there because f' = 0.
                let normal = DVec3::new(-out.x, -out.y, (out.x * u.x + out.y * u.y) / u.z).normalize();
                let along = (place - base).dot(u);
                if (0.0..=shaft.length).contains(&along) {
                    found[2 * e + k] = Some(RimPoint {
                        edge,
                        angle,
                        point: self.pose.transform(place),
                        normal: self.pose.rotation * normal,
                        gap: (crossing - place).dot(normal) - shaft.radius,
                    });
                }
            }
        }
        found
    }

    /// Position of the point of an edge at `angle` (rad) about the normal, in the cell (m).
    pub(super) fn rim(&self, edge: Edge, angle: f64) -> DVec3 {
        let z = match edge {
            Edge::Outer => -0.5 * self.thickness,
            Edge::Inner => 0.5 * self.thickness,
        };
        self.pose.transform((0.5 * self.hole_diameter * DVec2::from_angle(angle)).extend(z))
    }
}

/// Angles (rad) of the circle's points nearest to an axis that crosses its plane at `c`, with the
/// in-plane part `u` of its direction: the nearest, and the other minimum if there is one.
fn minima(c: DVec2, u: DVec2, radius: f64) -> [Option<f64>; 2] {
    let tilted = u.try_normalize().unwrap_or(DVec2::X);
    // (1 - k) R from the sine, which is accurate for small tilts.
    let (k, free) = (1.0 - u.length_squared(), u.length_squared() * radius);
    let (x, y) = (c.dot(tilted), tilted.perp_dot(c));
    let (kx, cy) = (k * x.abs(), y.abs());
    let back = |a: f64| {
        let (sin, cos) = libm::sincos(a);
        let turned = DVec2::new(if x < 0.0 { -cos } else { cos }, if y < 0.0 { -sin } else { sin }).rotate(tilted);
        libm::atan2(turned.y, turned.x)
    };
    let near = bisect(0.0, FRAC_PI_2, |s, c| free * s * c + kx * s - cy * c);
    let astroid = |v: f64| libm::cbrt(v) * libm::cbrt(v);
    let other = (astroid(kx) + astroid(cy) < astroid(free)).then(|| {
        let last = libm::atan2(libm::cbrt(cy), libm::cbrt(kx));
        back(PI - bisect(0.0, last, |s, c| free * s * c - kx * s - cy * c))
    });
    [Some(back(near)), other]
}

/// The root in [`low`, `high`] of a function of (sin, cos) that is negative below it and positive
/// above.
fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let (s, c) = libm::sincos(middle);
        if f(s, c) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}
