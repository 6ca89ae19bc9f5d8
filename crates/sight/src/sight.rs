//! The cell as cameras see it.

mod follow;

use crate::camera::{Room, Viewer, is_endoscope};
use crate::field::{Field, Recorded};
use crate::instrument::Shapes;
use crate::organ::{Draped, Whole};
use crate::{Error, OUTSIDE, Result, arm, furniture};
use glam::{DQuat, DVec3};
use std::path::PathBuf;
use trocar_camera::{Camera, DepthNoise, Pose};
use trocar_cell::{Cell, Placed};
use trocar_geometry::TriMesh;
use trocar_render::{BodyId, Look, Noise, Picture, Settings, ShapeId, Stage, SurfaceKind, render_into};
use trocar_scene::{InstrumentKind, Scene};
use trocar_specimen::Specimen;

/// Labels: organs from 1, instruments from here, arms from here, the rest from here.
const INSTRUMENTS: u16 = 101;
const ARMS: u16 = 111;
const REST: u16 = 201;

/// Width of the picture in which a depth camera finds its disparities, however small the picture is that is asked for [px].
const OWN_WIDTH: f64 = 848.0;

/// Sides of pictures [px].
const SIDES: std::ops::RangeInclusive<usize> = 8..=8192;

/// What sensors do to what they see; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensor {
    /// Noise of the colours: standard deviation at white that grows with the root of the light, and that without light. Good: 0.015 and 0.003.
    pub color: Option<[f32; 2]>,
    /// Noise of the depth, of cameras that measure it.
    pub depth: Option<DepthNoise>,
    /// Seed of both; frames have noise of their own by their time.
    pub seed: u32,
}

/// The cameras of a cell, or of a specimen alone.
pub struct Sight {
    viewers: Vec<Viewer>,
    labels: Vec<(u16, String)>,
    /// All but the organs.
    base: Stage,
    stage: Stage,
    organs: Vec<Shown>,
    arms: Vec<Arm>,
    section: Option<(DVec3, DVec3)>,
    picture: Picture,
    /// What the sensors do.
    pub sensor: Sensor,
}

/// An organ on the stage.
struct Shown {
    whole: Whole,
    label: u16,
    draped: Draped,
    shape: Option<ShapeId>,
    /// The bodies of the cell that are its pieces, with their elements.
    bodies: Vec<usize>,
    tets: Vec<Vec<[u32; 4]>>,
    nodes: Vec<DVec3>,
    before: Vec<DVec3>,
    skin: Vec<DVec3>,
}

/// An arm on the stage.
struct Arm {
    name: &'static str,
    /// The description that it is drawn from, and the shapes of base and links.
    drawn: Option<Drawn>,
    shapes: Vec<ShapeId>,
    links: Vec<BodyId>,
    shaft: BodyId,
    motor: BodyId,
    blades: [BodyId; 2],
}

/// All that the shapes of an arm with a description hang on, but for the number of its links.
#[derive(PartialEq)]
struct Drawn {
    file: PathBuf,
    flange: Option<String>,
    /// The scene asks for the file's shapes: where it shows none there are none, and no simple ones.
    asked: bool,
    model: String,
}

impl Sight {
    /// The cameras of `scene` in `cell`, which was made of it and of `specimen` (as [`Cell::new`] takes it).
    ///
    /// # Errors
    /// A camera with the lens of a recording that the specimen does not have, a cell of another scene.
    pub fn new(scene: &Scene, specimen: &Specimen, cell: &Cell) -> Result<Self> {
        let placed = Placed::new(scene, specimen)?.specimen;
        let mut sight = Self::over(&placed, scene.placement.pose(), Some(scene))?;
        // Lights are set by the organs as they were recorded, so that pictures do not depend on what the cell did before.
        sight.rebuild(None)?;
        let room = Room { middle: middle(&placed) };
        let viewers = Viewer::all(scene, specimen.camera.as_ref(), room, &mut sight.stage)?;
        for (k, tool) in scene.tools().iter().enumerate() {
            sight.add_arm(k, (scene, tool.arm), tool.instrument, cell)?;
        }
        sight.organs.iter_mut().for_each(|o| o.shape = None);
        sight.follow(cell)?;
        sight.viewers = viewers;
        Ok(sight)
    }

