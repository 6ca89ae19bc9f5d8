//! Light at a surface at once, without bounces: for policies and windows, tens of pictures a second.

use crate::light::Lamp;
use crate::stage::{Ahead, Stage, Surface, Touch};
use crate::tree::Stacks;
use glam::Vec3A;

/// A light nearer to the eye than this share of its distance to a surface casts no shadow that is worth a ray: what it does not
/// reach, the eye does not see, but for a rim at edges as thin as that share of the depth behind them.
const BESIDE: f32 = 0.1;

/// A surface that the eye sees, and the light that it sends there.
pub(crate) struct Seen {
    touch: Touch,
    surface: Surface,
    frame: Frame,
    /// Towards the eye, in the surface's frame.
    out: Vec3A,
    /// Gathered so far.
    pub light: Vec3A,
}

impl Seen {
    /// What a ray in `direction` met, in the light of the environment alone, which comes evenly.
    pub fn new(stage: &Stage, touch: Touch, surface: Surface, direction: Vec3A) -> Self {
        let frame = Frame::new(surface.smooth);
        let out = frame.local(-direction.normalize());
        // Metal is a mirror: what it shows of the room is darker towards its edges, where it shows what is behind it.
        let ambient = if stage.material(&touch).is_metal() { 0.35 + 0.85 * out.z } else { 1.0 };
        let light = surface.albedo * Vec3A::from(stage.environment) * ambient;
        Self { touch, surface, frame, out, light }
    }

    /// Light that a lamp adds where nothing is in its way, and whether the lamp is seen from another place than the eye's. Panels shine from their middles.
    fn lit_by(&self, stage: &Stage, lamp: &Lamp, eye: Vec3A) -> Option<(Vec3A, bool)> {
        let Self { surface, frame, out, .. } = self;
        let material = stage.material(&self.touch);
        let arriving = lamp.arriving(surface.position, [0.5; 2])?;
        let towards = frame.local(arriving.direction);
        let back = if material.scattering_length == Vec3A::ZERO {
            let parts = material.parts(surface.albedo, *out, towards);
            parts.gloss + parts.body
        } else {
            // Light that wanders comes round the terminator; what it adds there it lacks elsewhere.
            let wrap = material.scattering_length / (material.scattering_length + WRAP_LENGTH);
            let wrapped =
                (Vec3A::splat(towards.z) + wrap).max(Vec3A::ZERO) / ((Vec3A::ONE + wrap) * (Vec3A::ONE + wrap));
            material.gloss(surface.albedo, *out, towards) + surface.albedo * wrapped * std::f32::consts::FRAC_1_PI
        };
        let apart = BESIDE * arriving.distance;
        let aside = lamp.middle().distance_squared(eye) >= apart * apart;
        (back != Vec3A::ZERO).then_some((back * arriving.light, aside))
    }
}

/// What is needed to find the shadows of one lamp on a tile, kept from tile to tile.
#[derive(Default)]
pub(crate) struct Shades {
    ahead: Ahead,
    waiting: Vec<(usize, Vec3A)>,
    directions: Vec<Vec3A>,
}

/// Adds the light of all lamps to what the eye sees in a tile. With `shadows` those that are not beside the `eye` cast them: rays go from the lamp, so that those of a tile are a bundle.
pub(crate) fn light(
    stage: &Stage,
    eye: Vec3A,
    seen: &mut [Seen],
    shadows: bool,
    shades: &mut Shades,
    stacks: &mut Stacks,
) {
    let Shades { ahead, waiting, directions } = shades;
    for lamp in stage.lamps() {
        let middle = lamp.middle();
        waiting.clear();
        directions.clear();
        for (i, place) in seen.iter_mut().enumerate() {
            let Some((light, aside)) = place.lit_by(stage, lamp, eye) else { continue };
            if !(shadows && aside) {
                place.light += light;
                continue;
            }
            let Surface { position, flat, .. } = place.surface;
            let direction = position + flat * offset(position) - middle;
            // What turns away from the lamp is in its own shadow.
            if direction.dot(flat) < 0.0 {
                waiting.push((i, light));
                directions.push(direction);
            }
        }
        stage.ahead(middle, directions, ahead);
        for ((i, light), direction) in waiting.iter().zip(directions.iter()) {
            if !stage.blocked_ahead(ahead, middle, *direction, ALL_THE_WAY, stacks) {
                seen[*i].light += *light;
            }
        }
    }
}

/// Share of the way from a lamp on which something casts a shadow: less than all by what rounds.
const ALL_THE_WAY: f32 = 1.0 - 5e-7;

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
