//! The camera rig.

use crate::camera::{RigCamera, Room};
use crate::cell_stage::CellStage;
use crate::skins::ArmPosture;
use crate::{Error, OUTSIDE, Result};
use glam::{DQuat, DVec3};
use std::sync::Arc;
use trocar_camera::{Camera, DepthNoise};
use trocar_cell::{Cell, Placed};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Noise, Picture, RenderSettings, render_into};
use trocar_scene::{Scene, Start, Task};
use trocar_specimen::Specimen;

/// Width of a depth camera's native picture (px). Its disparities have this resolution for pictures
/// of any size.
const NATIVE_DEPTH_WIDTH: f64 = 848.0;

/// Range of the width and the height of a picture (px).
const PICTURE_SIDES: std::ops::RangeInclusive<usize> = 8..=8192;

/// Noise of the sensors; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraNoise {
    /// Colour noise: standard deviation of the shot noise at white, and of the read noise. Typical
    /// values are 0.015 and 0.003.
    pub color: Option<[f32; 2]>,
    /// Noise of cameras that measure depth.
    pub depth: Option<DepthNoise>,
    /// Seed of both. The noise of a frame also depends on its time.
    pub seed: u32,
}

/// The cameras of a cell, or of a specimen alone.
///
/// ```no_run
/// use trocar_cell::Cell;
/// use trocar_render::RenderSettings;
/// use trocar_sensors::CameraRig;
/// # fn show(scene: &trocar_scene::Scene, specimen: &trocar_specimen::Specimen, cell: &Cell)
/// # -> trocar_sensors::Result<()> {
/// let mut rig = CameraRig::new(scene, specimen, cell)?;
/// let picture = rig.render(cell, "endoscope", [224, 224], &RenderSettings::preview())?;
/// println!("depth at the first pixel: {} m", picture.depth.depth[0]);
/// # Ok(())
/// # }
/// ```
///
/// A copy shows another cell of the same scene as well. Both share everything but the organs that
/// have moved.
#[derive(Clone)]
pub struct CameraRig {
    cameras: Vec<RigCamera>,
    visible: CellStage,
    picture: Picture,
    /// See [`drawn_part`]; `None` for a specimen alone.
    scene: Option<Box<Scene>>,
    /// Noise of the sensors.
    pub noise: CameraNoise,
}

impl CameraRig {
    /// Builds the cameras of `scene` for `cell`, which was built from the same scene and `specimen`
    /// (see [`Cell::new`]).
    ///
    /// # Errors
    /// A camera uses the lens of a recording that the specimen does not have, or the cell belongs
    /// to another scene.
    pub fn new(scene: &Scene, specimen: &Specimen, cell: &Cell) -> Result<Self> {
        let arm = |side: &str| Ok((cell.arm_model(side)?.to_owned(), ArmPosture::of(cell, side)?));
        let sides = scene.tools().into_iter().map(|tool| tool.arm.name.name());
        let mut made = Self::without_cell(scene, specimen, &sides.map(arm).collect::<Result<Vec<_>>>()?)?;
        made.visible.update(cell)?;
        Ok(made)
    }

