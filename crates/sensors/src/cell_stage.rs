//! The stage of a cell: organs, their surroundings, arms and instruments, updated from the cell.

use crate::instrument::Shapes;
use crate::looks::{glossed, housing, polished, shell, wet};
use crate::section::section;
use crate::skins::{ArmPosture, Skins};
use crate::surroundings::surroundings;
use crate::{Result, arm};
use glam::DVec3;
use std::path::PathBuf;
use std::sync::Arc;
use trocar_cell::Cell;
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Appearance, BodyId, ShapeId, Stage};
use trocar_scene::{Imaging, Scene};
use trocar_specimen::Specimen;

/// First labels of instruments, arms, and other objects. Labels of organs start at 1.
const INSTRUMENTS: u16 = 101;
const ARMS: u16 = 111;
const OTHERS: u16 = 201;

/// Whether a label of a picture is that of an instrument or an arm.
pub fn is_tool(label: u16) -> bool {
    (INSTRUMENTS..OTHERS).contains(&label)
}

/// Everything that cameras of a cell can see. A copy shares what does not move.
#[derive(Clone)]
pub(crate) struct CellStage {
    /// The current stage.
    pub stage: Stage,
    /// Labels with the names of their objects.
    pub labels: Vec<(u16, String)>,
    /// The stage without the organs.
    base: Stage,
    skins: Skins,
    organs: Vec<OrganOnStage>,
    arms: Vec<Arm>,
    section: Option<(DVec3, DVec3)>,
    imaging: Imaging,
}

/// What is on the stage of an organ.
#[derive(Clone)]
struct OrganOnStage {
    label: u16,
    shape: Option<ShapeId>,
}

#[derive(Clone)]
struct Arm {
    name: &'static str,
    /// Description file of its shapes, and the shapes of base and links.
    drawn: Option<ShapeSource>,
    shapes: Vec<ShapeId>,
    links: Vec<BodyId>,
    shaft: BodyId,
    motor: BodyId,
    blades: [BodyId; 2],
}

/// Everything that determines the shapes of a described arm, except the number of its links.
#[derive(Clone, PartialEq)]
struct ShapeSource {
    file: PathBuf,
    flange: Option<String>,
    /// Whether the scene requests the shapes of the file. If so, simple shapes do not replace
    /// missing ones.
    requested: bool,
    model: String,
}

impl CellStage {
    /// Organs in the world frame (up along z), on their field in the surroundings of `scene`,
    /// without cameras. `recording` is the pose of the recording camera.
    pub fn new(placed: &Specimen, recording: Pose, scene: Option<&Scene>) -> Result<Self> {
        let mut all = Self {
            labels: Vec::new(),
            base: Stage::new(),
            stage: Stage::new(),
            skins: Skins::placed(placed),
            organs: Vec::new(),
            arms: Vec::new(),
            section: None,
            imaging: scene.map(|s| s.imaging).unwrap_or_default(),
        };
        for (k, organ) in placed.organs.iter().enumerate() {
            let label = 1 + k as u16;
            all.labels.push((label, organ.name.clone()));
            all.organs.push(OrganOnStage { label, shape: None });
        }
        for piece in surroundings(placed, recording, scene)? {
            all.add(piece.name, &piece.mesh, &piece.appearance)?;
        }
        Ok(all)
    }

    fn label(&mut self, first: u16, name: &str) -> u16 {
        if let Some((label, _)) = self.labels.iter().find(|(_, n)| n == name) {
            return *label;
        }
        let count = self.labels.iter().filter(|(l, _)| (first..first + 10).contains(l)).count() as u16;
        self.labels.push((first + count, name.to_owned()));
        first + count
    }

    fn add(&mut self, name: &str, mesh: &TriMesh, appearance: &Appearance) -> Result<()> {
        let label = self.label(OTHERS, name);
        self.base.add_mesh(mesh, label, appearance)?;
        Ok(())
    }

    /// Adds an arm with its instrument. The next update places it.
    pub fn add_arm(
        &mut self,
        k: usize,
        (scene, arm): (&Scene, &trocar_scene::Arm),
        held: &trocar_scene::Instrument,
        (model, posture): (&str, &ArmPosture),
    ) -> Result<()> {
        let (name, poses) = (arm.name.name(), &posture.links);
        let label = ARMS + k as u16;
        self.labels.push((label, format!("{name} arm")));
        // Arms with the same description share their shapes.
        let drawn = arm.drawn().map(|file| ShapeSource {
            file: scene.resolve(file),
            flange: arm.flange.clone(),
            requested: arm.shapes.is_some(),
            model: model.to_owned(),
        });
        let same = |a: &&Arm| drawn.is_some() && a.drawn == drawn && a.shapes.len() + 1 == poses.len();
        let known = self.arms.iter().find(same).map(|a| a.shapes.clone());
        let shapes = match known {
            Some(shapes) => shapes,
            None => {
                let meshes = arm::links(scene, arm, model, poses)?;
                meshes.iter().map(|mesh| self.base.add_shape(mesh)).collect::<std::result::Result<Vec<_>, _>>()?
            }
        };
        let mut links = Vec::new();
        for (shape, pose) in shapes.iter().zip(poses) {
            links.push(self.base.add_body(*shape, pose, label, &shell())?);
        }
        let held_shapes = Shapes::of(held);
        let label = INSTRUMENTS + k as u16;
        self.labels.push((label, held.name.clone()));
        let mut body = |mesh: &TriMesh, appearance: &Appearance| -> Result<BodyId> {
            let shape = self.base.add_shape(mesh)?;
            Ok(self.base.add_body(shape, &Pose::IDENTITY, label, appearance)?)
        };
        let shaft = body(&held_shapes.shaft, &polished())?;
        let motor = body(&held_shapes.motor, &housing(held.kind))?;
        let blades = [body(&held_shapes.blades[0], &polished())?, body(&held_shapes.blades[1], &polished())?];
        self.arms.push(Arm { name, drawn, shapes, links, shaft, motor, blades });
        Ok(())
    }

