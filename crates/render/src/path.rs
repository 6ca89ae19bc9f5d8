//! Light by paths: every bounce is joined with the lights and goes on in a random direction; what both ways can find is weighed
//! between them (Veach 1997, the power heuristic).

use crate::material::{Material, body_direction};
use crate::preview::{Frame, offset};
use crate::random::numbers;
use crate::stage::{Stage, Surface, Touch};
use crate::tree::{Ray, Stacks};
use glam::Vec3A;

/// Bounces after which paths are ended at random.
const SURE: u32 = 3;

/// What a path's random numbers are for; `draw` numbers its draws.
#[derive(Clone, Copy)]
pub(crate) struct Key {
    pub seed: u32,
    pub pixel: u32,
    pub sample: u32,
}

impl Key {
    /// Four numbers for purpose `what` at a bounce.
    pub fn draw(self, bounce: u32, what: u32) -> [f32; 4] {
        numbers([self.pixel, self.sample, bounce << 8 | what, self.seed])
    }
}

/// Purposes of random numbers; lights have theirs from `LIGHTS` on.
pub(crate) const LENS: u32 = 0;
const GO_ON: u32 = 1;
const WANDER: u32 = 2;
const END: u32 = 3;
const LIGHTS: u32 = 16;

/// A place where light is gathered, with its axes.
struct Place {
    surface: Surface,
    frame: Frame,
    /// Light of the body's part here for one at the place that is seen: wandering chooses it.
    weight: Vec3A,
}

/// Radiance that comes back along one path from `origin` along `direction`, of at most `bounces` bounces.
pub(crate) fn radiance(
    stage: &Stage,
    origin: Vec3A,
    direction: Vec3A,
    bounces: u32,
    key: Key,
    stacks: &mut Stacks,
) -> Vec3A {
    let (mut origin, mut direction) = (origin, direction);
    let mut throughput = Vec3A::ONE;
    let mut sum = Vec3A::ZERO;
    // Density with which the last bounce chose this direction; none other could for the eye's.
    let mut density = f32::INFINITY;
    for bounce in 0..=bounces {
        let touch = stage.first(origin, direction, f32::INFINITY, stacks);
        let reach = touch.map_or(f32::INFINITY, |t| t.t);
        if let Some(light) = panel(stage, origin, direction, reach, density) {
            return sum + throughput * light;
        }
        let Some(touch) = touch else { return sum + throughput * Vec3A::from(stage.environment) };
        if bounce == bounces {
            return sum;
        }
        let surface = stage.surface(&touch, direction);
        let material = if bounce == 0 { stage.material(&touch) } else { stage.blunt(&touch) };
        let seen = Place { surface, frame: Frame::new(surface.smooth), weight: Vec3A::ONE };
        let to_eye = seen.frame.local(-direction.normalize());
        let below = if bounce == 0 { wander(stage, &touch, &seen, material, key, stacks) } else { None };
        let share = material.gloss_share(surface.albedo, to_eye);
        sum += throughput * from_lights(stage, &seen, below.as_ref(), material, to_eye, share, bounce, key, stacks);

        let [choice, a, b, _] = key.draw(bounce, GO_ON);
        let (place, towards, factor, chosen) = if choice < share {
            let Some(towards) = material.gloss_direction(to_eye, [a, b]) else { return sum };
            let parts = material.parts(surface.albedo, to_eye, towards);
            (&seen, towards, parts.gloss, parts.gloss_density * share)
        } else {
            let place = below.as_ref().unwrap_or(&seen);
            let towards = body_direction([a, b]);
            let parts = material.parts(place.surface.albedo, to_eye, towards);
            (place, towards, parts.body * place.weight, parts.body_density * (1.0 - share))
        };
        direction = place.frame.world(towards);
        // A smooth normal may send it below the triangle.
        if chosen.is_nan() || chosen <= 0.0 || direction.dot(place.surface.flat) <= 0.0 {
            return sum;
        }
        throughput *= factor / chosen;
        density = chosen;
        origin = place.surface.position + place.surface.flat * offset(place.surface.position);
        if bounce >= SURE {
            let survives = throughput.max_element().min(0.95);
            if survives.is_nan() || key.draw(bounce, END)[0] >= survives {
                return sum;
            }
            throughput /= survives;
        }
    }
    sum
}

