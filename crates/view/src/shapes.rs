//! The constant messages: `scene` and `organs`.

use crate::arm_columns::ARM_COLUMNS;
use crate::error::Result;
use crate::message::{Binary, Data};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use trocar_camera::Distortion;
use trocar_cell::Cell;
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::SurfaceKind;
use trocar_scene::{InstrumentKind, Scene};
use trocar_sensors::{BoundSurface, DrawnCell, DrawnPart, image_circle};
use trocar_task::{Channels, Episode};
use trocar_tissue::Model;

/// A number that was never given before in this process: of scenes, of surfaces, of places of
/// nodes. Greater ones are newer.
pub(crate) fn fresh() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}

/// The surfaces of all organs, until one is cut.
pub(crate) struct Topology {
    /// Grows with each cut and each new scene.
    pub number: u64,
    pub scene: u64,
    pub names: Vec<String>,
    pub surfaces: Vec<Arc<BoundSurface>>,
    /// Bodies of the model that are pieces of each organ.
    pub bodies: Vec<Vec<usize>>,
    pub model: Model,
}

/// Seven numbers of a pose: place, then the quaternion, scalar first.
pub(crate) fn pose_numbers(pose: &Pose) -> [f64; 7] {
    let (t, q) = (pose.translation, pose.rotation);
    [t.x, t.y, t.z, q.w, q.x, q.y, q.z]
}

/// The message `scene`, with the number `scene`.
pub(crate) fn scene_message(number: u64, episode: &Episode, drawn: &DrawnCell) -> Result<Vec<u8>> {
    let (scene, cell) = (episode.arranged_scene(), episode.cell());
    let poses = drawn.poses(cell)?;
    let mut moving = poses.iter();
    let bodies = drawn.bodies.iter().map(|body| {
        let part = match body.part {
            DrawnPart::Fixed => "fixed",
            DrawnPart::Link(_) => "link",
            DrawnPart::Shaft => "shaft",
            DrawnPart::Motor => "motor",
            DrawnPart::Blade(_) => "blade",
        };
        let pose = if body.part == DrawnPart::Fixed { Some(&Pose::IDENTITY) } else { moving.next() };
        json!({
            "name": drawn.meshes[body.mesh].name, "mesh": body.mesh, "arm": body.arm, "part": part,
            "pose": pose_numbers(pose.unwrap_or(&Pose::IDENTITY)),
        })
    });
    let bodies: Vec<Value> = bodies.collect();
    let meshes = drawn.meshes.iter().enumerate().map(|(k, drawn)| {
        let (roughness, metal, wet) = match drawn.appearance.surface {
            SurfaceKind::Matte => (1.0, false, false),
            SurfaceKind::Metal { roughness } => (roughness, true, false),
            SurfaceKind::Coated { roughness, scattering_length, .. } => {
                (roughness, false, scattering_length.iter().any(|l| *l > 0.0))
            }
        };
        json!({
            "name": drawn.name, "color": drawn.appearance.color, "roughness": roughness, "metal": metal, "wet": wet,
            "vertices": format!("{k}.v"), "triangles": format!("{k}.t"),
            "colors": has_colors(&drawn.mesh).then(|| format!("{k}.c")),
        })
    });
    let meshes: Vec<Value> = meshes.collect();
    let program = episode.program();
    let names = channel_names(episode);
    let stages = program.stages.iter().map(|stage| {
        json!({"name": stage.name, "when": stage.text, "weight": stage.share, "channels": named(&stage.text, &names)})
    });
    let stages: Vec<Value> = stages.collect();
    let definition = scene.task_context()?.definition;
    let aborts: Vec<Value> = definition.aborts.iter().map(|a| json!({"name": a.name, "when": a.when})).collect();
    let gates: Vec<Value> =
        program.constants.iter().map(|(name, value)| json!({"name": name, "value": value})).collect();
    let ports: Vec<Value> = scene
        .ports
        .iter()
        .map(|p| json!({"name": p.name, "centre_m": p.centre_m, "normal": p.normal, "hole_diameter_mm": p.hole_diameter_mm}))
        .collect();
    let header = json!({
        "type": "scene", "scene": number, "name": scene.name,
        "task": {"name": scene.task.name.name(), "summary": definition.summary, "organ": scene.task.organ,
            "prompt": trocar_task::prompt(scene)},
        "control_hz": scene.rates.control_hz, "tissue_hz": (1.0 / trocar_cell::FRAME).round(), "seed": episode.seed(),
        "arms": arms(scene, cell)?, "ports": ports,
        "rcm_mm": {"threshold": scene.safety.rcm_threshold_mm, "abort": scene.safety.rcm_abort_mm},
        "force_limit_n": scene.safety.rules.force_guard.then_some(scene.safety.force_limit_n),
        "cameras": cameras(episode), "channels": names, "gates": gates, "stages": stages, "aborts": aborts,
        "arm_columns": ARM_COLUMNS[..], "meshes": meshes, "bodies": bodies,
    });
    let colors: Vec<Vec<u8>> = drawn.meshes.iter().map(|m| m.mesh.colors.as_flattened().to_vec()).collect();
    let mut message = Binary::new(header);
    for (k, drawn) in drawn.meshes.iter().enumerate() {
        add_mesh(&mut message, &k.to_string(), &drawn.mesh, &colors[k]);
    }
    Ok(message.into_bytes())
}