    /// A specimen as it was recorded: its `recording` camera if it has one, and a look at it from aside, `outside`.
    ///
    /// # Errors
    /// A mesh that is too large.
    pub fn of_specimen(specimen: &Specimen) -> Result<Self> {
        let pose = Pose { rotation: DQuat::from_rotation_arc(specimen.up.normalize(), DVec3::Z), ..Pose::IDENTITY };
        let mut placed = specimen.clone();
        for organ in &mut placed.organs {
            for p in organ.body.vertices.iter_mut().chain(&mut organ.surface.vertices) {
                *p = pose.transform(*p);
            }
        }
        let mut sight = Self::over(&placed, pose, None)?;
        let middle = middle(&placed);
        let room = Room { middle };
        if let Some(camera) = specimen.camera {
            sight.viewers.push(Viewer::lit("recording", camera, pose, true, room));
        }
        let away = pose.rotation * DVec3::Y;
        let away = DVec3::new(away.x, away.y, 0.0).try_normalize().unwrap_or(DVec3::Y);
        let size = placed.organs.iter().filter_map(|o| o.surface.bounds()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let size = size.map_or(0.1, |(low, high)| (high - low).length());
        let eye = middle + 1.1 * size * (0.62 * away + 0.25 * away.cross(DVec3::Z) + 0.75 * DVec3::Z);
        let model = Camera::centred(1280, 720, 58.0_f64.to_radians());
        sight.viewers.push(Viewer::lit(OUTSIDE, model, Pose::look_at(eye, middle, DVec3::Z), false, room));
        sight.rebuild(None)?;
        Ok(sight)
    }

    /// Organs, in the world's frame with up along z, on their field in the room of `scene`; no cameras yet. `recording` is the pose of the recording camera.
    fn over(placed: &Specimen, recording: Pose, scene: Option<&Scene>) -> Result<Self> {
        let mut sight = Self {
            viewers: Vec::new(),
            labels: Vec::new(),
            base: Stage::new(),
            stage: Stage::new(),
            organs: Vec::new(),
            arms: Vec::new(),
            section: None,
            picture: Picture::default(),
            sensor: Sensor::default(),
        };
        for (k, organ) in placed.organs.iter().enumerate() {
            let label = 1 + k as u16;
            sight.labels.push((label, organ.name.clone()));
            let whole = Whole::new(organ);
            let draped = whole.draped();
            let nodes = whole.body.vertices.clone();
            let bodies = Vec::new();
            sight.organs.push(Shown {
                whole,
                label,
                draped,
                shape: None,
                bodies,
                tets: Vec::new(),
                nodes,
                before: Vec::new(),
                skin: Vec::new(),
            });
        }
        let surfaces: Vec<&TriMesh> = placed.organs.iter().map(|o| &o.surface).collect();
        let recorded = match (&placed.background, &placed.camera) {
            (Some(picture), Some(camera)) => Some(Recorded { picture, camera, pose: recording }),
            _ => None,
        };
        let field = Field::under(&surfaces, recorded.as_ref())?;
        sight.add("field", &field.mesh, &wet(0.36))?;
        let ports = scene.map_or(&[][..], |s| &s.ports);
        let mut pieces = furniture::room(&field, ports);
        for (scene, camera) in scene.iter().flat_map(|s| s.cameras.iter().map(move |c| (s, c))) {
            if is_endoscope(camera) {
                pieces.extend(furniture::scope(&camera.shaft(&scene.placement), furniture::table(&field)));
            }
        }
        for piece in pieces {
            sight.add(piece.name, &piece.mesh, &piece.look)?;
        }
        Ok(sight)
    }

    fn label(&mut self, first: u16, name: &str) -> u16 {
        if let Some((label, _)) = self.labels.iter().find(|(_, n)| n == name) {
            return *label;
        }
        let count = self.labels.iter().filter(|(l, _)| (first..first + 10).contains(l)).count() as u16;
        self.labels.push((first + count, name.to_owned()));
        first + count
    }

    fn add(&mut self, name: &str, mesh: &TriMesh, look: &Look) -> Result<()> {
        let label = self.label(REST, name);
        self.base.add_mesh(mesh, label, look)?;
        Ok(())
    }

    fn add_arm(
        &mut self,
        k: usize,
        (scene, arm): (&Scene, &trocar_scene::Arm),
        held: &trocar_scene::Instrument,
        cell: &Cell,
    ) -> Result<()> {
        let name = arm.name.name();
        let poses = cell.link_poses(name)?;
        let label = ARMS + k as u16;
        self.labels.push((label, format!("{name} arm")));
        let shell =
            Look { color: [232; 3], surface: SurfaceKind::Coated { roughness: 0.42, ior: 1.48, wander: [0.0; 3] } };
        // Arms of one description share its shapes.
        let model = cell.arm_model(name)?;
        let drawn = arm.drawn().map(|file| Drawn {
            file: scene.resolve(file),
            flange: arm.flange.clone(),
            asked: arm.shapes.is_some(),
            model: model.to_owned(),
        });
        let same = |a: &&Arm| drawn.is_some() && a.drawn == drawn && a.shapes.len() + 1 == poses.len();
        let known = self.arms.iter().find(same).map(|a| a.shapes.clone());
        let shapes = match known {
            Some(shapes) => shapes,
            None => {
                let meshes = arm::links(scene, arm, model, &poses)?;
                meshes.iter().map(|mesh| self.base.add_shape(mesh)).collect::<std::result::Result<Vec<_>, _>>()?
            }
        };
        let mut links = Vec::new();
        for (shape, pose) in shapes.iter().zip(&poses) {
            links.push(self.base.add_body(*shape, pose, label, &shell)?);
        }
        let held_shapes = Shapes::of(held);
        let label = INSTRUMENTS + k as u16;
        self.labels.push((label, held.name.clone()));
        let polished = Look { surface: SurfaceKind::Metal { roughness: 0.3 }, ..Look::steel() };
        let dark = Look { color: [58, 61, 66], ..shell };
        let mut body = |mesh: &TriMesh, look: &Look| -> Result<BodyId> {
            let shape = self.base.add_shape(mesh)?;
            Ok(self.base.add_body(shape, &Pose::IDENTITY, label, look)?)
        };
        let shaft = body(&held_shapes.shaft, &polished)?;
        let motor = body(&held_shapes.motor, if held.kind == InstrumentKind::Grasper { &dark } else { &shell })?;
        let blades = [body(&held_shapes.blades[0], &polished)?, body(&held_shapes.blades[1], &polished)?];
        self.arms.push(Arm { name, drawn, shapes, links, shaft, motor, blades });
        Ok(())
    }

    /// Names of the cameras, the scene's first.
    pub fn cameras(&self) -> Vec<&str> {
        self.viewers.iter().map(|v| v.name.as_str()).collect()
    }

    /// What the labels of pictures stand for; 0 is nothing.
    pub fn labels(&self) -> &[(u16, String)] {
        &self.labels
    }

    /// Size of a camera's own picture [px].
    ///
    /// # Errors
    /// A camera that is not there.
    pub fn size(&self, camera: &str) -> Result<[usize; 2]> {
        let model = &self.viewers[self.viewer(camera)?].model;
        Ok([model.width, model.height])
    }

    /// The camera with which pictures of `size` are made, and its pose in the world.
    ///
    /// # Errors
    /// A camera that is not there.
    pub fn model(&self, camera: &str, size: [usize; 2]) -> Result<(Camera, Pose)> {
        let viewer = &self.viewers[self.viewer(camera)?];
        Ok((viewer.sized(size), viewer.pose))
    }

    /// Adds a camera that the room lights, or replaces the one of that name.
    pub fn add_camera(&mut self, name: &str, model: Camera, pose: Pose) {
        let room = Room { middle: self.organs_middle() };
        self.viewers.retain(|v| v.name != name);
        self.viewers.push(Viewer::lit(name, model, pose, false, room));
    }

    fn organs_middle(&self) -> DVec3 {
        let all = self.organs.iter().flat_map(|o| &o.whole.body.vertices);
        let (sum, n) = all.fold((DVec3::ZERO, 0_usize), |(sum, n), p| (sum + *p, n + 1));
        sum / n.max(1) as f64
    }

    /// Cuts the organs open for pictures by the plane through a point with a normal, and leaves out what is on the normal's side; `None` shows them whole. An organ that is in pieces
    /// is left as it is.
    pub fn section(&mut self, plane: Option<(DVec3, DVec3)>) {
        self.section = plane.map(|(point, normal)| (point, normal.normalize_or(DVec3::X)));
        self.organs.iter_mut().for_each(|o| o.shape = None);
    }

    fn viewer(&self, camera: &str) -> Result<usize> {
        self.viewers.iter().position(|v| v.name == camera).ok_or_else(|| Error::UnknownCamera {
            name: camera.chars().take(60).collect(),
            known: self.cameras().join(", "),
        })
    }

    /// What `camera` sees of `cell` as it is now, in a picture of `size` (width, height) [px]: the camera's own is scaled until it covers that, and its middle is cut out. Colour, depth
    /// along the camera's z [m], labels (see [`Self::labels`]), normals in the camera's frame. After the first picture of a size little is allocated, and nothing for organs that rest.
    ///
    /// # Errors
    /// A camera that is not there, a size that no picture has, a cell of another scene.
    pub fn see(&mut self, cell: &Cell, camera: &str, size: [usize; 2], settings: &Settings) -> Result<&Picture> {
        self.viewer(camera)?;
        self.follow(cell)?;
        self.expose(camera, size, settings, (1e3 * cell.time()).round() as u32)
    }

    /// What `camera` sees of the organs as they were recorded, or as they were when a cell was seen last.
    ///
    /// # Errors
    /// As [`Self::see`].
    pub fn see_still(&mut self, camera: &str, size: [usize; 2], settings: &Settings) -> Result<&Picture> {
        self.viewer(camera)?;
        if self.organs.iter().any(|o| o.shape.is_none()) {
            self.rebuild(None)?;
        }
        self.expose(camera, size, settings, 0)
    }

    fn expose(&mut self, camera: &str, size: [usize; 2], settings: &Settings, frame: u32) -> Result<&Picture> {
        if size.iter().any(|n| !SIDES.contains(n)) {
            return Err(Error::Size(size[0], size[1]));
        }
        let at = self.viewer(camera)?;
        let sensor = self.sensor;
        let Self { viewers, stage, picture, .. } = self;
        let viewer = &mut viewers[at];
        stage.lights.clone_from(&viewer.lights);
        stage.environment = viewer.environment;
        let mut film = viewer.film;
        film.noise = sensor.color.map(|[shot, read]| Noise { shot, read, seed: sensor.seed, frame });
        // What its eyes see is not cropped or scaled.
        let focal = viewer.model.fx * OWN_WIDTH / viewer.model.width.max(1) as f64;
        let (pose, depth) = (viewer.pose, viewer.depth);
        render_into(picture, stage, viewer.eye(size), &pose, settings, &film);
        if let Some(noise) = sensor.depth.filter(|_| depth) {
            let camera = viewer.sized(size);
            let seeds = [u64::from(sensor.seed), u64::from(frame)];
            noise.spoil(&mut picture.depth, Some(&picture.color), &camera, focal, seeds)?;
        }
        Ok(&self.picture)
    }

    /// Triangles on the stage.
    pub fn triangles(&self) -> usize {
        self.stage.triangles()
    }
}

/// Wet tissue whose film of water is as rough as that.
fn wet(roughness: f32) -> Look {
    let look = Look::tissue([190, 96, 88]);
    match look.surface {
        SurfaceKind::Coated { ior, wander, .. } => {
            Look { surface: SurfaceKind::Coated { roughness, ior, wander }, ..look }
        }
        _ => look,
    }
}

/// The middle of the organs.
fn middle(placed: &Specimen) -> DVec3 {
    let all = placed.organs.iter().filter_map(|o| o.surface.bounds());
    let bounds = all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    bounds.map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high))
}