/// Radiance of the nearest panel before `reach`, weighed against the joining that could have found it.
fn panel(stage: &Stage, origin: Vec3A, direction: Vec3A, reach: f32, density: f32) -> Option<Vec3A> {
    let ray = Ray::new(origin, direction);
    let mut nearest: Option<(f32, Vec3A)> = None;
    for lamp in stage.lamps() {
        let limit = nearest.map_or(reach, |n| n.0);
        if let Some((t, radiance, joined)) = lamp.met(&ray, limit) {
            let weight = if density.is_infinite() { 1.0 } else { heuristic(density, joined) };
            nearest = Some((t, radiance * weight));
        }
    }
    nearest.map(|n| n.1)
}

/// Light from all lights by joining: the gloss at the place seen, the body where light went in.
#[allow(clippy::too_many_arguments, reason = "one call; the arguments are one place on a path")]
fn from_lights(
    stage: &Stage,
    seen: &Place,
    below: Option<&Place>,
    material: &Material,
    to_eye: Vec3A,
    share: f32,
    bounce: u32,
    key: Key,
    stacks: &mut Stacks,
) -> Vec3A {
    let mut sum = Vec3A::ZERO;
    for (index, lamp) in stage.lamps().iter().enumerate() {
        let [a, b, ..] = key.draw(bounce, LIGHTS + (index as u32 & 0x7f));
        let mut gather = |place: &Place, gloss: bool, body: bool| {
            let Some(arriving) = lamp.arriving(place.surface.position, [a, b]) else { return };
            if arriving.direction.dot(place.surface.flat) <= 0.0 {
                return;
            }
            let parts = material.parts(place.surface.albedo, to_eye, place.frame.local(arriving.direction));
            let mut back = Vec3A::ZERO;
            if gloss {
                back += parts.gloss * joined_weight(arriving.density, parts.gloss_density * share);
            }
            if body {
                let weight = joined_weight(arriving.density, parts.body_density * (1.0 - share));
                back += parts.body * place.weight * weight;
            }
            if back == Vec3A::ZERO {
                return;
            }
            let origin = place.surface.position + place.surface.flat * offset(place.surface.position);
            if !stage.blocked(origin, arriving.direction, arriving.distance * (1.0 - 1e-4), stacks) {
                sum += back * arriving.light;
            }
        };
        match below {
            None => gather(seen, true, true),
            Some(below) => {
                gather(seen, true, false);
                gather(below, false, true);
            }
        }
    }
    sum
}

/// Weight of joining against going on; points are only found by joining.
fn joined_weight(joined: f32, going_on: f32) -> f32 {
    if joined == 0.0 { 1.0 } else { heuristic(joined, going_on) }
}

/// The power heuristic.
fn heuristic(chosen: f32, other: f32) -> f32 {
    let (a, b) = (chosen * chosen, other * other);
    if a.is_infinite() { 1.0 } else { a / (a + b).max(1e-30) }
}

/// Where light that comes out at `seen` went in: Burley's profile of normalised diffusion (Christensen and Burley 2015,
/// "Approximate Reflectance Profiles for Efficient Subsurface Scattering"), found by a short ray through the same body. The
/// profile integrates to 1 for each colour, so no light is lost or made on a flat surface.
fn wander(
    stage: &Stage,
    touch: &Touch,
    seen: &Place,
    material: &Material,
    key: Key,
    stacks: &mut Stacks,
) -> Option<Place> {
    let lengths = material.scattering_length;
    if lengths == Vec3A::ZERO {
        return None;
    }
    let [which, a, b, turn] = key.draw(0, WANDER);
    let length = lengths[((which * 3.0) as usize).min(2)];
    // A quarter falls off with the length, the rest with three times it.
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
    let normal = seen.surface.flat;
    let (x, y) = normal.any_orthonormal_pair();
    let (sin, cos) = (std::f32::consts::TAU * turn).sin_cos();
    let height = radius + 0.5 * length;
    let above = seen.surface.position + (x * cos + y * sin) * radius + normal * height;
    let found = stage.first_of(touch.body, above, -normal, 2.0 * height, stacks);
    let surface = match found {
        Some(found) => stage.surface(&found, -normal),
        // Beside a rim: it comes out where it went in.
        None => seen.surface,
    };
    Some(Place { surface, frame: Frame::new(surface.smooth), weight: each / mean })
}
