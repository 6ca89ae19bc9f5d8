//! A cell as meshes and poses, for viewers that draw it themselves.

use crate::instrument::Shapes;
use crate::looks::{housing, polished, shell};
use crate::skins::{ArmPosture, Skins};
use crate::surroundings::surroundings;
use crate::{Result, arm};
use trocar_cell::{Cell, Placed};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::Appearance;
use trocar_scene::Scene;
use trocar_specimen::Specimen;

/// A mesh in its own frame (m).
#[derive(Clone, Debug)]
pub struct DrawnMesh {
    /// Name of the object.
    pub name: String,
    /// Its surface, with or without colours.
    pub mesh: TriMesh,
    /// Colour, where the surface has none, and surface.
    pub appearance: Appearance,
}

/// What a body is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawnPart {
    /// Does not move.
    Fixed,
    /// A link of an arm, with the place of its pose in [`Cell::link_poses`].
    Link(usize),
    /// The shaft of an instrument.
    Shaft,
    /// The motor of an instrument.
    Motor,
    /// A blade: 1 opens towards +y of the gripper, -1 towards -y.
    Blade(i8),
}

/// A mesh at a pose.
#[derive(Clone, Debug)]
pub struct DrawnBody {
    /// Index of its mesh.
    pub mesh: usize,
    /// The arm that moves it.
    pub arm: Option<usize>,
    /// What it is.
    pub part: DrawnPart,
}

/// A cell as meshes and poses.
pub struct DrawnCell {
    /// The meshes.
    pub meshes: Vec<DrawnMesh>,
    /// The bodies that draw them.
    pub bodies: Vec<DrawnBody>,
    /// The organs' surfaces.
    pub skins: Skins,
    arms: Vec<&'static str>,
}

impl DrawnCell {
    /// Of `cell`, which was built from `scene` and `specimen`.
    ///
    /// # Errors
    /// Shapes that cannot be read; a cell of another scene.
    pub fn new(scene: &Scene, specimen: &Specimen, cell: &Cell) -> Result<Self> {
        let mut arms = Vec::new();
        for tool in scene.tools() {
            let name = tool.arm.name.name();
            arms.push((cell.arm_model(name)?.to_owned(), ArmPosture::of(cell, name)?));
        }
        let mut all = Self::without_cell(scene, specimen, &arms)?;
        all.skins.update(cell)?;
        Ok(all)
    }

    /// Of `scene` around `specimen` without a cell; `arms`: model and posture of each of the
    /// scene's arms. The organs are as recorded.
    ///
    /// # Errors
    /// Shapes that cannot be read.
    pub fn without_cell(scene: &Scene, specimen: &Specimen, arms: &[(String, ArmPosture)]) -> Result<Self> {
        let placed = Placed::new(scene, specimen)?.specimen;
        let mut all = Self { meshes: Vec::new(), bodies: Vec::new(), arms: Vec::new(), skins: Skins::placed(&placed) };
        for prop in surroundings(&placed, scene.placement.pose(), Some(scene))? {
            let mesh = all.mesh(prop.name.to_owned(), prop.mesh, prop.appearance);
            all.bodies.push(DrawnBody { mesh, arm: None, part: DrawnPart::Fixed });
        }
        for (k, (tool, (model, posture))) in scene.tools().iter().zip(arms).enumerate() {
            let name = tool.arm.name.name();
            all.arms.push(name);
            let links = arm::links(scene, tool.arm, model, &posture.links)?;
            let mut add = |part: DrawnPart, what: &str, mesh: TriMesh, appearance: Appearance| {
                let mesh = all.mesh(format!("{name} {what}"), mesh, appearance);
                all.bodies.push(DrawnBody { mesh, arm: Some(k), part });
            };
            for (i, link) in links.into_iter().enumerate() {
                add(DrawnPart::Link(i), "arm", link, shell());
            }
            let Shapes { shaft, motor, blades: [upper, lower] } = Shapes::of(tool.instrument);
            add(DrawnPart::Shaft, &tool.instrument.name, shaft, polished());
            add(DrawnPart::Motor, &tool.instrument.name, motor, housing(tool.instrument.kind));
            add(DrawnPart::Blade(1), &tool.instrument.name, upper, polished());
            add(DrawnPart::Blade(-1), &tool.instrument.name, lower, polished());
        }
        Ok(all)
    }

    /// The index of a mesh, which is added unless an equal one is there.
    fn mesh(&mut self, name: String, mesh: TriMesh, appearance: Appearance) -> usize {
        let same = |m: &DrawnMesh| m.mesh == mesh && m.appearance == appearance;
        if let Some(known) = self.meshes.iter().position(same) {
            return known;
        }
        self.meshes.push(DrawnMesh { name, mesh, appearance });
        self.meshes.len() - 1
    }

    /// Poses in the cell of the bodies that are not fixed, in their order.
    ///
    /// # Errors
    /// A cell of another scene.
    pub fn poses(&self, cell: &Cell) -> Result<Vec<Pose>> {
        let mut postures = Vec::with_capacity(self.arms.len());
        for arm in &self.arms {
            postures.push(ArmPosture::of(cell, arm)?);
        }
        Ok(self.poses_of(&postures))
    }

    /// The same for arms in these postures.
    pub fn poses_of(&self, postures: &[ArmPosture]) -> Vec<Pose> {
        let pose = |body: &DrawnBody| {
            let ArmPosture { links, gripper } = postures.get(body.arm?)?;
            match body.part {
                DrawnPart::Fixed => None,
                DrawnPart::Link(i) => links.get(i).copied(),
                DrawnPart::Shaft | DrawnPart::Motor => Some(gripper.pose),
                DrawnPart::Blade(side) => Some(gripper.blade(f64::from(side))),
            }
        };
        self.bodies.iter().filter_map(pose).collect()
    }
}
