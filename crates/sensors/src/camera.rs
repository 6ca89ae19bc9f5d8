//! The cameras of a scene prepared for rendering: pose, lens at any size, lights, exposure.

use crate::{Error, Result};
use glam::DVec3;
use std::sync::Arc;
use trocar_camera::Camera;
use trocar_core::Pose;
use trocar_render::{Film, Light, RayGenerator, Stage};
use trocar_scene::{CellCamera, Imaging, Scene};

/// Name of the overview camera that every rig has: both arms above the specimen, seen from the
/// other side of the table. A scene camera of the same name replaces it.
pub const OUTSIDE: &str = "outside";

/// Diameter of the endoscope's circular image relative to the image height. The corners of wide
/// pictures are black; square pictures lose little.
const IMAGE_CIRCLE: f32 = 1.34;
/// Distance of the endoscope's light from the centre of its lens (m). Real endoscopes have a ring
/// of fibres there.
const LIGHT_OFFSET: f64 = 0.0025;
/// A white surface at this multiple of the distance to the centre of the view has radiance 1.
const WHITE_DISTANCE_RATIO: f64 = 1.28;
/// Number of picture sizes for which a camera keeps its rays.
const CACHED_SIZES: usize = 3;

/// One camera of the rig.
#[derive(Clone, Debug)]
pub(crate) struct RigCamera {
    pub name: String,
    pub pose: Pose,
    /// Whether the camera measures depth.
    pub depth: bool,
    pub lights: Vec<Light>,
    pub environment: [f32; 3],
    pub film: Film,
    pub model: Camera,
    round: bool,
    rays: Vec<([usize; 2], Arc<RayGenerator>)>,
}

/// The lighting of the room.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub middle: DVec3,
}

impl Room {
    /// A soft box of about a metre above the specimen, on the side of the viewer.
    fn lights(self) -> Vec<Light> {
        let corner = self.middle + DVec3::new(-0.85, 0.25, 1.35);
        let radiance = [4.6, 4.5, 4.3];
        // It shines to the side of `along` x `across`: down and slightly towards the arms.
        vec![Light::Panel { corner, along: DVec3::new(0.0, 0.75, -0.35), across: DVec3::new(1.3, 0.0, 0.0), radiance }]
    }
}

impl RigCamera {
    /// A camera lit by the room.
    pub fn lit(name: &str, model: Camera, pose: Pose, depth: bool, room: Room) -> Self {
        Self {
            name: name.to_owned(),
            pose,
            depth,
            lights: room.lights(),
            environment: [0.30, 0.31, 0.33],
            film: Film { exposure: 1.0, vignette: 0.12, shoulder: 0.72, noise: None },
            model,
            round: false,
            rays: Vec::new(),
        }
    }

    /// The cameras of `scene` and the overview camera. The exposure of an endoscope depends on what
    /// it sees of `stage`.
    pub fn all(scene: &Scene, recording: Option<&Camera>, room: Room, stage: &mut Stage) -> Result<Vec<Self>> {
        let mut all = Vec::new();
        for camera in &scene.cameras {
            let model = camera.model(recording).ok_or_else(|| Error::Camera {
                name: camera.name.clone(),
                reason: "uses the lens of the recording camera, but the specimen has none; set its field of view"
                    .to_owned(),
            })?;
            let pose = camera.view.pose(&scene.placement);
            let mut prepared = Self::lit(&camera.name, model, pose, camera.depth, room);
            if is_endoscope(camera) {
                prepared.make_endoscope(stage);
            }
            all.push(prepared);
        }
        if all.iter().all(|v| v.name != OUTSIDE) {
            all.push(Self::outside(scene, room));
        }
        all.iter_mut().for_each(|camera| camera.adjust(&scene.imaging));
        Ok(all)
    }