/// Names of the numbers of a row: channels, then what the task measures beside.
pub(crate) fn channel_names(episode: &Episode) -> Vec<String> {
    let mut names = Channels::names();
    names.extend(episode.program().measures.iter().map(ToString::to_string));
    names
}

/// The channels that an expression names.
fn named(text: &str, names: &[String]) -> Vec<String> {
    let words: Vec<&str> = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
    names.iter().filter(|n| words.contains(&n.as_str())).cloned().collect()
}

fn has_colors(mesh: &TriMesh) -> bool {
    !mesh.colors.is_empty() && mesh.colors.len() == mesh.vertices.len()
}

fn add_mesh<'a>(message: &mut Binary<'a>, name: &str, mesh: &TriMesh, colors: &'a [u8]) {
    let vertices = mesh.vertices.iter().flat_map(|p| p.as_vec3().to_array()).collect();
    message.add(format!("{name}.v"), &[mesh.vertices.len(), 3], Data::F32(vertices));
    message.add(format!("{name}.t"), &[mesh.triangles.len(), 3], Data::U32(mesh.triangles.as_flattened().to_vec()));
    if has_colors(mesh) {
        message.add(format!("{name}.c"), &[mesh.vertices.len(), 3], Data::U8(colors));
    }
}

fn arms(scene: &Scene, cell: &Cell) -> Result<Vec<Value>> {
    let arm = |tool: trocar_scene::Tool<'_>| -> Result<Value> {
        let name = tool.arm.name.name();
        let space = cell.workspace(name)?;
        let bounds = space.bounds();
        let kind = if tool.instrument.kind == InstrumentKind::Grasper { "grasper" } else { "cutter" };
        let port = tool.port.and_then(|p| scene.ports.iter().position(|own| own.name == p.name));
        let joints = cell.joint_limits(name)?.len();
        Ok(json!({
            "name": name, "kind": kind, "instrument": tool.instrument.name, "port": port,
            "drive": if joints > 0 { "dynamics" } else { "ideal" }, "numbers": space.names(),
            "low": bounds.map(|b| b[0]), "high": bounds.map(|b| b[1]),
            "jaw_max_rad": tool.instrument.jaw_max_angle_deg.to_radians(),
            "blade_length_m": 1e-3 * tool.instrument.blade_length_mm,
            "shaft_radius_m": 0.5e-3 * tool.instrument.shaft_diameter_mm,
            "has_joints": joints > 0,
        }))
    };
    scene.tools().into_iter().map(arm).collect()
}

fn cameras(episode: &Episode) -> Vec<Value> {
    let scene = episode.arranged_scene();
    let recording = episode.specimen().camera.as_ref();
    let camera = |own: &trocar_scene::CellCamera| {
        let model = own.model(recording)?;
        let distortion: Vec<f64> = Distortion::into(model.distortion);
        Some(json!({
            "name": own.name, "endoscope": image_circle(own).is_some(), "pose": pose_numbers(&own.view.pose(&scene.placement)),
            "fx": model.fx, "fy": model.fy, "cx": model.cx, "cy": model.cy, "width": model.width, "height": model.height,
            "distortion": distortion, "circle": image_circle(own),
        }))
    };
    scene.cameras.iter().filter_map(camera).collect()
}

impl Topology {
    /// Of the organs as `drawn` has them now.
    pub fn of(scene: u64, cell: &Cell, drawn: &DrawnCell) -> Self {
        let organs = || drawn.skins.organs().iter();
        Self {
            number: fresh(),
            scene,
            names: organs().map(|o| o.name().to_owned()).collect(),
            surfaces: organs().map(|o| Arc::clone(o.surface())).collect(),
            bodies: organs().map(|o| o.bodies().to_vec()).collect(),
            model: cell.world().model.clone(),
        }
    }

    /// The message `organs`.
    pub fn message(&self) -> Vec<u8> {
        let bodies = self.model.bodies();
        let pins: Vec<Vec<f32>> = self
            .bodies
            .iter()
            .map(|own| {
                let of = |b: &usize| {
                    let body = &bodies[*b];
                    let pinned = body.rest_positions().iter().zip(body.pinned()).filter(|(_, pinned)| **pinned);
                    pinned.flat_map(|(p, _)| p.as_vec3().to_array()).collect::<Vec<f32>>()
                };
                own.iter().flat_map(of).collect()
            })
            .collect();
        let organ = |k: usize| {
            let young = self.bodies[k].first().map(|b| bodies[*b].material().young_modulus);
            json!({
                "name": self.names[k], "count": self.surfaces[k].mesh.vertices.len(), "triangles": format!("{k}.t"),
                "colors": format!("{k}.c"), "rest": format!("{k}.v"), "young_modulus_pa": young,
                "pins": (!pins[k].is_empty()).then(|| format!("{k}.p")),
            })
        };
        let organs: Vec<Value> = (0..self.names.len()).map(organ).collect();
        let header = json!({"type": "organs", "scene": self.scene, "topology": self.number, "organs": organs});
        let colors: Vec<Vec<u8>> = self.surfaces.iter().map(|s| s.mesh.colors.as_flattened().to_vec()).collect();
        let mut message = Binary::new(header);
        for (k, surface) in self.surfaces.iter().enumerate() {
            add_mesh(&mut message, &k.to_string(), &surface.mesh, &colors[k]);
            if !pins[k].is_empty() {
                message.add(format!("{k}.p"), &[pins[k].len() / 3, 3], Data::F32(pins[k].clone()));
            }
        }
        message.into_bytes()
    }
}
