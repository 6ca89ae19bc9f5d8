//! A body of several blended parts: the lobes of a liver or the loops of a coiled bowel.

use crate::noise;
use crate::tube::{LocalPoint, Tube};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::sync::OnceLock;
use trocar_geometry::{SignedDistance, isosurface, sample_distance};

/// A part of a [`Blend`].
#[derive(Clone, Debug)]
pub(crate) enum Part {
    /// An ellipsoid. The columns of `turn` are its axes, `radii` its semi-axes.
    Ellipsoid { centre: DVec3, turn: DMat3, radii: DVec3 },
    /// A round strand along a polyline. Every `folds.1` metres it is thinner by the share
    /// `folds.0`.
    Strand { line: Vec<DVec3>, radius: f64, folds: (f64, f64), seed: u64 },
}

/// Wall unevenness: height and width of bumps (m).
pub(crate) type Bumps = (f64, f64);

/// Specification of a [`Blend`].
#[derive(Clone, Debug)]
pub(crate) struct BlendSpec {
    pub parts: Vec<Part>,
    /// Width over which the surfaces of two parts merge (m).
    pub blend: f64,
    pub bumps: [Bumps; 2],
    pub seed: u64,
    /// Both ends of the organ.
    pub ends: [DVec3; 2],
    /// A tube that lies in a groove of this body, and the gap around it (m).
    pub groove: Option<(Tube, f64)>,
    /// Distance between samples on the surface (m).
    pub sampling: f64,
}

/// Blended parts, defined by a signed distance.
#[derive(Clone, Debug)]
pub(crate) struct Blend {
    spec: BlendSpec,
    /// A bounding ball per part.
    balls: Vec<(DVec3, f64)>,
    /// Points on the surface, computed on first use.
    samples: OnceLock<Vec<DVec3>>,
}

/// Width over which the rim of a groove is rounded (m).
const RIM: f64 = 4e-3;

impl Blend {
    pub fn new(spec: BlendSpec) -> Self {
        let balls = spec.parts.iter().map(Part::ball).collect();
        Self { spec, balls, samples: OnceLock::new() }
    }

    pub fn base(&self) -> DVec3 {
        self.spec.ends[0]
    }

    pub fn tip(&self) -> DVec3 {
        self.spec.ends[1]
    }

    /// Length of all strands; without strands the distance between the ends (m).
    pub fn length(&self) -> f64 {
        let strands: f64 = self.spec.parts.iter().map(Part::length).sum();
        if strands > 0.0 { strands } else { (self.tip() - self.base()).length() }
    }

    /// A bounding box.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let margin = 0.5 * self.spec.blend + self.spec.bumps.iter().map(|b| 2.0 * b.0).sum::<f64>();
        let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
        for part in &self.spec.parts {
            let (l, h) = part.bounds();
            (low, high) = (low.min(l), high.max(h));
        }
        (low - margin, high + margin)
    }

    /// Points on the surface.
    pub fn samples(&self) -> &[DVec3] {
        self.samples.get_or_init(|| {
            let rough = isosurface(&sample_distance(self, self.bounds(), self.spec.sampling), 0.0);
            rough.vertices.into_par_iter().map(|p| self.onto(p)).collect()
        })
    }

    pub fn groove(&self) -> Option<&Tube> {
        self.spec.groove.as_ref().map(|(tube, _)| tube)
    }

    /// Local coordinates of `p`: along the strands in their order, or along the line between the
    /// ends.
    pub fn local(&self, p: DVec3) -> LocalPoint {
        let (total, mut before) = (self.length(), 0.0);
        let (mut nearest, mut local) = (f64::INFINITY, None);
        for part in &self.spec.parts {
            if let Part::Strand { line, radius, .. } = part {
                let (along, foot, tangent) = foot(line, p);
                let d = p - foot;
                if d.length() - radius < nearest {
                    nearest = d.length() - radius;
                    let across = DVec3::Z.cross(tangent).normalize_or(DVec3::Y);
                    let angle = libm::atan2(d.dot(across.cross(tangent)), d.dot(across));
                    local = Some(LocalPoint { s: (before + along) / total, angle });
                }
            }
            before += part.length();
        }
        local.unwrap_or_else(|| {
            let axis = self.tip() - self.base();
            let s = (p - self.base()).dot(axis) / axis.length_squared();
            let d = p - self.base() - axis * s;
            let across = DVec3::Z.cross(axis).normalize_or(DVec3::Y);
            LocalPoint { s: s.clamp(0.0, 1.0), angle: libm::atan2(-d.z, d.dot(across)) }
        })
    }

    /// The surface point near `p`, by Newton's method along the gradient.
    fn onto(&self, mut p: DVec3) -> DVec3 {
        const H: f64 = 1e-5;
        for _ in 0..4 {
            let slope = [DVec3::X, DVec3::Y, DVec3::Z]
                .map(|e| (self.distance(p + e * H) - self.distance(p - e * H)) / (2.0 * H));
            let gradient = DVec3::from_array(slope);
            p -= gradient * (self.distance(p) / gradient.length_squared().max(0.25));
        }
        p
    }
}