    /// Scales light and exposure as the scene says. Factors of 1 keep every bit.
    fn adjust(&mut self, imaging: &Imaging) {
        let lamp = imaging.lamp as f32;
        for light in &mut self.lights {
            let (Light::Spot { intensity: strength, .. } | Light::Panel { radiance: strength, .. }) = light;
            *strength = strength.map(|v| v * lamp);
        }
        self.environment = self.environment.map(|v| v * lamp);
        self.film.exposure *= imaging.exposure as f32;
    }

    /// Turns the camera into an endoscope with its own light and a circular image.
    fn make_endoscope(&mut self, stage: &mut Stage) {
        let ahead = (self.pose.rotation * DVec3::Z).as_vec3();
        let distance = stage.cast(self.pose.translation.as_vec3(), ahead).map_or(0.08, |m| f64::from(m.t));
        self.lights =
            vec![Light::endoscope(&self.pose, LIGHT_OFFSET, WHITE_DISTANCE_RATIO * distance.clamp(0.02, 0.3))];
        self.environment = [0.085, 0.062, 0.058];
        self.film = Film { vignette: 0.4, ..Film::endoscope() };
        self.round = true;
    }

    /// The overview camera: beyond the specimen, high enough to look into the tray.
    fn outside(scene: &Scene, room: Room) -> Self {
        let n = scene.arms.len().max(1) as f64;
        let bases = scene
            .arms
            .iter()
            .map(|a| DVec3::from(a.base.map_or(a.start.position_m.unwrap_or_default(), |b| b.position_m)))
            .sum::<DVec3>()
            / n;
        let away = room.middle - bases;
        let away = DVec3::new(away.x, away.y, 0.0).try_normalize().unwrap_or(DVec3::Y);
        let side = away.cross(DVec3::Z);
        let eye = room.middle + 1.02 * away + 0.52 * side + 0.98 * DVec3::Z;
        let target = room.middle - 0.21 * away + 0.235 * DVec3::Z;
        let (width, height) = (1280, 720);
        let model = Camera::centred(width, height, 54.0_f64.to_radians());
        Self::lit(OUTSIDE, model, Pose::look_at(eye, target, DVec3::Z), false, room)
    }

    /// The camera model for a picture of another size: scaled to cover that size, then cropped to
    /// its centre.
    pub fn sized(&self, [width, height]: [usize; 2]) -> Camera {
        let (w, h) = (self.model.width as f64, self.model.height as f64);
        let scale = (width as f64 / w).max(height as f64 / h);
        let place = |c: f64, own: f64, new: usize| (c + 0.5 - 0.5 * (own - new as f64 / scale)) * scale - 0.5;
        Camera {
            width,
            height,
            fx: self.model.fx * scale,
            fy: self.model.fy * scale,
            cx: place(self.model.cx, w, width),
            cy: place(self.model.cy, h, height),
            ..self.model
        }
    }

    pub fn rays(&mut self, size: [usize; 2]) -> &RayGenerator {
        let at = match self.rays.iter().position(|(s, _)| *s == size) {
            Some(at) => at,
            None => {
                let rays = RayGenerator::new(self.sized(size));
                if self.rays.len() >= CACHED_SIZES {
                    self.rays.remove(0);
                }
                let rays = if self.round { rays.with_circular_image(IMAGE_CIRCLE) } else { rays };
                self.rays.push((size, Arc::new(rays)));
                self.rays.len() - 1
            }
        };
        &self.rays[at].1
    }
}

/// Diameter of the circular image of a camera over the image's height; `None` for a camera whose
/// image is not circular.
pub fn image_circle(camera: &CellCamera) -> Option<f64> {
    is_endoscope(camera).then_some(f64::from(IMAGE_CIRCLE))
}

/// Whether a camera is an endoscope: it has an oblique view, or the name `endoscope`.
pub(crate) fn is_endoscope(camera: &CellCamera) -> bool {
    camera.oblique_deg != 0.0 || camera.name == "endoscope"
}
