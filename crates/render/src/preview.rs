//! Light at a surface at once, without bounces: for policies and windows, tens of pictures a second.

use crate::material::Material;
use crate::stage::{Stage, Surface};
use crate::tree::Stacks;
use glam::Vec3A;

/// A light nearer to the eye than this share of its distance to a surface casts no shadow that is worth a ray: what it does not
/// reach, the eye does not see, but for a rim at edges as thin as that share of the depth behind them.
const BESIDE: f32 = 0.1;

/// Light towards the eye from the lights alone and, evenly, from the environment. Panels shine from their middles. With `shadows`,
/// which is where the eye is, lights that are not beside the eye cast them.
pub(crate) fn light(
    stage: &Stage,
    surface: &Surface,
    material: &Material,
    to_eye: Vec3A,
    shadows: Option<Vec3A>,
    stacks: &mut Stacks,
) -> Vec3A {
    let frame = Frame::new(surface.smooth);
    let out = frame.local(to_eye);
    // Metal is a mirror: what it shows of the room is darker towards its edges, where it shows what is behind it.
    let ambient = if material.is_metal() { 0.35 + 0.85 * out.z } else { 1.0 };
    let mut sum = surface.albedo * Vec3A::from(stage.environment) * ambient;
    for lamp in stage.lamps() {
        let Some(arriving) = lamp.arriving(surface.position, [0.5; 2]) else { continue };
        let towards = frame.local(arriving.direction);
        let parts = material.parts(surface.albedo, out, towards);
        let mut back = parts.gloss + parts.body;
        if material.wander != Vec3A::ZERO {
            // Light that wanders comes round the terminator; what it adds there it lacks elsewhere.
            let wrap = material.wander / (material.wander + WRAP_LENGTH);
            let cos = Vec3A::splat(towards.z);
            let wrapped = (cos + wrap).max(Vec3A::ZERO) / ((Vec3A::ONE + wrap) * (Vec3A::ONE + wrap));
            back = parts.gloss + surface.albedo * wrapped * std::f32::consts::FRAC_1_PI;
        }
        if back == Vec3A::ZERO {
            continue;
        }
        let beside = |eye: Vec3A| {
            let light = surface.position + arriving.direction * arriving.distance;
            light.distance_squared(eye) < (BESIDE * arriving.distance) * (BESIDE * arriving.distance)
        };
        if shadows.is_some_and(|eye| !beside(eye)) {
            let origin = surface.position + surface.flat * offset(surface.position);
            if stage.blocked(origin, arriving.direction, arriving.distance * (1.0 - 1e-4), stacks) {
                continue;
            }
        }
        sum += back * arriving.light;
    }
    sum
}

/// Wandering as far as this lets light go half round [m]: the size of what tissue is curved by.
const WRAP_LENGTH: f32 = 6e-3;

/// How far off a surface rays begin, beyond what rounding may have sunk them [m].
pub(crate) fn offset(position: Vec3A) -> f32 {
    2e-6 * (0.05 + position.abs().max_element())
}

/// Axes at a surface.
pub(crate) struct Frame {
    x: Vec3A,
    y: Vec3A,
    z: Vec3A,
}

impl Frame {
    pub fn new(normal: Vec3A) -> Self {
        let (x, y) = normal.any_orthonormal_pair();
        Self { x, y, z: normal }
    }

    pub fn local(&self, d: Vec3A) -> Vec3A {
        Vec3A::new(self.x.dot(d), self.y.dot(d), self.z.dot(d))
    }

    pub fn world(&self, d: Vec3A) -> Vec3A {
        self.x * d.x + self.y * d.y + self.z * d.z
    }
}
