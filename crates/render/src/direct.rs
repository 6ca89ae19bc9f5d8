//! Direct light without bounces on what rays hit: the reference for rasterised previews.

use crate::bvh::Stacks;
use crate::light::Lamp;
use crate::material::WRAP_LENGTH;
use crate::shading_frame::{ShadingFrame, offset};
use crate::stage::{BundleCandidates, Stage, StageHit, Surface};
use glam::Vec3A;

/// A light casts no shadow if its distance to the eye is less than this share of its distance to
/// the surface. A surface that such a light does not reach is hidden from the eye too. Only a rim
/// at edges remains, as thin as that share of the depth behind them.
pub(crate) const BESIDE_EYE_SHARE: f32 = 0.1;

/// A visible surface point and the light it sends to the eye.
pub(crate) struct VisiblePoint {
    hit: StageHit,
    surface: Surface,
    frame: ShadingFrame,
    /// Direction towards the eye, in the surface's frame.
    out: Vec3A,
    /// Radiance towards the eye, accumulated so far.
    pub light: Vec3A,
}

impl VisiblePoint {
    /// The hit of a ray in `direction`, lit by the uniform environment alone.
    pub fn new(stage: &Stage, hit: StageHit, surface: Surface, direction: Vec3A) -> Self {
        let frame = ShadingFrame::new(surface.smooth);
        let out = frame.local(-direction.normalize());
        // Metal mirrors the room: approximately darker towards grazing angles, where it mirrors
        // what lies behind it.
        let ambient = if stage.material(&hit).is_metal() { 0.35 + 0.85 * out.z } else { 1.0 };
        let light = surface.albedo * Vec3A::from(stage.environment) * ambient;
        Self { hit, surface, frame, out, light }
    }

    /// Radiance that an unoccluded lamp adds, and whether the lamp is far enough from the eye to
    /// cast visible shadows. A panel shines from its centre.
    fn lit_by(&self, stage: &Stage, lamp: &Lamp, eye: Vec3A) -> Option<(Vec3A, bool)> {
        let Self { surface, frame, out, .. } = self;
        let material = stage.material(&self.hit);
        let arriving = lamp.arriving(surface.position, [0.5; 2])?;
        let towards = frame.local(arriving.direction);
        let back = if material.scattering_length == Vec3A::ZERO {
            let lobes = material.lobes(surface.albedo, *out, towards);
            lobes.gloss + lobes.base
        } else {
            // Subsurface light reaches beyond the terminator; the lit side has correspondingly
            // less.
            let wrap = material.scattering_length / (material.scattering_length + WRAP_LENGTH);
            let wrapped =
                (Vec3A::splat(towards.z) + wrap).max(Vec3A::ZERO) / ((Vec3A::ONE + wrap) * (Vec3A::ONE + wrap));
            material.gloss(surface.albedo, *out, towards) + surface.albedo * wrapped * std::f32::consts::FRAC_1_PI
        };
        let apart = BESIDE_EYE_SHARE * arriving.distance;
        let aside = lamp.centre().distance_squared(eye) >= apart * apart;
        (back != Vec3A::ZERO).then_some((back * arriving.light, aside))
    }
}

/// Buffers for the shadows of one lamp on a tile, reused from tile to tile.
#[derive(Default)]
pub(crate) struct ShadowBuffers {
    candidates: BundleCandidates,
    waiting: Vec<(usize, Vec3A)>,
    directions: Vec<Vec3A>,
}

/// Adds the light of all lamps to the visible points of a tile. With `shadows`, lamps that are not
/// beside the `eye` cast them. Shadow rays start at the lamp: the rays of a tile form a bundle.
pub(crate) fn light(
    stage: &Stage,
    eye: Vec3A,
    visible: &mut [VisiblePoint],
    shadows: bool,
    shadow_buffers: &mut ShadowBuffers,
    stacks: &mut Stacks,
) {
    let ShadowBuffers { candidates, waiting, directions } = shadow_buffers;
    for lamp in stage.lamps() {
        let centre = lamp.centre();
        waiting.clear();
        directions.clear();
        for (i, point) in visible.iter_mut().enumerate() {
            let Some((light, aside)) = point.lit_by(stage, lamp, eye) else { continue };
            if !(shadows && aside) {
                point.light += light;
                continue;
            }
            let Surface { position, flat, .. } = point.surface;
            let direction = position + flat * offset(position) - centre;
            // A surface that faces away from the lamp is in its own shadow.
            if direction.dot(flat) < 0.0 {
                waiting.push((i, light));
                directions.push(direction);
            }
        }
        stage.collect_bundle(centre, directions, candidates);
        for ((i, light), direction) in waiting.iter().zip(directions.iter()) {
            if !stage.bundle_blocked(candidates, centre, *direction, SHADOW_RAY_END, stacks) {
                visible[*i].light += *light;
            }
        }
    }
}

/// Share of the distance from a lamp in which an occluder counts. It is below 1 by the rounding
/// error.
pub(crate) const SHADOW_RAY_END: f32 = 1.0 - 5e-7;
