//! Path tracing. Every vertex of a path samples the lights directly and a direction of its
//! material; light that both can find is weighted with the power heuristic (Veach 1997).

use crate::bvh::{Ray, Stacks};
use crate::material::{Material, cosine_direction};
use crate::samples::{PathSample, Purpose};
use crate::shading_frame::{ShadingFrame, offset};
use crate::stage::{Stage, StageHit, Surface};
use glam::Vec3A;

/// Number of bounces before Russian roulette starts.
const ROULETTE_START: u32 = 3;

/// A surface point where light is gathered, with its local frame.
struct PathVertex {
    surface: Surface,
    frame: ShadingFrame,
    /// Radiance of the base lobe here relative to the visible point. Subsurface sampling sets it.
    weight: Vec3A,
}

/// What a path sees first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstHit {
    /// Linear colour of the surface; white where there is none.
    pub albedo: Vec3A,
    /// Its unit normal; zero where there is none.
    pub normal: Vec3A,
    /// Its place relative to the eye (m).
    pub place: Vec3A,
}

/// Radiance along one path from `origin` in `direction` with at most `bounces` bounces. Writes what
/// it sees first.
pub(crate) fn radiance(
    stage: &Stage,
    origin: Vec3A,
    direction: Vec3A,
    bounces: u32,
    sample: PathSample,
    first: &mut FirstHit,
    stacks: &mut Stacks,
) -> Vec3A {
    *first = FirstHit { albedo: Vec3A::ONE, normal: Vec3A::ZERO, place: direction };
    let (mut origin, mut direction) = (origin, direction);
    let mut throughput = Vec3A::ONE;
    let mut sum = Vec3A::ZERO;
    // Density with which the last bounce sampled this direction; infinite for camera rays, which
    // have no alternative.
    let mut density = f32::INFINITY;
    for bounce in 0..=bounces {
        let hit = stage.first(origin, direction, f32::INFINITY, stacks);
        let reach = hit.map_or(f32::INFINITY, |t| t.t);
        if let Some(light) = panel(stage, origin, direction, reach, density) {
            return sum + throughput * light;
        }
        let Some(hit) = hit else { return sum + throughput * Vec3A::from(stage.environment) };
        if bounce == bounces {
            return sum;
        }
        let surface = stage.surface(&hit, direction);
        if bounce == 0 {
            *first = FirstHit { albedo: surface.albedo, normal: surface.smooth, place: surface.position - origin };
        }
        let material = if bounce == 0 { stage.material(&hit) } else { stage.path_material(&hit) };
        let visible = PathVertex { surface, frame: ShadingFrame::new(surface.smooth), weight: Vec3A::ONE };
        let to_eye = visible.frame.local(-direction.normalize());
        let entry = if bounce == 0 { subsurface_entry(stage, &hit, &visible, material, sample, stacks) } else { None };
        let gloss_probability = material.gloss_probability(surface.albedo, to_eye);
        sum += throughput
            * direct_light(
                stage,
                &visible,
                entry.as_ref(),
                material,
                to_eye,
                gloss_probability,
                bounce,
                sample,
                stacks,
            );

        let [choice, a, b, _] = sample.draw(Purpose::Direction(bounce));
        let (vertex, towards, factor, chosen) = if choice < gloss_probability {
            let Some(towards) = material.sample_gloss(to_eye, [a, b]) else { return sum };
            let lobes = material.lobes(surface.albedo, to_eye, towards);
            (&visible, towards, lobes.gloss, lobes.gloss_density * gloss_probability)
        } else {
            let vertex = entry.as_ref().unwrap_or(&visible);
            let towards = cosine_direction([a, b]);
            let lobes = material.lobes(vertex.surface.albedo, to_eye, towards);
            (vertex, towards, lobes.base * vertex.weight, lobes.base_density * (1.0 - gloss_probability))
        };
        direction = vertex.frame.world(towards);
        // A shading normal can send the direction below the triangle.
        if chosen.is_nan() || chosen <= 0.0 || direction.dot(vertex.surface.flat) <= 0.0 {
            return sum;
        }
        throughput *= factor / chosen;
        density = chosen;
        origin = vertex.surface.position + vertex.surface.flat * offset(vertex.surface.position);
        if bounce >= ROULETTE_START {
            let survives = throughput.max_element().min(0.95);
            if survives.is_nan() || sample.draw(Purpose::Roulette(bounce))[0] >= survives {
                return sum;
            }
            throughput /= survives;
        }
    }
    sum
}

/// Radiance of the nearest panel before `reach`, weighted against direct light sampling.
fn panel(stage: &Stage, origin: Vec3A, direction: Vec3A, reach: f32, density: f32) -> Option<Vec3A> {
    let ray = Ray::new(origin, direction);
    let mut nearest: Option<(f32, Vec3A)> = None;
    for lamp in stage.lamps() {
        let limit = nearest.map_or(reach, |n| n.0);
        if let Some((t, radiance, joined)) = lamp.intersect(&ray, limit) {
            let weight = if density.is_infinite() { 1.0 } else { power_heuristic(density, joined) };
            nearest = Some((t, radiance * weight));
        }
    }
    nearest.map(|n| n.1)
}