    /// Builds the cameras of `scene` for recorded surfaces, see [`show`](Self::show). `arms` has
    /// the model and a posture of each arm.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn without_cell(scene: &Scene, specimen: &Specimen, arms: &[(String, ArmPosture)]) -> Result<Self> {
        let placed = Placed::new(scene, specimen)?.specimen;
        let mut visible = CellStage::new(&placed, scene.placement.pose(), Some(scene))?;
        // Lights depend on the recorded pose of the organs: pictures do not depend on the history
        // of the cell.
        visible.rebuild()?;
        let room = Room { middle: middle(&placed) };
        let cameras = RigCamera::all(scene, specimen.camera.as_ref(), room, &mut visible.stage)?;
        for (k, (tool, (model, posture))) in scene.tools().iter().zip(arms).enumerate() {
            visible.add_arm(k, (scene, tool.arm), tool.instrument, (model, posture))?;
        }
        visible.invalidate();
        let scene = Some(Box::new(drawn_part(scene)));
        Ok(Self { scene, ..Self::with(visible, cameras) })
    }

    /// Whether [`new`](Self::new) gives the same cameras for both scenes.
    pub fn shows_same(one: &Scene, other: &Scene) -> bool {
        drawn_part(one) == drawn_part(other)
    }

    /// Whether [`new`](Self::new) would give the same cameras for `scene`. Where an episode begins
    /// does not matter.
    pub fn is_of(&self, scene: &Scene) -> bool {
        self.scene.as_ref().is_some_and(|own| **own == drawn_part(scene))
    }

    /// Builds the cameras of a specimen in its recorded pose: `recording` if the specimen has a
    /// camera, and `outside`, a view from the side.
    ///
    /// # Errors
    /// A mesh is too large.
    pub fn from_specimen(specimen: &Specimen) -> Result<Self> {
        let pose = Pose { rotation: DQuat::from_rotation_arc(specimen.up.normalize(), DVec3::Z), ..Pose::IDENTITY };
        let mut placed = specimen.clone();
        for organ in &mut placed.organs {
            for p in organ.body.vertices.iter_mut().chain(&mut organ.surface.vertices) {
                *p = pose.transform(*p);
            }
        }
        let mut visible = CellStage::new(&placed, pose, None)?;
        let mut cameras = Vec::new();
        let middle = middle(&placed);
        let room = Room { middle };
        if let Some(camera) = specimen.camera {
            cameras.push(RigCamera::lit("recording", camera, pose, true, room));
        }
        let away = pose.rotation * DVec3::Y;
        let away = DVec3::new(away.x, away.y, 0.0).try_normalize().unwrap_or(DVec3::Y);
        let size = placed.organs.iter().filter_map(|o| o.surface.bounds()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let size = size.map_or(0.1, |(low, high)| (high - low).length());
        let eye = middle + 1.1 * size * (0.62 * away + 0.25 * away.cross(DVec3::Z) + 0.75 * DVec3::Z);
        let model = Camera::centred(1280, 720, 58.0_f64.to_radians());
        cameras.push(RigCamera::lit(OUTSIDE, model, Pose::look_at(eye, middle, DVec3::Z), false, room));
        visible.rebuild()?;
        Ok(Self::with(visible, cameras))
    }

    fn with(visible: CellStage, cameras: Vec<RigCamera>) -> Self {
        Self { cameras, visible, picture: Picture::default(), scene: None, noise: CameraNoise::default() }
    }

    /// Updates the stage to the current state of the cell. [`Self::render`] does this itself.
    ///
    /// # Errors
    /// The cell belongs to another scene.
    pub fn update(&mut self, cell: &Cell) -> Result<()> {
        self.visible.update(cell)
    }

    /// Updates the stage to recorded surfaces and arms, which [`render_still`](Self::render_still)
    /// shows. `organs` has for each organ of the specimen its mesh and the positions of its
    /// vertices (m); `other_meshes`: the meshes are not those of the last call.
    ///
    /// # Errors
    /// Another number of organs or of positions.
    pub fn show(
        &mut self,
        organs: &[(Arc<TriMesh>, Vec<DVec3>)],
        other_meshes: bool,
        arms: &[ArmPosture],
    ) -> Result<()> {
        self.visible.show(organs, other_meshes, arms)
    }

    /// Names of the cameras: those of the scene first.
    pub fn cameras(&self) -> Vec<&str> {
        self.cameras.iter().map(|v| v.name.as_str()).collect()
    }

    /// Labels of pictures with the names of their objects; 0 means no object.
    pub fn labels(&self) -> &[(u16, String)] {
        &self.visible.labels
    }

    /// Native picture size of a camera (px).
    ///
    /// # Errors
    /// The camera is unknown.
    pub fn size(&self, camera: &str) -> Result<[usize; 2]> {
        let model = &self.cameras[self.index(camera)?].model;
        Ok([model.width, model.height])
    }

    /// Camera model for pictures of `size`, and its pose in the world.
    ///
    /// # Errors
    /// The camera is unknown.
    pub fn model(&self, camera: &str, size: [usize; 2]) -> Result<(Camera, Pose)> {
        let own = &self.cameras[self.index(camera)?];
        Ok((own.sized(size), own.pose))
    }

    /// Adds a camera lit by the room, or replaces the camera of the same name.
    pub fn add_camera(&mut self, name: &str, model: Camera, pose: Pose) {
        let room = Room { middle: self.visible.organs_middle() };
        self.cameras.retain(|v| v.name != name);
        self.cameras.push(RigCamera::lit(name, model, pose, false, room));
    }

    /// Sets a section plane through a point with a normal. Pictures show the cut organs without the
    /// part on the normal's side; `None` shows whole organs. Organs in pieces are not cut.
    pub fn set_section(&mut self, plane: Option<(DVec3, DVec3)>) {
        self.visible.set_section(plane);
    }

    fn index(&self, camera: &str) -> Result<usize> {
        self.cameras.iter().position(|v| v.name == camera).ok_or_else(|| Error::UnknownCamera {
            name: camera.chars().take(60).collect(),
            known: self.cameras().join(", "),
        })
    }

    /// Renders `cell` in its current state through `camera`.
    ///
    /// `size` is width and height (px). The camera's native picture is scaled to cover that size,
    /// then cropped to its centre. The picture contains colour, depth along the camera's z axis
    /// (m), labels (see [`Self::labels`]) and normals in the camera frame. After the first picture
    /// of a size, little memory is allocated, and none for organs at rest.
    ///
    /// # Errors
    /// The camera is unknown, the size is out of range, or the cell belongs to another scene.
    pub fn render(
        &mut self,
        cell: &Cell,
        camera: &str,
        size: [usize; 2],
        settings: &RenderSettings,
    ) -> Result<&Picture> {
        self.index(camera)?;
        self.update(cell)?;
        self.expose(camera, size, settings, (1e3 * cell.time()).round() as u32)
    }

    /// Renders the organs in their recorded pose, or in the state of the last cell that was
    /// rendered.
    ///
    /// # Errors
    /// See [`Self::render`].
    pub fn render_still(&mut self, camera: &str, size: [usize; 2], settings: &RenderSettings) -> Result<&Picture> {
        self.index(camera)?;
        self.visible.ensure_organs()?;
        self.expose(camera, size, settings, 0)
    }

    fn expose(&mut self, camera: &str, size: [usize; 2], settings: &RenderSettings, frame: u32) -> Result<&Picture> {
        if size.iter().any(|n| !PICTURE_SIDES.contains(n)) {
            return Err(Error::Size(size[0], size[1]));
        }
        let at = self.index(camera)?;
        let sensor = self.noise;
        let louder = self.scene.as_ref().map_or(1.0, |s| s.imaging.noise);
        let Self { cameras, visible: CellStage { stage, .. }, picture, .. } = self;
        let own = &mut cameras[at];
        stage.lights.clone_from(&own.lights);
        stage.environment = own.environment;
        let mut film = own.film;
        film.noise = sensor.color.map(|[shot, read]| {
            let [shot, read] = [shot, read].map(|v| v * louder as f32);
            Noise { shot, read, seed: sensor.seed, frame }
        });
        // The stereo pair itself is neither cropped nor scaled.
        let focal = own.model.fx * NATIVE_DEPTH_WIDTH / own.model.width.max(1) as f64;
        let (pose, depth) = (own.pose, own.depth);
        render_into(picture, stage, own.rays(size), &pose, settings, &film);
        if let Some(noise) = sensor.depth.filter(|_| depth) {
            let noise = DepthNoise { disparity_sigma: noise.disparity_sigma * louder, ..noise };
            let camera = own.sized(size);
            let seeds = [u64::from(sensor.seed), u64::from(frame)];
            noise.apply_resampled(&mut picture.depth, Some(&picture.color), &camera, focal, seeds)?;
        }
        Ok(&self.picture)
    }

    /// Frees what is kept of earlier pictures, see [`trocar_render::render_into`]. The next ones
    /// are made from nothing and are the same.
    pub fn forget_pictures(&mut self) {
        self.visible.stage.forget_pictures();
    }

    /// Number of triangles on the stage.
    pub fn triangles(&self) -> usize {
        self.visible.stage.triangles()
    }
}

/// The part of a scene that pictures are made of: all but the arms' starts and the task.
fn drawn_part(scene: &Scene) -> Scene {
    let mut part = scene.clone();
    part.arms.iter_mut().for_each(|arm| arm.start = Start { position_m: arm.start.position_m, ..Start::default() });
    part.task = Task::default();
    part
}

/// Centre of the organs.
fn middle(placed: &Specimen) -> DVec3 {
    let all = placed.organs.iter().filter_map(|o| o.surface.bounds());
    let bounds = all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    bounds.map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high))
}
