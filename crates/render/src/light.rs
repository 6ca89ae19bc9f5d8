//! Light sources. Radiance is linear and relative: a sensor with exposure 1 shows radiance 1 as
//! white.

mod lanes;

use crate::bvh::Ray;
use glam::{DVec3, Vec3A};
use trocar_core::Pose;

/// A light source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// A point light that shines into a cone. Its light falls off with the square of the distance.
    Spot {
        /// Position (m).
        position: DVec3,
        /// Axis of the cone.
        direction: DVec3,
        /// Linear radiant intensity on the axis (radiance times m²).
        intensity: [f32; 3],
        /// Half angle of the fully lit inner cone (rad).
        inner: f64,
        /// Half angle of the outer cone, beyond which it is dark (rad); pi for a light in all
        /// directions.
        outer: f64,
    },
    /// A visible rectangle that shines to the side of `along` x `across`.
    Panel {
        /// One corner (m).
        corner: DVec3,
        /// Edge vector from the corner (m).
        along: DVec3,
        /// The other edge vector from the corner (m).
        across: DVec3,
        /// Linear radiance of the surface.
        radiance: [f32; 3],
    },
}

/// Light that arrives at a point from one sampled position on a light source.
pub(crate) struct IncidentLight {
    /// Unit direction towards the light source.
    pub direction: Vec3A,
    /// Distance to the light source (m).
    pub distance: f32,
    /// Radiance, divided by the probability density if the position was sampled.
    pub light: Vec3A,
    /// Probability density per solid angle; 0 for a point light, which only explicit light sampling
    /// can reach.
    pub density: f32,
}

impl Light {
    /// The light of an endoscope: warm white, wide, and `beside` (m) from the lens towards the top
    /// of the picture. A white matte surface at distance `white_at` (m) that faces it has radiance
    /// 1.
    pub fn endoscope(view: &Pose, beside: f64, white_at: f64) -> Self {
        let power = std::f32::consts::PI * (white_at * white_at) as f32;
        Self::Spot {
            position: view.transform(DVec3::new(0.0, -beside, 0.0)),
            direction: view.rotation * DVec3::Z,
            intensity: [power, 0.965 * power, 0.91 * power],
            inner: 25.0_f64.to_radians(),
            outer: 62.0_f64.to_radians(),
        }
    }
}

/// A light source prepared for rendering.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lamp {
    Spot { position: Vec3A, direction: Vec3A, intensity: Vec3A, bright: f32, dark: f32 },
    Panel { corner: Vec3A, along: Vec3A, across: Vec3A, normal: Vec3A, area: f32, radiance: Vec3A },
}

impl Lamp {
    pub fn new(light: &Light) -> Self {
        match *light {
            Light::Spot { position, direction, intensity, inner, outer } => Self::Spot {
                position: position.as_vec3a(),
                direction: direction.normalize_or_zero().as_vec3a(),
                intensity: intensity.into(),
                bright: inner.cos() as f32,
                // Less than any cosine: the light shines in all directions.
                dark: if outer >= std::f64::consts::PI { f32::NEG_INFINITY } else { outer.cos() as f32 },
            },
            Light::Panel { corner, along, across, radiance } => {
                let normal = along.cross(across).as_vec3a();
                let (along, across) = (along.as_vec3a(), across.as_vec3a());
                let (corner, area) = (corner.as_vec3a(), normal.length());
                Self::Panel { corner, along, across, normal, area, radiance: radiance.into() }
            }
        }
    }

    /// Centre of the light source (m).
    pub fn centre(&self) -> Vec3A {
        match *self {
            Self::Spot { position, .. } => position,
            Self::Panel { corner, along, across, .. } => corner + 0.5 * along + 0.5 * across,
        }
    }

    /// Light that arrives at `point` from the position on the light source that two random numbers
    /// select; `None` if no light arrives.
    pub fn arriving(&self, point: Vec3A, [a, b]: [f32; 2]) -> Option<IncidentLight> {
        match *self {
            Self::Spot { position, direction, intensity, bright, dark } => {
                let to_light = position - point;
                let distance = to_light.length();
                let towards = to_light / distance.max(1e-12);
                let cos = -towards.dot(direction);
                let share = if dark == f32::NEG_INFINITY {
                    1.0
                } else {
                    let x = ((cos - dark) / (bright - dark).max(1e-6)).clamp(0.0, 1.0);
                    x * x * (3.0 - 2.0 * x)
                };
                let light = intensity * (share / (distance * distance).max(1e-12));
                (share > 0.0 && light.is_finite()).then_some(IncidentLight {
                    direction: towards,
                    distance,
                    light,
                    density: 0.0,
                })
            }
            Self::Panel { corner, along, across, normal, area, radiance } => {
                let to_light = corner + a * along + b * across - point;
                let distance = to_light.length();
                let towards = to_light / distance.max(1e-12);
                let cos = -towards.dot(normal) / area;
                if cos.is_nan() || cos <= 0.0 || distance <= 0.0 {
                    return None;
                }
                let density = distance * distance / (cos * area);
                Some(IncidentLight { direction: towards, distance, light: radiance / density, density })
            }
        }
    }

    /// Intersection of a ray with the lit side of a panel before `reach`: ray parameter, radiance,
    /// and the density with which [`Self::arriving`] samples that direction.
    pub fn intersect(&self, ray: &Ray, reach: f32) -> Option<(f32, Vec3A, f32)> {
        let Self::Panel { corner, along, across, normal, area, radiance } = *self else { return None };
        let slope = ray.direction.dot(normal);
        if slope >= 0.0 {
            return None;
        }
        let to_corner = corner - ray.origin;
        let t = to_corner.dot(normal) / slope;
        if !(t > 0.0 && t < reach) {
            return None;
        }
        let inside = ray.direction * t - to_corner;
        let a = inside.cross(across).dot(normal) / (area * area);
        let b = along.cross(inside).dot(normal) / (area * area);
        if !((0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b)) {
            return None;
        }
        let length = ray.direction.length();
        let density = (t * length) * (t * length) * length / -slope;
        Some((t, radiance, density))
    }
}