impl SignedDistance for Blend {
    /// Polynomial smooth minimum of the parts. Outside the blend width it is the distance to the
    /// nearest part.
    fn distance(&self, p: DVec3) -> f64 {
        let k = self.spec.blend;
        let mut d = f64::INFINITY;
        for (part, (centre, reach)) in self.spec.parts.iter().zip(&self.balls) {
            let least = (p - *centre).length() - reach;
            if least > d + k {
                continue;
            }
            let next = part.distance(p).max(least);
            d = if d.is_finite() { smooth_min(d, next, k) } else { next };
        }
        // Bumps fade with the distance from the surface.
        let smooth = d;
        for (i, &(height, width)) in self.spec.bumps.iter().enumerate() {
            let fade = (2.0 - smooth.abs() / (4.0 * width)).clamp(0.0, 1.0);
            if height > 0.0 && fade > 0.0 {
                d += fade * height * noise::fractal(self.spec.seed.wrapping_add(10 * i as u64), p / width, 2);
            }
        }
        match &self.spec.groove {
            Some((tube, space)) => -smooth_min(-d, tube.distance(p) - space, RIM),
            None => d,
        }
    }
}

impl Part {
    /// At most the distance to the surface outside, exact to first order on it.
    fn distance(&self, p: DVec3) -> f64 {
        match self {
            Self::Ellipsoid { centre, turn, radii } => {
                let q = turn.transpose() * (p - *centre) / *radii;
                let k0 = q.length();
                let k1 = (q / *radii).length();
                let thin = radii.min_element();
                // k0 is convex, so this is below the true distance outside. Inside it would be
                // above it.
                if k1 < 1e-9 { -thin } else { (k0 * (k0 - 1.0) / k1).max(-thin) }
            }
            Self::Strand { line, radius, folds: (depth, distance), seed } => {
                let (along, foot, _) = foot(line, p);
                let uneven = 0.07 * noise::smooth(*seed, DVec3::new(along / 0.012, 0.5, 0.5));
                let fold = libm::cos(std::f64::consts::PI * along / distance).powi(6);
                (p - foot).length() - radius * (1.0 + uneven + 0.35 * depth - depth * fold)
            }
        }
    }

    fn length(&self) -> f64 {
        match self {
            Self::Ellipsoid { .. } => 0.0,
            Self::Strand { line, .. } => line.windows(2).map(|w| (w[1] - w[0]).length()).sum(),
        }
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        match self {
            Self::Ellipsoid { centre, turn, radii } => {
                let half = DVec3::from_array([0, 1, 2].map(|i| (turn.row(i) * *radii).length()));
                (*centre - half, *centre + half)
            }
            Self::Strand { line, radius, .. } => {
                let low = line.iter().copied().fold(DVec3::MAX, DVec3::min);
                let high = line.iter().copied().fold(DVec3::MIN, DVec3::max);
                (low - 1.2 * *radius, high + 1.2 * *radius)
            }
        }
    }

    fn ball(&self) -> (DVec3, f64) {
        match self {
            Self::Ellipsoid { centre, radii, .. } => (*centre, radii.max_element()),
            Self::Strand { line, radius, .. } => {
                let centre = line.iter().sum::<DVec3>() / line.len().max(1) as f64;
                let reach = line.iter().map(|p| (p - centre).length()).fold(0.0, f64::max);
                (centre, reach + 1.2 * radius)
            }
        }
    }
}

/// Nearest point of a polyline: arc length, position, and direction.
fn foot(line: &[DVec3], p: DVec3) -> (f64, DVec3, DVec3) {
    let mut best = (0.0, line.first().copied().unwrap_or_default(), DVec3::X);
    let (mut nearest, mut before) = (f64::INFINITY, 0.0);
    for pair in line.windows(2) {
        let step = pair[1] - pair[0];
        let t = ((p - pair[0]).dot(step) / step.length_squared()).clamp(0.0, 1.0);
        let at = pair[0] + step * t;
        let d = p.distance_squared(at);
        let length = step.length();
        if d < nearest {
            nearest = d;
            best = (before + t * length, at, step / length);
        }
        before += length;
    }
    best
}

/// Minimum of two values, rounded where they differ by less than `k` (Quilez's quadratic smooth
/// minimum).
fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - 0.25 * k * h * h
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_ball_is_exact_and_two_merge() {
        let ball = |x: f64| Part::Ellipsoid {
            centre: DVec3::new(x, 0.0, 0.2),
            turn: DMat3::IDENTITY,
            radii: DVec3::splat(0.02),
        };
        let blend = |parts| {
            Blend::new(BlendSpec {
                parts,
                blend: 5e-3,
                bumps: [(0.0, 1.0); 2],
                seed: 0,
                ends: [DVec3::ZERO, DVec3::X],
                groove: None,
                sampling: 2e-3,
            })
        };
        let one = blend(vec![ball(0.0)]);
        assert!((one.distance(DVec3::new(0.03, 0.0, 0.2)) - 0.01).abs() < 1e-12);
        assert!(one.samples().iter().all(|p| ((p - DVec3::new(0.0, 0.0, 0.2)).length() - 0.02).abs() < 1e-6));
        let two = blend(vec![ball(-0.015), ball(0.015)]);
        let waist = DVec3::new(0.0, (0.02_f64.powi(2) - 0.015_f64.powi(2)).sqrt(), 0.2);
        assert!((two.distance(waist) + 5e-3 / 4.0).abs() < 1e-9, "a quarter of the width is filled in where both meet");
        assert!((two.distance(DVec3::new(0.035, 0.0, 0.2))).abs() < 1e-12, "and nothing far from there");
    }
}