/// Direct light from all lights: the gloss lobe at the visible point, the base lobe where light
/// entered.
#[allow(clippy::too_many_arguments, reason = "one call; the arguments are one vertex on a path")]
fn direct_light(
    stage: &Stage,
    visible: &PathVertex,
    entry: Option<&PathVertex>,
    material: &Material,
    to_eye: Vec3A,
    gloss_probability: f32,
    bounce: u32,
    sample: PathSample,
    stacks: &mut Stacks,
) -> Vec3A {
    let mut sum = Vec3A::ZERO;
    for (index, lamp) in stage.lamps().iter().enumerate() {
        let [a, b, ..] = sample.draw(Purpose::Light(bounce, index as u32));
        let mut gather = |vertex: &PathVertex, gloss: bool, base: bool| {
            let Some(arriving) = lamp.arriving(vertex.surface.position, [a, b]) else { return };
            if arriving.direction.dot(vertex.surface.flat) <= 0.0 {
                return;
            }
            let lobes = material.lobes(vertex.surface.albedo, to_eye, vertex.frame.local(arriving.direction));
            let mut back = Vec3A::ZERO;
            if gloss {
                back += lobes.gloss * direct_weight(arriving.density, lobes.gloss_density * gloss_probability);
            }
            if base {
                let weight = direct_weight(arriving.density, lobes.base_density * (1.0 - gloss_probability));
                back += lobes.base * vertex.weight * weight;
            }
            if back == Vec3A::ZERO {
                return;
            }
            let origin = vertex.surface.position + vertex.surface.flat * offset(vertex.surface.position);
            if !stage.blocked(origin, arriving.direction, arriving.distance * (1.0 - 1e-4), stacks) {
                sum += back * arriving.light;
            }
        };
        match entry {
            None => gather(visible, true, true),
            Some(entry) => {
                gather(visible, true, false);
                gather(entry, false, true);
            }
        }
    }
    sum
}

/// Weight of direct light sampling against direction sampling. Only direct sampling finds point
/// lights.
fn direct_weight(direct: f32, sampled: f32) -> f32 {
    if direct == 0.0 { 1.0 } else { power_heuristic(direct, sampled) }
}

/// The power heuristic.
fn power_heuristic(chosen: f32, other: f32) -> f32 {
    let (a, b) = (chosen * chosen, other * other);
    if a.is_infinite() { 1.0 } else { a / (a + b).max(1e-30) }
}

/// Point where light that leaves at `visible` entered the surface: Burley's profile of normalised
/// diffusion (Christensen and Burley 2015, "Approximate Reflectance Profiles for Efficient
/// Subsurface Scattering"), found by a short ray through the same body. The profile integrates to 1
/// for each colour, so a flat surface loses and gains no light.
fn subsurface_entry(
    stage: &Stage,
    hit: &StageHit,
    visible: &PathVertex,
    material: &Material,
    sample: PathSample,
    stacks: &mut Stacks,
) -> Option<PathVertex> {
    let lengths = material.scattering_length;
    if lengths == Vec3A::ZERO {
        return None;
    }
    let [which, a, b, turn] = sample.draw(Purpose::Subsurface);
    let length = lengths[((which * 3.0) as usize).min(2)];
    // A quarter of the profile decays with the length, the rest with three times the length.
    let scale = if a < 0.25 { length } else { 3.0 * length };
    let radius = -scale * (1.0 - b).ln();
    let profile = |length: f32| {
        if length > 0.0 {
            let x = radius / length;
            ((-x).exp() + (-x / 3.0).exp()) / (4.0 * length)
        } else {
            0.0
        }
    };
    let each = Vec3A::new(profile(lengths.x), profile(lengths.y), profile(lengths.z));
    let mean = (each.x + each.y + each.z) / 3.0;
    if mean.is_nan() || mean <= 0.0 || !radius.is_finite() {
        return None;
    }
    let normal = visible.surface.flat;
    let (x, y) = normal.any_orthonormal_pair();
    let (sin, cos) = (std::f32::consts::TAU * turn).sin_cos();
    let height = radius + 0.5 * length;
    let above = visible.surface.position + (x * cos + y * sin) * radius + normal * height;
    let found = stage.first_of(hit.body, above, -normal, 2.0 * height, stacks);
    let surface = match found {
        Some(found) => stage.surface(&found, -normal),
        // Beside a rim: light leaves where it entered.
        None => visible.surface,
    };
    Some(PathVertex { surface, frame: ShadingFrame::new(surface.smooth), weight: each / mean })
}