    /// Mean position of the organs' nodes at rest (m).
    pub fn organs_middle(&self) -> DVec3 {
        let all = self.skins.organs().iter().flat_map(|o| o.rest());
        let (sum, n) = all.fold((DVec3::ZERO, 0_usize), |(sum, n), p| (sum + *p, n + 1));
        sum / n.max(1) as f64
    }

    /// Sets the section plane (point, normal); `None` shows whole organs.
    pub fn set_section(&mut self, plane: Option<(DVec3, DVec3)>) {
        self.section = plane.map(|(point, normal)| (point, normal.normalize_or(DVec3::X)));
        self.invalidate();
    }

    /// Shows the organs as they were recorded, unless a cell was shown before.
    pub fn ensure_organs(&mut self) -> Result<()> {
        if self.organs.iter().any(|o| o.shape.is_none()) { self.rebuild() } else { Ok(()) }
    }

    /// Marks the organs as changed: the next update rebuilds the stage.
    pub fn invalidate(&mut self) {
        self.organs.iter_mut().for_each(|o| o.shape = None);
    }

    /// Updates the stage to the current state of the cell.
    pub fn update(&mut self, cell: &Cell) -> Result<()> {
        let same = self.skins.update(cell)?;
        let arms: Vec<ArmPosture> = self.arms.iter().map(|a| ArmPosture::of(cell, a.name)).collect::<Result<_>>()?;
        self.place(same, &arms)
    }

    /// Updates the stage to recorded surfaces and arms.
    pub fn show(
        &mut self,
        shown: &[(Arc<TriMesh>, Vec<DVec3>)],
        other_meshes: bool,
        arms: &[ArmPosture],
    ) -> Result<()> {
        self.skins.show(shown, other_meshes)?;
        self.place(!other_meshes, arms)
    }

    /// Puts the surfaces and the arms on the stage. `same`: the meshes are those on it.
    fn place(&mut self, same: bool, arms: &[ArmPosture]) -> Result<()> {
        if same && self.section.is_none() && self.organs.iter().all(|o| o.shape.is_some()) {
            for (organ, skin) in self.organs.iter().zip(self.skins.organs()).filter(|(_, skin)| skin.moved()) {
                if let Some(shape) = organ.shape {
                    self.stage.deform(shape, skin.positions())?;
                }
            }
        } else {
            self.rebuild()?;
        }
        self.pose_arms(arms)
    }

    /// Rebuilds the stage: the static part, which is shared, and the organs.
    pub fn rebuild(&mut self) -> Result<()> {
        self.stage = self.base.clone();
        for (organ, skin) in self.organs.iter_mut().zip(self.skins.organs()) {
            let mut mesh = TriMesh { vertices: skin.positions().to_vec(), ..skin.mesh().clone() };
            if let Some(((point, normal), (whole, nodes))) = self.section.zip(skin.whole()) {
                mesh = section(whole, skin.positions(), nodes, point, normal);
            }
            tint(&mut mesh, self.imaging.tint);
            let (shape, _) = self.stage.add_mesh(&mesh, organ.label, &glossed(wet(0.3), self.imaging.gloss))?;
            organ.shape = Some(shape);
        }
        Ok(())
    }

    fn pose_arms(&mut self, arms: &[ArmPosture]) -> Result<()> {
        for (arm, posture) in self.arms.iter().zip(arms) {
            for (body, pose) in arm.links.iter().zip(&posture.links) {
                self.stage.place(*body, pose)?;
            }
            let gripper = &posture.gripper;
            self.stage.place(arm.shaft, &gripper.pose)?;
            self.stage.place(arm.motor, &gripper.pose)?;
            for (body, side) in arm.blades.iter().zip([1.0, -1.0]) {
                self.stage.place(*body, &gripper.blade(side))?;
            }
        }
        Ok(())
    }
}

/// Scales the colour channels of a surface. Factors of 1 keep every bit.
fn tint(mesh: &mut TriMesh, factors: [f64; 3]) {
    for color in &mut mesh.colors {
        for (channel, factor) in color.iter_mut().zip(factors) {
            *channel = (f64::from(*channel) * factor).round().clamp(0.0, 255.0) as u8;
        }
    }
}
