//! The cameras of a scene, made ready to see: pose, lens at any size, lights, exposure.

use crate::{Error, Result};
use glam::DVec3;
use trocar_camera::{Camera, Pose};
use trocar_render::{Eye, Film, Light, Stage};
use trocar_scene::{CellCamera, Scene};

/// Name of the camera that every sight has: both arms over the specimen, from the other side of the table. A scene's own camera of that name goes before it.
pub const OUTSIDE: &str = "outside";

/// Diameter of the endoscope's round picture over the image's height: the corners of wide pictures are black, little of square ones.
const ROUND: f32 = 1.34;
/// The endoscope's light is this far from the middle of its lens [m]: fibres around it.
const BESIDE: f64 = 0.0025;
/// A white surface at this many times the distance of what is in the picture's middle is as bright as the film.
const WHITE_AT: f64 = 1.28;
/// Sizes of which a camera keeps its rays.
const SIZES: usize = 3;

/// One camera.
#[derive(Clone, Debug)]
pub(crate) struct Viewer {
    pub name: String,
    pub pose: Pose,
    /// It measures depth.
    pub depth: bool,
    pub lights: Vec<Light>,
    pub environment: [f32; 3],
    pub film: Film,
    pub model: Camera,
    round: bool,
    eyes: Vec<([usize; 2], Eye)>,
}

/// Where the room's light hangs: above this point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub middle: DVec3,
}

impl Room {
    /// A soft box of a metre above the specimen, towards those who look on.
    fn lights(self) -> Vec<Light> {
        let corner = self.middle + DVec3::new(-0.85, 0.25, 1.35);
        let radiance = [4.6, 4.5, 4.3];
        // It shines to the side of `along` x `across`: down, and a little towards the arms.
        vec![Light::Panel { corner, along: DVec3::new(0.0, 0.75, -0.35), across: DVec3::new(1.3, 0.0, 0.0), radiance }]
    }
}

impl Viewer {
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
            eyes: Vec::new(),
        }
    }

    /// The cameras of `scene`, and the one outside. Exposure of an endoscope is set by what it sees of `stage`.
    pub fn all(scene: &Scene, recording: Option<&Camera>, room: Room, stage: &mut Stage) -> Result<Vec<Self>> {
        let mut all = Vec::new();
        for camera in &scene.cameras {
            let model = camera.model(recording).ok_or_else(|| Error::Camera {
                name: camera.name.clone(),
                reason: "has the lens of the specimen's recording, and the specimen has none; give it a field of view"
                    .to_owned(),
            })?;
            let pose = camera.view.pose(&scene.placement);
            let mut viewer = Self::lit(&camera.name, model, pose, camera.depth, room);
            if is_endoscope(camera) {
                viewer.behind_lens(stage);
            }
            all.push(viewer);
        }
        if all.iter().all(|v| v.name != OUTSIDE) {
            all.push(Self::outside(scene, room));
        }
        Ok(all)
    }

    /// An endoscope: its own light, its round picture.
    fn behind_lens(&mut self, stage: &mut Stage) {
        let ahead = (self.pose.rotation * DVec3::Z).as_vec3();
        let distance = stage.cast(self.pose.translation.as_vec3(), ahead).map_or(0.08, |m| f64::from(m.t));
        self.lights = vec![Light::endoscope(&self.pose, BESIDE, WHITE_AT * distance.clamp(0.02, 0.3))];
        self.environment = [0.085, 0.062, 0.058];
        self.film = Film { vignette: 0.4, ..Film::endoscope() };
        self.round = true;
    }

    /// From beyond the specimen, high enough to look into the tray.
    fn outside(scene: &Scene, room: Room) -> Self {
        let n = scene.arms.len().max(1) as f64;
        let bases = scene.arms.iter().map(|a| DVec3::from(a.base.map_or(a.start.position_m.unwrap_or_default(), |b| b.position_m))).sum::<DVec3>() / n;
        let away = room.middle - bases;
        let away = DVec3::new(away.x, away.y, 0.0).try_normalize().unwrap_or(DVec3::Y);
        let side = away.cross(DVec3::Z);
        let eye = room.middle + 1.02 * away + 0.52 * side + 0.98 * DVec3::Z;
        let target = room.middle - 0.21 * away + 0.235 * DVec3::Z;
        let (width, height) = (1280, 720);
        let model = Camera::centred(width, height, 54.0_f64.to_radians());
        Self::lit(OUTSIDE, model, Pose::look_at(eye, target, DVec3::Z), false, room)
    }

    /// A picture of another size: scaled until it covers that, its middle cut out.
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

    /// The rays of a picture of that size.
    pub fn eye(&mut self, size: [usize; 2]) -> &Eye {
        let at = match self.eyes.iter().position(|(s, _)| *s == size) {
            Some(at) => at,
            None => {
                let eye = Eye::new(self.sized(size));
                if self.eyes.len() >= SIZES {
                    self.eyes.remove(0);
                }
                self.eyes.push((size, if self.round { eye.round(ROUND) } else { eye }));
                self.eyes.len() - 1
            }
        };
        &self.eyes[at].1
    }
}

/// Whether a camera is an endoscope: oblique, or of that name.
pub(crate) fn is_endoscope(camera: &CellCamera) -> bool {
    camera.oblique_deg != 0.0 || camera.name == "endoscope"
}
